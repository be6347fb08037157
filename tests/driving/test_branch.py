"""A branch of the world drives on as the world itself would."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import StepResult, World, in_direction, playbacks_of
from drlsl.traffic import load_recording

EGOS = 6
SHIELD = Shield.default(tier="numpy")
FAULTS = {"position_noise": 0.3, "speed_noise": 0.3, "drop_rate": 0.1, "latency": 0.4}


def world(**settings: Any) -> World:
    config = EnvConfig(recording="highway-test", **settings)
    recordings = [load_recording("highway-test"), load_recording("freeway")]
    playbacks = in_direction(playbacks_of(recordings, config.radar_range), config)
    made = World(config, [playbacks[ego % 2 :] for ego in range(EGOS)], SHIELD, measured=True)
    made.reset(list(range(EGOS)), [np.random.default_rng([3, ego]) for ego in range(EGOS)])
    return made


def plain(result: StepResult, egos: list[int]) -> dict[str, Any]:
    """All that a step gave for some egos."""
    found: dict[str, Any] = {}
    for holder in (result, result.decisions, result.scenes):
        for field in fields(holder):
            value = getattr(holder, field.name)
            if isinstance(value, np.ndarray):
                found[f"{type(holder).__name__}.{field.name}"] = value[egos].tolist()
    found |= {name: term[egos].tolist() for name, term in result.rewards.items()}
    found["contacts"] = [result.contacts.get(ego) for ego in egos]
    found["failures"] = [result.failures.get(ego) for ego in egos]
    return found


def draw(made: World, rng: np.random.Generator) -> np.ndarray:
    """Any actions, rarely a change, offered or not."""
    return np.where(rng.random(made.count) < 0.02, rng.integers(3, size=made.count), 0)


@pytest.mark.parametrize(
    "settings",
    [
        {"traffic": "recorded"},
        {"traffic": "reactive"},
        {"traffic": "reactive", "sensing": FAULTS},
        {"offers": "prediction"},
    ],
    ids=["recorded", "reactive", "sensing", "prediction"],
)
def test_a_branch_is_the_future_to_the_bit(settings: dict[str, Any]) -> None:
    rng = np.random.default_rng(8)
    made = world(**settings)
    for _ in range(60):
        made.step(draw(made, rng))
    left_alone = deepcopy(made)
    egos = [4, 0, 0, 3, 5]
    branch = made.branch(np.array(egos))
    assert branch.measures is None
    np.testing.assert_array_equal(branch.targets(), made.targets()[egos])
    # Long enough for contacts, and for entering the road again at a place that is drawn.
    ended, entered, contacts = np.zeros(EGOS, bool), False, 0
    for step in range(350):
        actions = draw(made, rng)
        ahead = branch.step(actions[egos])
        alone = left_alone.step(actions)
        result = made.step(actions)
        going = [place for place, ego in enumerate(egos) if not ended[ego]]
        mine = [egos[place] for place in going]
        assert plain(ahead, going) == plain(result, mine), f"step {step}"
        running = np.flatnonzero(~ended).tolist()
        assert plain(alone, running) == plain(result, running), "the branch changed the world"
        ended |= result.terminated | result.truncated
        entered |= bool(result.entered[mine].any())
        contacts += len(result.contacts)
        if ended.all():
            break
    assert entered or contacts, "nothing happened that could differ"


def test_a_world_that_has_not_begun_has_no_branch() -> None:
    config = EnvConfig(recording="highway-test")
    playbacks = in_direction(playbacks_of([load_recording("highway-test")], config.radar_range), config)
    with pytest.raises(RuntimeError, match="reset the environment first"):
        World(config, [playbacks], SHIELD).branch(np.array([0]))


def test_a_branch_remembers_where_the_vehicles_behind_their_record_were() -> None:
    """The past of the others decides who is to blame for a contact in the branch."""
    rng = np.random.default_rng(8)
    made = world(traffic="reactive")
    for _ in range(120):
        made.step(draw(made, rng))
    egos = [4, 0, 0, 3, 5]
    branch = made.branch(np.array(egos))
    there, here = made._reactive, branch._reactive
    assert there is not None
    assert here is not None
    compared = 0
    for place, ego in enumerate(egos):
        frame = made.frame_of(ego)
        for slot in np.flatnonzero(there.lag[ego]).tolist():
            recorded = made.playback_of(ego).track(frame, slot, frame - 50)
            mine, theirs = here.driven(place, slot, recorded), there.driven(ego, slot, recorded)
            assert mine.s.tolist() == theirs.s.tolist() != recorded.s.tolist()
            assert mine.speed.tolist() == theirs.speed.tolist()
            compared += 1
    assert compared > 3, "hardly anybody left the record"
