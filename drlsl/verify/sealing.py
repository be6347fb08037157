"""Rules and properties in one program, where neither changes the meaning of the other.

Rules come from the person who wants them proved. If they added a clause to a predicate of the properties, or
changed how these are read, a property would mean something else than its file says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.core import Clause, Indicator, variant
from drlsl.logic.loading import builtin, library
from drlsl.logic.terms import Struct, names
from drlsl.shield import consult_rules

DECLARED: Final = (("property", 2), ("violates", 1), ("image", 3), ("range", 3), ("unknown", 4), ("facts", 2))
"""The predicates that files of properties declare; each of several files may have clauses of them."""

_SHARED: Final = "".join(
    f":- multifile({name}/{arity}).\n:- discontiguous({name}/{arity}).\n" for name, arity in DECLARED
)

_RESERVED: Final = (*DECLARED, ("in", 2))

_Clauses: TypeAlias = Mapping[Indicator, Sequence[Clause]]


def consult_sealed(rules: Sequence[str | Path], properties: Sequence[str | Path]) -> Engine:
    """Return an engine with the rules, and with the properties as they are read by themselves.

    Raises:
        UserError: a file cannot be read, or rules and properties define or change the same predicate.
        PrologError: a file is not a valid program.
    """
    alone = Engine()
    _consult(alone, properties)
    wanted = _clauses(alone)
    engine = Engine()
    for path in rules:
        consult_rules(engine, path)
    own, flags = _clauses(engine), _flags(engine)
    _check_rules(own, wanted)
    _consult(engine, properties)
    _check_properties(own, wanted, _clauses(engine))
    if not flags == _flags(alone) == _flags(engine):
        raise UserError(
            "the rules and the properties set the flags iso or occurs_check to different values, which "
            "changes their meaning; set them alike in both"
        )
    return engine


def _flags(engine: Engine) -> tuple[bool, str]:
    """Return the flags that change the meaning of a program."""
    return engine.flags.iso, engine.flags.occurs_check


def _consult(engine: Engine, properties: Sequence[str | Path]) -> None:
    engine.consult_text(_SHARED, "what files of properties share")
    for path in properties:
        consult_rules(engine, path)


def _clauses(engine: Engine) -> dict[Indicator, list[Clause]]:
    """Return the clauses of every predicate that has any."""
    return {key: clauses for key in engine.predicates() if (clauses := engine.clauses(*key))}


def _check_rules(own: _Clauses, wanted: _Clauses) -> None:
    """Check that the rules leave the predicates of the properties alone."""
    mentioned = {name for clauses in wanted.values() for clause in clauses for name in names(clause.body)}
    for key, clauses in own.items():
        name = f"{key[0]}/{key[1]}"
        if key in wanted or key in _RESERVED:
            raise UserError(
                f"{_place(clauses)}: the rules define {name}, which belongs to the properties; "
                "rename it in the rules"
            )
        if _is_provided(key) and key[0] in mentioned:
            raise UserError(
                f"{_place(clauses)}: the rules define {name}, which Prolog provides and the properties use; "
                "rename it in the rules"
            )


def _check_properties(own: _Clauses, wanted: _Clauses, found: _Clauses) -> None:
    """Check that the properties leave the rules alone, and do not change when loaded with them."""
    for key, clauses in own.items():
        if list(found.get(key, ())) != list(clauses):
            new = [clause for clause in found.get(key, ()) if clause not in clauses] or clauses
            raise UserError(
                f"{_place(new)}: a property must not change {key[0]}/{key[1]}, which the rules define"
            )
    for key, clauses in wanted.items():
        if _is_provided(key):
            raise UserError(
                f"{_place(clauses)}: a property must not define {key[0]}/{key[1]}, which Prolog provides"
            )
        read = found.get(key, ())
        if len(read) != len(clauses) or not all(map(_alike, clauses, read)):
            raise UserError(
                f"{_place(clauses)}: beside the rules {key[0]}/{key[1]} is read as something else; "
                "do they declare operators or set flags?"
            )


def _is_provided(key: Indicator) -> bool:
    return builtin(*key) is not None or library().find(*key) is not None


def _place(clauses: Sequence[Clause]) -> str:
    """Return the position of the first of the clauses; an asserted clause has none."""
    return next((str(clause.span) for clause in clauses if clause.span is not None), "a directive")


def _alike(one: Clause, other: Clause) -> bool:
    """Return whether two clauses are the same up to the names of variables."""
    return variant(Struct(":-", (one.head, one.body)), Struct(":-", (other.head, other.body)))
