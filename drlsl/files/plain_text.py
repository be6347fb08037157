"""Text files and JSON, read strictly and written so that every reader accepts them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from drlsl.errors import UserError
from drlsl.logic import to_plain
from drlsl.logic.loading import LARGEST_FILE

MOST_DIGITS: Final = 400
"""Digits of the longest integer in JSON: longer ones exceed every float."""


def read_text(path: str | Path, what: str = "") -> str:
    """Read a file of UTF-8 text without its byte order mark; `what` names its kind in errors.

    Raises:
        UserError: it cannot be read, is too large, or is not UTF-8.
    """
    named = f"{what} {path}".strip()
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise UserError(f"cannot read {named}: {error.strerror}") from error
    if len(data) > LARGEST_FILE:
        raise UserError(f"cannot read {named}: it is larger than {LARGEST_FILE // 2**20} MiB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        advice = "it looks like UTF-16; " if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ""
        raise UserError(f"{path}: not UTF-8 text (byte {error.start}); {advice}save it as UTF-8") from error


def parse_json(text: str, name: str) -> Any:
    """Parse JSON text; `name` is its name in errors.

    Raises:
        UserError: it is not JSON (with line and column), holds a key twice, or an integer beyond the range of
            floats, which readers of JSON treat differently.
    """
    try:
        return json.loads(text, object_pairs_hook=_object, parse_int=_integer)
    except json.JSONDecodeError as error:
        raise UserError(f"{name}:{error.lineno}:{error.colno}: not JSON: {error.msg}") from error
    except RecursionError as error:
        raise UserError(f"{name}: nested too deeply") from error
    except _Refused as error:
        raise UserError(f"{name}: {error}") from error


class _Refused(Exception):
    """JSON that Python accepts but that is refused nevertheless."""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise _Refused(f"the key {json.dumps(twice)} is given {names.count(twice)} times; give it once")
    return made


def _integer(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise _Refused(f"an integer of {len(digits)} digits, which is out of range")
    return int(digits)


def to_json(data: Any) -> str:
    """Return data as JSON that every reader accepts; values beyond JSON become text, as in `to_plain`."""
    return json.dumps(_plain(data), indent=2, allow_nan=False)


def _plain(data: Any) -> Any:
    if isinstance(data, dict):
        return {name: _plain(item) for name, item in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(item) for item in data]
    return data if data is None or isinstance(data, bool) else to_plain(data)


def printable(text: str) -> str:
    """Return text on one line, with control characters as escapes."""
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else repr(char)[1:-1] for char in text)
