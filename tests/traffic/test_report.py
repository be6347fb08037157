"""The report counts what is there."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from drlsl.traffic import RecordingReport, load_recording, recording_report
from tests.traffic.writing import Row, write_highd

FRAMES = range(1, 11)


def report_of(tmp_path: Path, rows: list[Row]) -> RecordingReport:
    return recording_report(load_recording(write_highd(tmp_path / "h", rows, upper=(8.0, 12.0), trucks=[3])))


def test_gaps_and_headways(tmp_path: Path) -> None:
    rows = [Row(1, 1, 100.0, 22.0, vx=20.0, length=4.0), Row(1, 2, 140.0, 22.0, vx=30.0, length=6.0)]
    rows += [Row(1, 3, 100.0, 10.0, vx=-25.0, length=10.0), Row(1, 4, 80.0, 10.0, vx=-25.0, length=4.0)]
    report = report_of(tmp_path, rows)
    assert [lane.gap_m.p50 if lane.gap_m else None for lane in report.lanes] == [13.0, 35.0, None]
    # Front to front: 41 m at 20 m/s, and 17 m at 25 m/s.
    headways = [lane.time_headway_s.p50 for lane in report.lanes if lane.time_headway_s]
    assert headways == pytest.approx([17.0 / 25.0, 41.0 / 20.0])
    assert [lane.speed_m_s.mean if lane.speed_m_s else None for lane in report.lanes] == [25.0, 25.0, None]
    assert (report.cars, report.trucks, report.motorcycles) == (3, 1, 0)


def test_density_counts_vehicles_per_kilometre_and_frame(tmp_path: Path) -> None:
    rows = [Row(frame, 1, 10.0 + frame, 22.0) for frame in FRAMES]
    rows += [Row(frame, 2, 500.0 + frame, 22.0) for frame in FRAMES if frame <= 5]
    report = report_of(tmp_path, rows)
    kilometres = (report.x_max_m - report.x_min_m) / 1000
    assert report.lanes[1].density_veh_per_km == pytest.approx(1.5 / kilometres)


def test_lane_changes_and_appearances(tmp_path: Path) -> None:
    changing = [Row(frame, 1, 10.0 + frame, 22.0 if frame < 5 else 26.0) for frame in FRAMES]
    to_the_shoulder = [Row(frame, 2, 60.0 + frame, 22.0 if frame < 5 else 40.0) for frame in FRAMES]
    entering = [Row(frame, 3, 5.0 + frame, 26.0) for frame in FRAMES if frame > 6]
    popping_up = [Row(frame, 4, 300.0, 22.0) for frame in FRAMES if frame > 6]
    from_the_right = [Row(frame, 5, 295.0, 10.0, vx=-20.0) for frame in FRAMES if frame > 3]
    far_end = [Row(1, 6, 302.25, 10.0, vx=-20.0)]
    rows = changing + to_the_shoulder + entering + popping_up + from_the_right + far_end
    report = report_of(tmp_path, rows)
    assert report.lane_changes == 1
    assert (report.appearances, report.appearances_mid_road) == (3, 1)
    assert report.rows_off_lane == 6


def test_overlaps_are_counted_once_a_frame(tmp_path: Path) -> None:
    rows = [Row(frame, 1, 100.0, 22.0) for frame in FRAMES]
    rows += [Row(frame, 2, 104.0 if frame < 4 else 104.6, 22.5) for frame in FRAMES]
    rows += [Row(frame, 7, 104.0, 24.5) for frame in FRAMES]
    assert report_of(tmp_path, rows).overlaps == 3


def test_the_report_is_json(tmp_path: Path) -> None:
    rows = [Row(frame, 1, 100.0 + frame, 22.0) for frame in FRAMES]
    report = report_of(tmp_path, [*rows, rows[0]])
    content = json.loads(json.dumps(asdict(report), allow_nan=False))
    assert content["vehicles"] == 1
    assert content["dropped"] == [{"reason": "row repeated: same vehicle, frame and values", "rows": 1}]
    assert content["gap_m"] is None
