"""The table of arithmetic: a row means the same in every tier and proof, and a new row is enough for all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.logic import Engine
from drlsl.logic.core import BINARY, NODES, OPERATIONS, Operation, operations
from drlsl.lowering.backends import compile_numba
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import NotLowerable, Relation, Schema
from drlsl.verify import Case, Prover, Task
from drlsl.verify.attack import Orders, attack
from drlsl.verify.attack.enclosures import ANY, NO_NUMBER, operation, point
from drlsl.verify.smt.functions import bounds_of
from tests.lowering.tiers import Facts, Tiers, array_value, ask, expected_value, to_rows

NUMBERS, INTEGERS = ("numbers", 2), ("integers", 2)
SCHEMA = Schema(
    [
        Relation("numbers", ("float", "float"), single=True),
        Relation("integers", ("int", "int"), single=True),
    ]
)
ROWS = sorted(OPERATIONS)
COVERED = [key for key in ROWS if not OPERATIONS[key].refused]
FLOATS = st.one_of(
    st.sampled_from(
        [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 2.5, 0.49999999999999994, -0.49999999999999994, 1e15, 1e-31]
    ),
    st.floats(-40.0, 40.0),
)
WHOLE = st.one_of(st.sampled_from([0, 1, -1, 2, -7, 62, 2**40, -(2**53)]), st.integers(-50, 50))


def expression(name: str, arity: int, kinds: str) -> str:
    """The operation of a row on floats X and Y, or integers M and N, as `kinds` has it: f or i for each."""
    names = [one if kind == "f" else other for kind, one, other in zip(kinds, "XYX", "MNM", strict=False)]
    return f"'{name.replace(chr(92), chr(92) * 2)}'({', '.join(names[:arity])})" if arity else name


def arguments(*, positive: bool) -> str:
    """The goals that give X, Y, M and N their values.

    Where these are `positive`, generated code may leave out tests that their bounds make needless.
    """
    if positive:
        return "numbers(X0, Y0), integers(M0, N0), X is abs(X0), Y is abs(Y0), M is abs(M0), N is abs(N0)"
    return "numbers(X, Y), integers(M, N)"


def rule(name: str, arity: int, kinds: str, *, positive: bool = False) -> str:
    return f"p(Z) :- {arguments(positive=positive)}, Z is {expression(name, arity, kinds)}.\n"


def tiers(name: str, arity: int, kinds: str, *, positive: bool = False) -> Tiers:
    engine = Engine()
    engine.consult_text(rule(name, arity, kinds, positive=positive))
    return Tiers(engine, SCHEMA, Query("p", 1, "first"))


def scene(x: float, y: float, m: int, n: int) -> Facts:
    return {NUMBERS: [(x, y)], INTEGERS: [(m, n)]}


@pytest.mark.parametrize(("name", "arity"), ROWS)
def test_a_row_has_a_meaning_in_every_tier_or_says_why_not(name: str, arity: int) -> None:
    row = OPERATIONS[name, arity]
    if row.refused:
        with pytest.raises(NotLowerable, match=row.refused.split(",")[0]):
            tiers(name, arity, "fff")
        return
    assert bool(row.node) + bool(row.defined) + (arity == 0) == 1
    if row.node:
        assert NODES[row.node].compute is not operations._nothing
        assert len(row.grows) in (0, arity)
    if row.kind == "real" and row.curve is not None:
        assert row.curve.domain[0] < row.curve.domain[1]


EDGES = [
    scene(-0.5, 2.0, 12, 18),
    scene(2.5, -0.5, -7, 2),
    scene(-0.49999999999999994, 0.0, -7, 0),
    scene(0.0, -0.0, 1, 2**40),
    scene(1e15, 1e-31, -1, -1),
    scene(-3.7, 3.0, 2**53, 62),
]


@pytest.mark.parametrize(("name", "arity"), COVERED)
@settings(deadline=None, max_examples=2)
@given(st.lists(st.builds(scene, FLOATS, FLOATS, WHOLE, WHOLE), max_size=6))
def test_every_row_is_the_same_in_all_tiers(name: str, arity: int, scenes: Sequence[Facts]) -> None:
    kinds = [""] if arity == 0 else ["f", "i"] if arity == 1 else ["ff", "fi", "if", "ii"]
    if name in ("**", "^"):
        kinds.remove("ii")  # an integer power needs a constant exponent
    for one in kinds:
        for positive in (False, True):
            tiers(name, arity, one, positive=positive).check([*scenes, *EDGES])


@pytest.mark.parametrize("positive", [False, True])
@pytest.mark.parametrize(("name", "arity"), [key for key in COVERED if OPERATIONS[key].needs])
def test_a_value_used_twice_may_be_computed_where_it_has_none(
    name: str, arity: int, *, positive: bool
) -> None:
    """Generated code may compute it before it asks whether the branch that needs it is chosen."""
    row = OPERATIONS[name, arity]
    assert row.needs is not None
    kinds = "ii" if row.kind == "whole" else "ff"
    args = dict(zip("AB", "MN" if kinds == "ii" else "XY", strict=True))
    condition = "".join(args.get(sign, sign) for sign in row.needs[0])
    engine = Engine()
    engine.consult_text(
        f"p(Z) :- {arguments(positive=positive)}, "
        f"( {condition} -> S is {expression(name, arity, kinds)}, Z is S * S + S ; Z = none )."
    )
    scenes = [scene(-1.0, 0.0, -7, 0), scene(0.0, -0.0, 0, 0), scene(4.0, 2.0, 7, -2), scene(0.5, -2.0, 0, 3)]
    assert Tiers(engine, SCHEMA, Query("p", 1, "first")).check(scenes) == len(scenes)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "arity"), COVERED)
def test_machine_code_says_the_same_of_every_row(name: str, arity: int) -> None:
    pytest.importorskip("numba", reason="Numba is not installed")
    rng = np.random.default_rng(3)
    scenes = [scene(*rng.normal(0, 3, 2).tolist(), *rng.integers(-20, 20, 2).tolist()) for _ in range(40)]
    scenes += [scene(-0.49999999999999994, 0.0, -1, 0), scene(0.5, -0.0, 2**53, -1), scene(2.5, 2.0, 1, 40)]
    for kinds in ("ff", "ii")[: 1 if name in ("**", "^") else 2]:
        engine = Engine()
        engine.consult_text(rule(name, arity, kinds))
        compared(engine, Query("p", 1, "first"), scenes)


def test_machine_code_calls_functions_of_integers_and_of_floats() -> None:
    pytest.importorskip("numba", reason="Numba is not installed")
    values = "A is round(Y), B is log2(Z), C is gcd(M, N) << 2, D is M rem N"
    engine = Engine()
    engine.consult_text(f"p(A, B, C, D) :- numbers(Y, Z), integers(M, N), {values}.")
    assert (
        compared(
            engine, Query("p", 4, "first"), [scene(-0.49999999999999994, 3.0, -20, 12), scene(2.5, 0.1, 7, 7)]
        )
        == 2
    )


def compared(engine: Engine, query: Query, scenes: Sequence[Facts]) -> int:
    """Compare machine code with the interpreter; the number of scenes that it could answer."""
    program = compile_numba(lower(engine, SCHEMA, [query]))
    result = program(to_rows(program, SCHEMA, scenes))
    (answer,) = result.answers
    for n, facts in enumerate(scenes):
        if not result.undecided[n]:
            wanted = ask(engine, query, facts)
            assert not isinstance(wanted, Exception), (query, facts, wanted)
            given = array_value(program, query, answer.value[n], bool(answer.fails[n]))
            assert given == expected_value(program, query, wanted), (query, facts)
    return int(np.count_nonzero(~result.undecided))


SMOOTH = [row for row in NODES.values() if row.curve is not None]


@settings(deadline=None, max_examples=300)
@given(st.sampled_from(SMOOTH), st.floats(-800, 800), st.floats(0, 50), st.floats(0, 1))
def test_a_proof_bounds_what_is_computed(row: Operation, start: float, length: float, share: float) -> None:
    value = row.compute(start + share * length)
    given = (Fraction(start), Fraction(start) + Fraction(length))
    for low, high in (bounds_of(row, given), bounds_of(row, (None, None))):
        inside = (-math.inf if low is None else low) <= value <= (math.inf if high is None else high)
        assert inside or not math.isfinite(value)


@settings(deadline=None, max_examples=300)
@given(st.sampled_from(sorted(NODES)), FLOATS, FLOATS, WHOLE, WHOLE)
def test_exact_arithmetic_encloses_what_is_computed(name: str, x: float, y: float, m: int, n: int) -> None:
    row = NODES[name]
    numbers: list[Any] = [m, n] if row.kind == "whole" else [x, y]
    args = numbers[: row.arity]
    if row.kind == "whole" and name.startswith("shift") and abs(n) > 64:
        return
    value = row.compute(*args)
    found = operation(row, [point(Fraction(arg)) for arg in args], 80)
    if found is ANY:
        return
    if found is NO_NUMBER:
        assert row.divides or math.isnan(value)
        return
    slack = Fraction(1, 10**9) * (1 + abs(found.high)) + Fraction(1, 10**12)
    assert not math.isfinite(value) or found.low - slack <= Fraction(value) <= found.high + slack


FAR = """
far(D) :- numbers(X, Y), D is hypot(X, Y).
mixed(D) :- integers(M, _), numbers(_, Y), D is hypot(M, Y).
"""
PROPERTIES = """
property(no_shortcut, 'no vehicle is nearer than it is along the road').
violates(no_shortcut) :- apart(Along, D), D < abs(Along) - 0.001.
property(no_detour, 'no vehicle is further away than it is along the road').
violates(no_detour) :- apart(Along, D), D > abs(Along) + 1.0.
apart(Along, D) :-
    vehicle(ego, _, X0, Y0, _, _, _, _), vehicle(C, _, X, Y, _, _, _, _), C \\== ego,
    Along is X - X0, D is hypot(Along, Y - Y0).
"""


@pytest.fixture
def hypot(monkeypatch: pytest.MonkeyPatch) -> None:
    """The one row that adds hypot/2."""
    row = operations._defined("hypot", 2, "sqrt(A * A + B * B)")
    monkeypatch.setitem(OPERATIONS, ("hypot", 2), row)
    monkeypatch.setitem(BINARY, "hypot", row.evaluate)


@pytest.mark.usefixtures("hypot")
def test_one_row_is_enough_for_the_engine_and_generated_code() -> None:
    engine = Engine()
    engine.consult_text(FAR)
    assert engine.once("X is hypot(3, 4)") == {"X": 5.0}
    for name in ("far", "mixed"):
        both = Tiers(engine, SCHEMA, Query(name, 1, "first"))
        assert both.check([scene(3.0, 4.0, 3, 4), scene(-0.1, 1e15, -2, 0)]) == 2
    engine.replace_facts("numbers", 2, [(3.0, 4.0)])
    proof = engine.explain("far(D), D =:= 5.0")
    assert proof.holds
    assert "5.0 is hypot(3.0,4.0)" in str(proof)


@pytest.mark.usefixtures("hypot")
def test_one_row_is_enough_for_proofs(tmp_path: Path) -> None:
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(":- dynamic(vehicle/8).\n:- dynamic(focus/1).\n:- dynamic(radar_range/1).\n")
    properties.write_text(PROPERTIES)
    case = Case(0, 2, 1, 1)
    prover = Prover.of([rules], [properties])
    assert prover.refused == {}
    found = [one.status for one in prover.run(Task(case, ("no_shortcut", "no_detour"), 1, 20.0))]
    assert found == ["proved", "refuted"]
    floats = prover.floats("no_shortcut", 1)
    assert floats.margin is not None
    assert 0 < floats.error < floats.margin
    attacked = attack(prover.book, prover.property("no_shortcut"), Orders([case], 1, 2000, 7))
    assert attacked.hit is None
    assert attacked.scenes > 0
