"""What merge.pl promises where lanes end, and what it rightly does not."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from drlsl.driving.shield import default_rules
from drlsl.verify import Case, Request, verify
from drlsl.workers import Crew

RULES = default_rules()[0].parent
MERGE, PROPERTIES = RULES / "merge.pl", RULES / "merge.properties.pl"
CASES = (Case(0, 2, 2, 2), Case(0, 3, 3, 2), Case(2, 1, 2, 1))
NOT_MEANT = {"some_action", "nothing_hidden", "oncoming_is_no_better"}
OWN = (
    "some_action_or_other",
    "no_change_hidden",
    "leaves_in_time",
    "keeps_otherwise",
    "into_no_lane_that_ends",
    "can_stop_at_entry_of_ramp",
    "heeds_every_end",
    "can_stop_before_end",
    "brakes_fully_before_end",
)

SLIPS = {
    "the end is looked for where the ego's middle is": (
        "heeds_every_end",
        {"Room is Sign * (X - Px) - Length / 2": "Room is Sign * (X - Px)"},
    ),
    "the road always runs to the right": ("heeds_every_end", {"Room is Sign * (X - Px)": "Room is X - Px"}),
    "only the lane that the ego's middle is in counts": (
        "heeds_every_end",
        {"end_in_way(Room), speed(ego, V), follow": "own_end(Room), speed(ego, V), follow"},
    ),
    "the end of the lane is no leader": (
        "heeds_every_end",
        {"follow(Room, V, 0.0, A)": "A is 3.0 + 0 * Room"},
    ),
    "the ego may hesitate for as long as it likes": ("leaves_in_time", {"Room < Way, may_leave": "fail"}),
    "it must leave where it cannot": ("some_action_or_other", {"Room < Way, may_leave": "Room < Way"}),
    "a lane that ends is like any other": (
        "into_no_lane_that_ends",
        {"\\+ ends_sooner(Room).": "\\+ ends_sooner(Room), Room < 0.0."},
    ),
    "the lane that ends later counts as sooner": ("into_no_lane_that_ends", {"Own < Room.": "Own > Room."}),
    "the ego enters wherever there is a lane": (
        "can_stop_at_entry_of_ramp",
        {"\\+ obstacle(entry, _, _, _), \\+ end_too_near": "\\+ obstacle(entry, _, _, _)"},
    ),
}


def statuses(rules: Path, *only: str, cases: tuple[Case, ...] = CASES) -> Mapping[str, str]:
    request = Request((rules,), (PROPERTIES,), vehicles=2, only=only, cases=cases, attack=2000)
    return {result.name: f"{result.status} {result.reason}".strip() for result in verify(request).results}


@pytest.mark.parametrize("name", OWN)
def test_its_own_properties(name: str) -> None:
    assert statuses(MERGE, name) == {name: "proved"}


@pytest.mark.parametrize("name", sorted(NOT_MEANT))
def test_what_ends_of_lanes_take_away(name: str) -> None:
    assert statuses(MERGE, name) == {name: "refuted"}


@pytest.mark.parametrize("slip", SLIPS)
def test_slips_are_found(tmp_path: Path, slip: str) -> None:
    name, changes = SLIPS[slip]
    text = MERGE.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "slip.pl").write_text(text, encoding="utf-8")
    assert statuses(tmp_path / "slip.pl", name) == {name: "refuted"}


@pytest.mark.slow
def test_everything_else_is_proved_on_every_road() -> None:
    results = verify(Request((MERGE,), (PROPERTIES,), vehicles=2, crew=Crew(2))).results
    assert {result.name for result in results if result.status != "proved"} == NOT_MEANT
