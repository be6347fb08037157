"""Locks on folders: one process at a time, and its error tells the others which."""

import os
import platform
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import filelock

from drlsl.errors import UserError


class FolderLock(AbstractContextManager["FolderLock"]):
    """A lock that ends with the process, however it ends; a lock file left behind locks nobody out.

    The file names the holder. As a context manager it is released at the end.
    """

    def __init__(self, folder: Path, file: str, what: str, *, wait_s: float = 0.0) -> None:
        """Take the lock of `file` in `folder`; `what` states its purpose in messages.

        Raises:
            UserError: another process holds it, and still does after `wait_s`, or the file cannot be made.
        """
        path = folder / file
        self._lock = filelock.FileLock(path)
        try:
            self._lock.acquire(timeout=wait_s)
        except filelock.Timeout:
            raise UserError(
                f"{folder}: {_holder(path)} is at work here ({what}); wait for it, or stop it"
            ) from None
        except OSError as error:
            raise UserError(f"{path}: cannot lock: {error.strerror or error}") from error
        # If a locked file cannot be written to, as on Windows, it does not name the holder.
        with suppress(OSError):
            path.write_text(f"process {os.getpid()} on {platform.node()}\n", "utf-8")

    def release(self) -> None:
        """Release the lock; releasing it twice does no harm."""
        self._lock.release()

    def __exit__(self, *exception: object) -> None:
        self.release()


def _holder(path: Path) -> str:
    """Return the holder of a lock, as far as its file names it."""
    try:
        told = path.read_text("utf-8", errors="replace").strip()
    except OSError:
        told = ""
    return told if told.isprintable() and told else "another process"
