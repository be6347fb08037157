"""Overtaking on the right is counted from places, whatever any rule says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from drlsl.driving.scene import EGO, Action, Scene, SceneBatch, Vehicle
from drlsl.traffic import Direction
from scripts.overtakings import Counts, Overtakings, main
from tests.scenes import road

ROAD = road(2, 3, time_step=0.1)
KEEP, LEFT, RIGHT = (int(action) for action in Action)


Steps = list[tuple[Scene, int] | Scene]


def scene(lane: int, offset: float, other: int, speeds: tuple[float, float] = (30.0, 20.0)) -> Scene:
    """The ego in a lane, and one vehicle, its centre `offset` ahead, in another; lanes 3 to 5 run right."""
    sign = 1 if lane > 2 else -1

    def car(name: str, number: int, x: float, speed: float) -> Vehicle:
        return Vehicle(name, number, sign * x, ROAD.lanes[number - 1].centre, sign * speed, 0.0, 4.6, 1.9)

    return Scene(ROAD, car(EGO, lane, 100.0, speeds[0]), (car("v", other, 100.0 + offset, speeds[1]),), lane)


def count(*steps: tuple[Scene, int] | Scene, placed: Sequence[int] = ()) -> Counts:
    """Scenes one after another, some with the lane change that began on the way to them."""
    following = Overtakings(Counts())
    for number, step in enumerate(steps):
        after, action = step if isinstance(step, tuple) else (step, KEEP)
        changed, anew = np.array([action != KEEP]), np.array([number in placed])
        following.step(SceneBatch.of([after]), np.array([action]), changed, anew)
    return following.counts


def told(counts: Counts) -> tuple[int, int, int, int]:
    return (
        counts.passed_on_the_right,
        counts.after_a_lane_change,
        counts.within_20_s,
        counts.and_not_allowed,
    )


def test_a_lane_change_to_the_right_and_past() -> None:
    behind = scene(4, 20.0, 4)
    assert told(count(behind, (behind, RIGHT), scene(5, 1.0, 4), scene(5, -1.0, 4))) == (1, 1, 1, 1)


def test_in_the_other_direction() -> None:
    behind = scene(2, 20.0, 2)
    assert told(count(behind, (behind, RIGHT), scene(1, 1.0, 2), scene(1, -1.0, 2))) == (1, 1, 1, 1)


@pytest.mark.parametrize(
    "steps",
    [
        [scene(4, 1.0, 5), scene(4, -1.0, 5)],
        [scene(5, 20.0, 5), (scene(5, 20.0, 5), LEFT), scene(4, -1.0, 5)],
        [scene(4, 1.0, 4), scene(4, -1.0, 4)],
        [scene(3, 1.0, 2), scene(3, -1.0, 2)],
        [scene(5, -1.0, 4), scene(5, 1.0, 4)],
    ],
    ids=["on the left", "after a lane change to the left", "in one lane", "oncoming", "overtaken by it"],
)
def test_what_is_no_passing_on_the_right(steps: Steps) -> None:
    assert told(count(*steps)) == (0, 0, 0, 0)


def test_without_a_lane_change_it_is_passed_only() -> None:
    assert told(count(scene(5, 1.0, 4), scene(5, -1.0, 4))) == (1, 0, 0, 0)
    left_again: Steps = [
        scene(4, 20.0, 3),
        (scene(4, 20.0, 3), RIGHT),
        (scene(5, 9.0, 3), LEFT),
    ]
    assert told(count(*left_again, scene(4, 1.0, 3), scene(4, -1.0, 3))) == (1, 0, 0, 0)
    elsewhere: Steps = [
        scene(4, 20.0, 4),
        (scene(4, 20.0, 4), RIGHT),
        scene(5, 1.0, 4),
        scene(5, -1.0, 4),
    ]
    assert told(count(*elsewhere, placed=[3])) == (0, 0, 0, 0)
    was_behind: Steps = [
        scene(4, -5.0, 4),
        (scene(4, -5.0, 4), RIGHT),
        scene(5, 1.0, 4),
        scene(5, -1.0, 4),
    ]
    assert told(count(*was_behind)) == (1, 0, 0, 0)


def test_after_more_than_20_s_it_was_not_for_that() -> None:
    begin: Steps = [scene(4, 20.0, 4), (scene(4, 20.0, 4), RIGHT)]
    assert told(count(*begin, *[scene(5, 2.0, 4)] * 198, scene(5, -1.0, 4))) == (1, 1, 1, 1)
    assert told(count(*begin, *[scene(5, 2.0, 4)] * 202, scene(5, -1.0, 4))) == (1, 1, 0, 0)


@pytest.mark.parametrize(
    ("speeds", "allowed"), [((21.0, 16.0), True), ((22.5, 16.0), False), ((21.0, 17.0), False)]
)
def test_slowly_past_a_slow_one(speeds: tuple[float, float], allowed: bool) -> None:
    steps: Steps = [
        scene(4, 20.0, 4),
        (scene(4, 20.0, 4), RIGHT),
        scene(5, 1.0, 4),
        scene(5, -1.0, 4, speeds),
    ]
    assert told(count(*steps)) == (1, 1, 1, 0 if allowed else 1)


def test_another_vehicle_in_its_place_is_not_passed() -> None:
    before, after = SceneBatch.of([scene(5, 1.0, 4)]), SceneBatch.of([scene(5, -1.0, 4)])
    following = Overtakings(Counts())
    nothing = np.array([False])
    following.step(before, np.array([KEEP]), nothing, nothing)
    following.step(replace(after, id=after.id + 7), np.array([KEEP]), nothing, nothing)
    assert told(following.counts) == (0, 0, 0, 0)


def test_the_lanes_of_the_scenes_above() -> None:
    assert [lane.direction for lane in ROAD.lanes] == [Direction.RIGHT_TO_LEFT] * 2 + [
        Direction.LEFT_TO_RIGHT
    ] * 3


def test_the_script(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--recording", "highway-train", "--policy", "always-change", "--episodes", "2"])
    printed = dict(line.rsplit(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert printed["episodes"] == "2"
    assert int(printed["steps"].replace(",", "")) > 200
    assert int(printed["changes to the right"]) > 0
