"""Rows as other formats have them: names instead of numbers for vehicles, seconds instead of frames."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats

LONGEST: Final = 1e6
"""Most seconds between a row and the middle one, eleven days."""

FARTHEST: Final = 1e9
"""A number [m] above all coordinates of maps."""

ON_TIME: Final = 0.1
"""Share of a step by which a row may be off the time of its frame."""


def check_numbers(path: Path, values: Floats) -> None:
    """Check that places on a map, or speeds, are numbers that one can be at.

    Raises:
        UserError: one is not finite, or above 1e9.
    """
    if not (np.abs(values) < FARTHEST).all():
        raise UserError(f"{path}: a place or speed is not a finite number, or above {FARTHEST:g}")


def numbered(names: npt.NDArray[np.generic]) -> npt.NDArray[np.int64]:
    """Return ids for names: the numbers that they are, or 1, 2, 3 … in their order."""
    text = np.asarray(names, dtype=np.str_)
    if np.char.isdecimal(text).all():
        numbers = text.astype(np.float64)
        if numbers.max() < 2**31:
            return numbers.astype(np.int64)
    names, place = np.unique(text, return_inverse=True)
    order = sorted(range(len(names)), key=lambda one: _spoken(str(names[one])))
    number = np.empty(len(names), dtype=np.int64)
    number[order] = np.arange(1, len(names) + 1)
    return number[place]


def _spoken(name: str) -> list[tuple[int, str]]:
    """Return a key by which car.2 comes before car.10."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def frames_of(path: Path, seconds: Floats) -> tuple[npt.NDArray[np.int64], float]:
    """Return the frame of each time, from 0, and the frames a second.

    Raises:
        UserError: the times are not evenly spaced, or all the same.
    """
    row = int(np.argmax(np.abs(seconds - np.median(seconds))))
    if abs(seconds[row] - np.median(seconds)) > LONGEST:
        raise UserError(f"{path}: a row at {seconds[row]:g} s, days away from the others")
    times = np.unique(np.round(seconds, 6))
    if len(times) < 2:
        raise UserError(f"{path}: all rows have one time, {times[0]:g} s; a recording needs two")
    steps = np.diff(times)
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    # The mean over all of them, since the times of a file are rounded.
    step = float((times[-1] - times[0]) / np.rint((times[-1] - times[0]) / step))
    frame = np.rint((seconds - times[0]) / step)
    late = np.abs(seconds - times[0] - frame * step)
    if late.max() > ON_TIME * step:
        row = int(np.argmax(late))
        raise UserError(
            f"{path}: times are not evenly spaced: {seconds[row]:g} s is {late[row]:.3f} s off a frame of "
            f"{step:g} s"
        )
    return frame.astype(np.int64), float(np.round(1 / step, 4))
