"""The folder for what can be made again (loaded recordings, compiled rules), and how it is kept small."""

from __future__ import annotations

import os
import shutil
import stat
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drlsl.errors import UserError

UNUSED: Final = 30.0
"""Days after which a file that was not used is removed."""

IN_USE: Final = 1.0
"""Days for which a file that was used is never removed."""

MOST: Final = 20.0
"""Gigabytes above which files that were not used longest are removed, unless DRLSL_CACHE_GB says another."""


def cache_folder() -> Path:
    """Return the folder of caches: DRLSL_CACHE if set, else the platform's folder for caches."""
    chosen = os.environ.get("DRLSL_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "drlsl" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "drlsl"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "drlsl"


def make_room() -> None:
    """Remove what was not used for `UNUSED` days from the cache folder, and more if it is above its limit.

    Above the limit, DRLSL_CACHE_GB or `MOST`, what was not used longest goes first; what was used within a
    day stays. A file that another process has open or mapped stays whole for it.

    Raises:
        UserError: DRLSL_CACHE_GB is not a number above 0.
    """
    limit, now = _limit(), time.time()
    entries = _entries()
    total = sum(one.size for one in entries)
    for one in sorted(entries, key=lambda one: one.used):
        days = (now - one.used) / 86400
        if days < IN_USE or (days < UNUSED and total <= limit):
            break
        _remove(one.path)
        total -= one.size


@dataclass(slots=True)
class _Entry:
    """A file or an unpacked archive, kept or removed as one: last use [s], size [bytes]."""

    path: Path
    used: float = 0.0
    size: int = 0


def _entries() -> list[_Entry]:
    """Return what is in the folders of the cache folder, and files beside them."""
    root = cache_folder()
    entries: dict[Path, _Entry] = {}
    for path in root.rglob("*"):
        with suppress(OSError):  # removed meanwhile
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                kept = root.joinpath(*path.relative_to(root).parts[:2])
                entry = entries.setdefault(kept, _Entry(kept))
                entry.used = max(entry.used, status.st_atime, status.st_mtime)
                entry.size += status.st_size
    return list(entries.values())


def _remove(path: Path) -> None:
    """Remove a file or a folder; a folder leaves its place at once, so that no one finds a part of it."""
    # Windows does not move or remove what a process has open, and another process may have removed it.
    with suppress(OSError):
        if path.is_dir():
            gone = Path(tempfile.mkdtemp(prefix=".removed-", dir=path.parent))
            path = path.rename(gone / path.name).parent
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def _limit() -> float:
    """Return the most bytes that the cache folder may have."""
    chosen = os.environ.get("DRLSL_CACHE_GB") or str(MOST)
    try:
        gigabytes = float(chosen)
    except ValueError:
        gigabytes = 0.0
    if not gigabytes > 0:
        raise UserError(f"DRLSL_CACHE_GB is {chosen!r}; expected a number of gigabytes above 0")
    return gigabytes * 1e9
