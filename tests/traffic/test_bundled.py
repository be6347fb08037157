"""The bundled recordings are what the documentation promises."""

from __future__ import annotations

import hashlib
import lzma
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from drlsl.traffic import (
    BUNDLED,
    PRESETS,
    Direction,
    Recording,
    RecordingReport,
    Traffic,
    VehicleClass,
    bundled_recordings,
    load_recording,
    recording_report,
    simulate,
    write_highd,
)
from drlsl.traffic.array_kinds import Mask
from drlsl.traffic.simulated_drivers import HARDEST_BRAKING

HIGHWAYS = ("highway-train", "highway-test")
OVERTAKES = ("overtake-train", "overtake-test", "overtake-dense-test")
MERGES = ("merge-train", "merge-test")
NAMES = (*HIGHWAYS, "freeway", *OVERTAKES, *MERGES)


@pytest.fixture(scope="module")
def recordings() -> Mapping[str, Recording]:
    return {name: load_recording(name, cache=False) for name in NAMES}


@pytest.fixture(scope="module")
def reports(recordings: Mapping[str, Recording]) -> Mapping[str, RecordingReport]:
    return {name: recording_report(recording) for name, recording in recordings.items()}


def of_class(recording: Recording, kind: VehicleClass) -> Mask:
    ids = [vehicle for vehicle, found in recording.vehicle_class.items() if found is kind]
    return recording.frames.valid & np.isin(recording.frames.vehicle, ids)


def continued(recording: Recording) -> Mask:
    """Slots, from frame 1 on, whose vehicle was there the frame before."""
    index = np.arange(1, recording.frame_count)[:, None]
    return recording.frames.valid[1:] & (recording.frames.first[1:] < index)


def test_there_is_one_for_each_preset() -> None:
    assert set(bundled_recordings()) == set(NAMES) == set(PRESETS)


def test_all_together_take_four_and_a_half_megabytes_at_most() -> None:
    assert sum(path.stat().st_size for path in BUNDLED.rglob("*") if path.is_file()) <= 4_500_000


DIGESTS = {
    "freeway": "d2f7165852846aa96a3d8546a04de5f35a2a8b1fe20066f5962e134aac3aaa1d",
    "highway-test": "4c0b89d48ad778cb9b3af14e1faecc533d09e6ad5c98ec258e264db2014febeb",
    "highway-train": "79bea190a005055e2c1dbd9d443f88049456453d84f7f1a340a2cdbfaf3ac83a",
    "merge-test": "56fc07291e34cc36c32dfe48ae4716c8e58364eabefd57b4db776ab6a585d13f",
    "merge-train": "05cf12c4dfeb13962026aa79b7e1661e6e24c7834aec0863f9f9e1e916dd2996",
    "overtake-dense-test": "1bf444eb1e6f95057cdd51044fd146cc669ff5f6013bc692c493273b7e28050a",
    "overtake-test": "00e914d0b8936426a4268e5014058c9d93605bcc90e83c2544a739814f32a766",
    "overtake-train": "a95fe4703fc79d76caa19ef28a722bf0ca30a7fbc69ae67552ac7e7701d6f5bd",
}
"""SHA-256 of each recording's three files, unpacked: results with them can be compared between versions."""


@pytest.mark.parametrize("name", NAMES)
def test_the_rows_are_those_of_before(name: str) -> None:
    digest = hashlib.sha256()
    for path in sorted((BUNDLED / name).iterdir()):
        digest.update(lzma.decompress(path.read_bytes()))
    assert digest.hexdigest() == DIGESTS[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_presets_make_the_same_rows(name: str, tmp_path: Path) -> None:
    pytest.importorskip("libsumo", reason="needs the extra sumo")
    preset = PRESETS[name]
    made = write_highd(simulate(preset, seed=preset.seed, minutes=preset.minutes), tmp_path / name)
    for path in made.iterdir():
        assert path.read_bytes() == lzma.decompress((BUNDLED / name / f"{path.name}.xz").read_bytes())


@pytest.mark.parametrize("name", NAMES)
def test_every_promise_of_a_recording_is_kept(recordings: Mapping[str, Recording], name: str) -> None:
    recordings[name].validate()
    assert recordings[name].dropped == ()
    assert recordings[name].notes == ()


@pytest.mark.parametrize("name", HIGHWAYS)
def test_a_highway_looks_like_highd(
    recordings: Mapping[str, Recording], reports: Mapping[str, RecordingReport], name: str
) -> None:
    recording, report = recordings[name], reports[name]
    assert recording.frame_rate == 25.0
    assert [lane.direction.sign for lane in recording.lanes] == [-1, -1, -1, 1, 1, 1]
    assert (recording.x_min, recording.x_max) == pytest.approx((0.0, 420.0), abs=0.1)
    assert report.appearances / (recording.duration - 1) * 600 == pytest.approx(1700, rel=0.08)
    assert report.trucks / report.vehicles == pytest.approx(0.11, abs=0.015)
    assert report.lane_changes / report.vehicles > 0.05


def test_lengths(recordings: Mapping[str, Recording]) -> None:
    minutes = {name: recording.duration / 60 for name, recording in recordings.items()}
    assert minutes == pytest.approx({name: preset.minutes for name, preset in PRESETS.items()})
    assert minutes["highway-train"] >= 3.0
    assert min(minutes.values()) >= 1.5


def test_the_freeway_looks_like_us101(
    recordings: Mapping[str, Recording], reports: Mapping[str, RecordingReport]
) -> None:
    recording, report = recordings["freeway"], reports["freeway"]
    assert recording.frame_rate == 10.0
    assert recording.directions == (Direction.LEFT_TO_RIGHT,)
    assert len(recording.lanes) == 5
    assert recording.lanes[0].speed_limit == pytest.approx(29.06)
    assert np.mean([lane.density_veh_per_km for lane in report.lanes]) > 25
    assert 6.0 < np.mean(recording.frames.vx[recording.frames.valid]) < 16.0


@pytest.mark.parametrize("name", OVERTAKES)
def test_an_overtake_road_is_long_and_has_slow_trucks_and_fast_cars(
    recordings: Mapping[str, Recording], reports: Mapping[str, RecordingReport], name: str
) -> None:
    recording, report = recordings[name], reports[name]
    assert recording.frame_rate == 10.0
    assert [lane.direction.sign for lane in recording.lanes] == [1, 1, 1]
    assert (recording.x_min, recording.x_max) == pytest.approx((0.0, 1400.0), abs=0.1)
    flow = report.appearances / recording.duration * 3600
    assert flow == pytest.approx(PRESETS[name].flow, rel=0.15)
    assert report.trucks / report.vehicles == pytest.approx(0.22, abs=0.05)
    left, _, right = (lane.speed_m_s for lane in report.lanes)
    assert left is not None
    assert right is not None
    assert left.mean - right.mean > 8


@pytest.mark.parametrize("name", MERGES)
def test_a_merge_road_has_a_ramp_from_which_vehicles_join(
    recordings: Mapping[str, Recording], reports: Mapping[str, RecordingReport], name: str
) -> None:
    recording, report = recordings[name], reports[name]
    assert recording.frame_rate == 10.0
    assert [lane.speed_limit for lane in recording.lanes] == pytest.approx([120 / 3.6, 100 / 3.6], abs=0.01)
    (ramp,) = recording.merging_lanes
    assert (ramp.begin, ramp.end) == (200.0, 450.0)
    frames = recording.frames
    off = frames.valid & (frames.lane == 0)
    assert np.abs(frames.y[off] - ramp.centre).max() <= ramp.width / 2
    assert frames.x[off].max() < ramp.end
    on_the_ramp, on_the_road = (
        set(frames.vehicle[rows].tolist()) for rows in (off, frames.valid & (frames.lane > 0))
    )
    seen_to_the_end = on_the_ramp - set(frames.vehicle[-1].tolist())
    assert seen_to_the_end <= on_the_road
    assert len(seen_to_the_end) > 10
    # Those on the ramp are seen from where it runs beside the road.
    assert report.appearances_mid_road == pytest.approx(len(on_the_ramp), abs=3)


def test_the_overtake_and_the_merge_roads_say_that_their_traffic_reacts(
    recordings: Mapping[str, Recording],
) -> None:
    reacts = {name for name, recording in recordings.items() if recording.traffic is Traffic.REACTIVE}
    assert reacts == {*OVERTAKES, *MERGES}


@pytest.mark.parametrize("name", HIGHWAYS)
def test_people_drive_as_fast_as_they_do(recordings: Mapping[str, Recording], name: str) -> None:
    recording = recordings[name]
    speed = np.abs(recording.frames.vx)
    low, middle, high = np.percentile(speed[of_class(recording, VehicleClass.CAR)], [5, 50, 95])
    assert low > 23
    assert 27 < middle < 33
    assert high > 34
    trucks = speed[of_class(recording, VehicleClass.TRUCK)]
    assert 22 < np.mean(trucks) < 25
    assert trucks.max() < 27


@pytest.mark.parametrize("name", NAMES)
def test_no_two_boxes_overlap(reports: Mapping[str, RecordingReport], name: str) -> None:
    assert reports[name].overlaps == 0
    gap = reports[name].gap_m
    assert gap is not None
    assert gap.minimum > 1.0


@pytest.mark.parametrize("name", [name for name in NAMES if name not in MERGES])
def test_nobody_appears_mid_road(reports: Mapping[str, RecordingReport], name: str) -> None:
    # A vehicle is seen once its box is wholly on the stretch, so 15 m leave room for a step of 4 m.
    assert reports[name].appearances_mid_road == 0
    assert reports[name].rows_off_lane == 0


@pytest.mark.parametrize("name", NAMES)
def test_motion_is_continuous_and_agrees_with_velocity(
    recordings: Mapping[str, Recording], name: str
) -> None:
    frames, dt, same = recordings[name].frames, recordings[name].dt, continued(recordings[name])
    # Positions are rounded to centimetres in either frame, velocities to centimetres per second.
    rounding = 0.0101
    for position, velocity in ((frames.x, frames.vx), (frames.y, frames.vy)):
        step = np.diff(position, axis=0)[same]
        assert np.abs(step - velocity[1:][same] * dt).max() <= rounding + 0.005 * dt
    assert np.abs(frames.vy[frames.valid]).max() < 1.5
    assert np.abs(np.diff(frames.vy, axis=0)[same]).max() / dt < 3.0


@pytest.mark.parametrize("name", NAMES)
def test_nobody_brakes_harder_than_a_road_allows(recordings: Mapping[str, Recording], name: str) -> None:
    frames, dt, same = recordings[name].frames, recordings[name].dt, continued(recordings[name])
    acceleration = np.diff(frames.vx, axis=0)[same] / dt
    assert np.abs(acceleration).max() <= HARDEST_BRAKING + 0.01 / dt


@pytest.mark.parametrize("name", HIGHWAYS)
def test_lane_changes_take_seconds(recordings: Mapping[str, Recording], name: str) -> None:
    recording = recordings[name]
    frames, same = recording.frames, continued(recording)
    changes = np.argwhere((np.diff(frames.lane, axis=0) != 0) & same)
    lateral = [abs(frames.vy[t + 1, k]) for t, k in changes]
    assert len(changes) > 20
    assert 0.2 < np.median(lateral) <= 1.1


@pytest.mark.parametrize("name", NAMES)
def test_vehicles_vary_in_size(recordings: Mapping[str, Recording], name: str) -> None:
    recording = recordings[name]
    cars, trucks = (of_class(recording, kind) for kind in (VehicleClass.CAR, VehicleClass.TRUCK))
    assert len(np.unique(recording.frames.length[cars])) > 50
    assert recording.frames.length[cars].max() < 6 < 7.9 < recording.frames.length[trucks].min()
    assert recording.frames.width[recording.frames.valid].min() > 1.5
    assert recording.frames.width[recording.frames.valid].max() < 2.7


def test_train_and_test_are_different_traffic(recordings: Mapping[str, Recording]) -> None:
    for names in (HIGHWAYS, OVERTAKES[:2], MERGES):
        train, test = (recordings[name].frame(0) for name in names)
        assert not set(train.x.tolist()) & set(test.x.tolist())


@pytest.mark.parametrize("name", OVERTAKES)
def test_a_recording_is_the_same_by_whatever_path(
    recordings: Mapping[str, Recording], name: str, tmp_path: Path
) -> None:
    plain = tmp_path / name
    plain.mkdir()
    for packed in (BUNDLED / name).iterdir():
        (plain / packed.stem).write_bytes(lzma.decompress(packed.read_bytes()))
    paths: list[str | Path] = [
        BUNDLED / name,
        f"{BUNDLED / name}#01",
        BUNDLED / name / "01_tracks.csv.xz",
        plain,
    ]
    for path in paths:
        recording = load_recording(path, cache=path == plain)
        if path == plain:
            recording = load_recording(path)  # from the cache
        for item, array in recording.frames.arrays():
            np.testing.assert_array_equal(array, getattr(recordings[name].frames, item))
        assert (recording.lanes, recording.traffic) == (recordings[name].lanes, Traffic.REACTIVE)


def test_the_files_have_two_decimals_and_one_lane_numbering() -> None:
    with lzma.open(BUNDLED / "freeway" / "01_tracks.csv.xz", "rt") as file:
        names = file.readline().strip().split(",")
        cells = [file.readline().strip().split(",") for _ in range(100)]
    assert names[:4] == ["frame", "id", "x", "y"]
    assert {len(row[2].partition(".")[2]) for row in cells} == {2}
    assert {int(row[-1]) for row in cells} <= {2, 3, 4, 5, 6}
