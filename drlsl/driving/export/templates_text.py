"""The fixed parts of exported programs, with places for the rest."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Final

_PLACE: Final = re.compile(r"@([A-Z_]+)@")


def filled(name: str, **values: str) -> str:
    """Return the template of that name with a value in each of its places."""
    text = (files(__package__) / "templates" / name).read_text(encoding="utf-8")
    return _PLACE.sub(lambda place: values[place[1]], text)
