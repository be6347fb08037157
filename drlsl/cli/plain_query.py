"""`drlsl query` where its line needs no Typer, which takes longer to load than a scene takes to decide."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

_FLAGS: Final = {"--explain": "explain", "--json": "as_json"}
"""Options without a value, and what the arguments of `answer_query` call them."""


def plain_query(line: Sequence[str]) -> dict[str, Any] | None:
    """Return the arguments of `answer_query` that a command line gives; None if Typer must read the line.

    That is any other command, and a query with other options, with a mistake, or written in another way.
    """
    words = iter(line)
    if next(words, "") != "query":
        return None
    given: dict[str, Any] = {}
    for word in words:
        if word in _FLAGS:
            given[_FLAGS[word]] = True
            continue
        value = next(words, "")
        if not value or value.startswith("-"):
            return None
        match word:
            case "--state":
                given["state"] = Path(value)
            case "--rules":
                given.setdefault("rules", []).append(Path(value))
            case "--goal":
                given["goal"] = value
            case _:
                return None
    return given if "state" in given else None
