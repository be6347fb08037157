"""The folder for what can be made again: loaded recordings, compiled rules."""

from __future__ import annotations

import os
import sys
from pathlib import Path


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
