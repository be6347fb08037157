"""Roads as ordered: stretch, flow, trucks, limits of lanes, merging lanes; what recordings say."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from drlsl.cli.data import app
from drlsl.driving import EnvConfig, stress
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.traffic import (
    PRESETS,
    Direction,
    Merge,
    Recording,
    Traffic,
    VehicleClass,
    load_recording,
    recording_report,
    simulate,
    write_highd,
)
from drlsl.traffic.road_network import main_route, ramp_route
from drlsl.traffic.road_presets import LARGEST_FLOW, LIMITS, RAMP, SHORTEST_MERGE, STRETCHES, Preset
from tests.traffic.test_generate import by_hand
from tests.traffic.writing import Row
from tests.traffic.writing import write_highd as write_by_hand

needs_sumo = pytest.mark.skipif(importlib.util.find_spec("libsumo") is None, reason="needs the extra sumo")

LIMITED = (22.25, 27.75, 33.25)
"""Limits from the right lane to the left [m/s]."""

MERGE = Merge(at=150.0, length=200.0, flow=900.0)

ROAD = replace(
    PRESETS["highway-train"],
    frame_rate=10.0,
    flow=2400.0,
    truck_share=0.5,
    stretch=600.0,
    run_up=300.0,
    run_out=200.0,
    warm_up=60.0,
    lane_limits=LIMITED,
    merges=(MERGE,),
    traffic=Traffic.REACTIVE,
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    pytest.importorskip("libsumo", reason="needs the extra sumo")
    content = simulate(ROAD, seed=5, minutes=0.7)
    return load_recording(write_highd(content, tmp_path_factory.mktemp("roads") / "made"), cache=False)


numbers = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-1e4, 1e4)


@given(stretch=numbers, flow=numbers, share=numbers, limits=st.lists(numbers | st.just(30.0), max_size=4))
def test_numbers_are_taken_within_their_bounds_and_refused_elsewhere(
    stretch: float, flow: float, share: float, limits: list[float]
) -> None:
    preset = PRESETS["highway-test"]
    asked: dict[str, Any] = {
        "stretch": stretch,
        "flow": flow,
        "truck_share": share,
        "lane_limits": tuple(limits),
    }
    sound = STRETCHES[0] <= stretch <= STRETCHES[1] and 0 < flow <= preset.lanes * LARGEST_FLOW
    sound = sound and 0 <= share <= 1 and len(limits) in (0, preset.lanes)
    sound = sound and all(LIMITS[0] <= limit <= LIMITS[1] for limit in limits)
    if sound:
        assert replace(preset, **asked).lane_limits == tuple(limits)
    else:
        with pytest.raises(UserError) as caught:
            replace(preset, **asked)
        assert "\n" not in str(caught.value)


merges = st.lists(
    st.builds(
        Merge,
        st.floats(-10.0, 1400.0) | st.just(float("nan")),
        st.floats(40.0, 300.0) | st.just(float("nan")),
        st.floats(-10.0, 2600.0),
    ),
    max_size=3,
)


@given(merges=merges)
def test_merging_lanes_lie_in_the_stretch_apart_from_each_other(merges: list[Merge]) -> None:
    ordered = tuple(sorted(merges, key=lambda merge: merge.at))
    sound = all(
        0 <= merge.at <= merge.end <= 1400
        and merge.length >= SHORTEST_MERGE
        and 0 < merge.flow <= LARGEST_FLOW
        for merge in ordered
    )
    sound = sound and all(b.at >= a.end + RAMP for a, b in pairwise(ordered))
    if not sound:
        with pytest.raises(UserError):
            replace(PRESETS["overtake-test"], merges=ordered)
        return
    preset = replace(PRESETS["overtake-test"], merges=ordered, directions=tuple(Direction))
    assert len(preset.merging_lanes) == 2 * len(ordered)
    for lane in preset.merging_lanes:
        assert (lane.end - lane.begin) * lane.direction.sign >= SHORTEST_MERGE
        assert 0 <= min(lane.begin, lane.end) <= max(lane.begin, lane.end) <= preset.stretch
        edge = preset.lower_markings[-1] if lane.direction.sign > 0 else preset.upper_markings[0]
        assert abs(lane.centre - edge) == pytest.approx(preset.lane_width / 2)
    assert len(main_route(preset, Direction.LEFT_TO_RIGHT).split()) == 2 + 2 * len(ordered)


def test_a_ramp_leads_onto_its_own_merging_lane() -> None:
    preset = replace(ROAD, stretch=1000.0, merges=(MERGE, Merge(500.0, 100.0, 300.0)))
    route = ramp_route(preset, Direction.RIGHT_TO_LEFT, 1).split()
    assert route == [f"right_to_left_{part}" for part in ("ramp1", "merge1", "road2", "exit")]


limits = st.floats(5.0, 50.0).map(lambda value: round(value, 2))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    lane_limits=st.none() | st.tuples(limits, limits, limits),
    ramp=st.none() | st.floats(0.0, 200.0).map(lambda value: round(value, 2)),
    traffic=st.sampled_from(Traffic),
)
def test_what_a_recording_says_of_itself_is_read_back(
    tmp_path: Path, lane_limits: tuple[float, ...] | None, ramp: float | None, traffic: Traffic
) -> None:
    merges = () if ramp is None else (Merge(ramp, 60.0, 1.0),)
    preset = replace(ROAD, lanes=2, lane_width=4.0, lane_limits=(), merges=merges)
    content = replace(
        by_hand(),
        upper_markings=(8.0, 12.0),
        lower_markings=(20.0, 24.0, 28.0),
        lane_limits=lane_limits or (),
        merging_lanes=[
            replace(lane, centre=30.0) for lane in preset.merging_lanes if lane.direction.sign > 0
        ],
        traffic=traffic,
    )
    folder = write_highd(content, tmp_path / "out", force=True)
    for recording in [load_recording(folder, cache=False), load_recording(folder), load_recording(folder)]:
        assert tuple(lane.speed_limit for lane in recording.lanes) == (lane_limits or (130 / 3.6,) * 3)
        assert recording.traffic is traffic
        for lane, merge in zip(recording.merging_lanes, merges, strict=True):
            assert (lane.direction, lane.centre, lane.width) == (Direction.LEFT_TO_RIGHT, 30.0, 4.0)
            assert (lane.begin, lane.end) == pytest.approx((merge.at, merge.end), abs=0.01)
    own = {"laneSpeedLimits": lane_limits, "mergingLanes": merges, "traffic": traffic is Traffic.REACTIVE}
    header = (folder / "01_recordingMeta.csv").read_text().partition("\n")[0].split(",")
    assert [name for name in header if name in own] == [name for name, said in own.items() if said]


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        ("laneSpeedLimits", "30", "'30' is not 2 numbers joined by ';', one for each lane"),
        ("laneSpeedLimits", "30;fast", "'30;fast' is not 2 numbers"),
        ("laneSpeedLimits", "30;nan", "'30;nan' is not 2 numbers"),
        ("mergingLanes", "1:2:3", "'1:2:3' is not begin:end:top:bottom, in metres"),
        ("mergingLanes", "10:60:28:x", "'10:60:28:x' is not begin:end:top:bottom"),
        ("mergingLanes", "10:60:40:44", "a merging lane must lie beside the right lane of its direction"),
        ("mergingLanes", "60:10:28:32", "a merging lane must lie beside the right lane of its direction"),
        ("mergingLanes", "10:60:32:28", "a merging lane needs finite numbers and a width above 0"),
        ("mergingLanes", "10:10:28:32", "a merging lane must end after its beginning"),
        ("traffic", "wild", "'wild' is not recorded or reactive"),
    ],
)
def test_a_cell_that_means_nothing_is_refused(tmp_path: Path, column: str, cell: str, message: str) -> None:
    folder = write_by_hand(tmp_path / "h", [Row(1, 1, 100.0, 22.0)])
    meta = folder / "01_recordingMeta.csv"
    header, row = meta.read_text().splitlines()
    meta.write_text(f"{header},{column}\n{row},{cell}\n")
    with pytest.raises(UserError) as caught:
        load_recording(folder, cache=False)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("column", ["laneSpeedLimits", "mergingLanes", "traffic"])
def test_an_empty_cell_says_nothing(tmp_path: Path, column: str) -> None:
    folder = write_by_hand(tmp_path / "h", [Row(1, 1, 100.0, 22.0)])
    meta = folder / "01_recordingMeta.csv"
    header, row = meta.read_text().splitlines()
    meta.write_text(f"{column},{header}\n,{row}\n")
    recording = load_recording(folder, cache=False)
    assert {lane.speed_limit for lane in recording.lanes} == {130 / 3.6}
    assert (recording.merging_lanes, recording.traffic) == ((), Traffic.RECORDED)


@needs_sumo
def test_each_lane_has_its_limit_and_drivers_keep_it(made: Recording) -> None:
    ways = {way: [lane.speed_limit for lane in made.lanes_of(way)] for way in made.directions}
    assert ways == {Direction.RIGHT_TO_LEFT: list(LIMITED), Direction.LEFT_TO_RIGHT: list(LIMITED[::-1])}
    for lane in made.lanes:
        here = made.frames.valid & (made.frames.lane == lane.id)
        inside = here & (np.abs(made.frames.y - lane.centre) < 0.5)
        speed = np.abs(made.frames.vx[inside])
        # Who comes from a faster lane still brakes.
        assert np.percentile(speed, 90) <= lane.speed_limit + 0.02
        assert speed.max() < lane.speed_limit + 6.0


@needs_sumo
def test_the_merging_lane_is_used_and_left_before_it_ends(made: Recording) -> None:
    assert len(made.merging_lanes) == 2
    frames = made.frames
    off = frames.valid & (frames.lane == 0)
    for merging in made.merging_lanes:
        sign = merging.direction.sign
        mine = off & (np.abs(frames.y - merging.centre) <= merging.width / 2)
        front = sign * frames.x + frames.length / 2
        ids = np.unique(frames.vehicle[mine & (front >= sign * merging.begin)])
        assert len(ids) >= 5
        assert front[mine].min() >= sign * merging.begin - RAMP
        assert front[mine].max() <= sign * merging.end + 0.1
        entered = [
            vehicle for vehicle in ids if (frames.lane[frames.valid & (frames.vehicle == vehicle)] > 0).any()
        ]
        assert len(entered) >= 3
        off &= ~mine
    assert not off.any()
    report = recording_report(made)
    assert (report.overlaps, made.notes, made.traffic) == (0, (), Traffic.REACTIVE)
    assert report.largest_lateral_speed_m_s < 1.5
    assert all(lane.vehicles >= 5 for lane in report.merging_lanes)


@needs_sumo
def test_stretch_flow_and_trucks_are_as_ordered(made: Recording) -> None:
    assert (made.x_min, made.x_max) == pytest.approx((0.0, 600.0), abs=4.0)
    kinds = list(made.vehicle_class.values())
    assert kinds.count(VehicleClass.TRUCK) / len(kinds) == pytest.approx(0.5, abs=0.15)
    few = simulate(replace(ROAD, flow=600.0, merges=(), truck_share=0.0), seed=5, minutes=0.7)
    assert set(few.vehicle_class.values()) == {VehicleClass.CAR}
    assert len(few.vehicle_class) < 0.6 * len(kinds)


@needs_sumo
def test_the_ego_drives_past_a_merging_lane_and_is_not_to_blame(made: Recording) -> None:
    config = EnvConfig(recording="made")
    shield = Shield.default(tier="auto")
    *_, report = stress(config, [made], shield, ["random", "adversarial"], episodes=60, seed=0)
    assert (report.total.contacts_at_fault, report.total.off_road) == (0, 0)
    assert report.total.lane_changes > 20


@needs_sumo
def test_a_road_that_nobody_drives_on_is_refused() -> None:
    with pytest.raises(UserError, match="no vehicle was on the stretch: ask for more minutes or more flow"):
        simulate(replace(ROAD, flow=0.01, merges=(), warm_up=1.0), seed=1, minutes=0.02)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--stretch", "20"], "a stretch has 100 to 5000 m, not 20"),
        (["--flow", "nan"], "more than 0 and at most 7500 vehicles/h, not nan"),
        (["--truck-share", "1.5"], "the share of trucks is 0 to 1, not 1.5"),
        (["--lane-limits", "20,30"], "2 lane limits for 3 lanes; give one for all, or 3"),
        (["--lane-limits", "20,x,30"], "--lane-limits 20,x,30: expected numbers in m/s joined by commas"),
        (["--lane-limits", "70"], "a lane limit is 5 to 50 m/s, not 70"),
        (["--merge", "300:250"], "--merge 300:250: expected AT:LENGTH:FLOW in metres"),
        (["--merge", "1300:250:500"], "from 1300 to 1550 m does not lie in the stretch of 1400 m"),
        (["--merge", "300:10:500"], "a merging lane has 50 m or more, not 10"),
        (["--merge", "500:200:1", "--merge", "300:200:1"], "at 500 m begins less than 100 m behind the end"),
    ],
)
def test_what_cannot_be_made_is_one_line(tmp_path: Path, flags: list[str], message: str) -> None:
    out = tmp_path / "x"
    arguments = ["generate", "--preset", "overtake-test", "--out", str(out), *flags]
    with pytest.raises(UserError) as caught:
        CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not out.exists()


def test_the_flags_make_the_preset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Preset] = []

    def simulated(preset: Preset, **_: object) -> object:
        asked.append(preset)
        return by_hand()

    monkeypatch.setattr("drlsl.traffic.generate.simulate", simulated)
    monkeypatch.setattr("drlsl.traffic.simulate", simulated, raising=False)
    flags = "--stretch 2000 --flow 3000 --truck-share 0.1 --lane-limits 25 --traffic recorded"
    ramps = "--merge 900:200:300 --merge 300:250:600"
    arguments = f"generate --preset overtake-test --out {tmp_path / 'x'} {flags} {ramps}"
    assert CliRunner().invoke(app, arguments.split(), catch_exceptions=False).exit_code == 0
    expected = replace(
        PRESETS["overtake-test"],
        stretch=2000.0,
        flow=3000.0,
        truck_share=0.1,
        lane_limits=(25.0,) * 3,
        merges=(Merge(300.0, 250.0, 600.0), Merge(900.0, 200.0, 300.0)),
        traffic=Traffic.RECORDED,
    )
    assert asked == [expected]
