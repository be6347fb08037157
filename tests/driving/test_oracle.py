"""The oracle: what it chooses, seen against what then happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.drivers import Driver, Oracle, Situations, make_driver, most_wanted
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, drive_decision, in_direction, playbacks_of
from drlsl.errors import UserError
from drlsl.traffic import Recording, load_recording
from tests.driving.recordings import Drive, recording

KEEP, LEFT, RIGHT = range(3)
SHIELD = Shield.default(tier="numpy")
MIDDLE = 4
"""The middle one of the three lanes to the right of `recording`; 3 is to its left, 5 to its right."""


def world(made: Recording, egos: int = 1, **settings: Any) -> World:
    values = {"direction": "left_to_right", "decision_period": 1.0, **settings}
    config = EnvConfig(recording="by-hand", **values)
    playbacks = in_direction(playbacks_of([made], config.radar_range), config)
    one = World(config, [playbacks] * egos, SHIELD)
    one.reset(list(range(egos)), [np.random.default_rng([5, ego]) for ego in range(egos)])
    return one


def second_of(of: World) -> int:
    """Frames in a second, which is a decision."""
    return round(1.0 / of.playbacks.all[0].road.time_step)


def situations(of: World) -> Situations:
    decisions = of.decisions
    return Situations(decisions.observation.astype(np.float32), decisions.action_mask, of.seen, of.branch)


def driven(driver: Driver, of: World, seconds: int) -> tuple[np.ndarray, set[int]]:
    """How far each ego comes [m], at a steady speed once its track is done, and which ones met another."""
    reached, over, met = np.zeros(of.count), np.zeros(of.count, bool), set()
    for second in range(seconds):
        choice = most_wanted(driver.preferences(situations(of)), of.decisions.action_mask)
        result = drive_decision(of, choice.actions, frames=second_of(of))
        reached = np.where(over, reached, result.distance)
        done = result.truncated & ~over
        reached[done] += (result.speed * (seconds - 1 - second))[done]
        met |= {ego for ego in result.contacts if not over[ego]}
        over |= result.terminated | result.truncated
        if over.all():
            break
    return reached, met


def slow_ahead(*others: Drive) -> Recording:
    """A slow vehicle ahead of wherever an ego enters the two right lanes; the left lane is free."""
    slow = [Drive(lane, x, 18.0) for lane in (MIDDLE, MIDDLE + 1) for x in (190.0, 230.0)]
    return recording([*slow, *others], frames=700)


def test_it_is_never_behind_keeping_the_lane_where_a_change_pays() -> None:
    made, egos = slow_ahead(), 8
    settings = {"track_length": 330.0}
    kept, _ = driven(make_driver("keep"), world(made, egos, **settings), 20)
    reached, met = driven(Oracle(), world(made, egos, **settings), 20)
    assert not met
    assert (reached >= kept - 1e-9).all(), (reached - kept).tolist()
    assert (reached > kept + 5.0).sum() >= 3, "nobody gained anything"


def test_it_gets_farther_than_keeping_the_lane_on_a_bundled_road() -> None:
    made = load_recording("overtake-test")
    kept, _ = driven(make_driver("keep"), world(made, 16), 20)
    reached, _ = driven(Oracle(horizon=10.0), world(made, 16), 20)
    assert reached.mean() > kept.mean()


def test_it_sees_what_the_rules_cannot() -> None:
    """A vehicle comes up from beyond the radar, at twice the speed, in the lane that is offered."""
    made = slow_ahead(Drive(3, 0.0, 60.0, begin=95))
    _, met = driven(make_driver("always-change"), world(made, 8, traffic="recorded"), 10)
    assert met, "the scene holds no danger"
    _, struck = driven(Oracle(horizon=10.0), world(made, 8, traffic="recorded"), 10)
    assert len(struck) < len(met)


def prefers(of: World, **parameters: float) -> np.ndarray:
    return make_driver("oracle", parameters).preferences(situations(of))


def random_moments(count: int) -> Sequence[World]:
    """Egos at several moments of a drive in dense traffic."""
    of, rng = world(load_recording("overtake-dense-test"), 20), np.random.default_rng(2)
    moments, going = [], np.ones(of.count, bool)
    for _ in range(count):
        for _ in range(3):
            mask = of.decisions.action_mask
            wanted = (rng.random(mask.shape) + 1.0) * mask
            result = drive_decision(of, wanted.argmax(axis=1), frames=second_of(of))
            going &= ~(result.terminated | result.truncated)
        moments.append(of.branch(going.nonzero()[0]))
    return moments


def test_every_offered_action_has_a_value_and_no_other() -> None:
    choices = 0
    for of in random_moments(4):
        mask = of.decisions.action_mask
        wanted = prefers(of, horizon=4.0)
        assert (np.isfinite(wanted) == mask).all()
        choices += int((mask.sum(axis=1) > 1).sum())
        assert mask[np.arange(of.count), most_wanted(wanted, mask).preferred].all()
    assert choices > 5, "nobody had a choice"


def test_a_value_is_where_the_plan_leads() -> None:
    """With one decision a plan is the action and lane keeping: drive it, and see."""
    for of in random_moments(2):
        wanted = prefers(of, horizon=6.0, decisions=1)
        for ego, action in zip(*of.decisions.action_mask.nonzero(), strict=True):
            if of.decisions.action_mask[ego].sum() == 1:
                continue
            alone = of.branch(np.array([ego]))
            for frame in range(6 * second_of(of)):
                result = alone.step([action if frame == 0 else KEEP])
                if result.terminated[0] or result.truncated[0]:
                    break
            else:
                assert wanted[ego, action] == result.distance[0]
                continue
            assert (wanted[ego, action] < 0.0) == bool(result.terminated[0])


def test_more_decisions_and_equal_ones_lead_no_less_far() -> None:
    for of in random_moments(3):
        few, more = (prefers(of, horizon=9.0, decisions=count, pause=3.0) for count in (1, 3))
        assert (more >= few).all()
        assert prefers(of, horizon=9.0, decisions=3, pause=3.0).tolist() == more.tolist(), "not repeatable"


def test_a_value_depends_on_no_other_ego() -> None:
    (of,) = random_moments(1)
    together = prefers(of, horizon=6.0)
    for ego in range(0, of.count, 3):
        assert prefers(of.branch(np.array([ego])), horizon=6.0).tolist() == [together[ego].tolist()]


def test_a_plan_off_the_road_ranks_below_all_others() -> None:
    """Without a shield a change to the left of the left lane leads off the road."""
    of = world(slow_ahead(), 6, offers="all")
    wanted = prefers(of, horizon=8.0)
    assert np.isfinite(wanted).all()
    left_most = (of.seen.lane[:, 0] == 3).nonzero()[0]
    assert left_most.size
    assert (wanted[left_most, LEFT] < 0.0).all()
    assert (wanted[:, KEEP] > 0.0).all()


@pytest.mark.parametrize(
    "parameters", [{"horizon": 0.0}, {"decisions": 0}, {"decisions": 6}, {"pause": -1.0}]
)
def test_parameters_that_it_cannot_have(parameters: dict[str, float]) -> None:
    with pytest.raises(
        UserError, match=f"driver oracle: {next(iter(parameters))}: .*its parameters: horizon"
    ):
        make_driver("oracle", parameters)


def test_a_users_own_driver_is_not_shown_the_future(tmp_path: Any) -> None:
    (tmp_path / "peek.py").write_text("def peek(situations): return situations.branch(0)\n")
    driver = make_driver(f"{tmp_path}/peek.py:peek")
    with pytest.raises(UserError, match="'NoneType' object is not callable"):
        driver.preferences(situations(world(slow_ahead())))
