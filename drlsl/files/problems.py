"""Pydantic's validation errors in one line for people."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import BaseModel
from pydantic_core import ErrorDetails


def problem_text(problem: ErrorDetails, place: str, unknown: str, more: str = "") -> str:
    """Return the problem at `place`; `unknown` is the text for an unknown key, `more` is appended to it."""
    if problem["type"] == "missing":
        return f"{place} is missing{more}"
    if problem["type"] == "extra_forbidden":
        return f"{place} {unknown}"
    given = problem["input"]
    got = f", got {given!r}" if isinstance(given, str | int | float | bool | None) else ""
    return f"{place}: {reason_of(problem)}{got}{more}"


def reason_of(problem: ErrorDetails) -> str:
    """Return what is wrong with a value, in words for who wrote it in Python, in YAML or as a flag."""
    given, kind = problem["input"], problem["type"]
    if kind == "extra_forbidden":
        return "there is no such setting"
    if kind in ("tuple_type", "list_type"):
        such = f", such as [{given!r}]" if isinstance(given, str) else ""
        return f"input should be a list{such}"
    if kind in ("dict_type", "mapping_type", "model_type", "model_attributes_type"):
        return "input should be keys with values"
    text = problem["msg"]
    if kind == "value_error":
        return text.removeprefix("Value error, ")
    return f"{text[:1].lower()}{text[1:]}"


def setting_path(model: type[BaseModel], location: Iterable[int | str]) -> str:
    """Return the path of a value in a model, without pydantic's names of the alternatives of its type."""
    inner: type[BaseModel] | None = model
    parts: list[str] = []
    for part in location:
        if isinstance(part, int):
            parts.append(str(part))
        elif inner is not None and part in inner.model_fields:
            parts.append(part)
            inner = section_of(inner.model_fields[part].annotation)
    return ".".join(parts)


def section_of(annotation: object) -> type[BaseModel] | None:
    """Return the model that a field holds; None if it holds another value."""
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None
