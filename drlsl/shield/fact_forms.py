"""The facts that a rule program is told: their relations, and the kinds of their columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from numbers import Integral, Real
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.lowering.backends import Rows
from drlsl.lowering.ir import Kind, Relation, Schema

Facts: TypeAlias = Mapping[tuple[str, int], Sequence[Sequence[Any]]]
"""The rows of every relation by name and arity: names, integers and numbers, NumPy's too."""

Key: TypeAlias = tuple[str, int]

_KINDS: Final[dict[str, Kind]] = {"f": "float", "i": "int", "u": "int", "U": "atom", "O": "atom", "T": "atom"}
"""The kind of a column by the kind of its array's type."""

_EXPECTED: Final = "expected a name, an integer or a number"


_WRITE_FLOAT: Final = "write float(...) in every row of a column that may hold a fraction"


class FactForms:
    """The relations that facts are given of: those of a schema, or those that the program declares dynamic.

    Without a schema the first facts tell the kinds of the columns, and of a relation without rows the first
    facts that have some. Until all are known, `schema` is None.
    """

    def __init__(self, engine: Engine, schema: Schema | None) -> None:
        """Find the relations of `schema`, or of the program of `engine`.

        Raises:
            UserError: `schema` is none, or the program has rules for a relation of it.
        """
        declared = [key for key in engine.predicates() if engine.is_dynamic(*key)]
        self._optional = {key for key in declared if engine.clauses(*key)}
        self._kinds: dict[Key, tuple[Kind, ...] | None] = dict.fromkeys(declared)
        self.keys: frozenset[Key] = frozenset(self._kinds)
        if not isinstance(schema, Schema | None):
            raise UserError(
                f"schema is {schema!r:.80}; expected drlsl.lowering.Schema([Relation('car', ('float',))])"
            )
        self.schema = schema
        self._given = schema is not None
        if schema is None:
            self._complete()
            return
        self.keys, self._optional = frozenset(schema.relations), set()
        for key in self.keys:
            if key not in self._kinds and engine.clauses(*key):
                place = engine.clauses(*key)[0].span or "the program"
                raise UserError(f"{place}: the schema has {_text(key)} as facts, and the program as rules")

    def learn_arrays(self, facts: Mapping[Key, Rows]) -> None:
        """Check facts in arrays, and find out the kinds of columns that are not known.

        Raises:
            UserError: a relation is missing or not declared, or an array has no kind that facts have.
        """
        self.check_keys(facts)
        for key, rows in facts.items():
            if self._kinds.get(key) is None and self.schema is None:
                if len(rows.columns) != key[1]:
                    raise UserError(f"{_text(key)} is given {len(rows.columns)} columns; expected {key[1]}")
                self._kinds[key] = tuple(_kind_of_array(key, *column) for column in enumerate(rows.columns))
        self._complete()

    def learn(self, facts: Facts) -> None:
        """Check facts, and find out the kinds of columns that are not known.

        Raises:
            UserError: a relation is missing or not declared, or a row is not of its form.
        """
        self.check_keys(facts)
        for key, rows in facts.items():
            if isinstance(rows, str) or not hasattr(rows, "__len__"):
                raise UserError(
                    f"facts of {_text(key)} are {rows!r:.80}; expected a list of rows, each a tuple"
                )
            if self._kinds.get(key) is None and len(rows):
                self._kinds[key] = _kinds(key, rows)
        self._complete()

    def check_keys(self, facts: Mapping[Key, Any]) -> None:
        """Check that facts are given of every relation, and of no other.

        Raises:
            UserError: they are not.
        """
        if not isinstance(facts, Mapping):
            raise UserError(f"facts are {facts!r:.80}; expected a mapping of (name, arity) to rows")
        if facts.keys() == self.keys:
            return
        for key in facts:
            if not (isinstance(key, tuple) and len(key) == 2):
                raise UserError(f"facts are given of {key!r:.80}; expected (name, arity), such as ('car', 3)")
        for name, arity in facts.keys() - self.keys:
            raise UserError(
                f"facts of {name}/{arity} are given, which the rules do not declare; "
                f"{self._instead(name, arity)}"
            )
        missing = self.keys - facts.keys() - self._optional
        if missing:
            raise UserError(
                f"no facts of {_text(min(missing))} are given; give an empty list if there are none"
            )
        self.keys = frozenset(facts)  # the program has facts of its own for the others
        self._kinds = {key: kinds for key, kinds in self._kinds.items() if key in self.keys}

    def _instead(self, name: str, arity: int) -> str:
        """Return what may be meant by facts that are not declared."""
        declared = dict(sorted(self.keys, reverse=True))
        if name in declared:
            return f"declared is {name}/{declared[name]}"
        for near in get_close_matches(str(name), list(declared), 1):
            return f"did you mean {near}/{declared[near]}?"
        return f"declare it by `:- dynamic {name}/{arity}.`"

    def conformed(self, facts: Facts) -> dict[Key, list[tuple[Any, ...]]]:
        """Return facts with every value of its column's kind.

        Raises:
            UserError: a row has another arity, or a value of another kind, than its relation.
        """
        found: dict[Key, list[tuple[Any, ...]]] = {}
        for key, rows in facts.items():
            relation = self.relation(key)
            try:
                found[key] = [] if relation is None else list(relation.conform(rows))
            except (TypeError, ValueError) as error:
                raise self.misfit(error) from error
        return found

    def misfit(self, error: Exception) -> UserError:
        """Return the error for facts that are not of their relation's form."""
        told = "" if self._given else f", as in the first facts; {_WRITE_FLOAT}, or declare it by `schema`"
        return UserError(f"facts do not fit: {error}{told}")

    def relation(self, key: Key) -> Relation | None:
        """Return a relation; None while its kinds are not known."""
        if self.schema is not None:
            return self.schema.relations[key]
        kinds = self._kinds[key]
        return None if kinds is None else Relation(key[0], kinds)

    def unknown(self) -> list[str]:
        """Return the relations of which there were no rows yet, so that nothing is known of their columns."""
        return (
            []
            if self.schema is not None
            else sorted(_text(key) for key, kinds in self._kinds.items() if kinds is None)
        )

    def guess(self, kind: Kind) -> Schema:
        """Return a schema in which every column whose kind is not known is of `kind`."""
        known = {key: self.relation(key) for key in sorted(self.keys)}
        return Schema(one or Relation(key[0], (kind,) * key[1]) for key, one in known.items())

    def _complete(self) -> None:
        if self.schema is None and None not in self._kinds.values():
            self.schema = Schema(
                Relation(name, kinds) for (name, _), kinds in self._kinds.items() if kinds is not None
            )


def _kinds(key: Key, rows: Sequence[Sequence[Any]]) -> tuple[Kind, ...]:
    """Return the kinds of the columns of rows.

    Raises:
        UserError: a row has another arity, or a column has both names and numbers, or neither.
    """
    for row in rows:
        if isinstance(row, str) or not hasattr(row, "__len__") or len(row) != key[1]:
            raise UserError(f"a row of {_text(key)} is {row!r:.80}; expected a tuple of {key[1]}")
    return tuple(_kind(key, place, column) for place, column in enumerate(zip(*rows, strict=True)))


def _kind(key: Key, place: int, column: Iterable[Any]) -> Kind:
    kinds: set[Kind] = set()
    for value in column:
        kind = _kind_of(value)
        if kind is None:
            hint = (
                "; for what holds or not give a fact of arity 0, [()] or []"
                if isinstance(value, bool | np.bool_)
                else ""
            )
            raise UserError(f"column {place} of {_text(key)} is {value!r:.80}; {_EXPECTED}{hint}")
        kinds.add(kind)
    if kinds == {"int", "float"}:
        return "float"
    if len(kinds) > 1:
        raise UserError(
            f"column {place} of {_text(key)} has names and numbers; make it two relations, each of one kind"
        )
    return kinds.pop()


def _kind_of(value: Any) -> Kind | None:
    """Return the kind of a value; None if no fact holds one."""
    if isinstance(value, str):
        return "atom"
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    return "int" if isinstance(value, Integral) else "float"


def _kind_of_array(key: Key, place: int, column: Any) -> Kind:
    dtype = getattr(column, "dtype", None)
    kind = _KINDS.get(getattr(dtype, "kind", ""))
    if kind is None:
        raise UserError(
            f"column {place} of {_text(key)} is of {dtype or type(column).__name__}; expected an array of "
            "names, integers or numbers, or a `schema`, which says what it holds"
        )
    return kind


def _text(key: Key) -> str:
    return f"{key[0]}/{key[1]}"
