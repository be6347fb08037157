"""Velocities from positions: slopes of straight lines through the rows around each row."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from drlsl.traffic.array_kinds import Floats


def slopes(values: Floats, starts: npt.NDArray[np.int64], window: int) -> Floats:
    """Return the slope of the least squares line through the rows around each row, within its segment.

    Segments begin at `starts`. The window has at most `window` rows, an odd number, and is cut off at the
    ends of segments; a segment of one row has slope 0.
    """
    ends = np.append(starts[1:], len(values))
    result = np.zeros(len(values))
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        count = end - start
        if count < 2:
            continue
        rows = np.arange(count)
        low, high = np.maximum(rows - window // 2, 0), np.minimum(rows + window // 2 + 1, count)
        track = values[start:end] - values[start]
        sums = np.concatenate([[0.0], np.cumsum(track)])
        moments = np.concatenate([[0.0], np.cumsum(track * rows)])
        size = (high - low).astype(np.float64)
        middle = (low + high - 1) / 2
        spread = size * (size**2 - 1) / 12
        result[start:end] = (moments[high] - moments[low] - middle * (sums[high] - sums[low])) / spread
    return result
