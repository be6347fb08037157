"""The rules that ship for known environments: no findings, and the same offers and objections by SWI-Prolog.

SWI-Prolog keeps the answers of tables in an order of its own, so the order is not compared.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from gymnasium.envs.toy_text.frozen_lake import generate_random_map

from drlsl.logic import Engine
from drlsl.lowering import Schema, find_mistakes
from drlsl.shield import ActionRules, Facts, rule_file, rules_folder
from drlsl.shield.environments import frozen_lake_facts

_DRIVER = r"""
ask(Goal, Template) :- abolish_all_tables, forall(Goal, ( writeq(Template), nl )).
:- initialization(main).
main :- state(Number, Facts), told(Facts), writeq(state(Number)), nl,
    ask(offered(Action), Action), ask(objection(Action, Reason), Action-Reason), fail.
main.
told(Facts) :- forall(fact(Head), retractall(Head)), forall(member(Fact, Facts), assertz(Fact)).
"""


def lakes() -> list[Facts]:
    """The facts of some cells of some lakes."""
    found = []
    kinds: list[dict[str, Any]] = [{"is_slippery": False}, {}, {"success_rate": 0.7}]
    for number, slips in enumerate(kinds * 2):
        desc = generate_random_map(4, p=0.7 + 0.05 * number, seed=number)
        lake: Any = gymnasium.make("FrozenLake-v1", desc=desc, **slips).unwrapped
        lake.reset(seed=0)
        for cell in range(number % 3, 16, 3):
            if lake.desc.flat[cell] not in (b"H", b"G"):
                lake.s = cell
                found.append(frozen_lake_facts(lake))
    return found


def grids() -> list[Facts]:
    """An agent that looks in each direction, lava on two sides and a wall on another."""
    things = [(4, 2, "lava"), (3, 1, "wall"), (2, 2, "lava"), (0, 0, "goal")]
    return [{("agent", 3): [(3, 2, direction)], ("thing", 3): things} for direction in range(4)]


def by_swipl(path: Path, states: Sequence[Facts], folder: Path) -> list[list[str]]:
    """What SWI-Prolog prints for each state."""
    heads = "".join(f"fact({name}({', '.join('_' * arity)})).\n" for name, arity in states[0])
    told = ""
    for number, facts in enumerate(states):
        rows = [f"{name}({', '.join(map(str, row))})" for (name, _), rows in facts.items() for row in rows]
        told += f"state({number}, [{', '.join(rows)}]).\n"
    session = folder / "session.pl"
    text = path.read_text(encoding="utf-8")
    session.write_text(text + heads + told + _DRIVER, encoding="utf-8")
    done = subprocess.run(
        ["swipl", "-q", "-g", "halt", str(session)], capture_output=True, text=True, timeout=120, check=True
    )
    assert not done.stderr, done.stderr
    return [sorted(part.splitlines()[1:]) for part in done.stdout.split("state(")[1:]]


def by_the_engine(path: Path, states: Sequence[Facts]) -> list[list[str]]:
    engine = Engine()
    engine.consult(path)
    found = []
    for facts in states:
        for (name, arity), rows in facts.items():
            engine.replace_facts(name, arity, rows)
        offered = [engine.format(one["Action"]) for one in engine.query("offered(Action)")]
        because = engine.query("objection(Action, Reason)")
        reasons = [f"{one['Action']}-{engine.format(one['Reason'])}" for one in because]
        found.append(sorted(offered + reasons))
    return found


PROGRAMS = [
    path for path in sorted((rules_folder() / "envs").glob("*.pl")) if not path.match("*.properties.pl")
]


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.name)
def test_the_rules_that_ship_have_no_findings(path: Path) -> None:
    engine = Engine()
    engine.consult(path)
    assert not find_mistakes(engine, Schema(()))


@pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
@pytest.mark.parametrize(("name", "states"), [("frozen_lake.pl", lakes), ("minigrid.pl", grids)])
def test_the_engine_and_swipl_offer_the_same(name: str, states: Any, tmp_path: Path) -> None:
    path, told = rule_file(f"envs/{name}"), states()
    ours = by_the_engine(path, told)
    assert ours == by_swipl(path, told, tmp_path)
    assert {"-" in line for lines in ours for line in lines} == {True, False}


def test_without_a_schema_arrays_decide_as_the_interpreter() -> None:
    """Check it where ego/6 may have many rows: a least gap depends on the row, that there is one does not."""
    aims = [
        ("lane_left", 0.0, 25.0),
        ("idle", 4.0, 25.0),
        ("lane_right", 8.0, 25.0),
        ("faster", 4.0, 30.0),
        ("slower", 4.0, 20.0),
    ]
    others: list[list[tuple[float, float, float]]] = [
        [(130.0, 4.0, 25.0), (150.0, 0.0, 20.0)],
        [(106.0, 4.0, 25.0)],
        [],
    ]
    states: list[Facts] = [
        {
            ("ego", 6): [(100.0, 4.0, 25.0, 0.0, 5.0, 2.0)],
            ("vehicle", 9): [(n, x, y, v, 0.0, 5.0, 2.0, y, "yes") for n, (x, y, v) in enumerate(there)],
            ("aim", 3): aims,
            ("speeds", 2): [(20.0, 5.0)],
            ("period", 2): [(1.0, 0.188875603)],
        }
        for there in others
    ]
    names = [name for name, *_ in aims]
    masks = [
        ActionRules("envs/straight_road.pl", names, fallback="slower", tier=tier).offers(states).mask.tolist()
        for tier in ("interpreter", "numpy")
    ]
    assert masks[0] == masks[1]
    assert len({str(mask) for mask in masks[0]}) == 3
