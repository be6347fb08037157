"""Figures for checking whether a recording is plausible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drlsl.traffic.array_kinds import Floats, LaneIds, Mask
from drlsl.traffic.packed_frames import OFF_LANE, Frames
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.road import MergingLane

ENTRANCE = 15.0
"""A vehicle first seen with its rear more than this [m] into the stretch has appeared mid-road."""

STANDSTILL = 0.1
"""Speed [m/s] below which time headways are not measured."""

FRAMES_AT_ONCE = 256
"""Frames compared at once in the search for overlaps, which needs memory for every pair of vehicles."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Extremes, percentiles and mean of a quantity."""

    minimum: float
    p5: float
    p50: float
    p95: float
    maximum: float
    mean: float


@dataclass(frozen=True, slots=True)
class LaneReport:
    """One lane and its traffic; a Spread is None if there was nothing to measure."""

    id: int
    direction: str
    centre_m: float
    width_m: float
    speed_limit_m_s: float
    vehicles: int
    density_veh_per_km: float
    speed_m_s: Spread | None
    gap_m: Spread | None
    time_headway_s: Spread | None


@dataclass(frozen=True, slots=True)
class MergingLaneReport:
    """A merging lane, from x to x in the order of travel, and the number of vehicles seen in it."""

    direction: str
    begin_m: float
    end_m: float
    vehicles: int


@dataclass(frozen=True, slots=True)
class RecordingReport:
    """The figures of a recording.

    Speeds count along the lane's direction; gaps run from bumper to bumper, time headways from front to
    front, both to the leader in the same lane. `overlaps` counts pairs of boxes that overlap, once a frame.
    `traffic` is what the vehicles do about an ego if its configuration has no other wish.
    """

    name: str
    frame_rate_hz: float
    frames: int
    duration_s: float
    x_min_m: float
    x_max_m: float
    vehicles: int
    cars: int
    trucks: int
    motorcycles: int
    rows: int
    rows_off_lane: int
    most_in_one_frame: int
    lanes: tuple[LaneReport, ...]
    gap_m: Spread | None
    time_headway_s: Spread | None
    lane_changes: int
    appearances: int
    appearances_mid_road: int
    overlaps: int
    largest_lateral_speed_m_s: float
    traffic: str
    merging_lanes: tuple[MergingLaneReport, ...]
    dropped: tuple[Dropped, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Followers:
    """Every pair of a follower and its leader in the same lane and frame; arrays of shape (pairs,)."""

    lane: LaneIds
    gap: Floats
    headway: Floats


def recording_report(recording: Recording) -> RecordingReport:
    """Measure a recording; see RecordingReport."""
    frames, valid = recording.frames, recording.frames.valid
    pairs = _followers(recording)
    kinds = list(recording.vehicle_class.values())
    began, mid_road = _appearances(recording)
    return RecordingReport(
        name=recording.name,
        frame_rate_hz=recording.frame_rate,
        frames=recording.frame_count,
        duration_s=recording.duration,
        x_min_m=recording.x_min,
        x_max_m=recording.x_max,
        vehicles=len(kinds),
        cars=kinds.count(VehicleClass.CAR),
        trucks=kinds.count(VehicleClass.TRUCK),
        motorcycles=kinds.count(VehicleClass.MOTORCYCLE),
        rows=int(valid.sum()),
        rows_off_lane=int((valid & (frames.lane == OFF_LANE)).sum()),
        most_in_one_frame=int(valid.sum(axis=1).max()),
        lanes=_lanes(recording, pairs),
        gap_m=_spread(pairs.gap),
        time_headway_s=_spread(pairs.headway),
        lane_changes=_lane_changes(frames),
        appearances=began,
        appearances_mid_road=mid_road,
        overlaps=_overlaps(frames),
        largest_lateral_speed_m_s=float(np.abs(frames.vy[valid]).max()),
        traffic=recording.traffic.value,
        merging_lanes=tuple(
            MergingLaneReport(
                lane.direction.value, lane.begin, lane.end, _in_merging_lane(recording.frames, lane)
            )
            for lane in recording.merging_lanes
        ),
        dropped=recording.dropped,
        notes=recording.notes,
    )


def _spread(values: Floats) -> Spread | None:
    finite = values[np.isfinite(values)]
    if not len(finite):
        return None
    low, median, high = np.percentile(finite, [5, 50, 95]).tolist()
    return Spread(float(finite.min()), low, median, high, float(finite.max()), float(finite.mean()))


def _signs(recording: Recording) -> npt.NDArray[np.int64]:
    """Return the direction of travel per slot, the lane's or, off the lanes, the velocity's; shape (F, K)."""
    of_lane = np.array([0, *(lane.direction.sign for lane in recording.lanes)])[recording.frames.lane]
    moving = np.where(recording.frames.vx < 0, -1, 1)
    return np.where(of_lane == 0, moving, of_lane)


def _followers(recording: Recording) -> _Followers:
    frames, valid = recording.frames, recording.frames.valid
    use = valid & (frames.lane != OFF_LANE)
    index = np.nonzero(use)[0]
    sign = _signs(recording)[use]
    along, lane = frames.x[use] * sign, frames.lane[use]
    order = np.lexsort((along, lane, index))
    behind, ahead = order[:-1], order[1:]
    together = (index[behind] == index[ahead]) & (lane[behind] == lane[ahead])
    behind, ahead = behind[together], ahead[together]
    half, speed = frames.length[use] / 2, frames.vx[use] * sign
    distance = along[ahead] - along[behind]
    fronts = distance + half[ahead] - half[behind]
    headway = np.divide(
        fronts, speed[behind], out=np.full(len(behind), np.nan), where=speed[behind] > STANDSTILL
    )
    return _Followers(lane[behind], distance - half[ahead] - half[behind], headway)


def _lanes(recording: Recording, pairs: _Followers) -> tuple[LaneReport, ...]:
    kilometres = (recording.x_max - recording.x_min) / 1000
    reports = []
    for lane in recording.lanes:
        here: Mask = recording.frames.valid & (recording.frames.lane == lane.id)
        reports.append(
            LaneReport(
                id=lane.id,
                direction=lane.direction.value,
                centre_m=lane.centre,
                width_m=lane.width,
                speed_limit_m_s=lane.speed_limit,
                vehicles=len(np.unique(recording.frames.vehicle[here])),
                density_veh_per_km=float(here.sum()) / recording.frame_count / kilometres,
                speed_m_s=_spread(recording.frames.vx[here] * lane.direction.sign),
                gap_m=_spread(pairs.gap[pairs.lane == lane.id]),
                time_headway_s=_spread(pairs.headway[pairs.lane == lane.id]),
            )
        )
    return tuple(reports)


def _in_merging_lane(frames: Frames, lane: MergingLane) -> int:
    """Return the number of vehicles whose centre was in a merging lane."""
    sign = lane.direction.sign
    inside = (sign * frames.x >= sign * lane.begin) & (sign * frames.x <= sign * lane.end)
    inside &= np.abs(frames.y - lane.centre) <= lane.width / 2
    return len(np.unique(frames.vehicle[inside]))


def _lane_changes(frames: Frames) -> int:
    """Return the number of steps of one vehicle from one lane into another."""
    index = np.arange(1, frames.first.shape[0])[:, None]
    same = frames.valid[1:] & (frames.first[1:] < index)
    before, after = frames.lane[:-1], frames.lane[1:]
    return int((same & (before != after) & (before != OFF_LANE) & (after != OFF_LANE)).sum())


def _appearances(recording: Recording) -> tuple[int, int]:
    """Return the number of appearances after the first frame, and of those far from the entrance."""
    frames = recording.frames
    index = np.arange(recording.frame_count)[:, None]
    starts = frames.valid & (frames.first == index) & (index > 0)
    x, half, sign = frames.x[starts], frames.length[starts] / 2, _signs(recording)[starts]
    rear = x - sign * half
    depth = np.where(sign > 0, rear - recording.x_min, recording.x_max - rear)
    return int(starts.sum()), int((depth > ENTRANCE).sum())


def _overlaps(frames: Frames) -> int:
    """Return the number of pairs of boxes that overlap, over all frames."""
    count = 0
    for start in range(0, len(frames.x), FRAMES_AT_ONCE):
        chunk = slice(start, start + FRAMES_AT_ONCE)
        hit = _closer(frames.x[chunk], frames.length[chunk]) & _closer(frames.y[chunk], frames.width[chunk])
        # Each pair is counted from both sides, and each vehicle with itself.
        count += (int(hit.sum()) - int(frames.valid[chunk].sum())) // 2
    return count


def _closer(centre: Floats, size: Floats) -> Mask:
    """Return whether two extents overlap, for every pair in a frame; else False. Shape (F, K, K)."""
    distance = np.abs(centre[:, :, None] - centre[:, None, :])
    overlap: Mask = distance < (size[:, :, None] + size[:, None, :]) / 2
    return overlap
