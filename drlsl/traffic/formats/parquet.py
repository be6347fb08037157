"""Write and read recordings as Parquet (extra `parquet`), exactly.

The rows are columns frame, vehicle, x, y, vx, vy, length and width, in SI units and about the vehicle's
centre, as in Recording; all else is JSON in the metadata of the schema.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

from drlsl.errors import UserError
from drlsl.files import read_table, write_table
from drlsl.traffic.edit import rows_of
from drlsl.traffic.packed_frames import Film
from drlsl.traffic.recording import Recording
from drlsl.traffic.recording_facts import facts_of, recording_from
from drlsl.traffic.source import EPISODE, Source
from drlsl.traffic.tracks import Tracks, lanes_of_rows, pack, rounded

KEY: Final = b"drlsl"
"""Key of the schema's metadata under which the facts of a recording stand."""


def write_parquet(recording: Recording, path: Path) -> None:
    """Write a recording, whole or not at all.

    Raises:
        UserError: the extra is not installed, or the file cannot be written.
    """
    tracks = rows_of(recording)
    facts = {**facts_of(recording), "frame_count": recording.frame_count}
    write_table(path, {item.name: getattr(tracks, item.name) for item in fields(Tracks)}, KEY, facts)


def load_parquet(source: Source) -> Recording:
    """Load a recording that write_parquet wrote.

    Raises:
        UserError: the extra is not installed, or the file is none of these.
    """
    path = source.files[0]
    table = read_table(path)
    metadata = table.schema.metadata or {}
    if any(key.startswith(KEY + b" ") for key in metadata):  # the facts of something else of ours
        raise UserError(f"{path}: no recording, but {EPISODE}")
    if KEY not in metadata:
        raise UserError(
            f"{path}: a Parquet file without the facts of a recording, with columns "
            f"{', '.join(table.column_names[:8])}; expected one of drlsl data convert, or SUMO's FCD"
        )
    try:
        facts = json.loads(metadata[KEY])
        columns = {item.name: table.column(item.name).to_numpy() for item in fields(Tracks)}
        recording = recording_from(facts, _film(rounded(Tracks(**columns)), facts, source.name))
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(f"{path}: damaged: {error}") from error
    recording.validate()
    return recording


def _film(tracks: Tracks, facts: Any, name: str) -> Film:
    lanes = recording_from({**facts, "vehicle_class": {}}, None).lanes  # type: ignore[arg-type]
    return pack(tracks, lanes_of_rows(tracks.y, lanes), name=name, frame_count=int(facts["frame_count"]))
