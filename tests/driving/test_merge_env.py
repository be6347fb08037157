"""drlsl/Merge-v0: the ego merges from a ramp."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from drlsl.driving.config import EnvConfig
from drlsl.driving.envs import MergeEnv, MergeVectorEnv
from drlsl.driving.scene import Action

ID = "drlsl/Merge-v0"


def test_gymnasium_makes_it_and_finds_nothing_wrong() -> None:
    made = gymnasium.make(ID, recording="merge-test").unwrapped
    assert isinstance(made, MergeEnv)
    assert (made.config.recording, made.config.rules, made.config.entry) == (
        "merge-test",
        ("merge.pl",),
        "ramp",
    )
    check_env(made, skip_render_check=True)


def test_many_are_made_at_once() -> None:
    made = gymnasium.make_vec(ID, num_envs=2, autoreset_mode="SameStep")
    assert isinstance(made, MergeVectorEnv)
    assert made.config == EnvConfig(recording="merge-train", rules=("merge.pl",), entry="ramp")


def test_settings_and_a_configuration_take_the_place_of_its_own() -> None:
    assert MergeEnv(recording="merge-test", entry="road", rules=()).config == EnvConfig(
        recording="merge-test"
    )
    given = EnvConfig(recording="highway-test")
    assert MergeEnv(given).config is given
    with pytest.raises(TypeError, match="nearest that it has is 'entry'"):
        MergeEnv(entri="ramp")


def test_keeping_the_lane_is_refused_where_it_must_be_left_and_replaced_by_leaving_it() -> None:
    env = MergeVectorEnv(recording="merge-test", num_envs=32, autoreset_mode="SameStep", mode="replace")
    _, info = env.reset(seed=1)
    refused = 0
    for _ in range(150):
        mask = info["action_mask"]
        assert mask.any(axis=1).all()
        must = mask[:, Action.LANE_KEEPING] == 0
        *_, info = env.step(np.full(32, Action.LANE_KEEPING))
        assert (info["offered"] == ~must).all()
        assert (info["taken"][must] == Action.LEFT_LANE_CHANGE).all()
        refused += int(must.sum())
        assert not info["off_road"].any()
    assert refused > 20


def test_a_random_driver_behind_the_rules_merges_and_causes_no_accident() -> None:
    env = MergeVectorEnv(recording="merge-test", num_envs=50, autoreset_mode="SameStep")
    _, info = env.reset(seed=1)
    rng, merges = np.random.default_rng(0), 0
    for _ in range(400):
        draws = rng.random(info["action_mask"].shape) * info["action_mask"]
        *_, truncated, info = env.step(draws.argmax(axis=1))
        last = info.get("final_info", info)
        assert not last["off_road"].any()
        assert not last["at_fault"].any()
        assert not info["fail_safe"].any()
        merges += int(truncated.sum())
    assert merges > 50
