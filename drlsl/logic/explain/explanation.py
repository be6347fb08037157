"""Explanations as data, as text and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from drlsl.logic.conversion import to_plain
from drlsl.logic.core import term_variables
from drlsl.logic.syntax import Span
from drlsl.logic.terms import Atom, Operators, Struct, Term, deref, format_term

Shown: TypeAlias = "str | int | float"

_DIGITS: Final = 6  # significant digits of a float in an explanation
_TERM_DEPTH: Final = 8
_MAX_LINES: Final = 200
_MAX_BINDINGS: Final = 8
_SPLICED: Final = frozenset({"all", "either"})


@dataclass(frozen=True, slots=True)
class Step:
    """One goal of an explanation: it holds, with its proof below, or it fails, with the reasons below.

    Attributes:
        goal: the goal as it was called, floats rounded to 6 digits.
        holds: whether it holds.
        kind: ``rule``, ``fact``, ``builtin``, ``goal`` (not expanded), ``cut``, ``negation``, ``condition``,
            ``if``, ``either``, ``all``; for failures also ``predicate``, with a ``clause`` below each.
        source: the goal as the program has it.
        place: its position in the text, None if unknown.
        clause: the clause that was used, None for builtins.
        bindings: the clause's variables that are bound, by name; numbers stay numbers.
        children: the steps that it rests on.
        note: a further remark.
    """

    goal: str
    holds: bool
    kind: str
    source: str
    place: Span | None
    clause: Span | None
    bindings: Mapping[str, Shown]
    children: tuple[Step, ...]
    note: str

    def to_dict(self) -> dict[str, Any]:
        """Return the step as JSON's values."""
        return {
            "goal": self.goal,
            "holds": self.holds,
            "kind": self.kind,
            "source": self.source,
            "place": None if self.place is None else str(self.place),
            "clause": None if self.clause is None else str(self.clause),
            "bindings": {name: to_plain(value) for name, value in self.bindings.items()},
            "children": [child.to_dict() for child in self.children],
            "note": self.note,
        }


@dataclass(frozen=True, slots=True)
class Explanation:
    """An explanation: whether a goal holds, the values of its variables, and the steps."""

    goal: str
    holds: bool
    bindings: Mapping[str, Shown]
    steps: tuple[Step, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the explanation as JSON's values."""
        return {
            "goal": self.goal,
            "holds": self.holds,
            "bindings": {name: to_plain(value) for name, value in self.bindings.items()},
            "steps": [step.to_dict() for step in self.steps],
        }

    def to_json(self) -> str:
        """Return the explanation as JSON text."""
        return json.dumps(self.to_dict(), allow_nan=False, ensure_ascii=False)

    def text(self, max_lines: int = _MAX_LINES) -> str:
        """Return lines of text: ``+`` before goals that hold, ``-`` before failures, reasons indented."""
        verdict = "holds" if self.holds else "fails"
        head = f"{self.goal} {verdict}{_with(self.bindings)}"
        lines = [head]
        for step in self.steps:
            for line in _lines(step, 1):
                if len(lines) >= max_lines:
                    return "\n".join([*lines, "  ..."])
                lines.append(line)
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        """Return the lines of text as they are, for notebooks."""
        from html import escape

        return f"<pre>{escape(self.text())}</pre>"


def _lines(step: Step, depth: int) -> Iterator[str]:
    if step.kind in _SPLICED:
        for child in step.children:
            yield from _lines(child, depth)
        return
    margin = "  " * depth
    if step.kind == "clause":
        yield f"{margin}{step.clause or 'clause'}: {step.goal}"
    elif step.kind == "more":
        yield f"{margin}- and {step.goal}"
    elif step.kind == "if":
        depth -= 1
    else:
        yield f"{margin}{'+' if step.holds else '-'} {_described(step)}"
    if step.kind == "condition" and len(step.children) == 1 and step.children[0].kind == "builtin":
        return
    for child in step.children:
        yield from _lines(child, depth + 1)


def _described(step: Step) -> str:
    text = step.goal
    if step.kind == "condition":
        text = f"if {text}"
    if step.kind in ("builtin", "goal") and step.source != step.goal and not step.holds:
        text += f"  ({step.source})"
    where = step.clause if step.holds and step.clause is not None else step.place
    if where is not None:
        text += f"  [{where}]"
    if not step.holds and step.kind != "predicate":
        text += _with(step.bindings)
    return f"{text}: {step.note}" if step.note else text


def _with(bindings: Mapping[str, Shown]) -> str:
    if not bindings:
        return ""
    pairs = [f"{name} = {_rounded(bound)}" for name, bound in list(bindings.items())[:_MAX_BINDINGS]]
    return " with " + ", ".join(pairs) + (", ..." if len(bindings) > _MAX_BINDINGS else "")


def _rounded(bound: Shown) -> Shown:
    return _short(bound) if isinstance(bound, float) else bound


def _short(number: float) -> float:
    return float(f"{number:.{_DIGITS}g}")


def shown(term: Term, operators: Operators, labels: Mapping[int, str]) -> str:
    """Return a term as text: quoted, floats rounded, depth bounded, unnamed variables as ``_``."""
    return format_term(
        _with_short_floats(term, 0),
        operators,
        quoted=True,
        numbervars=True,
        max_depth=_TERM_DEPTH,
        variable_names={id(variable): labels.get(id(variable), "_") for variable in term_variables(term)},
    )


def _with_short_floats(term: Term, depth: int) -> Term:
    term = deref(term)
    if isinstance(term, float) and math.isfinite(term):
        return _short(term)
    if isinstance(term, Struct) and depth <= 4 * _TERM_DEPTH:
        return Struct(term.name, tuple(_with_short_floats(arg, depth + 1) for arg in term.args))
    return term


def value(term: Term, operators: Operators) -> Shown:
    """Return the value of a variable: a number unchanged, anything else as text."""
    term = deref(term)
    if isinstance(term, Atom):
        return term.name
    if isinstance(term, int) or (isinstance(term, float) and math.isfinite(term)):
        return term
    return shown(term, operators, {})
