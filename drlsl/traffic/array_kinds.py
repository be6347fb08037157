"""The kinds of arrays that traffic and driving pass on, and the numbers that they have of a vehicle."""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Ids: TypeAlias = npt.NDArray[np.int32]
LaneIds: TypeAlias = npt.NDArray[np.int16]
Mask: TypeAlias = npt.NDArray[np.bool_]

NUMBERS: Final = ("x", "y", "vx", "vy", "length", "width")
"""A vehicle's centre [m], velocity [m/s] and size [m], in the order in which tables and arrays have them."""
