"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from drlsl.errors import UserError


@contextmanager
def written_whole(path: Path, *, durable: bool = False) -> Iterator[IO[bytes]]:
    """Yield a file that replaces `path` at the end; after an error the old file is kept.

    `durable`: the new file then outlasts a power cut. Its folder must exist. A link stays one, and what it
    leads to is replaced.

    Raises:
        OSError: the file cannot be written.
    """
    if what := not_replaceable(path):
        raise OSError(f"is {what}, expected a file")
    path = path.resolve() if path.is_symlink() else path
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "w+b") as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
        # mkstemp makes files for the owner alone; others beside it follow the umask.
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    if durable:
        _sync_folder(path.parent)


def not_replaceable(path: Path) -> str | None:
    """Return what a path is, if that is nothing a file may take the place of, as a folder or a device."""
    if not path.exists() or path.is_file():
        return None
    return "a folder" if path.is_dir() else "a device or a pipe"


def write_atomic(path: Path, content: bytes) -> None:
    """Replace a file by `content`; after a crash the file is the old one or the new one, never a part.

    Raises:
        UserError: the file cannot be written.
    """
    try:
        with written_whole(path, durable=True) as file:
            file.write(content)
    except OSError as error:
        raise UserError(f"{path}: cannot write: {error.strerror or error}") from error


@contextmanager
def scratch_beside(folder: Path) -> Iterator[Path]:
    """Yield a folder beside `folder`, from which what is whole can be renamed; it is deleted at the end.

    Raises:
        OSError: it cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as scratch:
        yield Path(scratch)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _sync_folder(folder: Path) -> None:
    """Make a rename in `folder` outlast a power cut; Windows has no such call."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
