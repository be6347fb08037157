"""What pydantic finds wrong with values, in one line for people."""

from __future__ import annotations

from pydantic_core import ErrorDetails


def problem_text(problem: ErrorDetails, place: str, unknown: str, more: str = "") -> str:
    """Return what is wrong at `place`; `unknown` is said of a key that is not known, `more` comes behind."""
    if problem["type"] == "missing":
        return f"{place} is missing{more}"
    if problem["type"] == "extra_forbidden":
        return f"{place} {unknown}"
    given = problem["input"]
    got = f", got {given!r}" if isinstance(given, str | int | float | bool | None) else ""
    return f"{place}: {problem['msg'][:1].lower()}{problem['msg'][1:]}{got}{more}"
