"""Turn any recording into what highD's layout can hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.edit import rows_of
from drlsl.traffic.highd_writer import HighdContent
from drlsl.traffic.recording import Recording
from drlsl.traffic.road import Direction, Lane
from drlsl.traffic.tracks import Tracks, segment_starts

TOUCH: Final = 0.02
"""Distance [m] of two lanes that count as neighbours: markings are written with two decimals."""

ELSEWHERE: Final = 0
"""The location of recordings that are none of highD's six."""


def highd_content(recording: Recording) -> HighdContent:
    """Return the files' contents. A vehicle that vanishes and comes back gets another id, as in highD.

    Raises:
        UserError: the lanes of a direction do not touch, or its directions are not one above the other.
    """
    tracks, origin = _unbroken(rows_of(recording))
    upper, lower = (recording.lanes_of(way) for way in (Direction.RIGHT_TO_LEFT, Direction.LEFT_TO_RIGHT))
    if upper and lower and upper[-1].centre > lower[0].centre:
        raise UserError(
            f"{recording.name}: highD has the lanes from right to left above the others, this road has not"
        )
    limits = [lane.speed_limit for lane in recording.lanes]
    same = len(set(limits)) == 1
    return HighdContent(
        tracks=tracks,
        ax=None,
        ay=None,
        vehicle_class={
            int(vehicle): recording.vehicle_class[int(old)]
            for vehicle, old in zip(*_first_rows(tracks.vehicle, origin), strict=True)
        },
        frame_rate=recording.frame_rate,
        upper_markings=_markings(recording, upper),
        lower_markings=_markings(recording, lower),
        speed_limit=max(limits),
        lane_limits=() if same else limits,
        merging_lanes=recording.merging_lanes,
        traffic=recording.traffic,
        location=ELSEWHERE,
    )


def _unbroken(tracks: Tracks) -> tuple[Tracks, np.ndarray]:
    """Return rows with an id of its own for each unbroken stretch of a track, from 1, and their old ids."""
    starts = segment_starts(tracks)
    if len(starts) == len(np.unique(tracks.vehicle)):
        return tracks, tracks.vehicle
    lengths = np.diff(np.append(starts, len(tracks)))
    return replace(tracks, vehicle=np.repeat(np.arange(1, len(starts) + 1), lengths)), tracks.vehicle


def _first_rows(vehicle: np.ndarray, origin: np.ndarray) -> tuple[list[int], list[int]]:
    ids, first = np.unique(vehicle, return_index=True)
    return ids.tolist(), origin[first].tolist()


def _markings(recording: Recording, lanes: Sequence[Lane]) -> list[float]:
    for one, other in pairwise(lanes):
        if abs(other.centre - one.centre - (one.width + other.width) / 2) > TOUCH:
            raise UserError(f"{recording.name}: lanes {one.id} and {other.id} do not touch, as highD's do")
    borders = [lane.centre - lane.width / 2 for lane in lanes]
    return [*borders, lanes[-1].centre + lanes[-1].width / 2] if lanes else []
