"""The source of a recording: files, their format, and the part of them that is meant."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

EPISODE: Final = "an episode, which `drlsl view` and `drlsl render` show"
"""The words for a file of an episode that is named as a recording."""


@dataclass(frozen=True, slots=True)
class Source:
    """The source of one recording.

    `format` is the name of a row of FORMATS; `files` are what it reads, the file with the tracks first;
    `part` is the requested site, period or run inside that file, None for all of it.
    """

    name: str
    format: str
    files: tuple[Path, ...]
    part: str | None = None


def is_pattern(part: str) -> bool:
    """Return whether a part may mean several."""
    return any(mark in part for mark in "*?[")


def matching(part: str, names: Sequence[str]) -> list[str]:
    """Return the names that a part or a pattern means: `0*` those that begin so, `7` 07, `us101` US-101."""
    if part in names:
        return [part]
    spelt = [name for name in names if fnmatchcase(name.lower(), part.strip().lower())]
    return spelt or [name for name in names if fnmatchcase(_plain(name), _plain(part))]


def _plain(name: str) -> str:
    """Return a name without case, punctuation and leading zeros, as people spell it."""
    return re.sub(r"(?<![0-9])0+(?=[0-9])", "", re.sub(r"[^a-z0-9/*?\[\]]", "", name.strip().lower()))
