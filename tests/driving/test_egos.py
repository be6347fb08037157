"""What egos steer for."""

from __future__ import annotations

import numpy as np
import pytest

from drlsl.driving.scene import Action
from drlsl.driving.shield import NO_WISH
from drlsl.driving.simulation import playbacks_of
from drlsl.driving.simulation.egos import Egos
from drlsl.driving.simulation.entry import Entry
from drlsl.driving.simulation.playback import Courses, Playbacks
from drlsl.errors import UserError
from drlsl.traffic import Direction
from tests.driving.recordings import LANES, WIDTH, Drive, recording

EVERYONE = np.arange(5)


@pytest.fixture
def egos() -> tuple[Egos, Courses]:
    """One ego in the centre of each lane of the road."""
    playbacks = Playbacks(
        playbacks_of([recording([Drive(1, 400.0, 1.0), Drive(3, 5.0, 1.0)], frames=5)], 100.0)
    )
    sides = {one.direction: index for index, one in enumerate(playbacks.all)}
    egos = Egos(len(LANES), (4.6, 1.9), 10)
    for ego, lane in enumerate(LANES):
        egos.at.playback[ego], egos.at.ended[ego] = sides[lane.direction], False
        egos.place(ego, Entry(0, lane, 100.0, 20.0))
    return egos, playbacks.courses.take(egos.at.playback)


def lanes_of(egos: Egos) -> list[int]:
    lanes: list[int] = egos.at.target_lane.tolist()
    return lanes


def test_targets_are_what_steering_takes_up(egos: tuple[Egos, Courses]) -> None:
    some, courses = egos
    targets = some.targets(some.at.target_lane, courses, EVERYONE)
    centres = [lane.centre for lane in LANES]
    assert targets[:, Action.LANE_KEEPING].tolist() == centres
    # y is downward: the left of who drives to the left is the next lane below, and the other way round.
    beyond = LANES[1].centre + WIDTH
    assert targets[:, Action.LEFT_LANE_CHANGE].tolist() == [
        centres[1],
        beyond,
        centres[2] - WIDTH,
        *centres[2:4],
    ]
    assert targets[:, Action.RIGHT_LANE_CHANGE].tolist() == [
        centres[0] - WIDTH,
        centres[0],
        *centres[3:],
        centres[4] + WIDTH,
    ]
    for action in (Action.LEFT_LANE_CHANGE, Action.RIGHT_LANE_CHANGE):
        for ego, lane in enumerate(LANES):
            some.place(ego, Entry(0, lane, 100.0, 20.0))
        changed = some.steer(np.full(5, action), some.at.target_lane.copy(), courses)
        assert changed.all()
        assert some.at.target_y.tolist() == targets[:, action].tolist()
    assert lanes_of(some) == [1, 1, 4, 5, 5], "off the road the target lane stays the old one"


def test_a_lane_change_is_not_taken_up_during_another(egos: tuple[Egos, Courses]) -> None:
    some, courses = egos
    some.at.y += 0.5
    targets = some.targets(some.at.target_lane, courses, EVERYONE)
    assert np.isnan(targets[:, 1:]).all()
    assert not some.steer(np.full(5, Action.LEFT_LANE_CHANGE), some.at.target_lane.copy(), courses).any()
    assert lanes_of(some) == [1, 2, 3, 4, 5]


def test_the_lane_to_keep_is_steered_for(egos: tuple[Egos, Courses]) -> None:
    some, courses = egos
    keep = np.array([2, 2, 3, 3, 5])
    assert some.targets(keep, courses, EVERYONE)[:, 0].tolist() == [LANES[lane - 1].centre for lane in keep]
    assert some.targets(keep[3:], courses, np.array([3, 4]))[:, 0].tolist() == [
        LANES[2].centre,
        LANES[4].centre,
    ]
    some.at.ended[3] = True
    assert not some.steer(np.zeros(5, dtype=np.int64), keep, courses).any()
    assert lanes_of(some) == [2, 2, 3, 4, 5]


def test_a_lane_of_the_other_direction_cannot_be_kept(egos: tuple[Egos, Courses]) -> None:
    some, courses = egos
    with pytest.raises(UserError, match="lane 3, which the road does not have in the ego's direction"):
        some.steer(np.zeros(5, dtype=np.int64), np.array([3, 2, 3, 4, 5]), courses)


def test_an_ego_drives_alike_alone_and_beside_one_without_a_wish() -> None:
    """As where the rules fail for an ego now and then: the fail-safe has no comfortable acceleration."""
    playbacks = Playbacks(playbacks_of([recording([Drive(3, 5.0, 1.0)], frames=5)], 100.0))
    [side] = [index for index, one in enumerate(playbacks.all) if one.direction is Direction.LEFT_TO_RIGHT]
    paths = []
    for count in (1, 2):
        egos = Egos(count, (4.6, 1.9), 10)
        courses = playbacks.courses.take(np.full(count, side))
        for ego in range(count):
            egos.place(ego, Entry(0, LANES[3], 100.0, 20.0))
        path = []
        for target, wish in ((20.05, NO_WISH), (20.1, 0.5), (20.05, NO_WISH), (20.2, NO_WISH)):
            egos.drive(np.full(count, target), np.array([wish, NO_WISH][:count]), courses)
            path.append((float(egos.at.x[0]), float(egos.at.speed[0])))
        paths.append(path)
    assert paths[0] == paths[1]
