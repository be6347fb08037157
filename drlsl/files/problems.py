"""Pydantic's validation errors in one line for people."""

from __future__ import annotations

from pydantic_core import ErrorDetails


def problem_text(problem: ErrorDetails, place: str, unknown: str, more: str = "") -> str:
    """Return the problem at `place`; `unknown` is the text for an unknown key, `more` is appended to it."""
    if problem["type"] == "missing":
        return f"{place} is missing{more}"
    if problem["type"] == "extra_forbidden":
        return f"{place} {unknown}"
    given = problem["input"]
    got = f", got {given!r}" if isinstance(given, str | int | float | bool | None) else ""
    return f"{place}: {problem['msg'][:1].lower()}{problem['msg'][1:]}{got}{more}"
