"""Hand-written cases for the sections of ISO 13211-1 on syntax, writing, operators, flags and text."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import pytest

from drlsl.logic import Engine, PrologError, PrologSyntaxError
from drlsl.logic.core import subsumes
from drlsl.logic.syntax import Flags, read_term
from drlsl.logic.terms import Operators

_FOLDER = Path(__file__).parent / "sections"


def _cases() -> Iterator[object]:
    for path in sorted(_FOLDER.glob("*.txt")):
        gap = None
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if line.startswith("! "):
                gap = line[2:]
            elif " ==> " in line and not line.startswith("#"):
                goal, expected = line.split(" ==> ")
                marks = [pytest.mark.xfail(reason=gap, strict=True)] if gap else []
                yield pytest.param(goal, expected, id=f"{path.stem}:{number}", marks=marks)
                gap = None


def _plain(text: str) -> str:
    return text.replace("<NL>", "\n").replace("<TAB>", "\t")


def _engine_and_goal(case: str) -> tuple[Engine, str]:
    """An engine that has proved what stands before ``. ``, and the goal behind it."""
    engine = Engine(output=io.StringIO())
    first, separator, goal = case.partition("). ")
    if not separator:
        return engine, _plain(case)
    assert engine.holds(first + ")")
    return engine, _plain(goal)


@pytest.mark.parametrize(("case", "expected"), list(_cases()))
def test_case(case: str, expected: str) -> None:
    engine, goal = _engine_and_goal(case)
    kind, _, rest = expected.partition(" ")
    if kind == "syntax_error":
        with pytest.raises(PrologSyntaxError):
            engine.prepare(goal)
    elif kind == "throws":
        with pytest.raises(PrologError) as raised:
            engine.holds(goal)
        assert subsumes(read_term(rest, Operators(), Flags()).term, raised.value.formal), raised.value
    elif kind == "writes":
        assert engine.holds(goal)
        assert isinstance(engine.output, io.StringIO)
        assert engine.output.getvalue() == _plain(rest)
    elif kind in ("yes", "no"):
        assert engine.holds(goal) is (kind == "yes")
    else:
        template, wanted = expected.split(" in ", 1)
        found = engine.once(f"findall({template}, ({goal}), Found)")
        assert found is not None
        assert engine.holds(
            f"findall({template}, ({goal}), Found), Wanted = {wanted}, "
            "subsumes_term(Wanted, Found), subsumes_term(Found, Wanted)"
        ), found["Found"]
