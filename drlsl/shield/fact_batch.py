"""The facts of many states, as mappings of rows or as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.lowering.backends import BatchProgram, Rows
from drlsl.lowering.ir import Relation, Schema
from drlsl.shield.fact_forms import Facts, Key

ManyFacts: TypeAlias = Sequence[Facts] | Mapping[tuple[str, int], Rows]
"""The facts of N states: a mapping for each, or one of `Rows`, whose arrays have them all.

In arrays a column of names holds texts, which are slow, or the integers that `ActionRules.code` gives.
"""


def count_of(facts: ManyFacts) -> int:
    """Return the number of states.

    Raises:
        UserError: arrays are of different numbers of states.
    """
    if not isinstance(facts, Mapping):
        return len(facts)
    counts = {rows.scenes for rows in facts.values()} - {1}
    if len(counts) > 1:
        raise UserError(f"the facts are of {' and '.join(map(str, sorted(counts)))} states")
    return counts.pop() if counts else 1


def as_arrays(facts: ManyFacts, read: Mapping[Key, Relation], program: BatchProgram[Any]) -> dict[Key, Rows]:
    """Return the facts of the relations that an array program reads.

    Raises:
        TypeError, ValueError: a row is not of its relation's form.
    """
    if isinstance(facts, Mapping):
        return {key: _coded(relation, facts[key], program) for key, relation in read.items()}
    return {key: _packed(relation, [each[key] for each in facts], program) for key, relation in read.items()}


def facts_of_one(facts: ManyFacts, index: int, schema: Schema, names: Mapping[int, str]) -> Facts:
    """Return the facts of one of the states; `names` are those of integers in columns of names."""
    if not isinstance(facts, Mapping):
        return facts[index]
    return {key: _rows_of_one(schema.relations[key], rows, index, names) for key, rows in facts.items()}


def some_of(facts: ManyFacts, places: npt.NDArray[np.int64], count: int) -> ManyFacts:
    """Return the facts of some of the states, of `count` in all.

    Raises:
        UserError: the facts are not of as many states.
    """
    given = len(facts) if not isinstance(facts, Mapping) else count_of(facts)
    if given != count and not (isinstance(facts, Mapping) and given == 1):
        raise UserError(f"facts of {given} states are given; expected those of {count} environments")
    if len(places) == count:
        return facts
    if not isinstance(facts, Mapping):
        return [facts[place] for place in places.tolist()]
    return {key: _rows_of_some(rows, places) for key, rows in facts.items()}


def _rows_of_some(rows: Rows, places: npt.NDArray[np.int64]) -> Rows:
    if rows.index is not None:
        return replace(rows, index=rows.index[places])

    def chosen(array: Any) -> Any:
        return array if array is None or len(array) == 1 else array[places]

    return Rows([chosen(column) for column in rows.columns], chosen(rows.valid))


def _coded(relation: Relation, rows: Rows, program: BatchProgram[Any]) -> Rows:
    """Return rows whose columns of texts hold integers."""
    if len(rows.columns) != relation.arity:
        raise ValueError(
            f"facts of {relation.name}/{relation.arity} are given with {len(rows.columns)} columns"
        )
    columns = list(rows.columns)
    texts = [
        place for place, kind in enumerate(relation.columns) if kind == "atom" and _is_text(columns[place])
    ]
    if not texts:
        return rows
    for place in texts:
        column = np.asarray(columns[place])
        names, places = np.unique(column.astype(np.str_), return_inverse=True)
        codes = np.array([program.code(name) for name in names.tolist()], dtype=np.int64)
        columns[place] = codes[places].reshape(column.shape)
    return Rows(columns, rows.valid, rows.index)


def _is_text(column: Any) -> bool:
    return isinstance(column, np.ndarray) and column.dtype.kind in "OUT"


def _packed(
    relation: Relation, states: Sequence[Sequence[Sequence[Any]]], program: BatchProgram[Any]
) -> Rows:
    """Return the rows of each state as arrays, padded to the same number."""
    most = 1 if relation.single else max(map(len, states), default=0)
    valid = np.array([len(rows) for rows in states])[:, None] > np.arange(most)
    columns: list[Any] = []
    flat = [row for rows in states for row in relation.conform(rows[:most])]
    parts: Sequence[Sequence[Any]] = list(zip(*flat, strict=True)) or [()] * relation.arity
    for kind, values in zip(relation.columns, parts, strict=True):
        column = np.zeros(valid.shape, dtype=np.float64 if kind == "float" else np.int64)
        column[valid] = [program.code(value) for value in values] if kind == "atom" else values
        columns.append(column)
    if relation.single:
        # More rows than one are no rows, so that the state is left to the interpreter.
        valid &= np.array([len(rows) == 1 for rows in states])[:, None]
        return Rows([column[:, 0] for column in columns], valid[:, 0])
    return Rows(columns, valid)


def _rows_of_one(
    relation: Relation, rows: Rows, index: int, names: Mapping[int, str]
) -> list[tuple[Any, ...]]:
    if rows.index is not None:
        index = int(rows.index[index])
    columns = [_line(column, index) for column in rows.columns]
    valid = [True] * len(columns[0]) if rows.valid is None else _line(rows.valid, index)
    for place, kind in enumerate(relation.columns):
        if kind == "atom":
            columns[place] = [
                value if isinstance(value, str) else names.get(value, f"{relation.name}_{value}")
                for value in columns[place]
            ]
    return [row for row, there in zip(zip(*columns, strict=True), valid, strict=True) if there]


def _line(column: Any, index: int) -> list[Any]:
    """Return the values of a column in one state."""
    array = np.asarray(column if isinstance(column, np.ndarray) else column.cpu())
    line = array[0 if array.shape[0] == 1 else index]
    return [line.item()] if line.ndim == 0 else line.tolist()
