"""Terms as Python values and back, for the public API.

An atom is a `str`, a number an `int` or a `float`, a proper list a `list`; another compound term is a
`Compound`, an unbound variable a `Variable`, and Prolog's own string type a `String`, a subclass of `str` to
distinguish it from atoms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite, isnan
from numbers import Integral, Rational, Real
from typing import Any, Final, TypeAlias, Union

from drlsl.logic.errors import representation_error
from drlsl.logic.limits import Meter
from drlsl.logic.terms import (
    NIL,
    Atom,
    Struct,
    Term,
    Var,
    decimal_digits,
    deref,
    is_acyclic,
    make_list,
    variable_name,
)


@dataclass(frozen=True, slots=True)
class Compound:
    """A compound term that is not a list."""

    name: str
    args: tuple[Value, ...]

    def __str__(self) -> str:
        return f"{self.name}({', '.join(map(_text, self.args))})"


@dataclass(frozen=True, slots=True)
class Variable:
    """An unbound variable."""

    name: str

    def __str__(self) -> str:
        return self.name


class String(str):
    """A value of Prolog's string type."""

    __slots__ = ()


# Larger terms are checked first, to be sure that they are finite.
_LARGE: Final = 50_000
_REPORT: Final = 1024

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

    def __eq__(self, other: object) -> bool:
        """Return whether the other is a mapping of the same names to equal values."""
        return super().__eq__(other)

    def __repr__(self) -> str:
        return f"Solution({', '.join(f'{name}={value!r}' for name, value in self._values.items())})"


def to_value(term: Term, names: Mapping[Term, str] | None = None, meter: Meter | None = None) -> Value:
    """Return a term as a Python value; `names` has the names of variables that have one.

    Raises:
        RepresentationError: The term is cyclic.
        LimitExceeded: There is no time or no memory for it, by the meter of the solution's query.
    """
    term = deref(term)
    if type(term) is not Struct:
        return _simple_value(term, names or {})
    # Every compound term comes after the one that it is part of, so that values can be built from the end.
    order = _inner_first(term, meter)
    values: dict[int, Value] = {}
    for struct in order:
        if meter is not None:
            meter.spend(1)
        is_list, parts = _parts(struct)
        converted = [
            values[id(part)] if type(part) is Struct else _simple_value(part, names or {})
            for part in map(deref, parts)
        ]
        values[id(struct)] = converted if is_list else Compound(struct.name, tuple(converted))
    return values[id(term)]


def _inner_first(root: Struct, meter: Meter | None) -> list[Struct]:
    """Return the compound terms within a term, each once and after those inside it.

    Raises:
        RepresentationError: The term is cyclic.
    """
    order: list[Struct] = []
    begun: set[int] = set()
    done: set[int] = set()
    todo: list[tuple[Struct, bool]] = [(root, False)]
    while todo:
        struct, is_left = todo.pop()
        key = id(struct)
        if is_left:
            done.add(key)
            order.append(struct)
        elif key not in done:
            if key in begun:
                raise representation_error("acyclic_term")
            begun.add(key)
            todo.append((struct, True))
            todo.extend(
                (part, False) for part in map(deref, _parts(struct, meter)[1]) if type(part) is Struct
            )
    return order


def _parts(struct: Struct, meter: Meter | None = None) -> tuple[bool, list[Term]]:
    """Return whether a compound term is a proper list, and its elements or else its arguments."""
    items: list[Term] = []
    rest: Term = struct
    while type(rest) is Struct and rest.name == "." and len(rest.args) == 2:
        items.append(rest.args[0])
        if len(items) == _LARGE and not is_acyclic(struct):
            raise representation_error("acyclic_term")
        if meter is not None and not len(items) % _REPORT:
            meter.make(2 * _REPORT)
        rest = deref(rest.args[1])
    if meter is not None:
        meter.spend(len(struct.args))
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


_LONGEST: Final = 10**400
"""Integers with more digits exceed every float."""


def to_plain(value: Value) -> str | int | float | list[Any]:
    """Return a value for JSON: values that JSON lacks (terms, NaN, infinities) become text.

    So does an integer of more than 400 digits, which not every reader of JSON accepts.
    """
    if isinstance(value, list):
        return [to_plain(item) for item in value]
    if isinstance(value, int) and not -_LONGEST < value < _LONGEST:
        return decimal_digits(value)
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value if isinstance(value, str | int | float) else str(value)


def _text(value: Value) -> str:
    return decimal_digits(value) if isinstance(value, int) else str(value)


def to_term(value: Any, variables: dict[str, Var] | None = None, *, allow_nan: bool = False) -> Term:
    """Return a Python value as a term: the inverse of `to_value`. Terms are returned unchanged.

    `variables` holds, and receives, the variables by their names.

    Raises:
        TypeError: The value cannot be made a term; this includes a bool.
        ValueError: A list contains itself, or a number is NaN and that is not allowed.
    """
    known = {} if variables is None else variables
    if not isinstance(value, _COMPOUND):
        return _simple_term(value, known, allow_nan)
    made: dict[int, Term] = {}
    begun: set[int] = set()
    todo = [value]
    while todo:
        part = todo[-1]
        inside = part.args if isinstance(part, Compound) else part
        missing = [each for each in inside if isinstance(each, _COMPOUND) and id(each) not in made]
        if missing:
            if id(part) in begun:
                raise ValueError("the value contains itself, so no term can be made of it")
            begun.add(id(part))
            todo.extend(missing)
            continue
        todo.pop()
        terms = [
            made[id(each)] if isinstance(each, _COMPOUND) else _simple_term(each, known, allow_nan)
            for each in inside
        ]
        made[id(part)] = Struct(part.name, tuple(terms)) if isinstance(part, Compound) else make_list(terms)
    return made[id(value)]


_COMPOUND: Final = (list, tuple, Compound)


def _simple_term(value: Any, known: dict[str, Var], allow_nan: bool) -> Term:
    if allow_nan and type(value) is float:
        return value
    if isinstance(value, (Var, Struct)):
        return value
    if isinstance(value, String):
        return str(value)
    if isinstance(value, Variable):
        return known.setdefault(value.name, Var(value.name))
    return to_atomic(value)


def to_atomic(value: Any) -> Term:
    """Return a `str`, `int` or `float` as an atomic term, or a value of a class derived from or like them.

    Like them are the numbers of NumPy, which Python counts among the integral and the real ones.

    Raises:
        TypeError: It has another type; a bool is refused, too, since Prolog has none, and a fraction.
        ValueError: It is NaN.
    """
    if isinstance(value, Atom):
        return value
    if isinstance(value, str):
        return Atom(str(value))
    if isinstance(value, bool):
        raise TypeError(f"Prolog has no booleans: {value!r}; use an atom such as 'true', or 0 and 1")
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real) and not isinstance(value, Rational):
        number = float(value)
        if isnan(number):
            raise ValueError("NaN is not a value: it would make every comparison fail")
        return number
    raise TypeError(f"expected a str, an int or a float, got {type(value).__name__}: {value!r}")


def to_row(row: Iterable[Any], name: str, arity: int) -> tuple[Term, ...]:
    """Return the arguments of a fact as terms.

    Raises:
        TypeError: One of them is not a `str`, `int` or `float`.
        ValueError: Their number is not `arity`, or one of them is NaN.
    """
    terms = tuple(
        [
            Atom(value)
            if type(value) is str
            else value
            if type(value) is int or (type(value) is float and value == value)
            else to_atomic(value)
            for value in row
        ]
    )
    if len(terms) != arity:
        raise ValueError(f"a row of {name}/{arity} has {len(terms)} values: {terms!r}")
    return terms
