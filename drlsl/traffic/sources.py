"""Recognise the recordings of a path, by names and first lines alone."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from drlsl.errors import UserError
from drlsl.traffic.files import UNREADABLE, open_text, unreadable

BUNDLED = Path(__file__).parent / "recordings"
"""Folder of the recordings that come with the package, one highD folder each."""

SUFFIXES = (".csv", ".csv.gz", ".csv.xz")
"""Endings of the files of a highD recording."""

NGSIM_TEXT_COLUMNS = 18
"""Columns of NGSIM's text layout, which has no line of names."""

_TRACKS_FILE = re.compile(r"(\d+)_tracks\.csv(?:\.gz|\.xz)?")


class Format(Enum):
    """Formats that can be loaded."""

    HIGHD = "highD"
    NGSIM_CSV = "NGSIM, CSV"
    NGSIM_TEXT = "NGSIM, text"


@dataclass(frozen=True, slots=True)
class Source:
    """The source of one recording.

    `files` are the tracks, tracksMeta and recordingMeta of highD, or the one table of NGSIM; `part` is the
    requested site or period of that table, None for all of it.
    """

    name: str
    format: Format
    files: tuple[Path, ...]
    part: str | None = None


def bundled_recordings() -> tuple[str, ...]:
    """Return the names of the recordings that come with the package, sorted."""
    return tuple(sorted(path.name for path in BUNDLED.iterdir() if path.is_dir()))


def find_source(path: str | Path) -> Source:
    """Return the recording that a path or the name of a bundled recording means.

    Raises:
        UserError: there is none, or there are several without a choice, or the format is unknown.
    """
    location, part = _locate(path)
    name = location.name if part is None else f"{location.name}#{part}"
    if location.is_dir():
        chosen = _choose(location, part)
        return Source(name, Format.HIGHD, _highd_files(location, chosen))
    tracks = _TRACKS_FILE.fullmatch(location.name)
    if tracks:
        return Source(
            f"{location.parent.name}#{tracks[1]}", Format.HIGHD, _highd_files(location.parent, tracks[1])
        )
    return Source(name, _table_format(location), (location,), part)


def _locate(path: str | Path) -> tuple[Path, str | None]:
    """Return the folder or file, and the part of it."""
    if str(path) in bundled_recordings():
        return BUNDLED / path, None
    if Path(path).exists():
        return Path(path), None
    stem, mark, part = str(path).rpartition("#")
    if mark and Path(stem).exists():
        return Path(stem), part
    known = ", ".join(bundled_recordings())
    raise UserError(f"{path}: no such file or folder, and no bundled recording (those are {known})")


def _choose(folder: Path, part: str | None) -> str:
    """Return the id of the chosen recording in a highD folder."""
    found = (_TRACKS_FILE.fullmatch(path.name) for path in folder.iterdir())
    parts = sorted({match[1] for match in found if match})
    if not parts:
        raise UserError(
            f"{folder}: no recording in this folder; in highD layout it has files like 01_tracks.csv"
        )
    if part is None and len(parts) > 1:
        raise UserError(
            f"{folder}: holds recordings {', '.join(parts)}; choose one, as in {folder}#{parts[0]}"
        )
    if part is not None and part not in parts:
        raise UserError(f"{folder}: no recording {part}; it holds {', '.join(parts)}")
    return parts[0] if part is None else part


def _highd_files(folder: Path, part: str) -> tuple[Path, ...]:
    """Return the tracks, tracksMeta and recordingMeta files of one recording."""
    files = []
    for kind in ("tracks", "tracksMeta", "recordingMeta"):
        candidates = [folder / f"{part}_{kind}{suffix}" for suffix in SUFFIXES]
        existing = [path for path in candidates if path.is_file()]
        if not existing:
            raise UserError(f"{candidates[0]}: no such file, plain, .gz or .xz; a highD recording needs it")
        files.append(existing[0])
    return tuple(files)


def _table_format(path: Path) -> Format:
    """Return the NGSIM layout of a file, from its first line."""
    try:
        with open_text(path) as file:
            line = file.readline(10_000)
    except UNREADABLE as error:
        raise unreadable(path, error) from error
    if not line:
        raise UserError(f"{path}: the file is empty")
    if "vehicle_id" in line.lower():
        return Format.NGSIM_CSV
    if len(line.split()) == NGSIM_TEXT_COLUMNS and "," not in line:
        return Format.NGSIM_TEXT
    raise UserError(
        f"{path}: unknown format; expected a folder or an XX_tracks.csv in highD layout, "
        f"or an NGSIM table ({NGSIM_TEXT_COLUMNS} columns of text, or CSV with a column Vehicle_ID)"
    )
