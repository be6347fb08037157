"""Labelled lane changes kept in the cache folder, by the digest of all that they are a function of."""

from __future__ import annotations

import hashlib
import io
import json
import warnings
import zipfile
from collections.abc import Generator, Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.driving import EnvConfig
from drlsl.driving.scene import Road, SceneBatch
from drlsl.files import cache_folder, write_atomic
from drlsl.induction.lane_changes.labelled_changes import (
    SHARE,
    WATCHED,
    Changes,
    Labelling,
    labelled,
    labelling_shield,
)
from drlsl.traffic import Direction, Lane, Recording
from drlsl.version import __version__

_BROKEN: Final = (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile)


def cached_changes(how: Labelling, bias: str, recording: Recording) -> Generator[int, None, Changes]:
    """Yield and return what `labelled` does, or return it at once from the cache folder if it is there.

    A damaged or unwritable file is a warning, and the lane changes are driven again.
    """
    path = cache_folder() / "labels" / f"{_digest(how, bias, recording)}.npz"
    if path.is_file():
        try:
            return _read(path)
        except _BROKEN as error:
            warnings.warn(f"{path}: damaged cache file, labelled again ({error})", stacklevel=2)
    changes = yield from labelled(how, bias, recording)
    content = io.BytesIO()
    np.savez_compressed(content, **dict(_arrays(changes)))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, content.getvalue())
    except OSError as error:
        warnings.warn(f"{path}: labels cannot be kept there ({error.strerror or error})", stacklevel=2)
    return changes


def _digest(how: Labelling, bias: str, recording: Recording) -> str:
    """Return the digest of the version, the settings, the text of all rules, and the recording."""
    config = EnvConfig(recording=recording.name).model_dump(mode="json")
    facts = {
        "version": __version__,
        "how": asdict(how),
        "watched": [WATCHED, SHARE],
        "config": config,
        "lanes": [_lane(lane) for lane in recording.lanes],
        "rest": [
            recording.name,
            recording.frame_rate,
            recording.x_min,
            recording.x_max,
            recording.traffic.value,
        ],
    }
    total = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
    for file in labelling_shield(bias, tier="interpreter").files():
        if file.is_file():
            total.update(file.read_bytes())
    for _, array in recording.frames.arrays():
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()[:32]


def _lane(lane: Lane) -> dict[str, Any]:
    return {**asdict(lane), "direction": lane.direction.value}


def _arrays(changes: Changes) -> Iterator[tuple[str, Any]]:
    roads = [{**asdict(road), "lanes": [_lane(lane) for lane in road.lanes]} for road in changes.scenes.roads]
    facts = {"roads": roads, "origin": list(changes.origin), "left_out": dict(changes.left_out)}
    yield "facts", np.array(json.dumps(facts))
    yield "side", changes.side
    yield "unsafe", changes.unsafe
    for one in fields(SceneBatch):
        if one.name != "roads":
            yield f"scenes_{one.name}", getattr(changes.scenes, one.name)


def _read(path: Path) -> Changes:
    with np.load(path, allow_pickle=False) as stored:
        facts = json.loads(str(stored["facts"]))
        columns = {
            one.name: stored[f"scenes_{one.name}"] for one in fields(SceneBatch) if one.name != "roads"
        }
        side, unsafe = stored["side"], stored["unsafe"]
    roads = tuple(
        Road(**{**road, "lanes": tuple(_lane_of(lane) for lane in road["lanes"])}) for road in facts["roads"]
    )
    return Changes(
        SceneBatch(roads=roads, **columns), side, unsafe, tuple(facts["origin"]), facts["left_out"]
    )


def _lane_of(values: dict[str, Any]) -> Lane:
    return Lane(**{**values, "direction": Direction(values["direction"])})
