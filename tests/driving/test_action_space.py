"""What counts as an action: everything in the space, and nothing else, in every environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.scene import one_action, several_actions
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, playbacks_of
from tests.installed import needs_torch

from .recordings import Drive, recording

NO_ACTION = [0.4, 2.9999, 2.0, float("nan"), float("inf"), "1", "left_lane_change", None, True, np.True_, 1j]
NO_ACTION += [np.float32(1.0), b"1", {}, {1}, object(), np.datetime64(1, "s")]
OUT_OF_RANGE = [-1, 3, 10**30, -(2**63), np.int8(-1), np.uint64(2**64 - 1), np.array(3)]
ACTIONS = [0, 1, 2, np.int8(2), np.uint64(1), np.int64(0), np.array(1), np.array(2, dtype=np.uint8)]

TOLD = ("x", "y", "speed", "vy", "target_y", "frame", "distance")


def world_of(count: int, shield: Shield) -> World:
    config = EnvConfig(track_length=300.0)
    made = World(
        config,
        [playbacks_of([recording([Drive(1, 410.0, 1.0), Drive(3, 5.0, 0.0)])], config.radar_range)] * count,
        shield,
    )
    made.reset(list(range(count)), [np.random.default_rng(seed) for seed in range(count)])
    return made


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default(tier="numpy")


@pytest.fixture(scope="module")
def single(shield: Shield) -> HighwayEnv:
    env = HighwayEnv(EnvConfig(recording="highway-test"), shield=shield)
    env.reset(seed=1)
    return env


@pytest.fixture(scope="module")
def vector(shield: Shield) -> HighwayVectorEnv:
    env = HighwayVectorEnv(EnvConfig(recording="highway-test"), num_envs=2, shield=shield)
    env.reset(seed=1)
    return env


def standing(world: World) -> dict[str, Any]:
    state = world.get_state()
    return {name: state["at"][name].tolist() for name in TOLD} | {"rngs": state["rngs"]}


def assert_refused(step: Callable[[Any], object], given: object, world: World) -> None:
    before = standing(world)
    with pytest.raises((TypeError, ValueError)) as caught:
        step(given)
    message = str(caught.value)
    assert "expected" in message, message
    assert "\n" not in message
    assert len(message) < 300
    assert standing(world) == before


@pytest.mark.parametrize("action", [*NO_ACTION, *OUT_OF_RANGE, [1], (1,), np.array([1]), np.array([[1]])])
def test_the_environment_refuses_what_is_no_action(single: HighwayEnv, action: Any) -> None:
    assert_refused(single.step, action, single.world)


@pytest.mark.parametrize("action", [*NO_ACTION, *OUT_OF_RANGE])
def test_the_vector_environment_refuses_what_is_no_action(vector: HighwayVectorEnv, action: Any) -> None:
    assert_refused(vector.step, [0, action], vector.world)
    assert_refused(vector.world.step, [0, action], vector.world)
    assert_refused(vector.step, action, vector.world)


@pytest.mark.parametrize(
    "actions",
    [
        [],
        [0],
        [0, 1, 2],
        [[0], [1]],
        [[0, 1]],
        [0, [1]],
        0,
        "01",
        {0: 1, 1: 2},
        (0, 1.0),
        np.zeros((2, 1), dtype=np.int64),
        np.zeros((1, 2), dtype=np.int64),
        np.zeros(3, dtype=np.int64),
        np.zeros(2),
        np.zeros(2, dtype=np.bool_),
        np.array([0, 1], dtype=object),
        np.array([0, np.nan]),
        np.array([0, 3]),
        np.array([-1, 0]),
        np.array([0, 2**64 - 1], dtype=np.uint64),
        np.ma.masked_array([0, 1], mask=[False, True]),
    ],
)
def test_the_vector_environment_refuses_what_is_not_in_its_space(
    vector: HighwayVectorEnv, actions: Any
) -> None:
    assert_refused(vector.step, actions, vector.world)
    assert_refused(vector.world.step, actions, vector.world)


@pytest.mark.parametrize("action", ACTIONS)
def test_integers_of_every_kind_are_actions(single: HighwayEnv, action: Any) -> None:
    assert single.action_space.contains(action) or action.dtype == np.uint64
    assert one_action(action) == int(action)
    single.reset(seed=1)
    expected = single.step(int(action))
    single.reset(seed=1)
    found = single.step(action)
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1:4] == expected[1:4]


@pytest.mark.parametrize(
    "actions",
    [
        [0, 2],
        (0, 2),
        [np.int8(0), np.array(2)],
        np.array([0, 2]),
        np.array([0, 2], dtype=np.uint8),
        np.array([0, 9, 2, 9])[::2],
        np.array([0, 2], dtype=">i4"),
    ],
)
def test_integers_in_a_row_are_actions(actions: Any) -> None:
    found = several_actions(actions, 2)
    assert found.dtype == np.int64
    assert found.tolist() == [0, 2]


@needs_torch
def test_a_tensor_of_integers_is_actions() -> None:
    import torch

    assert several_actions(torch.tensor([0, 2]), 2).tolist() == [0, 2]


def test_every_sample_of_the_space_is_driven(single: HighwayEnv, vector: HighwayVectorEnv) -> None:
    single.action_space.seed(0)
    vector.action_space.seed(0)
    single.reset(seed=2)
    vector.reset(seed=2)
    for _ in range(5):
        single.step(single.action_space.sample())
        vector.step(vector.action_space.sample())


def test_a_world_of_one_refuses_too(shield: Shield) -> None:
    world = world_of(1, shield)
    for actions in ([0.4], [float("nan")], [[1]], 1, [None]):
        assert_refused(world.step, actions, world)
