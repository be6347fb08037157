"""Pictures and films written to files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.files import not_replaceable, write_atomic

FORMATS: Final = (".png", ".gif", ".mp4")


def check_film_path(path: Path) -> None:
    """Check that a picture or a film can be written there, before anything is driven.

    Raises:
        UserError: its ending is unknown, its folder does not exist, what is there is no file, or imageio is
            not installed.
    """
    if path.suffix.lower() not in FORMATS:
        raise UserError(f"{path}: expected a file that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise UserError(f"{path}: there is no folder {path.parent}")
    if what := not_replaceable(path):
        raise UserError(f"{path}: is {what}, expected a file to write")
    _imageio()


def _imageio() -> Any:
    try:
        import imageio.v2 as imageio
    except ImportError as error:
        raise UserError("writing pictures and films needs imageio: pip install 'drlsl[render]'") from error
    return imageio


class Film:
    """A picture (.png), or a film (.gif, .mp4); a context manager.

    It is put in its place whole at the end; after an error, what was there is left.
    """

    def __init__(self, path: Path, rate: float) -> None:
        """Begin a film of `rate` pictures a second; a .png holds the first of them.

        Raises:
            UserError: see `check_film_path`.
        """
        check_film_path(path)
        self._path = path
        self._rate = rate
        self._writer: Any = None
        self._memory = BytesIO()
        self._scratch: TemporaryDirectory[str] | None = None
        self.pictures = 0
        """Number of pictures taken so far."""

    @property
    def full(self) -> bool:
        """True if it takes no more pictures."""
        return self._path.suffix.lower() == ".png" and self.pictures > 0

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add a picture, uint8 (height, width, 3).

        Raises:
            UserError: the film cannot be written.
        """
        if self.full:
            return
        # The usual format of MP4 has half as many colours as points, so it takes no odd height or width.
        rows, columns = (-length % 2 for length in picture.shape[:2])
        with self._failures_told():
            if self._writer is None:
                self._writer = self._open()
            self._writer.append_data(np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge"))
        self.pictures += 1

    @contextmanager
    def _failures_told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise UserError(f"{self._path}: cannot write: {error.strerror or error}") from error

    def _open(self) -> Any:
        """Return what writes to memory or, as MP4 is made by another program, to a file in a folder apart."""
        imageio = _imageio()
        match self._path.suffix.lower():
            case ".png":
                return imageio.get_writer(self._memory, format=".png", mode="i")
            case ".gif":
                return imageio.get_writer(
                    self._memory, format=".gif", mode="I", duration=1000 / self._rate, loop=0
                )
            case _:
                self._scratch = TemporaryDirectory(prefix="drlsl-film-", ignore_cleanup_errors=True)
                return imageio.get_writer(self._apart(), fps=self._rate, macro_block_size=1)

    def _apart(self) -> Path:
        assert self._scratch is not None
        return Path(self._scratch.name, "film.mp4")

    def close(self) -> None:
        """Put the film in its place.

        Raises:
            UserError: it cannot be written.
        """
        try:
            if self._writer is not None:
                with self._failures_told():
                    self._finish()
                    content = self._memory.getvalue() if self._scratch is None else self._whole()
                write_atomic(self._path, content)
        finally:
            self._discard()

    def _finish(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def _whole(self) -> bytes:
        """Return the film that another program made, which does not tell if that failed.

        Raises:
            OSError: it is not whole.
        """
        try:
            with _imageio().get_reader(self._apart()) as reader:
                reader.get_data(0)
            return self._apart().read_bytes()
        except (OSError, RuntimeError, IndexError) as error:
            raise OSError("the film is not whole; is there room for temporary files?") from error

    def _discard(self) -> None:
        """Leave nothing but what is in its place."""
        with suppress(OSError):
            self._finish()
        if self._scratch is not None:
            self._scratch.cleanup()
            self._scratch = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self._discard()
