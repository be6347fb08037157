"""Keep loaded recordings in files that are mapped into memory: quick to load, and shared by processes."""

from __future__ import annotations

import hashlib
import json
import math
import mmap
import os
import re
import warnings
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from drlsl.files import cache_folder, make_room, written_whole
from drlsl.traffic.packed_frames import Film
from drlsl.traffic.recording import Recording
from drlsl.traffic.recording_facts import facts_of, recording_from
from drlsl.traffic.source import Source

LOADER_VERSION = 7
"""Version of the cache: raise it whenever a loader reads the same files differently or the layout changes."""

SAMPLE = 1 << 16
"""Bytes at either end of a file that go into its fingerprint, besides its size and time of change."""

FOLDER = "recordings"
"""Folder of these files in the cache folder."""

SUM = 8
"""Bytes of the checksum, which comes first."""

HEAD = 64
"""Bytes before the first array; the facts are filled up to a multiple, so that numbers lie where they may."""

ARRAYS = ("cells", "pieces")
"""The arrays of a film, in the order of the file."""

BROKEN = (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError)
"""Exceptions of reading a damaged cache file."""


def read_cached(source: Source) -> Recording | None:
    """Return the recording's cached copy; None if there is none or the files have changed since.

    Its film is the file itself, mapped into memory. It is checked here, whole, and may be replaced or deleted
    meanwhile: who has mapped a file keeps it.

    Warns: if the copy is damaged; it then counts as absent.
    """
    path = _cache_file(source)
    try:
        with open(path, "rb") as file:
            known = file.read(HEAD)[:SUM]
            content = np.frombuffer(_in_memory(file), dtype=np.uint8)
            # Check before use: the layout of the arrays is read from the same file.
            if known != _checksum(content):
                raise ValueError("the checksum is wrong")
            file.seek(HEAD)
            facts = json.loads(np.load(file, allow_pickle=False).tobytes())
            if facts["fingerprint"] != _fingerprint(source):
                return None
            film = Film(*(_mapped(file, content) for _ in ARRAYS))
        with suppress(OSError):
            os.utime(path)  # the time of its last use, by which `make_room` chooses
        return recording_from(facts, film)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except BROKEN as error:
        warnings.warn(f"{path}: damaged cache file, rebuilt ({error})", stacklevel=3)
        return None


def write_cached(source: Source, recording: Recording) -> None:
    """Keep a copy for read_cached, whole or not at all: checksum, facts as JSON, each array of the film.

    Warns: if the cache folder cannot be written; nothing else depends on it.
    """
    facts = json.dumps({"fingerprint": _fingerprint(source), **facts_of(recording)}).encode()
    facts += b" " * (-len(facts) % HEAD)
    whole = BytesIO()
    whole.write(bytes(HEAD))
    np.save(whole, np.frombuffer(facts, dtype=np.uint8))
    for name in ARRAYS:
        np.save(whole, getattr(recording.film, name))
    whole.write(bytes((HEAD - whole.tell()) % SUM))
    content = whole.getbuffer()
    content[:SUM] = _checksum(np.frombuffer(content, dtype=np.uint8))
    path = _cache_file(source)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        make_room()
        with written_whole(path) as file:
            # At once: what is written in small pieces stays in small pages.
            file.write(content)
    except OSError as error:
        warnings.warn(
            f"{path.parent}: recordings cannot be cached there ({error.strerror or error})", stacklevel=3
        )


def _in_memory(file: IO[bytes]) -> mmap.mmap:
    """Return a file as memory that all processes share, if possible in large pages.

    Egos read places far apart in the films of many recordings, and a processor remembers where some thousand
    pages are: to look others up takes it longer than to read them.

    Raises:
        ValueError: the file is empty.
    """
    memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    if hasattr(mmap, "MADV_HUGEPAGE"):
        with suppress(OSError):  # a kernel built without them
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory


def _mapped(file: IO[bytes], content: npt.NDArray[np.uint8]) -> npt.NDArray[np.int32]:
    """Return the array of the file's `content` that begins where the file stands, and move on behind it."""
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("an array of another version")
    shape, _, kind = np.lib.format.read_array_header_1_0(file)
    begin, size = file.tell(), math.prod(shape) * kind.itemsize
    if begin % kind.itemsize:
        raise ValueError("an array does not begin at a number")
    file.seek(begin + size)
    return content[begin : begin + size].view(kind).reshape(shape)


def _checksum(content: npt.NDArray[np.uint8]) -> bytes:
    """Return the sum of all words of 64 bits behind the head; CRC-32 would take longer than loading.

    That maps all pages, too, so that driving does not stop for them.
    """
    return int(np.add.reduce(content[HEAD:].view("<u8"))).to_bytes(SUM, "little")


def _cache_file(source: Source) -> Path:
    """Return the one file of a source, wherever it is, so that a changed source replaces its old copy."""
    where = "\n".join([source.name, source.part or "", *(str(path.resolve()) for path in source.files)])
    readable = re.sub(r"[^\w.-]+", "-", source.name)[:60]
    return cache_folder() / FOLDER / f"{readable}-{hashlib.sha256(where.encode()).hexdigest()[:16]}.film"


def _fingerprint(source: Source) -> str:
    """Return a digest that changes when the files or the loader do."""
    digest = hashlib.sha256(f"{LOADER_VERSION}".encode())
    for path in source.files:
        with open(path, "rb") as file:
            status = os.fstat(file.fileno())
            digest.update(f"\n{status.st_size} {status.st_mtime_ns}\n".encode())
            digest.update(file.read(SAMPLE))
            file.seek(max(status.st_size - SAMPLE, 0))
            digest.update(file.read(SAMPLE))
    return digest.hexdigest()
