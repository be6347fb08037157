"""The facts that a file of properties declares: what each column may hold, and how many rows there may be.

A file says `facts(car(key, number(0, 40), one_of([left, right])), any).` for each relation: a column holds
any number or integer within bounds, one of some names, a `key` of which no two rows have the same, or the
`key(car)` of another relation's row. A relation has `one` row or `any` number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, TypeAlias

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.terms import Atom, Operators, Struct, Term, deref, format_term
from drlsl.lowering.ir import FLOAT_BOUND, Kind, Node, Relation, Schema, reach
from drlsl.verify.names import OpenRelation
from drlsl.verify.ranges import Range, decimal

Key: TypeAlias = tuple[str, int]

_MOST_INTEGERS: Final = 32
_KINDS: Final[Mapping[str, Kind]] = {
    "number": "float",
    "integer": "int",
    "one_of": "atom",
    "key": "int",
    "key_of": "int",
}
_EXPECTED: Final = "number(Low, High), integer(Low, High), one_of([Name, ...]), key or key(Relation)"


@dataclass(frozen=True, slots=True)
class Column:
    """The contents of a column: a number within `bounds`, one of the `values`, a key, or one of `of`."""

    kind: str
    bounds: Range = (Fraction(0), Fraction(0))
    values: tuple[str | int, ...] = ()
    of: str = ""

    def __str__(self) -> str:
        if self.kind == "number":
            return f"{float(self.bounds[0]):g} to {float(self.bounds[1]):g}"
        if self.kind in ("key", "key_of"):
            return "a key" if self.kind == "key" else f"the key of a {self.of}"
        return ", ".join(map(str, self.values))


@dataclass(frozen=True, slots=True)
class Table:
    """A relation with what its columns may hold."""

    relation: Relation
    columns: tuple[Column, ...]

    @property
    def key(self) -> Key:
        """Name and arity."""
        return self.relation.name, self.relation.arity

    @property
    def is_open(self) -> bool:
        """True if it may have any number of rows."""
        return isinstance(self.relation, OpenRelation)


@dataclass(frozen=True, slots=True)
class Declared:
    """All relations, in the order of the file, the unknown numbers of properties among them."""

    tables: tuple[Table, ...]

    @property
    def schema(self) -> Schema:
        """The relations."""
        return Schema(table.relation for table in self.tables)

    def check_keys(self, roots: Iterable[Node]) -> None:
        """Check that a program does nothing with keys but compare two of them for equality.

        Raises:
            UserError: it compares or adds them as numbers, so that it matters which they are.
        """
        keys = {
            (table.relation, place)
            for table in self.tables
            for place, column in enumerate(table.columns)
            if column.kind in ("key", "key_of")
        }
        for node in reach(roots):
            columns = [arg for arg in node.args if arg.op == "col" and arg.data in keys]
            if columns and not (
                node.op == "eq" and all(arg.op == "col" and arg.data in keys for arg in node.args)
            ):
                name = columns[0].data[0].name
                raise UserError(f"a key of {name} is used as a number; only whether two are equal may count")


def declared_facts(engine: Engine, unknowns: Mapping[str, Range]) -> Declared | None:
    """Return the facts that `facts/2` declares, and those of the unknowns; None if it declares none.

    Raises:
        UserError: a declaration is not of the form that is expected.
    """
    tables = [_table(*map(deref, clause.args)) for clause in engine.clauses("facts", 2)]
    if not tables:
        return None
    names = [table.key for table in tables]
    for key in names:
        if names.count(key) > 1:
            raise UserError(f"facts({key[0]}/{key[1]}, ...) is declared more than once")
    _check_arities(engine, names)
    keyed = {table.relation.name for table in tables if table.relation.key is not None}
    for table in tables:
        for column in table.columns:
            if column.kind == "key_of" and column.of not in keyed:
                raise UserError(
                    f"facts({table.relation.name}, ...): key({column.of}) names no relation with a key"
                )
    tables += [
        Table(Relation(name, ("float",), single=True), (Column("number", bounds),))
        for name, bounds in unknowns.items()
    ]
    return Declared(tuple(tables))


def undeclared(engine: Engine, declared: Sequence[Key]) -> list[Key]:
    """Return the relations that the rules have facts of, and the properties do not declare."""
    return [
        key
        for key in engine.predicates()
        if key not in declared and engine.is_dynamic(*key) and not engine.clauses(*key)
    ]


def _check_arities(engine: Engine, declared: Sequence[Key]) -> None:
    """Check that no facts are declared with another arity than the rules have.

    Raises:
        UserError: some are.
    """
    for name, arity in undeclared(engine, declared):
        for known, other in declared:
            if known == name and not engine.is_dynamic(known, other):
                raise UserError(
                    f"facts({name}/{other}, ...) is declared; the rules have facts of {name}/{arity}"
                )


def _table(pattern: Term, rows: Term) -> Table:
    if not isinstance(pattern, Struct | Atom) or rows not in (Atom("one"), Atom("any")):
        raise UserError(
            f"facts({_text(pattern)}, {_text(rows)}): expected facts(Name(Column, ...), one) or any"
        )
    columns = tuple(map(_column, pattern.args)) if isinstance(pattern, Struct) else ()
    keys = [place for place, column in enumerate(columns) if column.kind == "key"]
    if len(keys) > 1:
        raise UserError(f"facts({_text(pattern)}, ...): expected one key at most")
    make: Any = OpenRelation if rows is Atom("any") else Relation
    kinds = tuple(_KINDS[column.kind] for column in columns)
    key = keys[0] if keys else None
    return Table(make(pattern.name, kinds, single=rows is Atom("one"), key=key), columns)


def _column(term: Term) -> Column:
    term = deref(term)
    if term is Atom("key"):
        return Column("key")
    args = tuple(map(deref, term.args)) if isinstance(term, Struct) else ()
    match (getattr(term, "name", ""), args):
        case "key", (Atom() as other,):
            return Column("key_of", of=other.name)
        case "one_of", (names,):
            items = _items(names)
            found = tuple(item.name for item in items if isinstance(item, Atom))
            if items and len(found) == len(items):
                return Column("one_of", values=found)
        case "number", (int() | float() as low, int() | float() as high):
            if low <= high and max(abs(low), abs(high)) <= FLOAT_BOUND:
                return Column("number", (decimal(low), decimal(high)))
        case "integer", (int() as low, int() as high):
            if 0 <= high - low < _MOST_INTEGERS:
                return Column("integer", values=tuple(range(low, high + 1)))
    raise UserError(f"facts: a column is {_text(term)}; expected {_EXPECTED}")


def _items(term: Term) -> list[Term]:
    """Return the items of a list; none if it is no list."""
    items = []
    while isinstance(term := deref(term), Struct) and term.name == "." and len(term.args) == 2:
        items.append(deref(term.args[0]))
        term = term.args[1]
    return items


def _text(term: Term) -> str:
    return format_term(term, Operators(), quoted=True)
