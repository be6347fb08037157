"""Rules cannot change what a property says, nor a property what the rules say."""

from __future__ import annotations

from pathlib import Path

import pytest

import drlsl.cli
from drlsl.errors import UserError
from drlsl.logic import PrologError
from drlsl.verify.properties import load

UNSAFE = "safe_actions(A) :- member(A, [left_lane_change, lane_keeping]).\n"
PROPERTIES = (
    "property(none, 'no lane change').\n"
    "violates(none) :- safe_actions(A), offered(A).\n"
    "offered(A) :- member(A, [left_lane_change, right_lane_change]).\n"
)

SMUGGLED = {
    "a clause that fails first": ("violates(_) :- !, fail.", "rules.pl:2:.*define violates/1"),
    "multifile": (":- multifile(violates/1).\nviolates(none) :- fail.", "rules.pl:3:.*define violates/1"),
    "a helper": ("offered(_) :- !, fail.", "rules.pl:2:.*define offered/1"),
    "a helper, multifile": (":- multifile(offered/1).\noffered(x).", "rules.pl:3:.*define offered/1"),
    "discontiguous": (":- discontiguous(offered/1).\noffered(x).", "rules.pl:3:.*define offered/1"),
    "asserted": (":- dynamic(offered/1).\n:- assertz(offered(x)).", "define offered/1"),
    "a range": ("range(ego_speed, 0, 1).", "rules.pl:2:.*define range/3"),
    "an unknown": ("unknown(moment, 0, 1, 'time').", "rules.pl:2:.*define unknown/4"),
    "an image": ("image(alone, vehicle(a), true).", "rules.pl:2:.*define image/3"),
    "in/2": ("in(_, G) :- call(G).", "rules.pl:2:.*define in/2"),
    "a library predicate": ("member(A, [A|_]).", "rules.pl:2:.*define member/2, which Prolog provides"),
    "another reading": (":- op(500, xfy, -).", "properties.pl:4:.*far/1 is read as something else"),
    "a flag": (":- set_prolog_flag(iso, false).", "flags"),
}


@pytest.mark.parametrize("name", SMUGGLED)
def test_rules_leave_the_properties_alone(tmp_path: Path, name: str) -> None:
    text, message = SMUGGLED[name]
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(UNSAFE + text + "\n")
    properties.write_text(PROPERTIES + "far(X) :- X is 5 - 2 - 1.\n")
    with pytest.raises(UserError, match=message):
        load([rules], [properties])


def test_the_command_line_says_so_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(UNSAFE + "violates(_) :- !, fail.\n")
    properties.write_text(PROPERTIES)
    assert drlsl.cli.run(["rules", "verify", str(rules), "--property", str(properties), "--jobs", "1"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"drlsl: {rules}:2: the rules define violates/1, which belongs to the properties; "
        "rename it in the rules"
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("safe_actions(_) :- fail.", "rules.pl:1:.*define safe_actions/1"),
        (":- multifile(safe_actions/1).\nsafe_actions(x).", "rules.pl:1:.*define safe_actions/1"),
        ("memberchk(_, _).", "properties.pl:4:.*must not define memberchk/2"),
        (":- set_prolog_flag(iso, false).", "flags"),
    ],
)
def test_properties_leave_the_rules_alone(tmp_path: Path, text: str, message: str) -> None:
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(UNSAFE)
    properties.write_text(PROPERTIES + text + "\n")
    with pytest.raises(UserError, match=message):
        load([rules], [properties])


def test_properties_abolish_no_rules(tmp_path: Path) -> None:
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(UNSAFE)
    properties.write_text(PROPERTIES + ":- abolish(safe_actions/1).\n")
    with pytest.raises(PrologError, match=r"properties\.pl:4"):
        load([rules], [properties])


def test_rules_may_hide_what_no_property_uses(tmp_path: Path) -> None:
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(UNSAFE + "last([X], X).\n")
    properties.write_text(PROPERTIES)
    assert [one.name for one in load([rules], [properties]).properties] == ["none"]


def test_ranges_are_within_what_facts_can_be(tmp_path: Path) -> None:
    """Beyond that the tiers leave a scene to the interpreter, and the lowered program says nothing of it."""
    properties = tmp_path / "properties.pl"
    properties.write_text("property(p, 'p'). violates(p) :- fail. range(position, -2.0e15, 2.0e15).")
    with pytest.raises(UserError, match="from -1e15 to 1e15"):
        load([], [properties])
