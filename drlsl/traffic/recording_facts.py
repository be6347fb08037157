"""The facts of a recording beside its arrays, as plain values for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from drlsl.traffic.packed_frames import Film
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.road import Direction, Lane, MergingLane, Traffic


def facts_of(recording: Recording) -> dict[str, Any]:
    """Return all of a recording but its film."""
    return {
        "name": recording.name,
        "frame_rate": recording.frame_rate,
        "lanes": [{**asdict(lane), "direction": lane.direction.value} for lane in recording.lanes],
        "x_min": recording.x_min,
        "x_max": recording.x_max,
        "vehicle_class": {vehicle: kind.value for vehicle, kind in recording.vehicle_class.items()},
        "dropped": [asdict(item) for item in recording.dropped],
        "notes": list(recording.notes),
        "merging_lanes": [
            {**asdict(lane), "direction": lane.direction.value} for lane in recording.merging_lanes
        ],
        "traffic": recording.traffic.value,
    }


def recording_from(facts: Mapping[str, Any], film: Film) -> Recording:
    """Return the recording of facts and a film.

    Raises:
        KeyError, TypeError, ValueError: the facts are not those of a recording.
    """
    kinds = {kind.value: kind for kind in VehicleClass}
    lanes = tuple(Lane(**{**lane, "direction": Direction(lane["direction"])}) for lane in facts["lanes"])
    return Recording(
        name=facts["name"],
        frame_rate=facts["frame_rate"],
        lanes=lanes,
        x_min=facts["x_min"],
        x_max=facts["x_max"],
        film=film,
        vehicle_class={int(vehicle): kinds[kind] for vehicle, kind in facts["vehicle_class"].items()},
        dropped=tuple(Dropped(**item) for item in facts["dropped"]),
        notes=tuple(facts["notes"]),
        merging_lanes=tuple(
            MergingLane(**{**lane, "direction": Direction(lane["direction"])})
            for lane in facts["merging_lanes"]
        ),
        traffic=Traffic(facts["traffic"]),
    )
