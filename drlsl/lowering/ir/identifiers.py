"""Names for generated code, after those in the rules."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable
from typing import Final

_WORDS: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_OTHER: Final = re.compile(r"\W+")
_NOT_ASCII: Final = re.compile(r"\W+", re.ASCII)


class Names:
    """Hands out each name once."""

    def __init__(self, reserved: Iterable[str] = (), *, ascii_only: bool = False) -> None:
        self._taken = {*keyword.kwlist, *reserved}
        self._numbers: dict[str, int] = {}  # the last one that was appended to a name; all before are taken
        self._other = _NOT_ASCII if ascii_only else _OTHER

    def new(self, hint: str) -> str:
        """Return an unused name: the hint in lower case, with a number appended if necessary."""
        base = self._other.sub("_", _WORDS.sub("_", hint).lower()).strip("_") or "value"
        if base[0].isdigit():
            base = f"v{base}"
        name, number = base, self._numbers.get(base, 1)
        while name in self._taken:
            number += 1
            name = f"{base}_{number}"
        self._numbers[base] = number
        self._taken.add(name)
        return name
