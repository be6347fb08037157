"""A decision held for several frames is those frames, one after another."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving import Action, EnvConfig
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.shield import Shield
from drlsl.errors import UserError

CONFIG = EnvConfig(recording="highway-test", track_length=60.0)
SHIELD = Shield.default(tier="auto")
FRAME = 0.04


def with_period(period: float | None, **settings: Any) -> EnvConfig:
    return EnvConfig.model_validate({**CONFIG.model_dump(), "decision_period": period, **settings})


@settings(max_examples=25, deadline=None)
@given(
    frames=st.integers(1, 40),
    discount=st.sampled_from([1.0, 0.95, 0.5]),
    seed=st.integers(0, 1000),
    offers=st.sampled_from(["rules", "all"]),
    actions=st.lists(st.sampled_from(list(Action)), min_size=1, max_size=6),
)
def test_a_decision_is_its_frames(
    frames: int, discount: float, seed: int, offers: str, actions: list[Action]
) -> None:
    held = HighwayEnv(with_period(frames * FRAME, offers=offers), shield=SHIELD, discount=discount)
    single = HighwayEnv(with_period(None, offers=offers), shield=SHIELD)
    held.reset(seed=seed)
    single.reset(seed=seed)
    for action in actions:
        total, terms, changed, entered = 0.0, dict.fromkeys(CONFIG.reward.single_terms, 0.0), False, False
        asked: dict[str, Any] = {}
        for frame in range(frames):
            step = single.step(action if frame == 0 else Action.LANE_KEEPING)
            weight, info = discount ** (frame / frames), step[4]
            asked = asked or {key: info[key] for key in ("offered", "taken")}
            total += weight * step[1]
            terms = {name: terms[name] + weight * info["rewards"][name] for name in terms}
            changed |= info["lane_change"]
            entered |= info["entered"]
            if step[2] or step[3]:
                break
        mine = held.step(action)
        assert np.array_equal(mine[0], step[0])
        assert mine[1] == pytest.approx(total)
        assert mine[2:4] == step[2:4]
        expected = {**info, **asked, "rewards": pytest.approx(terms)}
        expected |= {"lane_change": changed, "entered": entered}
        assert {**mine[4], "action_mask": 0} == {**expected, "action_mask": 0}
        assert np.array_equal(mine[4]["action_mask"], info["action_mask"])
        assert np.array_equal(held.action_masks(), single.action_masks())
        if mine[2] or mine[3]:
            return


def test_an_episode_that_ends_within_a_decision_is_left_as_it_ended() -> None:
    """Its neighbours drive on, and so does the world, but not what is told of it."""
    env = HighwayVectorEnv(with_period(2.0), num_envs=6, autoreset_mode="Disabled", shield=SHIELD)
    env.reset(seed=3)
    alone = [HighwayEnv(with_period(2.0), shield=SHIELD) for _ in range(6)]
    for index, one in enumerate(alone):
        one.reset(seed=3 + index)
    observations, rewards, terminated, truncated, info = env.step([0] * 6)
    assert (terminated | truncated).any()
    for index, one in enumerate(alone):
        mine = one.step(0)
        assert np.array_equal(observations[index], mine[0])
        assert (rewards[index], terminated[index], truncated[index]) == mine[1:4]
        for key in ("speed", "distance", "target_speed", "contact", "off_road"):
            assert info[key][index] == mine[4][key], key
        assert np.array_equal(env.action_masks()[index], one.action_masks())


def test_a_long_decision_begins_one_lane_change() -> None:
    env = HighwayEnv(with_period(12.0, recording="freeway", track_length=5000.0, offers="all"), shield=SHIELD)
    for seed in range(20):
        env.reset(seed=seed)
        lane = env.scene().target_lane
        if env.action_masks()[Action.LEFT_LANE_CHANGE]:
            info = env.step(Action.LEFT_LANE_CHANGE)[4]
            if not (info["contact"] or info["entered"]):
                assert abs(env.scene().target_lane - lane) <= 1
                return
    pytest.fail("no episode drove on for 12 s")


def test_frames_in_which_the_rules_fail_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The failure of one frame in the middle of a decision is not lost."""
    env = HighwayEnv(with_period(1.0), shield=SHIELD)
    env.reset(seed=0)
    ask, frame = env.world._ask, iter(range(100))

    def failing(*args: Any) -> Any:
        decisions = ask(*args)
        if next(frame) == 7:
            decisions.failures[0] = "made to fail"
        return decisions

    monkeypatch.setattr(env.world, "_ask", failing)
    info = env.step(0)[4]
    assert (info["fail_safe"], info["fail_safe_reason"]) == (True, "made to fail")
    assert not env.step(0)[4]["fail_safe"]


@pytest.mark.parametrize(
    ("recording", "period", "reason"),
    [
        ("highway-test", 0.05, r"no multiple of the recording's frame, 0.04 s; the nearest one is 0.04"),
        ("freeway", 0.25, r"no multiple of the recording's frame, 0.1 s; the nearest one is 0.2"),
        ("freeway", 0.01, r"the nearest one is 0.1"),
        (("highway-test", "freeway"), 1.0, r"frames of 0.04 and 0.1 s"),
    ],
)
def test_a_period_that_is_no_number_of_frames_is_refused(
    recording: str | tuple[str, ...], period: float, reason: str
) -> None:
    for make in (HighwayEnv, HighwayVectorEnv):
        with pytest.raises(UserError, match=reason):
            make(recording=recording, decision_period=period, shield=SHIELD)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf"), 61.0, "soon"])
def test_a_period_out_of_bounds_is_refused(period: Any) -> None:
    with pytest.raises(ValueError, match="decision_period"):
        EnvConfig(decision_period=period)
