"""Make a recording of tracks on a map, the last step of readers whose roads are not drawn along x."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from drlsl.traffic.alignment import Axis, along_road, fit_axis
from drlsl.traffic.assemble import Road, assemble
from drlsl.traffic.lane_pieces import Piece, lanes_of_pieces
from drlsl.traffic.plausible import Place, check_rows, true_frames
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.tracks import Tracks, without_duplicates

UNLIMITED_SPEED = 130 / 3.6
"""Speed limit [m/s] where a source has none: the advisory speed of the German Autobahn.

Source: Autobahn-Richtgeschwindigkeits-V, section 1.
"""

Pieces = Callable[[Tracks, npt.NDArray[np.int64], Axis], Sequence[Piece]]
"""Return pieces of lanes from rows along the road, their indices in the source, and the road's axis."""


@dataclass(frozen=True, slots=True)
class OnMap:
    """Tracks on a map, x to the right and y upward [m], boxes by their centres, in any order; frames from 0.

    `limit` [m/s] is None where the source has none; `usual_width` [m] is that of a lane that is alone and
    has no width in the source.
    """

    tracks: Tracks
    frame_rate: float
    vehicle_class: Mapping[int, VehicleClass]
    limit: float | None = None
    usual_width: float = 3.66
    dropped: tuple[Dropped, ...] = ()
    notes: tuple[str, ...] = ()


def assemble_from_map(name: str, place: Place, read: OnMap, pieces: Pieces) -> Recording:
    """Return the recording, straightened: x from the rearmost box, y from the uppermost lane's border.

    Raises:
        UserError: the tracks are no traffic on one road.
    """
    check_rows(place, read.tracks)
    tracks, frame_rate, thinned = true_frames(place, read.tracks, read.frame_rate)
    tracks, rows, repeated = without_duplicates(tracks)
    axis = fit_axis(place.path, tracks)
    tracks = along_road(tracks, axis)
    limit = UNLIMITED_SPEED if read.limit is None else read.limit
    lanes, left_out = lanes_of_pieces(place.path, pieces(tracks, rows, axis), limit, read.usual_width)
    begin, top = float((tracks.x - tracks.length / 2).min()), lanes[0].centre - lanes[0].width / 2
    notes = [*read.notes, *thinned, *left_out]
    if axis.bend:
        notes.append(f"road straightened: its axis is up to {axis.bend:.1f} m off a straight line")
    return assemble(
        name,
        place,
        replace(tracks, x=tracks.x - begin, y=tracks.y - top),
        frame_rate,
        Road(tuple(replace(lane, centre=lane.centre - top) for lane in lanes)),
        read.vehicle_class,
        dropped=(*read.dropped, *repeated),
        notes=tuple(notes),
    )
