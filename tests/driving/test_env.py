"""The Gymnasium environment."""

from __future__ import annotations

import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import drlsl  # noqa: F401  (registers the environment)
from drlsl.driving.envs import HighwayEnv
from drlsl.errors import UserError


@pytest.fixture(scope="module")
def env() -> HighwayEnv:
    made = gymnasium.make("drlsl/Highway-v0", recording="highway-test").unwrapped
    assert isinstance(made, HighwayEnv)
    return made


def test_gymnasium_accepts_it(env: HighwayEnv) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*not within the observation space.*seed.*")
        check_env(env, skip_render_check=True)


def test_spaces_and_info(env: HighwayEnv) -> None:
    observation, info = env.reset(seed=3)
    assert observation.dtype == np.float32
    assert observation.shape == (len(env.shield.observation),) == (21,)
    assert env.observation_space.contains(observation)
    assert env.action_space == gymnasium.spaces.Discrete(3)
    assert_told(env, info, 0.0)
    assert info["entered"]
    for _ in range(50):
        observation, reward, terminated, truncated, info = env.step(0)
        assert env.observation_space.contains(observation)
        assert_told(env, info, reward)
        assert not terminated
        assert not truncated
    assert info["distance"] > 0


def assert_told(env: HighwayEnv, info: dict[str, Any], reward: float) -> None:
    assert info["action_mask"].dtype == np.int8
    assert info["action_mask"].tolist() == env.action_masks().astype(int).tolist()
    assert info["action_mask"][0] == 1
    assert list(info["rewards"]) == env.config.reward.single_terms
    assert sum(info["rewards"].values()) == pytest.approx(reward)
    assert {"contact", "at_fault", "off_road", "lane_change", "speed", "target_speed", "fail_safe"} <= set(
        info
    )


def test_a_seed_is_an_episode(env: HighwayEnv) -> None:
    def episode() -> list[tuple[list[float], float]]:
        env.reset(seed=11)
        return [
            (step[0].tolist(), step[1]) for step in (env.step(action) for action in [1, 0, 0, 2] + [0] * 40)
        ]

    assert episode() == episode()


def test_settings_are_fields_of_the_configuration() -> None:
    made = gymnasium.make("drlsl/Highway-v0", recording="highway-test", direction="right_to_left").unwrapped
    assert isinstance(made, HighwayEnv)
    made.reset(seed=0)
    assert made.scene().ego.vx < 0


def test_a_recording_that_is_not_there() -> None:
    with pytest.raises(UserError, match="nowhere"):
        gymnasium.make("drlsl/Highway-v0", recording="nowhere")


def test_a_mask_before_the_first_episode() -> None:
    with pytest.raises(RuntimeError, match="reset"):
        HighwayEnv(recording="highway-test").action_masks()


@pytest.mark.parametrize("order", ["drlsl, gymnasium", "gymnasium, drlsl", "drlsl.cli, gymnasium"])
def test_importing_the_package_registers_the_environment(order: str) -> None:
    code = f"import {order}; assert 'drlsl/Highway-v0' in gymnasium.registry; assert gymnasium.__loader__"
    subprocess.run([sys.executable, "-c", code], check=True)
