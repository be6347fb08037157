"""What overtake_left.pl promises, and what it rightly does not."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from drlsl.driving.shield import default_rules
from drlsl.verify import Case, Request, verify
from drlsl.workers import Crew

RULES = default_rules()[0].parent
LEFT, PROPERTIES = RULES / "overtake_left.pl", RULES / "overtake_left.properties.pl"
CASES = (Case(0, 2, 1, 1), Case(0, 3, 2, 2), Case(1, 2, 2, 2))
NOT_MEANT = {"left_is_as_right", "nothing_hidden", "oncoming_is_no_better"}
OWN = (
    "no_overtaking_on_the_right",
    "slowly_past_a_queue",
    "only_past_a_queue",
    "back_to_the_right",
    "right_is_left_at_most",
    "nothing_too_close_hidden",
)

SLIPS = {
    "the vehicle ahead in the own lane is overlooked": (
        "no_overtaking_on_the_right",
        {"Sign * (Y0 - Y) >= 0.0": "Sign * (Y0 - Y) > 0.0"},
    ),
    "anybody ahead on the right holds the ego back": (
        "no_overtaking_on_the_right",
        {"offset(Leader, S1), S1 =< S ->": "true ->"},
    ),
    "vehicles that come the other way count": ("back_to_the_right", {"V2 >= 0.0, ": ""}),
    "km/h taken for m/s": ("no_overtaking_on_the_right", {"V is 60 / 3.6": "V is 60"}),
    "a queue may be passed at any speed": ("slowly_past_a_queue", {"V is 20 / 3.6": "V is 200 / 3.6"}),
    "one vehicle is a queue": ("only_past_a_queue", {"Gap2 > Gap1": "Gap2 >= Gap1"}),
    "vehicles behind count": ("back_to_the_right", {"S > 0.0,": "S > -50.0,"}),
    "the objections of highway.pl are dropped": (
        "nothing_too_close_hidden",
        {":- ensure_loaded('highway.pl').": ":- ensure_loaded('highway.pl').\n:- abolish(objection/2)."},
    ),
}


def statuses(rules: Path, *only: str, cases: tuple[Case, ...] = CASES) -> Mapping[str, str]:
    request = Request((rules,), (PROPERTIES,), vehicles=3, only=only, cases=cases, attack=2000)
    return {result.name: f"{result.status} {result.reason}".strip() for result in verify(request).results}


@pytest.mark.parametrize("name", OWN)
def test_its_own_properties(name: str) -> None:
    assert statuses(LEFT, name) == {name: "proved"}


@pytest.mark.parametrize("name", sorted(NOT_MEANT))
def test_what_the_law_takes_away(name: str) -> None:
    assert statuses(LEFT, name) == {name: "refuted"}


@pytest.mark.parametrize("slip", SLIPS)
def test_slips_are_found(tmp_path: Path, slip: str) -> None:
    name, changes = SLIPS[slip]
    text = LEFT.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "slip.pl").write_text(text, encoding="utf-8")
    assert statuses(tmp_path / "slip.pl", name) == {name: "refuted"}


SYMMETRIES = {"left_is_as_right": 7, "both_directions_alike": 12}
"""Vehicles that these would have to be proved with to hold for any number; 6 are tried."""


def test_all_but_the_symmetries_are_known_for_any_number_of_vehicles() -> None:
    results = verify(Request((LEFT,), (PROPERTIES,), vehicles=6, cases=())).results
    assert {result.name: result.enough for result in results if not result.for_any_number} == SYMMETRIES


@pytest.mark.slow
def test_everything_else_is_proved_on_every_road() -> None:
    results = verify(Request((LEFT,), (PROPERTIES,), vehicles=6, crew=Crew(2))).results
    assert {result.name for result in results if result.status != "proved"} == NOT_MEANT
    open_ended = {result.name for result in results if result.for_any_number}
    assert open_ended >= {result.name for result in results if result.status == "proved"} - SYMMETRIES.keys()
