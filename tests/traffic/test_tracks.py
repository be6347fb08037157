"""Rows become padded arrays without loss."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.traffic import Tracks, lanes_of_rows, pack
from drlsl.traffic.packed_frames import Frames
from drlsl.traffic.tracks import segment_starts, without_duplicates
from tests.traffic.test_recording import LANES


def tracks_of(pairs: list[tuple[int, int]], values: list[float] | None = None) -> Tracks:
    frame = np.array([frame for frame, _ in pairs])
    vehicle = np.array([vehicle for _, vehicle in pairs])
    x = np.array(values, dtype=float) if values else frame * 100.0 + vehicle
    ones = np.ones(len(pairs))
    return Tracks(x, ones, ones, ones, ones, ones, frame, vehicle)


presences = st.sets(st.tuples(st.integers(0, 12), st.integers(0, 6)), min_size=1)


def packed(present: set[tuple[int, int]]) -> Frames:
    rows, _, dropped = without_duplicates(tracks_of(list(present)))
    assert not dropped
    return pack(rows, np.ones(len(rows), dtype=np.int16), name="test").frames


@given(presences)
def test_every_row_has_its_slot_and_no_other(present: set[tuple[int, int]]) -> None:
    frames = packed(present)
    found = {(int(t), int(frames.vehicle[t, k])) for t, k in zip(*np.nonzero(frames.valid), strict=True)}
    assert found == present
    assert np.array_equal(frames.x[frames.valid], [t * 100.0 + v for t, v in sorted_by_slot(frames)])


def sorted_by_slot(frames: Frames) -> list[tuple[int, int]]:
    return [(int(t), int(frames.vehicle[t, k])) for t, k in zip(*np.nonzero(frames.valid), strict=True)]


@given(presences)
def test_there_are_no_more_slots_than_the_busiest_frame_needs(present: set[tuple[int, int]]) -> None:
    frames = packed(present)
    assert frames.vehicle.shape[1] == frames.valid.sum(axis=1).max()


@given(presences)
def test_first_is_the_start_of_the_unbroken_stretch(present: set[tuple[int, int]]) -> None:
    frames = packed(present)
    for t, k in zip(*np.nonzero(frames.valid), strict=True):
        vehicle, start = int(frames.vehicle[t, k]), int(t)
        while (start - 1, vehicle) in present:
            start -= 1
        assert frames.first[t, k] == start


@given(presences)
def test_a_vehicle_keeps_its_slot_while_it_is_seen(present: set[tuple[int, int]]) -> None:
    frames = packed(present)
    slot = {
        (int(t), int(frames.vehicle[t, k])): int(k) for t, k in zip(*np.nonzero(frames.valid), strict=True)
    }
    for (t, vehicle), k in slot.items():
        assert slot.get((t - 1, vehicle), k) == k


def test_duplicates_are_told_from_contradictions() -> None:
    rows = tracks_of([(3, 1), (2, 1), (2, 1), (2, 1), (2, 4)], [30.0, 20.0, 20.0, 21.0, 24.0])
    kept, source, dropped = without_duplicates(rows)
    assert kept.x.tolist() == [20.0, 30.0, 24.0]
    assert source.tolist() == [1, 0, 4]
    assert [(item.rows, item.reason.split()[1]) for item in dropped] == [(1, "repeated:"), (1, "contradicts")]


def test_segments_begin_at_new_vehicles_and_after_gaps() -> None:
    rows = tracks_of([(0, 1), (1, 1), (3, 1), (4, 2)])
    assert segment_starts(rows).tolist() == [0, 2, 3]


def test_lanes_come_from_geometry() -> None:
    y = np.array([-0.1, 0.0, 3.9, 4.1, 8.0, 12.0, 15.9, 16.1])
    assert lanes_of_rows(y, LANES).tolist() == [0, 1, 1, 0, 2, 3, 3, 0]


def test_lanes_that_touch_leave_no_crack() -> None:
    from drlsl.traffic import Direction, Lane

    lanes = [Lane(n + 1, Direction.LEFT_TO_RIGHT, 9.83 + 3.66 * n, 3.66, 30.0) for n in range(5)]
    borders = np.array([8.0 + 3.66 * n for n in range(1, 5)])
    assert (lanes_of_rows(borders, lanes) > 0).all()
    assert (lanes_of_rows(np.round(borders, 2), lanes) > 0).all()


def test_frame_numbers_that_cannot_be_are_refused() -> None:
    with pytest.raises(UserError, match="check the frame numbers"):
        pack(tracks_of([(0, 1), (2**31 - 2, 1)]), np.ones(2, dtype=np.int16), name="test")
