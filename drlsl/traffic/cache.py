"""Keep loaded recordings as arrays, so that the next load is quick."""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from pathlib import Path
from typing import IO

import numpy as np

from drlsl.files import cache_folder, written_whole
from drlsl.traffic.recording import EMPTY_SLOT, Frames, Recording
from drlsl.traffic.recording_facts import facts_of, recording_from
from drlsl.traffic.source import Source

LOADER_VERSION = 5
"""Version of the cache: raise it whenever a loader reads the same files differently or the layout changes."""

SAMPLE = 1 << 16
"""Bytes at either end of a file that go into its fingerprint, besides its size and time of change."""

SUM = 8
"""Bytes of the checksum, which comes first."""

PIECE = 1 << 24
"""Bytes that are added up at once."""

BROKEN = (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError)
"""Exceptions of reading a damaged cache file."""


def read_cached(source: Source) -> Recording | None:
    """Return the recording's cached copy; None if there is none or the files have changed since.

    Warns: if the copy is damaged; it then counts as absent.
    """
    path = _cache_file(source)
    try:
        with open(path, "rb") as file:
            known = file.read(SUM)
            if known.startswith(np.lib.format.MAGIC_PREFIX):
                return None  # from a version that kept its checksum elsewhere
            # Check before use: the layout of the arrays is read from the same file.
            if known != _checksum(file):
                raise ValueError("the checksum is wrong")
            file.seek(SUM)
            facts = json.loads(str(np.load(file, allow_pickle=False)))
            if facts["fingerprint"] != _fingerprint(source):
                return None
            arrays = {name: np.load(file, allow_pickle=False) for name in EMPTY_SLOT}
            return recording_from(facts, Frames(**arrays))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except BROKEN as error:
        warnings.warn(f"{path}: damaged cache file, rebuilt ({error})", stacklevel=3)
        return None


def write_cached(source: Source, recording: Recording) -> None:
    """Keep a copy for read_cached, whole or not at all: checksum, facts as JSON, each array of Frames.

    Warns: if the cache folder cannot be written; nothing else depends on it.
    """
    facts = {"fingerprint": _fingerprint(source), **facts_of(recording)}
    arrays = [np.array(json.dumps(facts)), *(getattr(recording.frames, name) for name in EMPTY_SLOT)]
    path = _cache_file(source)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as file:
            file.write(bytes(SUM))
            for array in arrays:
                np.save(file, array)
            file.seek(SUM)
            checksum = _checksum(file)
            file.seek(0)
            file.write(checksum)
    except OSError as error:
        warnings.warn(f"{path.parent}: recordings cannot be cached there ({error})", stacklevel=3)


def _checksum(file: IO[bytes]) -> bytes:
    """Return the sum of all following words of 64 bits; CRC-32 would take longer than loading."""
    total = 0
    while piece := file.read(PIECE):
        words = np.frombuffer(piece.ljust(-(-len(piece) // SUM) * SUM, b"\0"), dtype="<u8")
        total += int(np.add.reduce(words))
    return (total % 2**64).to_bytes(SUM, "little")


def _cache_file(source: Source) -> Path:
    """Return the one file of a source, wherever it is, so that a changed source replaces its old copy."""
    where = "\n".join([source.name, source.part or "", *(str(path.resolve()) for path in source.files)])
    readable = re.sub(r"[^\w.-]+", "-", source.name)[:60]
    return cache_folder() / f"{readable}-{hashlib.sha256(where.encode()).hexdigest()[:16]}.npy"


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
