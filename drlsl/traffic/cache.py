"""Keep loaded recordings as arrays, so that the next load is quick."""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from drlsl.traffic.recording import EMPTY_SLOT, Dropped, Frames, Recording, VehicleClass
from drlsl.traffic.road import Direction, Lane
from drlsl.traffic.sources import Source

LOADER_VERSION = 1
"""Raise this whenever a loader would read the same files differently, or the layout below changes."""

SAMPLE = 1 << 16
"""Bytes at either end of a file that go into its fingerprint, besides its size and time of change."""

BROKEN = (OSError, EOFError, ValueError, KeyError, TypeError, IndexError, zipfile.BadZipFile, zlib.error)
"""What reading a damaged cache file raises."""


def cache_folder() -> Path:
    """Where cached recordings lie: DRLSL_CACHE where set, else the platform's folder for caches."""
    chosen = os.environ.get("DRLSL_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "drlsl" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "drlsl"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "drlsl"


def read_cached(source: Source) -> Recording | None:
    """The recording as loaded before; None where there is no such copy or the files have changed since.

    Warns: where the copy is damaged, in which case it counts as absent.
    """
    path = _cache_file(source)
    try:
        with np.load(path, allow_pickle=False) as stored:
            facts = json.loads(str(stored["facts"]))
            if facts["fingerprint"] != _fingerprint(source):
                return None
            arrays = _padded(tuple(facts["shape"]), stored)
            kinds = [VehicleClass(kind) for kind in facts["classes"]]
            codes = dict(zip(stored["vehicles"].tolist(), stored["codes"].tolist(), strict=True))
        classes = {vehicle: kinds[code] for vehicle, code in codes.items()}
        return _recording(facts, arrays, classes)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except BROKEN as error:
        warnings.warn(f"{path}: damaged cache file, rebuilt ({error})", stacklevel=3)
        return None


def write_cached(source: Source, recording: Recording) -> None:
    """Keep a copy for read_cached, whole or not at all.

    Warns: where the cache folder cannot be written; nothing else depends on it.
    """
    classes = [kind.value for kind in VehicleClass]
    facts = {
        "fingerprint": _fingerprint(source),
        "name": recording.name,
        "frame_rate": recording.frame_rate,
        "lanes": [{**asdict(lane), "direction": lane.direction.value} for lane in recording.lanes],
        "x_min": recording.x_min,
        "x_max": recording.x_max,
        "dropped": [asdict(item) for item in recording.dropped],
        "notes": recording.notes,
        "classes": classes,
        "shape": recording.frames.valid.shape,
    }
    present = recording.frames.valid
    arrays: dict[str, Any] = {
        "facts": np.array(json.dumps(facts)),
        "vehicles": np.array(list(recording.vehicle_class), dtype=np.int32),
        "codes": np.array(
            [classes.index(kind.value) for kind in recording.vehicle_class.values()], dtype=np.int8
        ),
        "cells": np.flatnonzero(present).astype(np.int32),
        **{name: array[present] for name, array in recording.frames.arrays() if name != "valid"},
    }
    path = _cache_file(source)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
            try:
                np.savez(file, **arrays)
                file.close()
                os.replace(file.name, path)
            except BaseException:
                file.close()
                Path(file.name).unlink(missing_ok=True)
                raise
    except OSError as error:
        warnings.warn(f"{path.parent}: recordings cannot be cached there ({error})", stacklevel=3)


def _padded(shape: tuple[int, int], stored: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """The arrays of Frames from the values of the slots that hold a vehicle, all that is stored."""
    valid = np.zeros(shape[0] * shape[1], dtype=np.bool_)
    valid[stored["cells"]] = True
    full, empty = np.flatnonzero(valid), np.flatnonzero(~valid)
    arrays: dict[str, npt.NDArray[Any]] = {"valid": valid.reshape(shape)}
    for name in EMPTY_SLOT.keys() - arrays.keys():
        values = stored[name]
        array = np.empty(len(valid), dtype=values.dtype)
        array[full], array[empty] = values, EMPTY_SLOT[name]
        arrays[name] = array.reshape(shape)
    return arrays


def _recording(facts: dict[str, Any], arrays: dict[str, Any], classes: dict[int, VehicleClass]) -> Recording:
    lanes = tuple(Lane(**{**lane, "direction": Direction(lane["direction"])}) for lane in facts["lanes"])
    return Recording(
        name=facts["name"],
        frame_rate=facts["frame_rate"],
        lanes=lanes,
        x_min=facts["x_min"],
        x_max=facts["x_max"],
        frames=Frames(**arrays),
        vehicle_class=classes,
        dropped=tuple(Dropped(**item) for item in facts["dropped"]),
        notes=tuple(facts["notes"]),
    )


def _cache_file(source: Source) -> Path:
    """One file for each source, wherever it lies, so that a changed source replaces its old copy."""
    where = "\n".join([source.name, source.part or "", *(str(path.resolve()) for path in source.files)])
    readable = re.sub(r"[^\w.-]+", "-", source.name)[:60]
    return cache_folder() / f"{readable}-{hashlib.sha256(where.encode()).hexdigest()[:16]}.npz"


def _fingerprint(source: Source) -> str:
    """Changes when the files or the loader do."""
    digest = hashlib.sha256(f"{LOADER_VERSION}".encode())
    for path in source.files:
        with open(path, "rb") as file:
            status = os.fstat(file.fileno())
            digest.update(f"\n{status.st_size} {status.st_mtime_ns}\n".encode())
            digest.update(file.read(SAMPLE))
            file.seek(max(status.st_size - SAMPLE, 0))
            digest.update(file.read(SAMPLE))
    return digest.hexdigest()
