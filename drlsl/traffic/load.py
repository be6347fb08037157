"""One way in: load a recording by path or by the name of a bundled one."""

from __future__ import annotations

from pathlib import Path

from drlsl.errors import UserError
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
    location, part = _locate(path)
    return _parse(location, part)


def _locate(path: str | Path) -> tuple[Path, str | None]:
    """The folder or file meant, and the part of it."""
    if str(path) in bundled_recordings():
        return BUNDLED / path, None
    if Path(path).exists():
        return Path(path), None
    stem, mark, part = str(path).rpartition("#")
    if mark and Path(stem).exists():
        return Path(stem), part
    known = ", ".join(bundled_recordings())
    raise UserError(f"{path}: no such file or folder, and no bundled recording ({known})")


def _parse(location: Path, part: str | None) -> Recording:
    """Read the files themselves."""
    from drlsl.traffic.highd import highd_parts, load_highd, part_of_tracks_file
    from drlsl.traffic.ngsim import load_ngsim, ngsim_layout

    name = location.name if part is None else f"{location.name}#{part}"
    if location.is_dir():
        parts = highd_parts(location)
        if not parts:
            raise UserError(
                f"{location}: no recording in this folder; highD layout has files like 01_tracks.csv"
            )
        if part is None and len(parts) > 1:
            raise UserError(
                f"{location}: holds recordings {', '.join(parts)}; choose one, as in {location}#{parts[0]}"
            )
        if part is not None and part not in parts:
            raise UserError(f"{location}: no recording {part}; it holds {', '.join(parts)}")
        return load_highd(location, part or parts[0], name=name)
    tracks_of = part_of_tracks_file(location)
    if tracks_of is not None:
        return load_highd(location.parent, tracks_of, name=name)
    layout = ngsim_layout(location)
    if layout is None:
        raise UserError(
            f"{location}: unknown format; expected a folder or an XX_tracks.csv in highD layout, "
            "or an NGSIM table (18 columns of text, or CSV with a column Vehicle_ID)"
        )
    return load_ngsim(location, layout, part, name=name)
