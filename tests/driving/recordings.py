"""Small recordings made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drlsl.traffic import NUMBERS, Direction, Lane, Recording, Tracks, VehicleClass, lanes_of_rows, pack

WIDTH = 3.75
LIMIT = 36.0
LANES = tuple(
    Lane(index + 1, direction, centre, WIDTH, LIMIT)
    for index, (direction, centre) in enumerate(
        [(Direction.RIGHT_TO_LEFT, 1.875), (Direction.RIGHT_TO_LEFT, 5.625)]
        + [(Direction.LEFT_TO_RIGHT, 12.0 + 1.875 + index * WIDTH) for index in range(3)]
    )
)
LENGTH = 420.0


@dataclass(frozen=True)
class Drive:
    """A vehicle at constant velocity: where it is in frame 0, or `begin`, and how long it is seen."""

    lane: int
    x: float
    speed: float
    begin: int = 0
    end: int | None = None
    vy: float = 0.0
    length: float = 4.6
    width: float = 1.9


def recording(drives: Sequence[Drive], *, frames: int = 400, frame_rate: float = 25.0) -> Recording:
    """A recording of `drives` on two lanes to the left above three lanes to the right, 420 m long."""
    rows: list[tuple[float, ...]] = []
    for vehicle, drive in enumerate(drives):
        lane = LANES[drive.lane - 1]
        for frame in range(drive.begin, frames if drive.end is None else drive.end):
            time = (frame - drive.begin) / frame_rate
            x, y = drive.x + lane.direction.sign * drive.speed * time, lane.centre + drive.vy * time
            if 0 <= x <= LENGTH:
                velocity = lane.direction.sign * drive.speed
                rows.append((frame, vehicle, x, y, velocity, drive.vy, drive.length, drive.width))
    columns = np.array(rows, dtype=np.float64).T
    order = np.lexsort((columns[0], columns[1]))
    frame, vehicle, *numbers = (column[order] for column in columns)
    tracks = Tracks(
        **dict(zip(NUMBERS, numbers, strict=True)),
        frame=frame.astype(np.int64),
        vehicle=vehicle.astype(np.int64),
    )
    made = Recording(
        name="by-hand",
        frame_rate=frame_rate,
        lanes=LANES,
        x_min=0.0,
        x_max=LENGTH,
        film=pack(tracks, lanes_of_rows(tracks.y, LANES), name="by-hand"),
        vehicle_class={int(one): VehicleClass.CAR for one in np.unique(tracks.vehicle)},
    )
    made.validate()
    return made
