"""Unknown facts: every number an unknown within its bounds, every name and every row open."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from fractions import Fraction

from drlsl.logic.terms import Atom
from drlsl.verify.smt import Algebra, Bool, Constant, Finite, Model, Polynomial, Row, Value, evaluate, holds
from drlsl.verify.told.declared import Column, Declared, Key, Table

Rows = dict[Key, list[tuple[str | int | Fraction, ...]]]
"""Facts with exact numbers, by name and arity."""

NOBODY = 0
"""The key of no row."""


class SymbolicFacts:
    """All sets of facts with up to so many rows of each relation: what a solver is asked about.

    Open relations have `rows` rows at most. Keys are 1, 2, ... in the order of the rows: rules may only ask
    whether two are equal.
    """

    def __init__(self, algebra: Algebra, declared: Declared, rows: Mapping[Key, int]) -> None:
        self.algebra = algebra
        self.always: list[Bool] = []
        self.about: dict[str, list[Bool]] = {}
        self.usual: dict[int, tuple[int, Fraction]] = {}
        self._most = dict(rows)
        self._named = {table.relation.name: self._most.get(table.key, 1) for table in declared.tables}
        self.facts: dict[Key, list[Row]] = {table.key: list(self._rows(table)) for table in declared.tables}

    def tidy(self) -> list[Bool]:
        """Return no conditions: no set of facts is tidier than another."""
        return []

    def _rows(self, table: Table) -> list[Row]:
        booleans = self.algebra.booleans
        count = self._most.get(table.key, 0) if table.is_open else 1
        result: list[Row] = []
        there = booleans.true
        for number in range(1, count + 1):
            name = f"{table.relation.name}_{number}"
            if table.is_open:
                # the rows that exist come first
                there = booleans.and_((there, booleans.flag(f"{name}_exists")))
            columns = [self._value(f"{name}_{place}", number, one) for place, one in enumerate(table.columns)]
            result.append(Row(there, tuple(columns)))
        return result

    def _value(self, name: str, number: int, column: Column) -> Value | Finite:
        if column.kind == "number":
            low, high = column.bounds
            ring = self.algebra.ring
            return ring.const(low) if low == high else ring.unknown(name, low, high)
        if column.kind == "key":
            return {number: self.algebra.booleans.true}
        if column.kind == "key_of":
            return self._one_of(name, [NOBODY, *range(1, self._named[column.of] + 1)])
        return self._one_of(name, [Atom(one) if isinstance(one, str) else one for one in column.values])

    def _one_of(self, name: str, constants: Sequence[Constant]) -> Finite:
        """Return one of the constants, any."""
        booleans = self.algebra.booleans
        result: Finite = {}
        none_yet = booleans.true
        for constant in constants[:-1]:
            flag = booleans.flag(f"{name}_{constant}")
            result[constant] = booleans.and_((none_yet, flag))
            none_yet = booleans.and_((none_yet, booleans.not_(flag)))
        result[constants[-1]] = none_yet
        return result

    def of(self, model: Model) -> Rows:
        """Return the facts that a model describes."""
        flags = defaultdict(bool, model.flags)

        def chosen(value: Value | Finite) -> str | int | Fraction:
            if isinstance(value, dict):
                found = next(constant for constant, cond in value.items() if holds(cond, {}, flags))
                return found.name if isinstance(found, Atom) else found
            assert isinstance(value, Polynomial)
            return evaluate(value, model.numbers)

        return {
            key: [tuple(map(chosen, row.columns)) for row in rows if holds(row.present, {}, flags)]
            for key, rows in self.facts.items()
        }
