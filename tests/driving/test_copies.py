"""Copies of environments and shields in the middle of an episode: they go on alike, and each on its own."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import drlsl  # noqa: F401  (registers the environment)
from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.scene import EGO, Scene, SceneBatch, Vehicle
from drlsl.driving.shield import Shield
from drlsl.logic import Engine
from tests.installed import TIERS
from tests.scenes import road

WAYS: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),  # noqa: S301  (made here)
}
FAULTY = {"position_noise": 0.5, "speed_noise": 0.3, "drop_rate": 0.1, "latency": 0.2}
KINDS: dict[str, dict[str, Any]] = {
    "recorded": {},
    "reactive": {"traffic": "reactive"},
    "faulty": {"sensing": FAULTY},
    "prediction": {"offers": "prediction"},
}


def same(one: Any, other: Any) -> bool:
    """Whether two answers of an environment are the same to the bit, arrays and their kinds included."""
    if isinstance(one, np.ndarray):
        if one.dtype == object:
            return same(one.tolist(), other.tolist())
        alike = one.dtype == other.dtype and one.shape == other.shape
        return bool(alike and one.tobytes() == other.tobytes())
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and one == other


def drive(env: Any, steps: int, seed: int) -> list[Any]:
    """What an environment tells in some steps with actions drawn from a seed, and in a reset or two."""
    rng = np.random.default_rng(seed)
    told = []
    for _ in range(steps):
        count = getattr(env, "num_envs", None)
        told.append(env.step(rng.integers(3, size=count) if count else int(rng.integers(3))))
        if count is None and (told[-1][2] or told[-1][3]):
            told.append(env.reset())
    return told


def single(kind: str, tier: str = "numpy") -> HighwayEnv:
    return HighwayEnv(EnvConfig(recording="highway-test", tier=tier, track_length=300.0, **KINDS[kind]))


def vector(kind: str, mode: AutoresetMode) -> HighwayVectorEnv:
    config = EnvConfig(recording="highway-test", tier="numpy", track_length=200.0, **KINDS[kind])
    return HighwayVectorEnv(config, num_envs=3, autoreset_mode=mode)


def assert_goes_on_alike(env: Any, way: Callable[[Any], Any], steps: int) -> None:
    """The copy goes on as the original, which goes on as if there had been no copy."""
    env.reset(seed=3)
    drive(env, 20, seed=1)
    begun = way(env)
    untouched = way(env)
    # Another way than the original will go: nothing of it may be seen there.
    drive(begun, 30, seed=9)
    twin = way(env)
    expected = drive(env, steps, seed=2)
    drive(begun, 5, seed=8)
    assert same(drive(twin, steps, seed=2), expected)
    assert same(drive(way(untouched), steps, seed=2), expected)
    assert same(env.reset(seed=5), twin.reset(seed=5))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", KINDS)
def test_an_environment_goes_on_alike(kind: str, way: str) -> None:
    assert_goes_on_alike(single(kind), WAYS[way], 60)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        ("recorded", AutoresetMode.NEXT_STEP),
        ("faulty", AutoresetMode.SAME_STEP),
        pytest.param("reactive", AutoresetMode.NEXT_STEP, marks=pytest.mark.slow),
    ],
)
def test_a_vector_environment_goes_on_alike(kind: str, mode: AutoresetMode, way: str) -> None:
    assert_goes_on_alike(vector(kind, mode), WAYS[way], 60)


@pytest.mark.parametrize("way", WAYS)
def test_what_infos_share_cannot_be_written_to_in_a_copy_either(way: str) -> None:
    twin = WAYS[way](vector("recorded", AutoresetMode.NEXT_STEP))
    _, info = twin.reset(seed=1)
    for name in ("_speed", "contact", "fail_safe_reason"):
        with pytest.raises(ValueError, match="read-only"):
            info[name][0] = True


@pytest.mark.parametrize("way", WAYS)
def test_environments_made_by_gymnasium_go_on_alike(way: str) -> None:
    settings: dict[str, Any] = {"recording": "highway-test", "tier": "numpy"}
    made = gymnasium.make("drlsl/Highway-v0", max_episode_steps=500, **settings)
    assert_goes_on_alike(gymnasium.wrappers.RecordEpisodeStatistics(made), WAYS[way], 15)
    assert_goes_on_alike(gymnasium.make_vec("drlsl/Highway-v0", num_envs=2, **settings), WAYS[way], 15)


@pytest.mark.parametrize("way", WAYS)
def test_an_environment_that_was_never_reset_can_be_copied(way: str) -> None:
    env = single("recorded")
    twin = WAYS[way](env)
    assert same(twin.reset(seed=1), env.reset(seed=1))


def test_a_deep_copy_shares_the_recording() -> None:
    env = single("recorded")
    twin = copy.deepcopy(env)
    assert twin.world.playbacks.films is env.world.playbacks.films
    assert twin.shield is not env.shield
    assert twin.shield is twin.world.shield
    assert twin.shield.engine is not env.shield.engine


def test_a_pickled_environment_holds_its_recording_once() -> None:
    env = single("recorded")
    film = env.world.playbacks.all[0].film
    size = film.cells.nbytes + film.pieces.nbytes
    assert len(pickle.dumps(env)) < 1.8 * size


def test_a_pickled_environment_goes_on_in_another_process(tmp_path: Path) -> None:
    env = single("recorded", tier="scalar")
    env.reset(seed=3)
    drive(env, 10, seed=1)
    (tmp_path / "env").write_bytes(pickle.dumps(env))
    code = (
        "import pickle, sys; from pathlib import Path; from tests.driving.test_copies import drive;"
        "env = pickle.loads(Path(sys.argv[1]).read_bytes());"
        "Path(sys.argv[2]).write_bytes(pickle.dumps(drive(env, 25, seed=2)))"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "env"), str(tmp_path / "told")]
    subprocess.run(command, check=True, cwd=Path(__file__).parents[2])
    told = pickle.loads((tmp_path / "told").read_bytes())  # noqa: S301  (made here)
    assert same(told, drive(env, 25, seed=2))


def one_scene() -> Scene:
    others = (
        Vehicle("v0", 2, 40.0, 7.25, 20.0, 0.0, 4.6, 1.9),
        Vehicle("v1", 1, -8.0, 3.5, 40.0, 0.0, 4.6, 1.9),
    )
    return Scene(road(0, 3), Vehicle(EGO, 2, 0.0, 7.25, 30.0, 0.0, 4.6, 1.9), others, 2)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("tier", TIERS)
def test_a_shield_answers_alike(tier: str, way: str) -> None:
    shield, scene = Shield.default(tier=tier), one_scene()
    expected = shield.decide(scene), shield.decide_batch(SceneBatch.of([scene])).action_mask.tolist()
    twin = WAYS[way](shield)
    shield.engine.consult_text(":- abolish(safe_actions/1). safe_actions(lane_keeping).")
    assert twin.decide(scene) == expected[0]
    assert twin.decide_batch(SceneBatch.of([scene])).action_mask.tolist() == expected[1]
    assert twin.tier == tier
    assert shield.decide(scene).action_mask == (1, 0, 0)


def test_a_shallow_copy_of_a_shield_has_an_engine_of_its_own() -> None:
    shield = Shield.default()
    twin = copy.copy(shield)
    assert twin.engine is not shield.engine
    assert twin.decide(one_scene()) == shield.decide(one_scene())


@pytest.mark.parametrize("way", WAYS)
def test_rules_that_remember_are_copied_with_what_they_remember(way: str) -> None:
    engine = Engine()
    engine.consult_text(
        """
        :- dynamic(asked/1). asked(0).
        safe_actions(lane_keeping).
        safe_actions(left_lane_change) :- asked(N), 1 =:= N mod 2.
        longitudinal_velocity(V) :- retract(asked(N)), M is N + 1, assertz(asked(M)), V is float(M).
        state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).
        front_is_free.
        entry_is_safe.
        """
    )
    shield, scene = Shield(engine), one_scene()
    assert [shield.decide(scene).target_speed for _ in range(3)] == [1.0, 2.0, 3.0]
    twin = WAYS[way](shield)
    assert [twin.decide(scene).target_speed for _ in range(2)] == [4.0, 5.0]
    assert shield.decide(scene).target_speed == 4.0
    assert [twin.decide(scene).action_mask for _ in range(2)] == [(1, 1, 0), (1, 0, 0)]
