import dataclasses
from typing import Any

import numpy as np
import pytest

from drlsl.driving.drivers import Situations
from drlsl.driving.simulation import EpisodeMeasures
from drlsl.learning import ShieldState, as_record, drive
from drlsl.learning.episode import EVALUATION_STREAM, TRAINING_STREAM, EpisodeSummary, episode_seed
from drlsl.learning.totals import time_saved, times_of, totals

from .fake import fakes

MEASURED = (
    "windows_per_km",
    "mean_time_completed",
    "jerk_rms",
    "hard_braking",
    "short_ttc",
    "headway_5",
    "headway_50",
    "imposed_braking",
    "imposed_hard_braking",
)


class Fixed:
    """A policy whose values are always the same."""

    window = 1

    def __init__(self, *values: float) -> None:
        self._values = np.array(values, np.float32)

    def preferences(self, situations: Situations) -> np.ndarray:
        return np.tile(self._values, (len(situations.offered), 1))


def driven(*values: float, shield: ShieldState, seed: int = 0, episodes: int = 30) -> list[EpisodeSummary]:
    return list(drive(fakes(4), Fixed(*values), shield=shield, episodes=episodes, seed=seed))


def test_without_the_shield_the_best_action_of_all_is_taken() -> None:
    summaries = driven(0, 0, 1, shield="off")
    assert all(summary.off_road or summary.contact for summary in summaries)
    assert all(summary.lane_changes == summary.steps <= 3 for summary in summaries)
    assert all(summary.mask_size == 3.0 for summary in summaries)


def test_with_the_shield_the_best_safe_action_is_taken() -> None:
    summaries = driven(0, 0, 1, shield="on")
    assert not any(summary.off_road for summary in summaries)
    assert all(summary.lane_changes <= 2 for summary in summaries)
    assert all(1.0 <= summary.mask_size < 3.0 for summary in summaries)


@pytest.mark.parametrize("shield", ["on", "off"])
def test_interventions_are_counted_against_the_rules_either_way(shield: ShieldState) -> None:
    keep = totals(driven(1, 0, 0, shield=shield))
    assert keep.interventions == 0.0
    right = driven(0, 0, 1, shield=shield)
    assert all(summary.interventions >= (not summary.contact) for summary in right)
    assert 0.0 < totals(right).interventions <= 1.0
    # Kept from going right, the ego stays in the rightmost lane, where right is never safe.
    if shield == "on":
        assert all(summary.interventions >= summary.steps - 10 for summary in right if summary.steps > 20)


def test_an_evaluation_is_a_function_of_its_seed() -> None:
    assert driven(1, 0, 0, shield="off") == driven(1, 0, 0, shield="off")
    assert driven(1, 0, 0, shield="off") != driven(1, 0, 0, shield="off", seed=1)


def test_the_same_episodes_are_driven_with_and_without_the_shield() -> None:
    on, off = driven(1, 0, 0, shield="on"), driven(1, 0, 0, shield="off")
    assert [dataclasses.replace(item, mask_size=3.0) for item in on] == off


def test_more_episodes_begin_with_the_same_ones() -> None:
    assert driven(1, 0, 0, shield="off", episodes=9)[:4] == driven(1, 0, 0, shield="off", episodes=4)


def test_episodes_come_in_order_however_many_are_driven_side_by_side() -> None:
    policy = Fixed(0, 0, 1)
    alone, together = (
        list(drive(fakes(count), policy, shield="on", episodes=11, seed=5)) for count in (1, 7)
    )
    assert alone == together
    assert len(alone) == 11


def test_no_training_episode_is_met_again() -> None:
    training = {episode_seed(0, TRAINING_STREAM, index) for index in range(2_000)}
    evaluation = {episode_seed(0, EVALUATION_STREAM, index) for index in range(500)}
    assert not training & evaluation
    assert len(training) == 2_000


def summary(**values: Any) -> EpisodeSummary:
    base: dict[str, Any] = {
        field.name: {"bool": False, "str": "", "int": 0, "float": 0.0}[
            str(getattr(field.type, "__name__", field.type))
        ]
        for field in dataclasses.fields(EpisodeSummary)
        if field.default is dataclasses.MISSING
    }
    return EpisodeSummary(**base | values)


def test_totals() -> None:
    episodes = [
        summary(
            steps=10,
            mean_speed=30.0,
            total_return=1.0,
            lane_changes=2,
            interventions=4,
            fail_safe=1,
            not_offered=3,
            distance=2000.0,
        ),
        summary(steps=30, mean_speed=20.0, total_return=2.0, contact=True, at_fault=True, lane_changes=1),
        summary(steps=20, mean_speed=20.0, total_return=6.0, contact=True),
        summary(steps=20, mean_speed=20.0, total_return=3.0, off_road=True, interventions=12),
    ]
    together = totals(episodes)
    assert dataclasses.asdict(together) == {
        "episodes": 4,
        "lane_changes": 3,
        "contacts_at_fault": 1,
        "contacts_not_at_fault": 1,
        "off_road": 1,
        "completed": 1,
        "mean_steps": 20.0,
        "mean_steps_completed": 10.0,
        "mean_speed": pytest.approx(21.25),
        "mean_return": 3.0,
        "interventions": pytest.approx(0.2),
        "not_offered": 3,
        "fail_safe": 1,
        "at_fault_per_1000_km": pytest.approx(500.0),
        "excused_per_1000_km": pytest.approx(500.0),
        "lane_changes_per_km": pytest.approx(1.5),
        "interventions_per_km": pytest.approx(8.0),
        **dict.fromkeys(MEASURED),
    }
    assert totals(episodes[1:]).mean_steps_completed is None
    with pytest.raises(ValueError, match="no episode"):
        totals([])


def measured(time: float, **values: Any) -> EpisodeSummary:
    headways = [0.0] * 121
    headways[20] = time
    measures = EpisodeMeasures(
        time=time,
        jerk_square=4.0 * time,
        hard_braking=0.1 * time,
        short_ttc=0.2 * time,
        windows=3.0,
        imposed=time / 10,
        imposed_hard=0.0,
        headways=tuple(headways),
    )
    return summary(steps=10, distance=1000.0, measures=measures, **values)


def test_totals_of_measures() -> None:
    together = totals([measured(10.0), measured(30.0, contact=True)])
    assert {name: getattr(together, name) for name in MEASURED} == {
        "windows_per_km": pytest.approx(3.0),
        "mean_time_completed": pytest.approx(10.0),
        "jerk_rms": pytest.approx(2.0),
        "hard_braking": pytest.approx(0.1),
        "short_ttc": pytest.approx(0.2),
        "headway_5": pytest.approx(1.05),
        "headway_50": pytest.approx(1.05),
        "imposed_braking": pytest.approx(2.0),
        "imposed_hard_braking": 0.0,
    }


def test_time_is_saved_where_both_complete() -> None:
    others = [measured(20.0), measured(20.0), measured(5.0, contact=True), measured(10.0)]
    mine = [measured(18.0), measured(3.0, off_road=True), measured(20.0), measured(9.0)]
    saved = time_saved(times_of(mine), times_of(others))
    assert saved == pytest.approx(0.1)
    assert times_of(mine) == [18.0, None, 20.0, 9.0]
    assert time_saved(times_of(others), times_of(others)) == 0.0
    assert time_saved([None], [20.0]) is None
    assert times_of([summary()]) == [None]
    with pytest.raises(ValueError, match="shorter"):
        time_saved(times_of(mine), times_of(others)[:2])


def test_a_record_holds_totals_and_episodes() -> None:
    record = as_record([summary(steps=5)], env={"recording": "x"}, shield="on", seed=3)
    assert (record["episodes"], record["shield"], record["seed"]) == (1, "on", 3)
    assert record["totals"]["mean_steps"] == 5.0
    assert record["per_episode"][0]["steps"] == 5
    assert record["per_episode"][0]["measures"] is None
    taken = as_record([measured(10.0)], env={}, shield="on", seed=3)["per_episode"][0]["measures"]
    assert (taken["time"], "headways" in taken) == (10.0, False)
