"""The formats that can be loaded, one row each. No reader is imported before it is used."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from drlsl.errors import UserError
from drlsl.traffic.files import ENCODING, open_bytes, readable
from drlsl.traffic.road_beside import road_beside, vehicle_types_beside
from drlsl.traffic.source import Source

if TYPE_CHECKING:
    from drlsl.traffic.recording import Recording

TRACKS_FILE: Final = re.compile(r"(\d+)_tracks\.csv(?:\.gz|\.xz)?")
"""Name of the tracks of highD, exiD, inD, rounD and uniD."""

_SUFFIXES: Final = (".csv", ".csv.gz", ".csv.xz")

_FIRST: Final = 1 << 16
"""Bytes of a file by which its format is recognised; SUMO writes its configuration in front."""

NGSIM_TEXT_COLUMNS: Final = 18
"""Columns of NGSIM's text layout, which has no line of names."""


@dataclass(frozen=True, slots=True)
class Start:
    """A file's path and its beginning, in lower case, of Parquet its end, too."""

    path: Path
    head: str

    @property
    def columns(self) -> set[str]:
        """The cells of the first line, without punctuation."""
        cells = re.split(r"[,;\t]", self.head.split("\n", 1)[0].strip())
        return {re.sub(r"[-_ \"]", "", cell) for cell in cells}


@dataclass(frozen=True, slots=True)
class Format:
    """One format: what it is called, how a file of it is recognised, and who reads it.

    `reader` is MODULE:FUNCTION in this folder, from a Source to a Recording, and `parts`, if the file may
    hold several recordings, one from a Source to their names. `companions` returns the files that belong to
    the one recognised; `named_by_folder`: with them, the recording is called as their folder.
    """

    name: str
    reader: str
    is_it: Callable[[Start], bool]
    parts: str | None = None
    companions: Callable[[Path], tuple[Path, ...]] = lambda path: (path,)
    named_by_folder: bool = False


def _numbered(path: Path) -> tuple[Path, ...]:
    """Return the tracks, tracksMeta and recordingMeta files of one recording; packed like `path`, if several.

    Raises:
        UserError: one is missing.
    """
    number, _, ending = path.name.rpartition("_tracks")
    files = [path]
    for kind in ("tracksMeta", "recordingMeta"):
        endings = sorted(_SUFFIXES, key=lambda suffix: suffix != ending)
        candidates = [path.parent / f"{number}_{kind}{suffix}" for suffix in endings]
        existing = [candidate for candidate in candidates if candidate.is_file()]
        if not existing:
            raise UserError(f"{candidates[0]}: no such file, plain, .gz or .xz; the recording needs it")
        files.append(existing[0])
    return tuple(files)


def _with_road(path: Path) -> tuple[Path, ...]:
    """Return AUTOMATUM's tracks and, if it is there, its road."""
    road = path.parent / "staticWorld.xodr"
    return (path, road) if road.is_file() else (path,)


def _with_network(path: Path) -> tuple[Path, ...]:
    """Return tracks and, if it is there, the file of their road."""
    road = road_beside(path)
    return (path,) if road is None else (path, road)


def _with_network_and_types(path: Path) -> tuple[Path, ...]:
    """Return SUMO's tracks, the file of their road if it is there, and those of vehicle types."""
    return (*_with_network(path), *vehicle_types_beside(path))


def _is_tracks(start: Start) -> bool:
    return TRACKS_FILE.fullmatch(start.path.name) is not None


FORMATS: Final = (
    Format(
        "exiD, inD, rounD, uniD",
        "levelx:load_levelx",
        lambda start: _is_tracks(start) and "xcenter" in start.columns,
        companions=_numbered,
        named_by_folder=True,
    ),
    Format("highD", "highd:load_highd", _is_tracks, companions=_numbered, named_by_folder=True),
    Format(
        "SUMO FCD, CSV",
        "sumo_fcd:load_fcd",
        lambda start: "timesteptime" in start.columns,
        companions=_with_network_and_types,
    ),
    Format(
        "NGSIM, CSV", "ngsim:load_ngsim", lambda start: "vehicleid" in start.columns, parts="ngsim:part_names"
    ),
    Format(
        "SUMO FCD, Parquet",
        "sumo_fcd:load_fcd",
        lambda start: start.head.startswith("par1") and "timestep_time" in start.head,
        companions=_with_network_and_types,
    ),
    Format("Parquet of DRLSL", "parquet:load_parquet", lambda start: start.head.startswith("par1")),
    Format(
        "SUMO FCD, XML",
        "sumo_fcd:load_fcd",
        lambda start: "<fcd-export" in start.head,
        companions=_with_network_and_types,
    ),
    Format("CommonRoad", "commonroad:load_commonroad", lambda start: "<commonroad" in start.head),
    Format(
        "TGSIM",
        "tgsim:load_tgsim",
        lambda start: {"xlockf", "lanekf"} <= start.columns,
        parts="tgsim:part_names",
    ),
    Format(
        "I-24 MOTION",
        "i24:load_i24",
        lambda start: ".json" in start.path.name and '"x_position"' in start.head,
    ),
    Format(
        "AUTOMATUM",
        "automatum:load_automatum",
        lambda start: start.path.name.startswith("dynamicWorld.json"),
        companions=_with_road,
        named_by_folder=True,
    ),
    Format(
        "ASAM OSI",
        "osi:load_osi",
        lambda start: start.path.suffix in (".mcap", ".osi"),
        companions=_with_network,
    ),
    Format(
        "NGSIM, text",
        "ngsim:load_ngsim",
        lambda start: (
            "," not in start.head.split("\n", 1)[0]
            and len(start.head.split("\n", 1)[0].split()) == NGSIM_TEXT_COLUMNS
        ),
        parts="ngsim:part_names",
    ),
)


def find_format(path: Path) -> Format | None:
    """Return the format of a file, from its name and beginning; None if it is unknown.

    Raises:
        UserError: the file cannot be read.
    """
    with readable(path), open_bytes(path) as file:
        start = file.read(_FIRST)
        if start.startswith(b"PAR1"):  # its columns are named at its end
            file.seek(max(path.stat().st_size - _FIRST, 0))
            start += file.read()
        head = start.decode(ENCODING, errors="replace").lower()
    return next((row for row in FORMATS if row.is_it(Start(path, head))), None)


def read(source: Source) -> Recording:
    """Read the files of a source.

    Raises:
        UserError: they are faulty; the message names file, line and column where there are any.
    """
    row = next(row for row in FORMATS if row.name == source.format)
    recording: Recording = _function(row.reader)(source)
    return recording


def part_names(source: Source) -> tuple[str, ...]:
    """Return the names of the recordings in the file of a source; none if its format has no parts."""
    row = next(row for row in FORMATS if row.name == source.format)
    return () if row.parts is None else tuple(_function(row.parts)(source))


def _function(place: str) -> Any:
    module, name = place.split(":")
    return getattr(import_module(f"drlsl.traffic.formats.{module}"), name)
