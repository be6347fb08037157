"""Unpack archives of recordings into the cache folder."""

from __future__ import annotations

import hashlib
import shutil
import zipfile
import zlib
from pathlib import Path

from drlsl.errors import UserError
from drlsl.files import cache_folder, scratch_beside


def unpacked(path: Path) -> Path:
    """Return the folder with the contents of a zip archive; it is unpacked once, until it changes.

    Raises:
        UserError: the archive is damaged or protected, or there is no room for its contents.
    """
    try:
        status = path.stat()
        mark = f"{path.resolve()}\n{status.st_size}\n{status.st_mtime_ns}"
        folder = cache_folder() / "unpacked" / f"{path.stem}-{hashlib.sha256(mark.encode()).hexdigest()[:16]}"
        if folder.is_dir():
            return folder
        folder.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(path) as archive:
            if not archive.infolist():
                raise UserError(f"{path}: cannot be unpacked: the archive is empty")
            needed = sum(item.file_size for item in archive.infolist())
            room = shutil.disk_usage(folder.parent).free
            if needed > room:
                raise UserError(f"{path}: needs {needed:,} bytes when unpacked, and {room:,} are free")
            with scratch_beside(folder) as scratch:
                archive.extractall(scratch / "new")
                (scratch / "new").rename(folder)
    except (OSError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        raise UserError(f"{path}: cannot be unpacked: {error}") from error
    return folder
