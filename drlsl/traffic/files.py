"""Open text files, plain or compressed."""

from __future__ import annotations

import gzip
import lzma
import zlib
from pathlib import Path
from typing import IO

from drlsl.errors import UserError

UNREADABLE = (OSError, EOFError, UnicodeDecodeError, lzma.LZMAError, zlib.error)
"""Exceptions of opening, decompressing or decoding a broken file."""

ENCODING = "utf-8-sig"
"""UTF-8, with or without a byte order mark."""


def open_text(path: Path) -> IO[str]:
    """Open a text file for reading, decompressed as its suffix says."""
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding=ENCODING, newline="")
    if path.suffix == ".xz":
        return lzma.open(path, "rt", encoding=ENCODING, newline="")
    return open(path, encoding=ENCODING, newline="")


def unreadable(path: Path, error: BaseException) -> UserError:
    """Return the error for a file that cannot be opened, decompressed or decoded."""
    return UserError(f"{path}: cannot be read: {error or type(error).__name__}")
