"""Write and read recordings as Parquet (extra `parquet`), exactly.

The rows are columns frame, vehicle, x, y, vx, vy, length and width, in SI units and about the vehicle's
centre, as in Recording; all else is JSON in the metadata of the schema.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from drlsl.errors import UserError
from drlsl.files import written_whole
from drlsl.traffic.edit import rows_of
from drlsl.traffic.packed_frames import Film
from drlsl.traffic.recording import Recording
from drlsl.traffic.recording_facts import facts_of, recording_from
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks, lanes_of_rows, pack, rounded

KEY: Final = b"drlsl"
"""Key of the schema's metadata under which the facts of a recording stand."""


def pyarrow() -> tuple[ModuleType, ModuleType]:
    """Return pyarrow and pyarrow.parquet.

    Raises:
        UserError: the extra is not installed.
    """
    try:
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise UserError(
            f"Parquet files need {error.name or 'pyarrow'}; install it with: pip install 'drlsl[parquet]'"
        ) from error
    return arrow, parquet


def write_parquet(recording: Recording, path: Path) -> None:
    """Write a recording, whole or not at all.

    Raises:
        UserError: the extra is not installed, or the file cannot be written.
    """
    arrow, parquet = pyarrow()
    tracks = rows_of(recording)
    facts = {**facts_of(recording), "frame_count": recording.frame_count}
    table = arrow.table({item.name: getattr(tracks, item.name) for item in fields(Tracks)})
    table = table.replace_schema_metadata({KEY: json.dumps(facts).encode()})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as file:
            parquet.write_table(table, file, compression="zstd")
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error}") from error


def load_parquet(source: Source) -> Recording:
    """Load a recording that write_parquet wrote.

    Raises:
        UserError: the extra is not installed, or the file is none of these.
    """
    path = source.files[0]
    table = read_table(path)
    metadata = table.schema.metadata or {}
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


def read_table(path: Path) -> Any:
    """Return the table of a Parquet file.

    Raises:
        UserError: the extra is not installed, or the file cannot be read.
    """
    arrow, parquet = pyarrow()
    try:
        return parquet.read_table(path)
    except (OSError, arrow.ArrowException) as error:
        raise UserError(f"{path}: cannot be read: {str(error).splitlines()[0]}") from error


def _film(tracks: Tracks, facts: Any, name: str) -> Film:
    lanes = recording_from({**facts, "vehicle_class": {}}, None).lanes  # type: ignore[arg-type]
    return pack(tracks, lanes_of_rows(tracks.y, lanes), name=name, frame_count=int(facts["frame_count"]))
