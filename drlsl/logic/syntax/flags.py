"""The flags of an engine.

Source: ISO 13211-1 7.11, 8.17.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Final

from drlsl.logic.errors import domain_error, instantiation_error, permission_error, type_error
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

_SWITCH: Final = ("on", "off")
_CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "char_conversion": _SWITCH,
    "debug": _SWITCH,
    "unknown": ("error", "fail", "warning"),
    "double_quotes": ("codes", "chars", "atom", "string"),
    "occurs_check": ("false", "true", "error"),
    "iso": ("true", "false"),
}
_DEFAULTS: Final[dict[str, Term]] = {
    "bounded": Atom("false"),
    "max_integer": sys.maxsize,
    "min_integer": -sys.maxsize - 1,
    "integer_rounding_function": Atom("toward_zero"),
    "char_conversion": Atom("off"),
    "debug": Atom("off"),
    "max_arity": Atom("unbounded"),
    "unknown": Atom("error"),
    "double_quotes": Atom("codes"),
    "occurs_check": Atom("false"),
    "iso": Atom("true"),
    "dialect": Atom("drlsl"),
}


class Flags:
    """The flags of one engine.

    Frequently used ones are attributes, too: `unknown`, `double_quotes`, `occurs_check` (each the name of its
    value) and `iso` (a bool: False accepts the extensions of SWI-Prolog). `conversions` were set by
    char_conversion/2; `active_conversions` is empty while the flag char_conversion is off.
    """

    __slots__ = ("_values", "conversions", "double_quotes", "iso", "occurs_check", "unknown")

    def __init__(self) -> None:
        self._values = dict(_DEFAULTS)
        self.conversions: dict[str, str] = {}
        self._refresh()

    def _refresh(self) -> None:
        self.double_quotes = self._name("double_quotes")
        self.unknown = self._name("unknown")
        self.occurs_check = self._name("occurs_check")
        self.iso = self._name("iso") == "true"

    def _name(self, flag: str) -> str:
        value = self._values[flag]
        assert isinstance(value, Atom)
        return value.name

    @property
    def active_conversions(self) -> dict[str, str]:
        """The conversions that reading applies to unquoted characters (3.32, 8.14.5)."""
        return self.conversions if self._name("char_conversion") == "on" else {}

    def copy(self) -> Flags:
        """Return independent flags with the same values."""
        twin = Flags()
        twin._values.update(self._values)
        twin.conversions.update(self.conversions)
        twin._refresh()
        return twin

    def items(self) -> Iterator[tuple[str, Term]]:
        """Yield each flag and its value."""
        return iter(list(self._values.items()))

    def get(self, name: str) -> Term | None:
        """Return the value of a flag; None if there is no such flag."""
        return self._values.get(name)

    def set(self, flag: Term, value: Term) -> None:
        """Change a flag, as set_prolog_flag/2 does.

        Raises:
            InstantiationError, PrologTypeError, DomainError, PrologPermissionError: in the order of 8.17.1.3.
        """
        flag, value = deref(flag), deref(value)
        if isinstance(flag, Var) or isinstance(value, Var):
            raise instantiation_error()
        if not isinstance(flag, Atom):
            raise type_error("atom", flag)
        if flag.name not in self._values:
            raise domain_error("prolog_flag", flag)
        choices = _CHOICES.get(flag.name)
        if choices is None:
            self._refuse(flag, value)
        elif not isinstance(value, Atom) or value.name not in choices:
            raise domain_error("flag_value", Struct("+", (flag, value)))
        self._values[flag.name] = value
        self._refresh()

    def _refuse(self, flag: Atom, value: Term) -> None:
        """Refuse to set a fixed flag: a domain error for a wrong value, else a permission error."""
        current = self._values[flag.name]
        if flag.name == "bounded" and not (isinstance(value, Atom) and value.name in ("true", "false")):
            raise domain_error("flag_value", Struct("+", (flag, value)))
        if isinstance(current, int) and not isinstance(value, int):
            raise domain_error("flag_value", Struct("+", (flag, value)))
        raise permission_error("modify", "flag", flag)
