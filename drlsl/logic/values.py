"""Terms as Python values and back: what the public API hands out and takes.

An atom is a `str`, a number an `int` or a `float`, a proper list a `list`; another compound term is a
`Compound`, an unbound variable a `Variable`, and Prolog's own string type a `String`, which is a `str` that
knows it is no atom.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias, Union

from drlsl.logic.errors import representation_error
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, make_list
from drlsl.logic.unify import is_acyclic
from drlsl.logic.writer import variable_name


@dataclass(frozen=True, slots=True)
class Compound:
    """A compound term that is no list."""

    name: str
    args: tuple[Value, ...]

    def __str__(self) -> str:
        return f"{self.name}({', '.join(map(str, self.args))})"


@dataclass(frozen=True, slots=True)
class Variable:
    """An unbound variable."""

    name: str

    def __str__(self) -> str:
        return self.name


class String(str):
    """A value of Prolog's string type."""

    __slots__ = ()


# Larger terms are looked at first, to be sure that they are finite.
_LARGE: Final = 50_000

Value: TypeAlias = Union[str, int, float, "list[Any]", Compound, Variable]


class Solution(Mapping[str, Value]):
    """The variables of a query with their values; those whose names begin with ``_`` are left out."""

    __slots__ = ("_values",)

    def __init__(self, values: dict[str, Value]) -> None:
        self._values = values

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"Solution({', '.join(f'{name}={value!r}' for name, value in self._values.items())})"


def to_value(term: Term, names: Mapping[Term, str] | None = None) -> Value:
    """A term as a Python value; `names` has the names of variables that have one."""
    term = deref(term)
    if type(term) is not Struct:
        return _simple_value(term, names or {})
    # Every compound term behind the one that it is part of, so that values can be built from the end.
    order = [term]
    is_checked = False
    for struct in order:
        if len(order) > _LARGE and not is_checked:
            if not is_acyclic(term):
                raise representation_error("acyclic_term")
            is_checked = True
        order.extend(part for part in map(deref, _parts(struct)[1]) if type(part) is Struct)
    values: dict[int, Value] = {}
    for struct in reversed(order):
        if id(struct) in values:
            continue
        is_list, parts = _parts(struct)
        converted = [
            values[id(part)] if type(part) is Struct else _simple_value(part, names or {})
            for part in map(deref, parts)
        ]
        values[id(struct)] = converted if is_list else Compound(struct.name, tuple(converted))
    return values[id(term)]


def _parts(struct: Struct) -> tuple[bool, list[Term]]:
    """Whether a compound term is a proper list, and its elements or else its arguments."""
    items: list[Term] = []
    rest: Term = struct
    while type(rest) is Struct and rest.name == "." and len(rest.args) == 2:
        items.append(rest.args[0])
        if len(items) == _LARGE and not is_acyclic(struct):
            raise representation_error("acyclic_term")
        rest = deref(rest.args[1])
    return (True, items) if rest is NIL else (False, list(struct.args))


def _simple_value(term: Term, names: Mapping[Term, str]) -> Value:
    if type(term) is Atom:
        return [] if term is NIL else term.name
    if type(term) is Var:
        return Variable(names.get(term) or variable_name(term))
    if type(term) is str:
        return String(term)
    assert type(term) is int or type(term) is float
    return term


def to_term(value: Any, variables: dict[str, Var] | None = None) -> Term:
    """A Python value as a term: the inverse of `to_value`. Terms stay as they are.

    Raises:
        TypeError: The value is nothing that a term can be made of; a bool in particular.
    """
    kind = type(value)
    if kind is str:
        return Atom(value)
    if kind is int or kind is float or kind is Atom or kind is Var or kind is Struct:
        return value  # type: ignore[no-any-return]  # kind says so
    if isinstance(value, String):
        return str(value)
    if isinstance(value, Variable):
        known = variables if variables is not None else {}
        return known.setdefault(value.name, Var(value.name))
    if isinstance(value, (list, tuple)):
        return make_list([to_term(item, variables) for item in value])
    if isinstance(value, Compound):
        return Struct(value.name, tuple(to_term(arg, variables) for arg in value.args))
    return to_atomic(value)


def to_atomic(value: Any) -> Term:
    """A `str`, `int` or `float`, or a value of a class derived from them, as an atomic term.

    Raises:
        TypeError: It is something else; a bool is refused too, since Prolog has none.
    """
    if isinstance(value, Atom):
        return value
    if isinstance(value, str):
        return Atom(str(value))
    if isinstance(value, bool):
        raise TypeError(f"Prolog has no booleans: {value!r}; use an atom such as 'true', or 0 and 1")
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    raise TypeError(f"expected a str, an int or a float, got {type(value).__name__}: {value!r}")


def to_row(row: Iterable[Any], name: str, arity: int) -> tuple[Term, ...]:
    """The arguments of a fact as terms.

    Raises:
        TypeError: One of them is no `str`, `int` or `float`.
        ValueError: Their number is not `arity`.
    """
    terms = tuple(
        [
            Atom(value)
            if type(value) is str
            else value
            if type(value) is float or type(value) is int
            else to_atomic(value)
            for value in row
        ]
    )
    if len(terms) != arity:
        raise ValueError(f"a row of {name}/{arity} has {len(terms)} values: {terms!r}")
    return terms
