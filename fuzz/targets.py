"""What fuzzing does with a text: read it, or load it and ask it something, under limits."""

from __future__ import annotations

import io

from drlsl.logic import Engine, Halt, Limits, PrologError
from drlsl.logic.syntax import Flags, read_term, read_terms
from drlsl.logic.terms import Operators

LIMITS = Limits(inferences=20_000, seconds=5.0)
# How many solutions are asked for, at most.
_SOLUTIONS = 20
# What takes longer or more memory than the limits can bound: one step of it, on numbers that are huge.
_COSTLY = (
    "length",
    "numlist",
    "**",
    "^",
    "<<",
    "~",
    "tab",
    "include",
    "consult",
    "ensure_loaded",
    "use_module",
)


def read(text: str) -> None:
    """Read a text term by term, and as one term.

    Raises:
        Exception: Anything but a PrologError: a bug.
    """
    reader = read_terms(text, Operators(), Flags(), "fuzz")
    while True:
        try:
            next(reader)
        except StopIteration:
            break
        except PrologError as error:
            str(error)
    try:
        read_term(text, Operators(), Flags())
    except PrologError as error:
        str(error)


def consult(program: str, goal: str, *, compiled: bool = True) -> None:
    """Load a program and ask it a goal; both its errors must be Prolog's, and the engine must stay usable.

    Raises:
        Exception: Anything but a PrologError: a bug.
    """
    if ":-" in program.replace(" :- ", "") or any(word in program + goal for word in _COSTLY):
        # A directive runs without limits.
        program = "p(1)."
    engine = Engine(compiled=compiled, output=io.StringIO())
    try:
        engine.consult_text(program)
    except PrologError as error:
        str(error)
    if not any(word in goal for word in _COSTLY):
        try:
            for number, solution in enumerate(engine.query(goal, limits=LIMITS)):
                for value in solution.values():
                    engine.format(value)
                if number == _SOLUTIONS:
                    break
        except (PrologError, Halt) as error:
            str(error)
    assert Engine(output=io.StringIO()).holds("atom_length(abc, 3), \\+ fail, X = 1, X == 1")
    assert engine.holds("true")
