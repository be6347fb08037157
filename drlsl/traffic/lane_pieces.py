"""Lanes of a road from pieces of lanes: lanelets, lanes of edges, or where vehicles with a lane id drive."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.road import Direction, Lane
from drlsl.traffic.words import counted

SPAN: Final = 0.8
"""Share of the stretch a lane must span to be one of the road's; ramps and merging lanes span less."""

SAME: Final = 1.2
"""Distance [m] across the road within which pieces are of one lane."""

WANDER: Final = 1.5
"""Range across the road [m] of 80 % of a piece, above which it is not parallel to the road, as a ramp."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a lane: the sign of its traffic, from x to x, its centre and width [m], NaN if unknown."""

    sign: int
    begin: float
    end: float
    centre: float
    width: float = float("nan")


def pieces_of_ids(
    ids: npt.NDArray[np.generic], x: Floats, vx: Floats, centre: Floats, width: Floats | None = None
) -> list[Piece]:
    """Return a piece for each lane id of rows with it; `centre` is the lane's centre by each row [m]."""
    pieces = []
    order = np.argsort(ids, kind="stable")
    names, starts = np.unique(ids[order], return_index=True)
    for rows in np.split(order, starts[1:]) if len(names) else []:
        low, high = np.percentile(centre[rows], [10, 90]).tolist()
        if high - low > WANDER:
            continue
        pieces.append(
            Piece(
                sign=1 if np.median(vx[rows]) >= 0 else -1,
                begin=float(x[rows].min()),
                end=float(x[rows].max()),
                centre=float(np.median(centre[rows])),
                width=float("nan") if width is None else float(np.median(width[rows])),
            )
        )
    return pieces


def lanes_of_pieces(
    path: Path, pieces: Sequence[Piece], limit: float, usual_width: float
) -> tuple[tuple[Lane, ...], tuple[str, ...]]:
    """Return the lanes that span the road, and a note on what is left out.

    Raises:
        UserError: there is none, or the lanes of the two directions lie among each other.
    """
    strips: list[tuple[float, float, Direction]] = []
    left_out = 0
    for sign, direction in ((-1, Direction.RIGHT_TO_LEFT), (1, Direction.LEFT_TO_RIGHT)):
        mine = [piece for piece in pieces if piece.sign == sign]
        if mine:
            kept, others = _spanning(mine)
            left_out += others
            strips += [(low, high, direction) for low, high in _borders(kept, usual_width)]
    if not strips:
        raise UserError(f"{path}: no lane spans {SPAN:.0%} of the road")
    strips.sort(key=lambda strip: strip[0] + strip[1])
    directions = [direction for _, _, direction in strips]
    if sum(one is not other for one, other in itertools.pairwise(directions)) > 1:
        raise UserError(f"{path}: the lanes of the two directions lie among each other")
    lanes = tuple(
        Lane(number, direction, (low + high) / 2, high - low, limit)
        for number, (low, high, direction) in enumerate(strips, start=1)
    )
    some = counted(left_out, "lane that does", "lanes that do")
    note = f"{some} not span the road left out: vehicles there are in lane 0"
    return lanes, ((note,) if left_out else ())


def _spanning(pieces: Sequence[Piece]) -> tuple[list[tuple[float, float]], int]:
    """Return centre and width of the lanes that span the road, or lie between such, and how many do not."""
    ordered = sorted(pieces, key=lambda piece: piece.centre)
    lanes: list[list[Piece]] = []
    for piece in ordered:
        if lanes and piece.centre - float(np.mean([one.centre for one in lanes[-1]])) <= SAME:
            lanes[-1].append(piece)
        else:
            lanes.append([piece])
    stretch = max(piece.end for piece in pieces) - min(piece.begin for piece in pieces)
    spans = [place for place, lane in enumerate(lanes) if _covered(lane) >= SPAN * stretch]
    if not spans:
        return [], len(lanes)
    kept = lanes[spans[0] : spans[-1] + 1]
    return [_middle(lane) for lane in kept], len(lanes) - len(kept)


def _covered(lane: Sequence[Piece]) -> float:
    """Return the length of road that pieces cover together, gaps of a few metres between them as well."""
    total, reached = 0.0, -np.inf
    for piece in sorted(lane, key=lambda piece: piece.begin):
        total += max(0.0, piece.end - max(piece.begin, reached))
        reached = max(reached, piece.end)
    return total


def _middle(lane: Sequence[Piece]) -> tuple[float, float]:
    """Return centre and width of a lane, its pieces weighted by their lengths."""
    length = np.array([max(piece.end - piece.begin, 1e-6) for piece in lane])
    centre = float(np.average([piece.centre for piece in lane], weights=length))
    width = np.array([piece.width for piece in lane])
    known = np.isfinite(width)
    return centre, float(np.average(width[known], weights=length[known])) if known.any() else float("nan")


def _borders(lanes: Sequence[tuple[float, float]], usual_width: float) -> list[tuple[float, float]]:
    """Return the strips of lanes that touch, from centres and widths; an unknown width is the spacing."""
    centres, widths = (
        (np.array(column) for column in zip(*lanes, strict=True)) if lanes else (np.array([]),) * 2
    )
    spacing = np.diff(centres)
    usual = float(np.median(spacing)) if len(spacing) else usual_width
    widths = np.where(np.isfinite(widths), widths, usual)
    inner = ((centres + widths / 2)[:-1] + (centres - widths / 2)[1:]) / 2
    edges = [*(centres - widths / 2)[:1], *inner, *(centres + widths / 2)[-1:]]
    return list(itertools.pairwise(edges))
