"""Asks all tiers the same questions about the same facts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.logic import Engine, PrologError
from drlsl.lowering.backends import BatchProgram, Rows, compile_numpy, compile_scalar
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import NotLowerable, Relation, Schema, Undecided
from tests.installed import TORCH
from tests.lowering.plain import compile_plain

Program: TypeAlias = BatchProgram[Any]

ARRAY_TIERS: Final[dict[str, Callable[[Lowered], Program]]] = {
    "numpy": compile_numpy,
    "loops": compile_plain,
}
"""The back ends for many scenes, all of which give the interpreter's bits."""

if TORCH:
    import torch

    from drlsl.lowering.backends import compile_torch

    torch.set_num_threads(1)  # tests run beside each other
    ARRAY_TIERS["torch"] = compile_torch

Facts = Mapping[tuple[str, int], Sequence[Sequence[Any]]]


def ask(engine: Engine, query: Query, facts: Facts) -> Any:
    """The interpreter's answer in the form of the scalar tier; an error as the exception."""
    variables = [f"A{place}" for place in range(query.arity)]
    goal = f"{query.name}({', '.join(variables)})" if variables else query.name
    try:
        for (name, arity), rows in facts.items():
            engine.replace_facts(name, arity, rows)
        if query.mode == "holds":
            return engine.holds(goal)
        if query.mode == "first":
            solution = engine.once(goal)
            return None if solution is None else _values(solution, variables)
        solutions = [_values(solution, variables) for solution in engine.query(goal)]
    except (PrologError, ValueError) as error:  # the engine takes no NaN
        return error
    return solutions if query.mode == "all" else _distinct(solutions)


def _values(solution: Mapping[str, Any], variables: Sequence[str]) -> Any:
    values = tuple(solution[variable] for variable in variables)
    return values[0] if len(values) == 1 else values


def _distinct(items: Sequence[Any]) -> list[Any]:
    return [item for place, item in enumerate(items) if item not in items[:place]]


def same(left: Any, right: Any) -> bool:
    """Equal in value and in kind; a zero's sign does not count."""
    if isinstance(left, float) and isinstance(right, float):
        return left == right or (math.isnan(left) and math.isnan(right))
    if isinstance(left, list | tuple) and isinstance(right, list | tuple):
        return len(left) == len(right) and all(map(same, left, right))
    return type(left) is type(right) and bool(left == right)


def to_rows(program: Program, schema: Schema, scenes: Sequence[Facts]) -> dict[tuple[str, int], Rows]:
    """Scenes as arrays, each scene's rows padded with zeros."""
    atoms = program.code
    return {
        key: _single(relation, [scene[key] for scene in scenes])
        if relation.single
        else _many(relation, [scene[key] for scene in scenes], atoms)
        for key, relation in schema.relations.items()
    }


def _single(relation: Relation, rows: Sequence[Sequence[Sequence[Any]]]) -> Rows:
    valid = np.array([len(row) == 1 for row in rows])
    columns = [np.array([row[0][place] if row else 0 for row in rows]) for place in range(relation.arity)]
    return Rows(columns, valid)


def _many(relation: Relation, scenes: Sequence[Sequence[Sequence[Any]]], code: Any) -> Rows:
    shape = (len(scenes), max(map(len, scenes)))
    valid = np.zeros(shape, dtype=np.bool_)
    columns = [np.zeros(shape, dtype=float if kind == "float" else np.int64) for kind in relation.columns]
    for n, rows in enumerate(scenes):
        valid[n, : len(rows)] = True
        for k, row in enumerate(rows):
            for column, value in zip(columns, row, strict=True):
                column[n, k] = code(value) if isinstance(value, str) else value
    return Rows(columns, valid)


def columns_of(rows: Rows) -> list[Any]:
    """The columns of rows that leave none out."""
    columns = [column for column in rows.columns if column is not None]
    assert len(columns) == len(rows.columns)
    return columns


class Tiers:
    """One query of a program in all tiers; `arrays` is empty where its answer has no form as an array."""

    def __init__(self, engine: Engine, schema: Schema, query: Query, *, arrays: bool = True) -> None:
        self.engine = engine
        self.schema = schema
        self.query = query
        lowered = lower(engine, schema, [query])
        self.scalar = compile_scalar(lowered)
        self.arrays: Mapping[str, Program] = {}
        if arrays:
            try:
                self.arrays = {name: make(lowered) for name, make in ARRAY_TIERS.items()}
            except NotLowerable:
                self.arrays = {}

    def check(self, scenes: Sequence[Facts]) -> int:
        """Compare the tiers' answers; the number of scenes that generated code could answer."""
        expected = [ask(self.engine, self.query, facts) for facts in scenes]
        answered = 0
        for facts, answer in zip(scenes, expected, strict=True):
            try:
                (given,) = self.scalar(facts)
            except Undecided:
                continue
            answered += 1
            assert same(answer, given), (
                f"{self.query}: interpreter {answer!r}, scalar {given!r}, facts {facts!r}"
            )
        for tier in self.arrays:
            self._check_arrays(tier, scenes, expected)
        return answered

    def _check_arrays(self, tier: str, scenes: Sequence[Facts], expected: Sequence[Any]) -> None:
        program = self.arrays[tier]
        result = program(to_rows(program, self.schema, scenes))
        (answer,) = result.answers
        value, fails, undecided = map(np.asarray, (answer.value, answer.fails, result.undecided))
        for n, (facts, wanted) in enumerate(zip(scenes, expected, strict=True)):
            if undecided[n]:
                continue
            assert not isinstance(wanted, Exception), (
                f"{self.query}: {wanted!r} went unnoticed in {tier}, facts {facts!r}"
            )
            given = array_value(program, self.query, value[n], bool(fails[n]))
            loose = expected_value(program, self.query, wanted)
            assert given == loose, f"{self.query}: interpreter {loose!r}, {tier} {given!r}, facts {facts!r}"


def array_value(program: Program, query: Query, value: Any, fails: bool) -> Any:
    """An answer in arrays as numbers, and the solutions among the choices in any order."""
    if query.mode == "holds":
        return bool(value)
    if query.mode == "first":
        return None if fails else value.tolist()
    return sorted(
        (item for item, there in zip(program.choices[query], value, strict=True) if there), key=repr
    )


def expected_value(program: Program, query: Query, value: Any) -> Any:
    """The interpreter's answer in the form that arrays have: atoms as codes, no tuples."""
    if query.mode in ("set", "all"):
        return sorted(_distinct(value), key=repr)
    if isinstance(value, str):
        return program.code(value)
    if isinstance(value, tuple):
        return [
            part
            for item in value
            for given in (expected_value(program, query, item),)
            for part in (given if isinstance(given, list) else [given])
        ]
    return [expected_value(program, query, item) for item in value] if isinstance(value, list) else value
