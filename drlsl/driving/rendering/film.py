"""Pictures and films written to files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError

FORMATS: Final = (".png", ".gif", ".mp4")


def check_film_path(path: Path) -> None:
    """Check that a picture or a film can be written there, before anything is driven.

    Raises:
        UserError: its ending is unknown, its folder does not exist, or imageio is not installed.
    """
    if path.suffix.lower() not in FORMATS:
        raise UserError(f"{path}: expected a file that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise UserError(f"{path}: there is no folder {path.parent}")
    _imageio()


def _imageio() -> Any:
    try:
        import imageio.v2 as imageio
    except ImportError as error:
        raise UserError("writing pictures and films needs imageio: pip install 'drlsl[render]'") from error
    return imageio


class Film:
    """A picture (.png), or a film (.gif, .mp4), that is written as it is made; a context manager."""

    def __init__(self, path: Path, rate: float) -> None:
        """Begin a film of `rate` pictures a second; a .png holds the first of them.

        Raises:
            UserError: see `check_film_path`.
        """
        check_film_path(path)
        self._path = path
        self._rate = rate
        self._writer: Any = None
        self.pictures = 0
        """Number of pictures taken so far."""

    @property
    def full(self) -> bool:
        """True if it takes no more pictures."""
        return self._path.suffix.lower() == ".png" and self.pictures > 0

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add a picture, uint8 (height, width, 3)."""
        if self.full:
            return
        if self._writer is None:
            self._writer = self._open()
        # The usual format of MP4 has half as many colours as points, so it takes no odd height or width.
        rows, columns = (-length % 2 for length in picture.shape[:2])
        self._writer.append_data(np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge"))
        self.pictures += 1

    def _open(self) -> Any:
        imageio = _imageio()
        match self._path.suffix.lower():
            case ".png":
                return imageio.get_writer(self._path, mode="i")
            case ".gif":
                return imageio.get_writer(self._path, mode="I", duration=1000 / self._rate, loop=0)
            case _:
                return imageio.get_writer(self._path, fps=self._rate, macro_block_size=1)

    def close(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
