"""Programs that nobody would write answer in C and in JavaScript as in Python."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from drlsl.logic import Engine
from drlsl.logic.core import NODES
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.backends.answer_lists import results_of
from drlsl.lowering.backends.curly import offered
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import NotLowerable, Undecided, reach
from tests.lowering import programs
from tests.lowering.exported import GCC, NODE, UNDECIDED, Facts, loose, run_c, run_js

Run = Callable[[Sequence[Lowered], Sequence[Sequence[Facts]], Path], list[list[Any]]]

LANGUAGES = [
    pytest.param(run_c, marks=pytest.mark.skipif(GCC is None, reason="there is no C compiler"), id="c"),
    pytest.param(run_js, marks=pytest.mark.skipif(NODE is None, reason="there is no node"), id="js"),
]
INEXACT = frozenset(name for name, row in NODES.items() if row.library and row.kind in ("real", "power"))


class Enough(Exception):
    """There are enough programs."""


def generated(count: int) -> tuple[list[Lowered], list[list[Facts]]]:
    """The same programs in every run, with scenes for each."""
    found: list[Lowered] = []
    scenes: list[list[Facts]] = []

    @settings(
        max_examples=50 * count,
        phases=[Phase.generate],
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(program=programs.programs(), some=st.lists(programs.facts(), min_size=2, max_size=4))
    def collect(program: tuple[str, list[tuple[str, int]]], some: list[Any]) -> None:
        if len(found) >= count:
            raise Enough
        text, predicates = program
        engine = Engine()
        engine.consult_text(text)
        for name, arity in predicates[-1:]:
            for mode in ("holds",) if arity == 0 else ("first", "all"):
                try:
                    query = Query(name, arity, mode)  # type: ignore[arg-type]  # a Mode
                    lowered = lower(engine, programs.SCHEMA, [query])
                except NotLowerable:
                    continue
                found.append(lowered)
                scenes.append(some)

    with pytest.raises(Enough):
        collect()
    return found, scenes


def agrees(one: Any, other: Any, ulps: int) -> bool:
    if isinstance(one, int | float) and isinstance(other, int | float) and not isinstance(one, bool):
        return one == other or abs(one - other) <= ulps * math.ulp(max(abs(one), abs(other)))
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(agrees(a, b, ulps) for a, b in zip(one, other, strict=True))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(agrees(one[key], other[key], ulps) for key in one)
    return type(one) is type(other) and bool(one == other)


def check(run: Run, count: int, folder: Path) -> None:
    found, scenes = generated(count)
    assert len(found) >= count
    answers = run(found, scenes, folder)
    decided = 0
    for lowered, some, given_answers in zip(found, scenes, answers, strict=True):
        scalar = compile_scalar(lowered)
        roots = [node for node, _ in results_of(lowered.pool, lowered.answers)]
        roots += [one.undecided for one in lowered.answers]
        used = [node for node, _ in results_of(lowered.pool, lowered.answers)]
        ulps = 2 if any(node.op in INEXACT for node in reach(used)) else 0
        for facts, answer in zip(some, given_answers, strict=True):
            try:
                wanted = loose(list(scalar(facts)))
            except Undecided:
                assert answer == UNDECIDED, (lowered.answers[0].query, facts)
                continue
            if answer != UNDECIDED:  # integers beyond 2^53 on the way
                decided += 1
                assert agrees(wanted, answer, ulps), (lowered.answers[0].query, facts, wanted, answer)
    assert decided > len(found)


@pytest.mark.parametrize("run", LANGUAGES)
def test_generated_programs(run: Run, tmp_path: Path) -> None:
    check(run, 40, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("run", LANGUAGES)
def test_many_generated_programs(run: Run, tmp_path: Path) -> None:
    check(run, 400, tmp_path)


UNKNOWN_TO_JS = {"erf", "erfc", "lgamma"}


def test_every_operation_has_its_function() -> None:
    infix = {"add", "sub", "mul", "neg", "tofloat"}
    assert NODES.keys() - infix <= offered("c")
    assert NODES.keys() - infix - UNKNOWN_TO_JS <= offered("mjs")


NUMBERS = (0, 1, -1, 2, 3, -7, 10, 64, 2**20, -(2**20) + 1, 2**52, 2**53 - 1, -(2**53) + 1)
FLOATS = (
    0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    2.5,
    -2.5,
    0.49999999999999994,
    1e-9,
    3.7,
    -12.25,
    700.0,
    4503599627370497.5,
)


@pytest.mark.parametrize("run", LANGUAGES)
def test_every_operation_at_many_values(run: Run, tmp_path: Path) -> None:
    """One query for each operation; each scene has one pair of arguments."""
    unary = [row for row in NODES.values() if row.arity == 1 and row.node not in UNKNOWN_TO_JS]
    binary = [row for row in NODES.values() if row.arity == 2]
    found, scenes = [], []
    for row in (*unary, *binary):
        if row.node == "isign":
            continue
        whole = row.kind == "whole"
        first, second = ("A", "B") if whole else ("Z", "L")
        args = first if row.arity == 1 else f"{first}, {second}"
        quoted = row.name.replace("\\", "\\\\")
        name = f"'{quoted}'"
        engine = Engine()
        engine.consult_text(f"value(X) :- seen(A, Z), limit(L), steps(B), X is {name}({args}).")
        try:
            found.append(lower(engine, programs.SCHEMA, [Query("value", 1, "first")]))
        except NotLowerable:
            assert row.node in ("pow", "neg", "sub")  # other forms of these are lowered
            continue
        values = [(a, b) for a in (NUMBERS if whole else FLOATS) for b in (NUMBERS if whole else FLOATS)]
        scenes.append([_scene(a, b) for a, b in values])
    answers = run(found, scenes, tmp_path)
    for lowered, some, given_answers in zip(found, scenes, answers, strict=True):
        scalar = compile_scalar(lowered)
        used = [node for node, _ in results_of(lowered.pool, lowered.answers)]
        ulps = 2 if any(node.op in INEXACT for node in reach(used)) else 0
        for facts, answer in zip(some, given_answers, strict=True):
            try:
                (wanted,) = scalar(facts)
            except Undecided:
                assert answer == UNDECIDED, (lowered.answers[0].terms, facts, answer)
                continue
            if abs(wanted) >= 2**53 and isinstance(wanted, int):
                assert answer == UNDECIDED
            else:
                assert agrees([wanted], answer, ulps), (scalar, facts, wanted, answer)


def _scene(a: float, b: float) -> Facts:
    return {
        ("car", 4): [("ego", 0, 0.0, 0.0)],
        ("slot", 3): [],
        ("seen", 2): [(int(a), float(a))],
        ("limit", 1): [(float(b),)],
        ("steps", 1): [(int(b),)],
    }
