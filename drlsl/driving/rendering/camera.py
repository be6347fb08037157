"""The map from the road to a picture of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Camera:
    """The map from the road [m] to the picture [pixel]; the road is stretched across."""

    x: float
    y: float
    along: float
    across: float
    width: int

    def point(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel of a place."""
        return (x - self.x) * self.along, (y - self.y) * self.across

    def visible(self) -> tuple[float, float]:
        """Return the first and the last x [m] in the picture."""
        return self.x, self.x + self.width / self.along

    def multiples(self, distance: float) -> Iterator[float]:
        """Return the multiples of a `distance` [m] that are in the picture, and one before."""
        begin, end = self.visible()
        numbers = range(math.floor(begin / distance), math.ceil(end / distance))
        return (index * distance for index in numbers)
