"""Load recordings by path or by the names of bundled ones."""

from __future__ import annotations

from pathlib import Path

from drlsl.traffic.cache import read_cached, write_cached
from drlsl.traffic.formats import read
from drlsl.traffic.recording import Recording
from drlsl.traffic.source import Source
from drlsl.traffic.sources import find_source, find_sources


def load_recording(path: str | Path, *, cache: bool = True) -> Recording:
    """Load a recording, its format recognised from the files.

    `path` is the name of a bundled recording (`highway-train`; write `./highway-train` for a folder of that
    name), a file in one of the formats of docs/data.md, a folder, a data set's root or a zip archive that
    holds one. Where there are several recordings, `#` and the part choose one: `highd#03`,
    `trajectories.csv#us-101`. With `cache`, a copy that loads faster is kept in the cache folder and used
    until the files change.

    Raises:
        UserError: there is no recording, or it is faulty; the message names file, line and column.
    """
    return load_source(find_source(path), cache=cache)


def load_recordings(path: str | Path, *, cache: bool = True) -> list[Recording]:
    """Load all recordings that a path means, as `find_sources` finds them.

    Raises:
        UserError: there is no recording, or one is faulty; the message names file, line and column.
    """
    return [load_source(source, cache=cache) for source in find_sources(path)]


def load_source(source: Source, *, cache: bool = True) -> Recording:
    """Load the recording of a source.

    Raises:
        UserError: it is faulty; the message names file, line and column.
    """
    if not cache:
        return read(source)
    recording = read_cached(source)
    if recording is None:
        recording = read(source)
        write_cached(source, recording)
        # Held in the file that all processes share, if there is one now.
        recording = read_cached(source) or recording
    return recording
