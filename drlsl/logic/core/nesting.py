"""Recursion without Python's stack, for terms that nest deeper than it allows."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")
Deep: TypeAlias = Generator[Any, Any, T]
"""A recursive function as a generator: it yields the generator of each inner call and is sent its result."""


def run_deep(work: Deep[T]) -> T:
    """Return the result of a recursive function that is written as a generator."""
    stack: list[Deep[Any]] = [work]
    value: Any = None
    while True:
        try:
            inner = stack[-1].send(value)
        except StopIteration as end:
            stack.pop()
            value = end.value
            if not stack:
                return value  # type: ignore[no-any-return]  # that of `work`
        else:
            stack.append(inner)
            value = None
