"""Make a recording of rows in SI units, the last step of every reader."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.plausible import Place, check_contradictions, check_lanes, odd_notes
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.road import Lane, MergingLane, Traffic
from drlsl.traffic.tracks import Tracks, lanes_of_rows, pack, rounded
from drlsl.traffic.words import counted, listed


@dataclass(frozen=True, slots=True)
class Road:
    """The road of a recording, as in Recording."""

    lanes: tuple[Lane, ...]
    merging_lanes: tuple[MergingLane, ...] = ()
    traffic: Traffic = Traffic.RECORDED


def assemble(
    name: str,
    place: Place,
    tracks: Tracks,
    frame_rate: float,
    road: Road,
    vehicle_class: Mapping[int, VehicleClass],
    *,
    dropped: tuple[Dropped, ...] = (),
    notes: tuple[str, ...] = (),
) -> Recording:
    """Return the recording of rows that are sorted by vehicle and frame, without repeats, frames from 0.

    The lane of a row is the strip that holds its centre. The recorded stretch runs from the rearmost to the
    foremost box.

    Raises:
        UserError: the rows are no traffic on this road, or a vehicle has no class.
    """
    check_contradictions(place.path, len(tracks) + sum(item.rows for item in dropped), dropped)
    seen = np.unique(tracks.vehicle).tolist()
    unknown = [str(vehicle) for vehicle in seen if vehicle not in vehicle_class]
    if unknown:
        raise UserError(f"{place.path}: no class for vehicle {listed(unknown)}")
    tracks = rounded(tracks)
    lane = lanes_of_rows(tracks.y, road.lanes)
    check_lanes(place.path, tracks, lane, road.lanes)
    recording = Recording(
        name=name,
        frame_rate=frame_rate,
        lanes=road.lanes,
        x_min=float((tracks.x - tracks.length / 2).min()),
        x_max=float((tracks.x + tracks.length / 2).max()),
        film=pack(tracks, lane, name=name),
        vehicle_class={vehicle: vehicle_class[vehicle] for vehicle in seen},
        dropped=dropped,
        notes=(*notes, *_off_road(tracks, lane, road), *odd_notes(place, tracks, frame_rate)),
        merging_lanes=road.merging_lanes,
        traffic=road.traffic,
    )
    recording.validate()
    return recording


def _off_road(tracks: Tracks, lane: np.ndarray, road: Road) -> tuple[str, ...]:
    """Return notes on rows that do not fit the road."""
    notes = []
    off = lane == 0
    for merging in road.merging_lanes:
        off &= np.abs(tracks.y - merging.centre) > merging.width / 2
    if off.any():
        have = "has its centre" if off.sum() == 1 else "have their centre"
        notes.append(f"{counted(int(off.sum()), 'row')} {have} in no lane (lane 0)")
    sign = np.array([0] + [item.direction.sign for item in road.lanes])[lane]
    backward = int((tracks.vx * sign < -1.0).sum())
    if backward:
        moves = f"{counted(backward, 'row')} {'moves' if backward == 1 else 'move'}"
        notes.append(f"{moves} against the lane's direction faster than 1 m/s")
    return tuple(notes)
