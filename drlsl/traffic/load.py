"""Load a recording by path or by the name of a bundled one."""

from __future__ import annotations

from pathlib import Path

from drlsl.traffic.cache import read_cached, write_cached
from drlsl.traffic.recording import Recording
from drlsl.traffic.sources import Format, Source, bundled_recordings, find_source

__all__ = ["bundled_recordings", "load_recording"]


def load_recording(path: str | Path, *, cache: bool = True) -> Recording:
    """Load a recording, its format recognised from the files.

    `path` is the name of a bundled recording (`highway-train`; write `./highway-train` for a folder of that
    name), a folder in highD layout, one of its `XX_tracks.csv` files, or an NGSIM table as text or CSV. Where
    a folder or file holds several recordings, `#` and the part choose one: `highd#03`,
    `trajectories.csv#us-101`. With `cache`, a copy that loads faster is kept in the cache folder and used
    until the files change.

    Raises:
        UserError: there is no recording, or it is faulty; the message names file, line and column.
    """
    source = find_source(path)
    recording = read_cached(source) if cache else None
    if recording is None:
        recording = _parse(source)
        if cache:
            write_cached(source, recording)
    return recording


def _parse(source: Source) -> Recording:
    """Read the source files."""
    # pandas, which only the readers need, takes longer to import than a cached recording takes to load.
    if source.format is Format.HIGHD:
        from drlsl.traffic.highd import load_highd

        return load_highd(source)
    from drlsl.traffic.ngsim import load_ngsim

    return load_ngsim(source)
