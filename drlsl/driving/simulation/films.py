"""Films of several recordings as one, for loops over egos that each drive in a film of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.traffic import CELL, PIECE, UNIT, Film, Floats, Integers, Mask

WORD: Final = 4
"""Bytes of a number of a film."""


@dataclass(frozen=True, slots=True, eq=False)
class Reels:
    """The places of N egos' films in `Films`: arrays of shape (N,).

    `cells_begin`: the place in `cells` where the film begins; `first_piece`: the row of `table` where its
    pieces begin; `frames` and `slots`, how many it has.
    """

    cells_begin: Integers
    first_piece: Integers
    frames: Integers
    slots: Integers


class Films:
    """Films where they lie in memory, none of them copied.

    `slots`: the most slots of a film; where a film has fewer, the others are empty. `cells` are the
    films' arrays as an array of one axis; `table` (P, 5), the pieces of all films, as in `Film.pieces`.
    """

    def __init__(self, films: Sequence[Film]) -> None:
        """Take films, one or more; `reels` has a value for each of them."""
        self._films = tuple(films)
        self.slots = max(film.slots for film in films)
        self.cells, cells_begin = spanned([film.cells for film in films])
        self.reels = Reels(
            cells_begin,
            first_piece=np.cumsum([0, *(len(film.pieces) for film in films)])[:-1],
            frames=np.array([len(film) for film in films]),
            slots=np.array([film.slots for film in films]),
        )
        self.table = np.concatenate([film.pieces for film in films])

    def __reduce__(self) -> tuple[type[Films], tuple[tuple[Film, ...]]]:
        """Return how to make the films again elsewhere: `cells` span memory of this process."""
        return Films, (self._films,)

    def pieces(self, reels: Reels, frame: Integers) -> Integers:
        """Return the rows of `table` in a `frame` (N,) each; shape (N, S)."""
        column = np.arange(self.slots)
        # Slot 0 of every film is empty, as those are that a film does not have.
        column = np.where(column < reels.slots[:, None], column, 0)
        found: Integers = self.cells[_row(reels, PIECE, frame)[:, None] + column] + reels.first_piece[:, None]
        return found

    def valid(self, reels: Reels, frame: Integers) -> Mask:
        """Return which slots hold a vehicle in a `frame` (N,) each; shape (N, S)."""
        there: Mask = self.pieces(reels, frame) != reels.first_piece[:, None]
        return there

    def piece_of(self, reels: Reels, frame: Integers, slot: Integers) -> Integers:
        """Return the row of `table` in a `frame` and `slot` (N,) each."""
        found: Integers = self.cells[_row(reels, PIECE, frame) + slot] + reels.first_piece
        return found

    def motion_of(self, reels: Reels, column: int, frame: Integers, slot: Integers) -> Floats:
        """Return a column of the first four `NUMBERS` in a `frame` and `slot` (N,) each."""
        found: Floats = self.cells[_row(reels, column, frame) + slot] * UNIT
        return found


def _row(reels: Reels, column: int, frame: Integers) -> Integers:
    """Return where in `Films.cells` a column of a `frame` (N,) each begins."""
    row: Integers = CELL * np.minimum(frame, reels.frames - 1) + column
    return reels.cells_begin + row * reels.slots


def spanned(arrays: Sequence[npt.NDArray[np.int32]]) -> tuple[npt.NDArray[np.int32], Integers]:
    """Return one array of one axis in which all of `arrays` are found, and the places where each begins.

    It is read-only, and spans the memory from the first of the arrays to the end of the last, whatever lies
    between them: read it only at places of the arrays, and only as long as these exist. So films that are
    mapped from files stay in these files, and machine code takes one array for any number of them.
    """
    if len(arrays) == 1:
        return arrays[0].reshape(-1), np.zeros(1, dtype=np.int64)
    starts = np.array([array.ctypes.data for array in arrays])
    if (starts % WORD).any():
        raise ValueError("an array of a film does not begin at a word of memory")
    low, high = int(starts.min()), max(array.ctypes.data + array.nbytes for array in arrays)
    memory = SimpleNamespace(
        __array_interface__={"version": 3, "data": (low, True), "shape": ((high - low) // WORD,)}
        | {"typestr": np.dtype(np.int32).str}
    )
    return np.asarray(memory), (starts - low) // WORD
