"""Facts in the words of a table: rows of values, or values by the names of their columns."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import yaml

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.terms import TRUE, Atom, Struct, deref
from drlsl.lowering.ir import Kind, Relation, Schema
from drlsl.shield import Facts

Key: TypeAlias = tuple[str, int]
Value: TypeAlias = str | int | float

_WORDS: Final[Mapping[Kind, str]] = {"atom": "a name", "int": "an integer", "float": "a number"}


class FactProblem(ValueError):
    """A problem with facts; `keys` lead to its place below `facts` or `columns`."""

    def __init__(self, keys: Sequence[int | str], text: str) -> None:
        super().__init__(text)
        self.keys: Final = tuple(keys)


@dataclass
class Told:
    """A relation, as far as it is known: the names of its columns, and the values that tables give them.

    `usual` are the values of columns that a row does not give. `fewest` and `most` are the least and the
    largest number of rows in a state.
    """

    key: Key
    names: tuple[str, ...] = ()
    usual: Mapping[str, Value] = field(default_factory=dict)
    kinds: dict[int, Kind] = field(default_factory=dict)
    seen: dict[int, list[Value]] = field(default_factory=dict)
    fewest: int | None = None
    most: int = 0

    def note(self, place: int, value: object) -> Value:
        """Return the value of a column, whose kind is known from now on.

        Raises:
            ValueError: no fact holds it, or it is of another kind than others in its column.
        """
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            hint = "; write yes, no, on and off in quotes" if isinstance(value, bool) else ""
            raise ValueError(f"{self.column(place)} is {value!r:.60}; expected a name or a number{hint}")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{self.column(place)} is {value}; expected a finite number")
        kind: Kind = "atom" if isinstance(value, str) else "int" if isinstance(value, int) else "float"
        known = self.kinds.setdefault(place, kind)
        if (kind == "atom") != (known == "atom"):
            raise ValueError(f"{self.column(place)} is {value!r:.60}; in other rows it is {_WORDS[known]}")
        if "float" in (kind, known):
            self.kinds[place] = "float"
        values = self.seen.setdefault(place, [])
        if value not in values:
            values.append(value)
        return value

    def column(self, place: int) -> str:
        """Return the name of a column for errors."""
        name = self.names[place] if self.names else f"value {place + 1}"
        return f"{name} of {self.key[0]}/{self.key[1]}"

    def relation(self) -> Relation:
        """Return the relation; columns without values are of numbers.

        Generated code is told that there is one row where every state has one; others go to the interpreter.
        """
        name, arity = self.key
        kinds = tuple(self.kinds.get(place, "float") for place in range(arity))
        return Relation(name, kinds, single=arity > 0 and self.fewest == self.most == 1)


class ToldFacts:
    """The facts that tables tell a program: of the predicates that it declares dynamic."""

    def __init__(self, engine: Engine) -> None:
        """Take the relations of a program.

        Raises:
            ValueError: it declares none.
        """
        declared = [key for key in engine.predicates() if engine.is_dynamic(*key)]
        if not declared:
            raise ValueError("the rules declare no facts; list those that they are told in `:- dynamic`")
        self._engine = engine
        self._own = {key for key in declared if engine.clauses(*key)}
        self.relations: Final = {key: Told(key) for key in declared}

    def declare(self, columns: Mapping[str, Mapping[str, object]]) -> None:
        """Name the columns of relations, with the values of those that a row does not give.

        Raises:
            FactProblem: the program declares no such relation, or a value is none that a fact holds.
        """
        for name, given in columns.items():
            told = self._told(name, len(given), (name,))
            usual = {column: value for column, value in given.items() if value is not None}
            names = tuple(given)
            if told.names and (told.names, told.usual) != (names, usual):
                raise FactProblem((name,), f"{name}: another table names its columns otherwise")
            told.names, told.usual = names, usual  # type: ignore[assignment]  # `note` refuses what is none
            for place, column in enumerate(names):
                if column in usual:
                    try:
                        told.note(place, usual[column])
                    except ValueError as error:
                        raise FactProblem((name, column), str(error)) from error

    def facts(self, given: Mapping[str, object]) -> dict[Key, list[tuple[Value, ...]]]:
        """Return the facts of a state; of relations that are not given there are none.

        Raises:
            FactProblem: they are not of the form that the program declares.
        """
        found: dict[Key, list[tuple[Value, ...]]] = {}
        for name, value in given.items():
            told = self._told(name, self._arity(name, value), (name,))
            found[told.key] = [
                self._row(told, row, (name, *keys)) for keys, row in _rows(told, value, (name,))
            ]
        for key, told in self.relations.items():
            if key not in self._own:
                rows = found.setdefault(key, [])
                told.fewest = len(rows) if told.fewest is None else min(told.fewest, len(rows))
                told.most = max(told.most, len(rows))
        return found

    def complete(self, states: Sequence[dict[Key, list[tuple[Value, ...]]]]) -> Schema:
        """Return the schema of all facts that were told, and give every state all of its relations.

        Facts that the program has itself hold in states that tell no others.

        Raises:
            UserError: those that some state tells and others do not are none that a table can tell.
        """
        told = {key for state in states for key in state} | (self.relations.keys() - self._own)
        own = {key: self._own_rows(key) for key in told & self._own}
        for state in states:
            for key in told:
                state.setdefault(key, list(own.get(key, ())))
        return Schema(self.relations[key].relation() for key in self.relations if key in told)

    def _own_rows(self, key: Key) -> list[tuple[Value, ...]]:
        """Return the facts that the program has itself of a relation."""
        heads = [deref(clause.head) for clause in self._engine.clauses(*key) if clause.body is TRUE]
        found = [tuple(map(deref, head.args)) if isinstance(head, Struct) else () for head in heads]
        rows = [[one.name if isinstance(one, Atom) else one for one in row] for row in found]
        try:
            return [
                tuple(self.relations[key].note(place, one) for place, one in enumerate(row)) for row in rows
            ]
        except ValueError as error:
            raise UserError(
                f"the program's own facts: {error}; tell {key[0]} in none or all states"
            ) from error

    def _told(self, name: str, arity: int, keys: Sequence[str]) -> Told:
        """Return the relation that is called so."""
        plain, _, number = name.rpartition("/")
        wanted = (plain, int(number)) if plain and number.isdigit() else (name, arity)
        if wanted in self.relations:
            return self.relations[wanted]
        same = [f"{one}/{other}" for one, other in sorted(self.relations) if one == wanted[0]]
        everything = ", ".join(f"{one}/{other}" for one, other in sorted(self.relations))
        there = f"declared is {' and '.join(same)}" if same else f"the rules declare {everything} dynamic"
        raise FactProblem(keys, f"there are no facts {wanted[0]}/{wanted[1]}; {there}")

    def _arity(self, name: str, value: object) -> int:
        """Return the arity that a name without one has: that of the only such relation, or the rows'."""
        known = [arity for other, arity in self.relations if other == name]
        if len(known) == 1:
            return known[0]
        rows = list(value.values()) if isinstance(value, dict) else value
        first = rows[0] if isinstance(rows, list) and rows else rows
        return len(first) if isinstance(first, list | dict) else 0 if isinstance(value, bool) else 1

    def _row(self, told: Told, row: object, keys: Sequence[int | str]) -> tuple[Value, ...]:
        arity = told.key[1]
        if isinstance(row, dict):
            row = self._by_names(told, row, keys)
        if not isinstance(row, list):
            raise FactProblem(keys, f"a row of {told.key[0]}/{arity} is {row!r:.60}; expected {arity} values")
        if len(row) != arity:
            raise FactProblem(keys, f"a row of {told.key[0]}/{arity} has {len(row)} values")
        try:
            return tuple(told.note(place, value) for place, value in enumerate(row))
        except ValueError as error:
            raise FactProblem(keys, str(error)) from error

    def _by_names(self, told: Told, row: Mapping[str, object], keys: Sequence[int | str]) -> list[object]:
        name = f"{told.key[0]}/{told.key[1]}"
        if not told.names:
            raise FactProblem(keys, f"the columns of {name} have no names; give them in the head: columns")
        for column in row:
            if column not in told.names:
                known = ", ".join(told.names)
                raise FactProblem((*keys, column), f"{column} is no column of {name}; expected {known}")
        values = {**told.usual, **row}
        missing = [column for column in told.names if column not in values]
        if missing:
            raise FactProblem(keys, f"a row of {name} has no {missing[0]}, which has no usual value")
        return [values[column] for column in told.names]


def _rows(
    told: Told, value: object, keys: Sequence[int | str]
) -> Iterator[tuple[tuple[int | str, ...], object]]:
    """Yield the rows in a value, and the keys that lead to each below it."""
    if told.key[1] == 0:
        if not isinstance(value, bool):
            expected = f"{told.key[0]} has no values; expected true if it holds, or false"
            raise FactProblem(keys, expected)
        yield from [((), [])] if value else []
    elif isinstance(value, dict):
        if not any(isinstance(item, list | dict | None) for item in value.values()):
            yield (), value
            return
        yield from (((name,), row) for name, row in value.items() if row is not None)
    elif isinstance(value, list):
        if value and not any(isinstance(item, list | dict) for item in value):
            yield (), value
            return
        yield from (((place,), row) for place, row in enumerate(value))
    else:
        raise FactProblem(keys, f"{told.key[0]} is {value!r:.60}; expected a list of rows")


@dataclass(frozen=True)
class ToldState:
    """The facts of a state, as tables tell them."""

    facts: Facts
    told: ToldFacts

    def state(self) -> Facts:
        """Return the facts."""
        return self.facts

    def row(self) -> str:
        """Return them as a row of a table, in one line of YAML."""
        return flow({"facts": facts_row(self.facts)})

    def changed(self, chance: random.Random) -> ToldState:
        """Return facts like them: numbers slightly off, values and numbers of rows as in other states."""
        relations = self.told.relations
        facts = {key: list(_changed(chance, relations[key], rows)) for key, rows in self.facts.items()}
        return ToldState(facts, self.told)


def facts_row(facts: Facts) -> dict[str, object]:
    """Return facts as the value of the key `facts`; relations without rows are left out."""
    return {
        name if [other for other, _ in facts].count(name) == 1 else f"{name}/{arity}": (
            True if arity == 0 else list(rows[0]) if len(rows) == 1 else [list(row) for row in rows]
        )
        for (name, arity), rows in facts.items()
        if len(rows)
    }


def flow(values: Mapping[str, object]) -> str:
    """Return plain values in one line of YAML."""
    return yaml.safe_dump(values, default_flow_style=True, width=math.inf, sort_keys=False).strip()


def _changed(chance: random.Random, told: Told, rows: Sequence[Sequence[Any]]) -> Iterator[tuple[Any, ...]]:
    left = len(rows)
    for row in rows:
        if left > (told.fewest or 0) and chance.random() < 0.1:
            left -= 1
            continue
        yield tuple(_other(chance, told, place, value) for place, value in enumerate(row))
    if left < told.most and chance.random() < 0.2:
        yield tuple(chance.choice(told.seen[place]) for place in range(told.key[1]))


def _other(chance: random.Random, told: Told, place: int, value: Any) -> Any:
    if chance.random() < 0.15:
        return chance.choice(told.seen[place])
    if isinstance(value, str) or chance.random() < 0.6:
        return value
    if told.kinds[place] == "int":
        return value + chance.choice((-1, 1))
    return round(value + chance.gauss(0.0, max(1.0, abs(value)) * chance.choice((0.003, 0.03, 0.3))), 3)
