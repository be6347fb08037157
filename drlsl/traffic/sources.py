"""Find the recordings of a path, by names and beginnings of files alone."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from glob import glob
from pathlib import Path

from drlsl.errors import UserError
from drlsl.traffic.archive import unpacked
from drlsl.traffic.formats import FORMATS, find_format, part_names
from drlsl.traffic.source import EPISODE, Source, is_pattern, matching

BUNDLED = Path(__file__).parent / "recordings"
"""Folder of the recordings that come with the package, one highD folder each."""

DEEPEST = 3
"""Folders below the named one in which recordings are looked for: a data set may have them in `data`."""

NUMBERED = "its files are called 01_tracks.csv, 01_tracksMeta.csv and 01_recordingMeta.csv"

TABLES = (".csv", ".txt", ".json", ".xml", ".parquet", ".mcap", ".osi")
"""Endings of the files that are looked at in a folder."""


def bundled_recordings() -> tuple[str, ...]:
    """Return the names of the recordings that come with the package, sorted."""
    return tuple(sorted(path.name for path in BUNDLED.iterdir() if path.is_dir()))


def find_source(path: str | Path) -> Source:
    """Return the one recording that a path or the name of a bundled recording means.

    Raises:
        UserError: there is none, or there are several, or the format is unknown.
    """
    found = find_sources(path)
    if len(found) > 1:
        stem, _ = _split(path)
        names = [_name_alone(stem, source) for source in found[:12]]
        listed = ", ".join(name.removeprefix(f"{stem}#") for name in names) + (
            ", …" if len(found) > 12 else ""
        )
        raise UserError(f"{path}: holds recordings {listed}; choose one, as in {names[0]}")
    return found[0]


def find_sources(path: str | Path) -> list[Source]:
    """Return all recordings that a path means, in the order of their names.

    A path is the name of a bundled recording, a file, a folder with recordings, the root of a data set or a
    zip archive of one, or a pattern of such paths (`data/*_tracks.csv`). After `#` comes a part of it, or a
    pattern of parts.

    Raises:
        UserError: there is none, or the format is unknown.
    """
    stem, part = _split(path)
    if is_pattern(stem) and not Path(stem).exists():
        paths = sorted(glob(stem))
        if not paths:
            raise UserError(f"{path}: no file or folder is called so")
        return [one for each in paths for one in find_sources(f"{each}#{part}" if part else each)]
    location, part = _locate(path)
    place = unpacked(location) if location.suffix == ".zip" and location.is_file() else location
    if place.is_dir():
        return _in_folder(location, place, part)
    return _in_file(location, part)


def recording_names(path: str | Path) -> list[str]:
    """Return a name for each recording that a path means, by which `find_source` finds it alone.

    Raises:
        UserError: there is none, or the format is unknown.
    """
    sources = find_sources(path)
    if len(sources) == 1:
        return [str(path)]
    return [_name_alone(_split(path)[0], source) for source in sources]


def _split(path: str | Path) -> tuple[str, str | None]:
    """Return the path of what is there, and the part of it; names of files and parts may have a # in them."""
    whole = str(path)
    marks = [at for at, mark in enumerate(whole) if mark == "#"]
    for stem, part in ((whole, None), *((whole[:at], whole[at + 1 :]) for at in reversed(marks))):
        if (part is None and stem in bundled_recordings()) or (stem and Path(stem).exists()):
            return stem, part
    stem, mark, part = whole.partition("#")
    return stem, part if mark else None


def _name_alone(stem: str, source: Source) -> str:
    """Return the name of one of the recordings that `stem` means: a part of it, else its own file."""
    name = stem + source.name.removeprefix(Path(stem).name)
    if Path(stem).exists() and [one.files for one in find_sources(name)] == [source.files]:
        return name
    return str(source.files[0]) if source.part is None else f"{source.files[0]}#{source.part}"


def _locate(path: str | Path) -> tuple[Path, str | None]:
    """Return the folder or file, and the part of it."""
    stem, part = _split(path)
    if part is None and stem in bundled_recordings():
        return BUNDLED / stem, None
    if stem and Path(stem).exists():
        return Path(stem), part
    known = ", ".join(bundled_recordings())
    named = str(path) or "an empty name"
    raise UserError(f"{named}: no such file or folder, and no bundled recording (those are {known})")


def _in_file(location: Path, part: str | None) -> list[Source]:
    """Return the recordings of one file."""
    if _is_episode(location):
        raise UserError(f"{location}: no recording, but {EPISODE}")
    row = find_format(location)
    if row is None:
        raise _unknown(location)
    files = row.companions(location)
    name = (
        f"{location.parent.name}#{_own_part(location)}"
        if row.named_by_folder and len(files) > 1
        else location.name
    )
    source = Source(name, row.name, files)
    if part is None:
        return [source]
    if row.parts is None:
        raise UserError(f"{location}: {row.name} has no parts to choose from, but #{part} is asked for")
    if not is_pattern(part):
        return [replace(source, name=f"{name}#{part}", part=part)]
    parts = part_names(source)
    chosen = matching(part, parts)
    if not chosen:
        raise UserError(f"{location}: has no part {part!r}; it holds {', '.join(parts) or 'one recording'}")
    return [replace(source, name=f"{name}#{one}", part=one) for one in chosen]


def _is_episode(path: Path) -> bool:
    """Return whether a file is an episode's archive: people keep other arrays in such files, too."""
    if path.suffix != ".npz":
        return False
    with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        return "header.npy" in archive.namelist()
    return False


def _in_folder(location: Path, folder: Path, part: str | None) -> list[Source]:
    """Return the recordings of a folder; `location` is what the user called it."""
    found = _sources_below(folder)
    if not found:
        if any(map(_is_episode, folder.glob("*.npz"))):
            raise UserError(f"{location}: no recordings, but episodes, which `drlsl view` shows")
        raise UserError(
            f"{location}: no recording in this folder; in highD layout it has files like 01_tracks.csv, and "
            f"known formats are {_known()}"
        )
    labels = _labels(found, folder)
    if part is not None:
        chosen = matching(part, labels)
        if not chosen:
            raise UserError(f"{location}: no recording {part}; it holds {', '.join(labels)}")
    elif len(found) == 1:
        return [replace(found[0], name=location.name)]
    else:
        chosen = labels
    return [
        replace(source, name=f"{location.name}#{label}")
        for source, label in zip(found, labels, strict=True)
        if label in chosen
    ]


def _sources_below(folder: Path, depth: int = DEEPEST) -> list[Source]:
    """Return the recordings in a folder or, if there are none, in those below it."""
    entries = sorted(folder.iterdir())
    found = []
    for path in entries:
        if path.is_file() and path.with_suffix("").suffix + path.suffix in _endings(path):
            row = find_format(path)
            if row is not None and not path.name.startswith("."):
                found.append(Source(path.name, row.name, row.companions(path)))
    if found or depth == 0:
        return found
    below = [path for path in entries if path.is_dir() and not path.name.startswith(".")]
    return [source for path in below for source in _sources_below(path, depth - 1)]


def _endings(path: Path) -> set[str]:
    """Return the last two suffixes of a path, if files of such names are looked at."""
    last = path.with_suffix("").suffix + path.suffix
    packed = path.suffix in (".gz", ".xz")
    return {last} if (path.with_suffix("").suffix if packed else path.suffix) in TABLES else set()


def _label(source: Source) -> str:
    """Return the part that chooses a recording of several."""
    return source.part or _own_part(source.files[0])


def _labels(sources: Sequence[Source], folder: Path) -> list[str]:
    """Return the parts of a folder that choose each recording; where some are alike, with their folders."""
    labels = [_label(source) for source in sources]
    paths = [source.files[0].relative_to(folder) for source in sources]
    below = [(path.parent / label).as_posix() for path, label in zip(paths, labels, strict=True)]
    for longer in (below, [path.as_posix() for path in paths]):
        labels = [
            label if labels.count(label) == 1 else other for label, other in zip(labels, longer, strict=True)
        ]
    return labels


def _own_part(path: Path) -> str:
    number = path.name.split("_tracks.csv")[0]
    return number if number != path.name else path.name


def _known() -> str:
    return "; ".join(row.name for row in FORMATS)


def _unknown(path: Path) -> UserError:
    """Return the error for a file of no known format, which says what it looks like."""
    from drlsl.traffic.files import open_text, readable

    with readable(path), open_text(path) as file:
        start = file.read(10_000)
    line = start.partition("\n")[0]
    if not start:
        return UserError(f"{path}: the file is empty")
    seen: Sequence[tuple[str, str]] = (
        ("xcenter", f"columns of exiD; {NUMBERED}"),
        ("xvelocity", f"columns of highD; {NUMBERED}"),
        ("<!doctype html", "a page of a web site, no data"),
        ("git-lfs", "a pointer of Git LFS, no data; fetch it with git lfs pull"),
    )
    if '"ego"' in start and '"road"' in start:
        return UserError(f"{path}: no recording, but a scene, which `drlsl query --state {path}` reads")
    for mark, what in seen:
        if mark in line.lower():
            return UserError(f"{path}: unknown format; it looks like {what}")
    return UserError(f"{path}: unknown format; expected a folder or a file of {_known()}")
