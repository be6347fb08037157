"""Episodes in files: NumPy archives (.npz) of arrays, or Parquet (.parquet, extra `parquet`).

`numpy.load(FILE)["header"].item()` is the header, in JSON; the other arrays are described in
`episode_arrays`. Parquet has a row for each frame, described in `episode_table`.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.episodes.driven_episode import Episode
from drlsl.driving.episodes.episode_arrays import arrays_of, episode_from
from drlsl.driving.episodes.episode_table import has_header, read_arrays, write_arrays
from drlsl.errors import UserError
from drlsl.files import write_atomic

SUFFIX: Final = ".npz"

PARQUET: Final = ".parquet"

SUFFIXES: Final = (SUFFIX, PARQUET)
"""Endings of the files of episodes."""


def episode_files(folder: Path) -> list[Path]:
    """Return the files of a folder that are those of episodes, sorted.

    Raises:
        UserError: a Parquet file is there that cannot be read.
    """
    return sorted(path for path in folder.glob("*") if is_episode(path))


def is_episode(path: Path) -> bool:
    """Return whether a file is called as that of an episode is; a recording may be Parquet, too.

    Raises:
        UserError: a Parquet file cannot be read.
    """
    return path.suffix == SUFFIX or (path.suffix == PARQUET and path.is_file() and has_header(path))


def save_episode(path: Path, episode: Episode) -> None:
    """Write an episode to a file, as its ending says; equal episodes are equal files.

    Raises:
        UserError: it cannot be written, or the ending is none of an episode.
    """
    if path.suffix not in SUFFIXES:
        raise UserError(f"{path}: an episode is written to a file that ends in {' or '.join(SUFFIXES)}")
    arrays = arrays_of(episode)
    if path.suffix == PARQUET:
        write_arrays(path, arrays)
        return
    content = io.BytesIO()
    # Its stubs do not know that the names of arrays may be any.
    save: Callable[..., None] = np.savez_compressed
    save(content, **arrays)
    write_atomic(path, content.getvalue())


def load_episode(path: str | Path) -> Episode:
    """Read an episode from a file.

    Raises:
        UserError: the file cannot be read, or is no episode.
    """
    place = Path(path)
    return episode_from(read_arrays(place) if place.suffix == PARQUET else _archived(place), path)


def _archived(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a NumPy archive.

    Raises:
        UserError: the file cannot be read, or is no archive of an episode.
    """
    try:
        with open(path, "rb") as file:
            if not zipfile.is_zipfile(file):
                raise UserError(
                    f"{path}: not an episode, which is an .npz archive; "
                    "drlsl eval --episodes-out writes episodes"
                )
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
    except OSError as error:
        raise UserError(f"cannot read the episode {path}: {error.strerror or error}") from error
    except (ValueError, EOFError, AttributeError, zipfile.BadZipFile) as error:
        raise UserError(f"{path}: not an episode, which is an .npz archive: {error}") from error
    if "header" not in arrays:
        raise UserError(
            f"{path}: not an episode: it has no header; drlsl eval --episodes-out writes episodes"
        )
    return arrays
