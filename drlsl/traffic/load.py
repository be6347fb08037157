"""One way in: load a recording by path or by the name of a bundled one."""

from __future__ import annotations

from pathlib import Path

from drlsl.traffic.recording import Recording

BUNDLED = Path(__file__).parent / "recordings"
"""Folder of the recordings that come with the package, one highD folder each."""


def bundled_recordings() -> tuple[str, ...]:
    """Names of the recordings that come with the package, sorted."""
    return tuple(sorted(path.name for path in BUNDLED.iterdir() if path.is_dir()))


def load_recording(path: str | Path, *, cache: bool = True) -> Recording:
    """Load a recording, its format recognised from the files.

    `path` is the name of a bundled recording (`highway-train`; write `./highway-train` for a folder of that
    name), a folder in highD layout, one of its `XX_tracks.csv` files, or an NGSIM table as text or CSV. Where
    a folder or file holds several recordings, `#` and the part choose one: `highd#03`,
    `trajectories.csv#us-101`.

    Raises: UserError where nothing is found there, or that names file, line and column of what is wrong in
        it.
    """
    from drlsl.traffic.highd import highd_parts, load_highd

    location = BUNDLED / path if str(path) in bundled_recordings() else Path(path)
    parts = highd_parts(location)
    return load_highd(location, parts[0], name=location.name)
