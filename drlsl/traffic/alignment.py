"""Turn tracks on a map into tracks along a road: x along its axis, y across it and downward.

The axis comes from the vehicles themselves. They drive along it: the median direction of their ways is that
of the road and, where the road bends, the median slope of their ways in each cell is that of the axis
there. So no map is needed, and a lane change of some does not turn the road.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.tracks import Tracks, segment_starts

LEAST_WAY: Final = 20.0
"""Way of a vehicle [m] from which its direction is known."""

CELL: Final = 20.0
"""Length of the cells [m] in which the axis is straight."""

STRAIGHT: Final = 0.15
"""Range [m] from side to side of an axis that is taken for straight; positions are no better than this."""

PARALLEL: Final = 0.9
"""Least length of the mean of the unit vectors of all ways, their angles doubled: 1 if all are parallel."""

STEEPEST: Final = 60.0
"""Largest angle [degrees] between the axis and its mean direction."""

MINORITY: Final = 0.02
"""Share of ways against the others from which a road has two directions."""


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """The axis of a road on a map, y upward: a polyline, and the unit vector of its mean direction.

    `along`, shape (n,), are the vertices' positions along the mean direction [m], `left` those across it,
    to its left, and `way` the lengths of the polyline to them. One vertex: a straight road.
    """

    direction: tuple[float, float]
    along: Floats
    left: Floats
    way: Floats

    @property
    def bend(self) -> float:
        """Range of the axis from side to side of its mean direction [m]; 0 if it is straight."""
        return float(np.ptp(self.left))

    def on_road(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return places along and across the road, y downward [m], and the angle of the axis there [rad]."""
        ux, uy = self.direction
        along, left = x * ux + y * uy, -x * uy + y * ux
        angle = np.full(np.shape(x), np.arctan2(uy, ux))
        if len(self.along) < 2:
            return along, -left, angle
        slope = np.diff(self.left) / np.diff(self.along)
        foot = along
        for _ in range(4):  # the foot of the perpendicular, by fixed-point steps of less than the bend
            piece = np.clip(np.searchsorted(self.along, foot) - 1, 0, len(slope) - 1)
            offset = left - (self.left[piece] + slope[piece] * (foot - self.along[piece]))
            foot = along + offset * slope[piece] / (1 + slope[piece] ** 2)
        stretch = np.sqrt(1 + slope[piece] ** 2)
        across = (left - self.left[piece] - slope[piece] * (along - self.along[piece])) / stretch
        return (
            self.way[piece] + (foot - self.along[piece]) * stretch,
            -across,
            angle + np.arctan(slope[piece]),
        )


def fit_axis(path: Path, tracks: Tracks) -> Axis:
    """Return the axis of the road that vehicles drive on; rows sorted by vehicle and frame, y upward.

    Raises:
        UserError: they do not drive on one road that can be straightened, as at a crossing.
    """
    starts = segment_starts(tracks)
    ends = np.append(starts[1:], len(tracks)) - 1
    x, y = tracks.x[ends] - tracks.x[starts], tracks.y[ends] - tracks.y[starts]
    way = np.hypot(x, y)
    if not (way >= LEAST_WAY).any():
        raise UserError(f"{path}: no vehicle drives {LEAST_WAY:g} m, so the direction of the road is unknown")
    angle, weight = np.arctan2(y, x)[way >= LEAST_WAY], way[way >= LEAST_WAY]
    mean = complex((weight * np.exp(2j * angle)).sum() / weight.sum())
    if abs(mean) < PARALLEL:
        raise UserError(
            f"{path}: vehicles drive in all directions, as at a crossing or on a roundabout; only stretches "
            "of a freeway "
            "can be straightened"
        )
    turned = float(np.angle(mean)) / 2
    turned += float(np.median(_within(angle - turned, np.pi)))
    forward = float((weight * (np.cos(angle - turned) > 0)).sum() / weight.sum())
    both = MINORITY < forward < 1 - MINORITY
    if np.cos(turned) < 0 if both else forward < 0.5:
        turned += np.pi
    axis = Axis((float(np.cos(turned)), float(np.sin(turned))), np.zeros(1), np.zeros(1), np.zeros(1))
    return _bent(path, axis, tracks, starts)


def _within(angle: Floats, period: float) -> Floats:
    """Return angles in [-period/2, period/2)."""
    return (angle + period / 2) % period - period / 2


def _bent(path: Path, straight: Axis, tracks: Tracks, starts: npt.NDArray[np.int64]) -> Axis:
    """Return the axis with its bends, the same one if it has none."""
    along, down, _ = straight.on_road(tracks.x, tracks.y)
    cell = np.floor(along / CELL).astype(np.int64)
    new = np.ones(len(tracks), dtype=np.bool_)
    new[1:] = cell[1:] != cell[:-1]
    new[starts] = True
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(tracks)) - 1
    run = along[last] - along[first]
    far = np.abs(run) >= CELL / 4
    slopes = -(down[last] - down[first])[far] / run[far]
    cells = cell[first][far]
    present = np.unique(cells)
    if len(present) < 2:
        return straight
    medians = np.array([np.median(slopes[cells == one]) for one in present])
    every = np.arange(present[0], present[-1] + 1)
    slope = np.interp(every, present, medians)
    slope = np.convolve(np.pad(slope, 1, mode="edge"), np.ones(3) / 3, mode="valid")
    left = np.concatenate([[0.0], np.cumsum(slope * CELL)])
    left -= left.mean()
    if np.ptp(left) < STRAIGHT:
        return straight
    if np.abs(slope).max() > np.tan(np.radians(STEEPEST)):
        raise UserError(
            f"{path}: the road turns by more than {STEEPEST:g} degrees and cannot be straightened"
        )
    vertices = np.arange(every[0], every[-1] + 2) * CELL
    left += np.median(-down - np.interp(along, vertices, left))  # through the traffic, so that feet are near
    way = np.concatenate([[0.0], np.cumsum(np.hypot(CELL, slope * CELL))])
    return Axis(straight.direction, vertices, left, way)


def along_road(tracks: Tracks, axis: Axis) -> Tracks:
    """Return tracks on a map as tracks along its road, velocities in the direction of the axis there."""
    x, y, angle = axis.on_road(tracks.x, tracks.y)
    cos, sin = np.cos(angle), np.sin(angle)
    return replace(
        tracks, x=x, y=y, vx=tracks.vx * cos + tracks.vy * sin, vy=tracks.vx * sin - tracks.vy * cos
    )
