"""The kinds of arrays that traffic and driving pass on, and the numbers that they have of a vehicle."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Ids: TypeAlias = npt.NDArray[np.int32]
LaneIds: TypeAlias = npt.NDArray[np.int16]
Mask: TypeAlias = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """The boxes and velocities of vehicles, arrays of one shape."""

    x: Floats
    """Centre along the road [m]."""
    y: Floats
    """Centre across the road [m], downward."""
    vx: Floats
    """Velocity along x [m/s], signed."""
    vy: Floats
    """Velocity along y [m/s], signed."""
    length: Floats
    """Extent along x [m], > 0."""
    width: Floats
    """Extent along y [m], > 0."""


NUMBERS: Final = tuple(field.name for field in fields(Boxes))
"""A vehicle's centre [m], velocity [m/s] and size [m], in the order in which tables and arrays have them."""
