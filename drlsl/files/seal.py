"""Checksums that files carry of their own content, so that a damaged file is never accepted.

A file without a checksum is from an older version, or written by hand: it is read unchecked. SHA-256 guards
against accidents, not against people, who can compute it, too.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from drlsl.errors import UserError

_MARK: Final = b"DRLSL SHA-256 "
_LENGTH: Final = len(_MARK) + 64
"""Bytes of the comment that closes an archive."""

_LINE: Final = "# SHA-256 of the lines above, "
_KEY: Final = "sha256"


class DamagedError(ValueError):
    """The content does not match its checksum."""

    def __str__(self) -> str:
        return "the checksum does not match the content"


def digest(paths: list[Path]) -> str:
    """Return the SHA-256 over the contents of files, in order."""
    total = hashlib.sha256()
    for path in paths:
        total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def digests(paths: Iterable[Path]) -> dict[str, str]:
    """Return the SHA-256 of each file, by its name without the folder."""
    return {path.name: digest([path]) for path in paths}


def seal_archive(content: bytes) -> bytes:
    """Add the checksum of a ZIP archive, such as `torch.save` writes, as its comment."""
    if not content.endswith(b"\0\0"):
        raise ValueError("expected a ZIP archive without a comment")
    return content[:-2] + _LENGTH.to_bytes(2, "little") + _MARK + _digest(content)


def open_archive(content: bytes) -> bool:
    """Check an archive that may have a checksum; return whether it has one.

    Raises:
        DamagedError: the checksum does not fit.
    """
    comment = content[-_LENGTH:]
    if not comment.startswith(_MARK):
        return False
    archive, length = content[: -_LENGTH - 2], content[-_LENGTH - 2 : -_LENGTH]
    if length != _LENGTH.to_bytes(2, "little") or comment != _MARK + _digest(archive + b"\0\0"):
        raise DamagedError
    return True


def seal_text(text: str) -> str:
    """Return lines of text, such as YAML, with their checksum in a comment at the end."""
    return f"{text}{_LINE}{_digest(text.encode()).decode()}\n"


def open_text(text: str) -> str:
    """Return the lines that were sealed, or all lines if there is no checksum.

    Raises:
        DamagedError: the checksum does not fit.
    """
    lines, mark, found = text.rpartition(_LINE)
    if not mark:
        return text
    if found != f"{_digest(lines.encode()).decode()}\n":
        raise DamagedError
    return lines


def check_text(path: Path, advice: str) -> None:
    """Check that a file of sealed text is as it was written; `advice` is for the error.

    Raises:
        UserError: the checksum does not fit, or the file cannot be read.
    """
    try:
        open_text(path.read_bytes().decode())
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise UserError(f"{path}: damaged, or changed by hand ({error}); {advice}") from error


def seal_values(values: Mapping[str, Any]) -> str:
    """Return JSON of plain values, including their checksum."""
    return json.dumps({**values, _KEY: _digest_of(values)}, indent=1, allow_nan=False) + "\n"


def open_values(text: str) -> dict[str, Any]:
    """Return the values that were sealed, or all values if there is no checksum.

    Raises:
        DamagedError: the checksum does not fit.
        ValueError: this is not JSON, or not an object.
    """
    values = json.loads(text)
    if not isinstance(values, dict):
        raise ValueError("expected a JSON object")
    if _KEY in values and values.pop(_KEY) != _digest_of(values):
        raise DamagedError
    return values


def _digest_of(values: Mapping[str, Any]) -> str:
    """Return the checksum of values in JSON, independent of their layout and order."""
    plain = json.loads(json.dumps(values, allow_nan=False))
    return _digest(json.dumps(plain, sort_keys=True).encode()).decode()


def _digest(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
