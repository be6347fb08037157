"""Estimate the road of an NGSIM table, its bend and its lanes, from the vehicles.

NGSIM measures the lateral position from the left edge of a road that bends by up to a lane's width along the
section, and its lane ids flicker. Here the bend that all lanes share is fitted and removed, and the lanes
are strips around the tracks of the vehicles of each lane id.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.road import Direction, Lane
from drlsl.traffic.tracks import Tracks

CELL = 10.0
"""Length of the cells [m] in which lateral positions are combined."""

NOBODY = 300.0
"""Length of road [m] on which no vehicle is seen, at which the road ends."""

SPAN = 0.8
"""Share of the section a lane must span to be one of the road's; auxiliary lanes and ramps span less."""

STIFFNESS = 3.0
"""Weight of the axis' second differences against one vehicle's position, 1/m each."""

USUAL_WIDTH = 3.66
"""Lane width [m] if only one lane is driven on: 12 ft, that of US freeways."""

LEAST_WIDTH = 2.0
"""Least distance [m] of two lanes; two lane ids that are closer are an error."""


def straighten(tracks: Tracks, lane_ids: npt.NDArray[np.int64]) -> tuple[Floats, float]:
    """Return lateral positions from the road's axis, and the axis' range from side to side [m].

    Each lane's median position per cell is its offset plus the axis; both are fitted by least squares with a
    penalty on the axis' second differences. The axis is 0 on average, so that positions stay near the
    recorded ones.
    """
    passages = _longest_road(_passages(tracks, lane_ids))
    cells = passages.groupby(["lane", "cell"])["y"].agg(["median", "size"]).reset_index()
    cells.columns = pd.Index(["lane", "cell", "y", "vehicles"])
    first, count = int(cells["cell"].min()), int(cells["cell"].max() - cells["cell"].min()) + 1
    lanes, lane = np.unique(cells["lane"].to_numpy(), return_inverse=True)
    rows = np.arange(len(cells))
    design = np.zeros((len(cells), len(lanes) + count))
    design[rows, lane] = 1.0
    design[rows, len(lanes) + cells["cell"].to_numpy() - first] = 1.0
    weight = np.sqrt(cells["vehicles"].to_numpy(dtype=np.float64))
    bending = np.zeros((max(count - 2, 0), len(lanes) + count))
    for row in range(len(bending)):
        bending[row, len(lanes) + row : len(lanes) + row + 3] = STIFFNESS * np.array([1.0, -2.0, 1.0])
    matrix = np.vstack([design * weight[:, None], bending])
    target = np.concatenate([cells["y"].to_numpy() * weight, np.zeros(len(bending))])
    axis = np.linalg.lstsq(matrix, target, rcond=None)[0][len(lanes) :]
    axis -= axis.mean()
    middles = (first + np.arange(count) + 0.5) * CELL
    return tracks.y - np.interp(tracks.x, middles, axis), float(np.ptp(axis))


def _longest_road(passages: pd.DataFrame) -> pd.DataFrame:
    """Return the passages through the road, without those beyond a stretch that no vehicle passes.

    A single row with a wrong position would else be 18 km of road to fit an axis to.
    """
    present = np.unique(passages["cell"].to_numpy())
    block = np.concatenate([[0], np.cumsum(np.diff(present) > NOBODY / CELL)])
    blocks = block[np.searchsorted(present, passages["cell"].to_numpy())]
    longest: pd.DataFrame = passages[blocks == np.bincount(blocks).argmax()]
    return longest


def _passages(tracks: Tracks, lane_ids: npt.NDArray[np.int64]) -> pd.DataFrame:
    """Return one row for each passage of a vehicle through a cell of a main lane: lane, cell, and median y.

    The lane is that of most rows, so that flickering ids have no effect and slow vehicles no more weight than
    others.
    """
    cell = np.floor(tracks.x / CELL).astype(np.int64)
    rows = pd.DataFrame({"vehicle": tracks.vehicle, "cell": cell, "lane": lane_ids, "y": tracks.y})
    lanes = rows.groupby(["vehicle", "cell", "lane"])["y"].agg(["median", "size"]).reset_index()
    lanes = lanes.sort_values("size", kind="stable").drop_duplicates(["vehicle", "cell"], keep="last")
    passages = lanes.rename(columns={"median": "y"})[["lane", "cell", "y"]]
    return passages[passages["lane"].isin(_main_lanes(passages))]


def _main_lanes(passages: pd.DataFrame) -> list[int]:
    """Return lane ids that span the section, and those between two such, by position from the left."""
    lanes = passages.groupby("lane").agg(span=("cell", "nunique"), y=("y", "median")).sort_values("y")
    spans = np.flatnonzero(lanes["span"] >= SPAN * lanes["span"].max())
    return [int(lane) for lane in lanes.index[spans[0] : spans[-1] + 1]]


def fit_lanes(
    path: Path, tracks: Tracks, lane_ids: npt.NDArray[np.int64], speed_limit: float
) -> tuple[Lane, ...]:
    """Return the main lanes, strips that touch; borders are midway between the medians of neighbours.

    Raises:
        UserError: two lanes are too close together.
    """
    medians = _passages(tracks, lane_ids).groupby("lane")["y"].median().sort_values()
    centres = medians.to_numpy(dtype=np.float64)
    spacing = np.diff(centres)
    if len(spacing) and spacing.min() < LEAST_WIDTH:
        close = int(np.argmin(spacing))
        left, right = medians.index[close : close + 2]
        raise UserError(
            f"{path}: lanes {left} and {right} lie {spacing[close]:.1f} m apart, less than the "
            f"{LEAST_WIDTH} m of two lanes; are Lane_ID and Local_X right?"
        )
    half = (float(np.median(spacing)) if len(spacing) else USUAL_WIDTH) / 2
    borders = np.concatenate([[centres[0] - half], (centres[1:] + centres[:-1]) / 2, [centres[-1] + half]])
    return tuple(
        Lane(number, Direction.LEFT_TO_RIGHT, (left + right) / 2, right - left, speed_limit)
        for number, (left, right) in enumerate(pairwise(borders.tolist()), start=1)
    )
