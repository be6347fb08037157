"""The vector environment is the environment, N times, to the bit."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import drlsl  # noqa: F401  (registers the environment)
from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.shield import Shield
from drlsl.errors import UserError

CONFIGS = [
    EnvConfig(recording="highway-test", direction="left_to_right", track_length=25.0),
    EnvConfig(recording="highway-test", direction="both", track_length=25.0),
    EnvConfig(recording="freeway", direction="left_to_right", track_length=25.0),
    EnvConfig(recording=("highway-test", "freeway"), direction="both", track_length=25.0),
    EnvConfig(recording="highway-test", direction="right_to_left", track_length=25.0),
]
MODES: list[dict[str, Any]] = [
    {},
    {"offers": "prediction", "prediction_horizon": 2.0},
    {"offers": "all"},
    {"traffic": "reactive"},
    {"sensing": {"position_noise": 0.3, "speed_noise": 0.2, "drop_rate": 0.2, "latency": 0.2}},
    {
        "offers": "prediction",
        "traffic": "reactive",
        "sensing": {"position_noise": 0.5, "noise_time": 0.0, "drop_rate": 0.7, "latency": 0.35},
    },
]
"""Ways in which an environment can differ from the default."""

STEPS = 90
"""Enough for several episodes of 25 m, and for some that end off the road."""


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default(tier="auto")


def same(ours: Any, theirs: Any, where: str = "info") -> None:
    """Whether two infos are alike, key for key, type for type and bit for bit."""
    if isinstance(theirs, dict):
        assert set(ours) == set(theirs), where
        for key in theirs:
            same(ours[key], theirs[key], f"{where}[{key!r}]")
    elif theirs.dtype == object:
        for mine, other in zip(ours, theirs, strict=True):
            assert np.array_equal(mine, other), where
    else:
        assert ours.dtype == theirs.dtype, where
        assert np.array_equal(ours, theirs), where


def marked(info: dict[str, Any]) -> dict[str, Any]:
    """The info with what a mask says is not there blanked: its value means nothing."""
    result: dict[str, Any] = {}
    for key, value in info.items():
        mask = info.get(f"_{key}")
        if isinstance(value, dict):
            result[key] = marked(value)
        elif mask is None or mask.all():
            result[key] = value
        else:
            result[key] = value.copy()
            result[key][~mask] = None if value.dtype == object else 0
    return result


def with_settings(settings: dict[str, Any]) -> list[EnvConfig]:
    return [EnvConfig.model_validate({**config.model_dump(), **settings}) for config in CONFIGS]


@pytest.mark.parametrize(
    ("mode", "settings"),
    [
        *((AutoresetMode.NEXT_STEP, settings) for settings in MODES),
        *((AutoresetMode.SAME_STEP, settings) for settings in (MODES[0], MODES[-1])),
    ],
)
def test_it_is_the_environment_n_times(shield: Shield, mode: AutoresetMode, settings: dict[str, Any]) -> None:
    configs = with_settings(settings)
    ours = HighwayVectorEnv(configs, autoreset_mode=mode, shield=shield)
    makers = [lambda config=config: HighwayEnv(config, shield=shield) for config in configs]
    theirs = SyncVectorEnv(makers, autoreset_mode=mode)
    rng = np.random.default_rng(4)
    mine: tuple[Any, ...] = ours.reset(seed=9)
    other: tuple[Any, ...] = theirs.reset(seed=9)
    ended = 0
    for _ in range(STEPS):
        for left, right in zip(mine[:-1], other[:-1], strict=True):
            assert left.dtype == right.dtype
            assert np.array_equal(left, right)
        same(marked(mine[-1]), marked(other[-1]))
        if len(mine) == 5:
            ended += int((mine[2] | mine[3]).sum())
        actions = rng.integers(3, size=len(CONFIGS))
        mine, other = ours.step(actions), theirs.step(actions)
    assert ended > 2 * len(CONFIGS)


def test_without_autoreset_a_mask_says_who_begins_anew(shield: Shield) -> None:
    env = HighwayVectorEnv(CONFIGS[0], num_envs=3, autoreset_mode=AutoresetMode.DISABLED, shield=shield)
    env.reset(seed=[1, 2, 3])
    over = np.zeros(3, dtype=np.bool_)
    while not over.any():
        observations, _, terminated, truncated, _ = env.step(np.zeros(3, dtype=np.int64))
        over = terminated | truncated
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset them first"):
        env.step(np.zeros(3, dtype=np.int64))
    again, info = env.reset(options={"reset_mask": over})
    assert np.array_equal(again[~over], observations[~over])
    assert np.array_equal(info["_speed"], over)
    assert (info["distance"][over] == 0.0).all()
    env.step(np.zeros(3, dtype=np.int64))


def test_gymnasium_makes_it() -> None:
    env = gymnasium.make_vec("drlsl/Highway-v0", num_envs=2, recording="highway-test")
    assert isinstance(env.unwrapped, HighwayVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    observations, info = env.reset(seed=0)
    assert env.observation_space.contains(observations)
    assert info["action_mask"].shape == (2, 3)
    assert env.step(env.action_space.sample())[0].shape == (2, 21)


@pytest.mark.parametrize("settings", MODES)
def test_a_world_goes_on_from_its_state(shield: Shield, settings: dict[str, Any]) -> None:
    first, second = (HighwayVectorEnv(with_settings(settings), shield=shield) for _ in range(2))
    rng = np.random.default_rng(0)
    actions = rng.integers(3, size=(2 * STEPS, len(CONFIGS)))
    first.reset(seed=3)
    for step in actions[:STEPS]:
        first.step(step)
    second.reset(seed=77)
    state = first.get_state()
    second.set_state(state)
    assert np.array_equal(first.action_masks(), second.action_masks())
    assert all(first.world.scene(ego) == second.world.scene(ego) for ego in range(len(CONFIGS)))
    for step in actions[STEPS:]:
        ours: tuple[Any, ...] = first.step(step)
        theirs: tuple[Any, ...] = second.step(step)
        for left, right in zip(ours, theirs, strict=True):
            if isinstance(left, dict):
                same(left, right)
            else:
                assert np.array_equal(left, right)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HighwayVectorEnv(CONFIGS, num_envs=3), "5 configurations for 3 environments"),
        (lambda: HighwayVectorEnv([], num_envs=0), "one environment or more"),
        (
            lambda: HighwayVectorEnv([EnvConfig(), EnvConfig(track_length=2.0)]),
            "differ in more than recording and direction",
        ),
    ],
)
def test_configurations_that_do_not_fit_are_refused(make: Any, message: str) -> None:
    with pytest.raises(UserError, match=message):
        make()


def test_bad_seeds_masks_and_actions_are_refused(shield: Shield) -> None:
    env = HighwayVectorEnv(CONFIGS[0], num_envs=2, shield=shield)
    with pytest.raises(ValueError, match="3 seeds for 2"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(ValueError, match="expected a Boolean array"):
        env.reset(options={"reset_mask": np.array([1, 0])})
    with pytest.raises(ValueError, match="marks no environment"):
        env.reset(options={"reset_mask": np.zeros(2, dtype=np.bool_)})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="unknown action"):
        env.step(np.array([0, -1]))
