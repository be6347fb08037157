"""Declaring predicates tabled, and dropping their tables."""

from __future__ import annotations

from drlsl.logic.builtins.arguments import indicator, members
from drlsl.logic.builtins.database import to_declare
from drlsl.logic.core import Caller, Indicator, call_table, det
from drlsl.logic.errors import PrologPermissionError, permission_error
from drlsl.logic.terms import Struct, Term


class _Unsupported(PrologPermissionError):
    """A kind of table that is not supported."""

    def message(self) -> str:
        return f"{super().message()}: tables hold every answer, so declare Name/Arity"


def _indicators(specification: Term) -> list[Indicator]:
    """Return the predicates that an argument of table/1 names.

    Raises:
        PrologError: It names none, or requests aggregated answers (``path(_, _, min)``) or another method.
    """
    named = []
    for term in members(specification):
        if type(term) is Struct and len(term.args) == 2 and term.name == "//":
            name, arity = indicator(Struct("/", term.args))
            named.append((name, arity + 2))
        elif type(term) is Struct and term.name != "/":
            raise _Unsupported(permission_error("declare", "table_mode", term).term)
        else:
            named.append(indicator(term))
    return named


@det("table", 1)
def table(machine: Caller, specification: Term) -> bool:
    """Have calls of predicates answered from tables."""
    for predicate in to_declare(machine, _indicators(specification)):
        predicate.tabled = call_table
        predicate.defined = True
        predicate.changed()
    return True


@det("abolish_all_tables", 0)
def abolish_all_tables(machine: Caller) -> bool:
    """Drop the answers of tabled predicates, as any change of a clause does."""
    machine.program.tables.clear()
    return True
