"""A rule program as one file of plain ISO Prolog."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from drlsl.driving.explain import Objection
from drlsl.driving.export.iso_prolog import iso_text
from drlsl.driving.export.rule_program import OBJECTION, RuleProgram
from drlsl.driving.export.stored import StoredDecision
from drlsl.driving.export.templates_text import filled
from drlsl.driving.scene import SCHEMA, Scene, facts_of
from drlsl.driving.shield import COMFORT, LANE, Decision
from drlsl.logic.terms import Atom, Operators, format_term
from drlsl.lowering.ir import NotLowerable

_EXACT: Final = "drlsl_near(X, Y) :- X =:= Y."
_ROUGH: Final = "drlsl_near(X, Y) :- abs(X - Y) =< 1.0e-14 * max(abs(X), abs(Y))."


def prolog_files(program: RuleProgram, stored: Sequence[StoredDecision]) -> dict[str, str]:
    """Return `rules.pl` and its check with the stored decisions, by name.

    Raises:
        NotLowerable: a clause calls what other systems do not have, or do differently.
    """
    usable = [(one, one.decision) for one in stored if one.decision is not None]
    head = program.head("%")
    check = filled(
        "check.pl",
        HEAD=head,
        COUNT=str(len(usable)),
        FORGET="\n".join(_forget(name, arity) for name, arity in SCHEMA.relations),
        OPTIONAL="\n".join(_optional(program)),
        NEAR=_EXACT if _is_exact(program) else _ROUGH,
        SCENES="\n".join(
            _stored(program, number, one, decision) for number, (one, decision) in enumerate(usable, start=1)
        ),
    )
    return {"rules.pl": f"{head}\n\n{iso_text(program.shield.engine)}", "check.pl": check}


def _is_exact(program: RuleProgram) -> bool:
    """Return whether systems must agree to the bit, as far as that can be seen."""
    try:
        return program.is_exact(program.decision(ordered=True))
    except NotLowerable:
        return False


def _forget(name: str, arity: int) -> str:
    blanks = ", ".join(["_"] * arity)
    return f"drlsl_forget :- retract({name}({blanks})), fail."


def _optional(program: RuleProgram) -> Iterable[str]:
    """Yield the predicates that ask what a program need not define."""
    for question, name in ((LANE, "drlsl_lane"), (COMFORT, "drlsl_acceleration")):
        if program.defines(question):
            yield f"{name}([Stored]) :- {question.name}(X), !, drlsl_near(X, Stored)."
        else:
            yield f"{name}([])."
    if program.has_reasons:
        yield f"drlsl_objections(Found) :- findall(Action-Reason, {OBJECTION.name}(Action, Reason), Found)."
    else:
        yield "drlsl_objections([])."


def _stored(program: RuleProgram, number: int, one: StoredDecision, decision: Decision) -> str:
    facts = ",\n    ".join(_facts(one.scene))
    wanted = decision.comfortable_acceleration
    objections = [
        f"{action.atom}-{_reason(reason)}" for action, found in one.unsafe.items() for reason in found
    ]
    parts = [
        f"[{', '.join(action.atom for action in decision.safe_actions)}]",
        _number(decision.target_speed),
        f"[{', '.join(map(_number, decision.observation))}]",
        "true" if decision.front_is_free else "false",
        f"[{decision.lane_to_keep}]" if program.defines(LANE) else "[]",
        f"[{_number(wanted)}]" if wanted < float("inf") else "[]",
        f"[{', '.join(objections)}]",
    ]
    return f"drlsl_scene({number}, [\n    {facts}\n], answer({', '.join(parts)}))."


def _facts(scene: Scene) -> Iterable[str]:
    for (name, arity), rows in facts_of(scene).items():
        for row in SCHEMA.relations[name, arity].conform(rows):
            yield f"{name}({', '.join(map(_value, row))})"


def _reason(objection: Objection) -> str:
    args = [*objection.details]
    if objection.vehicle is not None and objection.gap is not None and objection.needed is not None:
        args = [objection.vehicle, objection.gap, objection.needed]
    name = _value(objection.reason)
    return f"{name}({', '.join(map(_value, args))})" if args else name


def _value(value: str | float) -> str:
    return format_term(Atom(value), Operators(), quoted=True) if isinstance(value, str) else _number(value)


def _number(value: float) -> str:
    return format_term(value, Operators(), quoted=True)
