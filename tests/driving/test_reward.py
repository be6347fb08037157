"""The reward's terms."""

from __future__ import annotations

import pytest

from drlsl.driving.config import RewardConfig
from drlsl.driving.simulation import TERMS
from drlsl.driving.simulation.reward import chosen_terms, reward_term, reward_weights


def terms(
    *,
    config: RewardConfig | None = None,
    playing: bool = True,
    changed: bool = False,
    front_is_free: bool = True,
    speed: float = 0.0,
    contact: bool = False,
    off_road: bool = False,
    progress: float = 0.0,
    limit: float = 30.0,
    acceleration: float = 0.0,
    jerk: float = 0.0,
    dt: float = 0.04,
) -> dict[str, float]:
    config = config or RewardConfig()
    weights = reward_weights(config)
    found = {
        name: reward_term(
            term,
            weights,
            playing,
            changed,
            front_is_free,
            contact,
            off_road,
            speed,
            progress,
            limit,
            acceleration,
            jerk,
            dt,
        )
        for name, term in zip(config.single_terms, chosen_terms(config).tolist(), strict=True)
    }
    assert list(found) == config.single_terms
    return found


def test_the_papers_weights() -> None:
    assert terms(changed=True)["lane_change"] == -5.0
    assert terms(speed=30.0)["velocity"] == pytest.approx(0.3)


@pytest.mark.parametrize("term", ["collision", "off_road"])
@pytest.mark.parametrize(("progress", "expected"), [(0.0, -100.0), (0.5, -60.0), (1.0, -20.0), (1.2, -20.0)])
def test_ending_late_costs_less(term: str, progress: float, expected: float) -> None:
    found = terms(contact=term == "collision", off_road=term == "off_road", progress=progress)
    assert found[term] == pytest.approx(expected)
    assert sum(found.values()) == pytest.approx(expected)


def test_an_uneventful_step_costs_nothing() -> None:
    assert set(terms().values()) == {0.0}


ALL = RewardConfig.model_validate({"terms": ["paper", "lost_speed", "comfort", "jerk"]})


def test_paper_stands_for_its_four_terms_and_the_others_are_chosen_by_name() -> None:
    assert RewardConfig().single_terms == ["lane_change", "velocity", "collision", "off_road"]
    assert tuple(ALL.single_terms) == TERMS
    assert list(terms(config=RewardConfig(terms=("jerk", "lane_change")))) == ["jerk", "lane_change"]


@pytest.mark.parametrize(("dt", "frames"), [(0.04, 25), (0.1, 10)])
def test_a_second_costs_the_same_at_any_frame_rate(dt: float, frames: int) -> None:
    found = terms(config=ALL, speed=20.0, limit=30.0, acceleration=-2.0, jerk=3.0, dt=dt)
    assert found["lost_speed"] * frames == pytest.approx(-0.25 * 10.0)
    assert found["comfort"] * frames == pytest.approx(-0.05 * 4.0)
    assert found["jerk"] * frames == pytest.approx(-0.01 * 9.0)


def test_a_lane_change_behind_somebody_may_be_worth_something() -> None:
    config = RewardConfig(lane_change=1.0, lane_change_behind=2.0)
    assert terms(config=config, changed=True)["lane_change"] == -1.0
    assert terms(config=config, changed=True, front_is_free=False)["lane_change"] == 2.0
    assert terms(config=config, front_is_free=False)["lane_change"] == 0.0
    assert terms(changed=True, front_is_free=False)["lane_change"] == -5.0


def test_an_episode_that_is_over_earns_nothing() -> None:
    found = terms(config=ALL, playing=False, speed=20.0, acceleration=-2.0, jerk=3.0)
    assert set(found.values()) == {0.0}


@pytest.mark.parametrize("given", [["paper", "velocity"], ["jerk", "jerk"], [], ["speed"]])
def test_a_term_that_is_unknown_or_named_twice_is_refused(given: list[str]) -> None:
    with pytest.raises(ValueError, match=r"named twice|at least 1 item|Input should be"):
        RewardConfig.model_validate({"terms": given})
