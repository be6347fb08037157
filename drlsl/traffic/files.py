"""Open text files, plain or compressed."""

from __future__ import annotations

import gzip
import json
import lzma
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, cast

from drlsl.errors import UserError

_UNREADABLE: Final[tuple[type[Exception], ...]] = (
    OSError,
    EOFError,
    UnicodeDecodeError,
    lzma.LZMAError,
    zlib.error,
)
"""Exceptions of opening, decompressing or decoding a broken file."""

ENCODING = "utf-8-sig"
"""UTF-8, with or without a byte order mark."""

_NO_TEXT: Final = {
    b"PK\x03\x04": "it is a zip archive; name it .zip, or unpack it",
    b"PAR1": "it is a Parquet file; name it .parquet",
    b"\xff\xfe": "it is UTF-16; save it as UTF-8",
    b"\xfe\xff": "it is UTF-16; save it as UTF-8",
}
"""First bytes of files that are no text, and what to do about them."""

_FIRST_BYTES: Final = 1024


def open_bytes(path: Path) -> IO[bytes]:
    """Open a file for reading, decompressed as its suffix says."""
    if path.suffix == ".gz":
        return cast(IO[bytes], gzip.open(path, "rb"))
    if path.suffix == ".xz":
        return lzma.open(path, "rb")
    return open(path, "rb")


def open_text(path: Path) -> IO[str]:
    """Open a text file for reading, decompressed as its suffix says.

    Raises:
        UserError: its first bytes are no text; the message says what they are.
    """
    with open_bytes(path) as file:
        start = file.read(_FIRST_BYTES)
    for mark, trouble in _NO_TEXT.items():
        if start.startswith(mark):
            raise UserError(f"{path}: cannot be read: {trouble}")
    if b"\0" in start:
        raise UserError(f"{path}: cannot be read: it holds zero bytes, so it is UTF-16 or no text at all")
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding=ENCODING, newline="")
    if path.suffix == ".xz":
        return lzma.open(path, "rt", encoding=ENCODING, newline="")
    return open(path, encoding=ENCODING, newline="")


@contextmanager
def readable(path: Path, *further: type[Exception]) -> Iterator[None]:
    """Turn the exceptions of reading a broken file, and `further` ones, into one error.

    Raises:
        UserError: the file cannot be opened, decompressed or decoded.
    """
    try:
        yield
    except (*_UNREADABLE, *further) as error:
        raise UserError(f"{path}: cannot be read: {error or type(error).__name__}") from error


@contextmanager
def readable_xml(path: Path) -> Iterator[None]:
    """Turn the exceptions of reading a broken XML file into one error, with the line where there is one.

    Raises:
        UserError: the file cannot be opened, decompressed or decoded, or is malformed.
    """
    from xml.etree.ElementTree import ParseError

    try:
        with readable(path):
            yield
    except ParseError as error:
        raise UserError(f"{path}:{error.position[0]}: malformed XML: {error}") from error


def read_json(path: Path) -> Any:
    """Read a JSON file, decompressed as its suffix says.

    Raises:
        UserError: it cannot be read, or is malformed.
    """
    try:
        with readable(path), open_text(path) as file:
            return json.load(file)
    except ValueError as error:
        raise UserError(f"{path}: malformed JSON: {error}") from error
