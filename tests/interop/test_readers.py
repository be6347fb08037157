"""Readers of traffic that others keep agree with ours on files of our own making: the same rows, alike.

A road is straightened by us, and not by them: what a straight road leaves alone is compared, which is how far
vehicles move and are apart, and how fast they are.
"""

from __future__ import annotations

import subprocess
from collections import defaultdict
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

from drlsl.traffic import Recording, highd_content, load_recording, write_highd
from drlsl.traffic.edit import rows_of
from tests.traffic import twins
from tests.traffic.test_formats import assert_twins

State: TypeAlias = tuple[float, float, float]
"""x, y [m] of a vehicle's centre on a map, and its speed [m/s]."""

Theirs: TypeAlias = dict[tuple[int, int], State]
"""The state of each vehicle in each frame; frames from that of the first row."""


def assert_agreed(recording: Recording, theirs: Theirs) -> None:
    """The same rows, within 1 cm of the distances of all vehicles in a frame, and 0.05 m/s."""
    first = min(frame for _, frame in theirs)
    tracks = rows_of(recording)
    ours = {
        (int(vehicle), int(frame)): (x, y, float(np.hypot(vx, vy)))
        for vehicle, frame, x, y, vx, vy in zip(
            tracks.vehicle, tracks.frame, tracks.x, tracks.y, tracks.vx, tracks.vy, strict=True
        )
    }
    shifted = {(vehicle, frame - first): state for (vehicle, frame), state in theirs.items()}
    assert ours.keys() == shifted.keys()
    together = defaultdict(list)
    for vehicle, frame in ours:
        together[frame].append(vehicle)
    for frame, vehicles in together.items():
        mine, other = (np.array([rows[vehicle, frame] for vehicle in vehicles]) for rows in (ours, shifted))
        assert np.abs(mine[:, 2] - other[:, 2]).max() <= 0.05
        assert np.abs(_apart(mine) - _apart(other)).max() <= 0.015
    for vehicle in {vehicle for vehicle, _ in ours}:
        frames = sorted(frame for one, frame in ours if one == vehicle)
        mine, other = (np.array([rows[vehicle, frame] for frame in frames]) for rows in (ours, shifted))
        assert np.abs(_apart(mine)[0] - _apart(other)[0]).max() <= 0.015


def _apart(states: np.ndarray) -> np.ndarray:
    """The distance of each from each."""
    distance: np.ndarray = np.hypot(
        states[:, None, 0] - states[None, :, 0], states[:, None, 1] - states[None, :, 1]
    )
    return distance


def of_lxd_io(root: Path, part: int, x: str, y: str, size: tuple[str, str] | None) -> Theirs:
    """All rows of a recording that lxd-io finds; of `size` a half is added where it gives a corner."""
    lxd_io = pytest.importorskip("lxd_io")
    found = lxd_io.Dataset(root)
    assert found.recording_ids == [part]
    read = found.get_recording(part)
    theirs: Theirs = {}
    for one in read.track_ids:
        track = read.get_track(one)
        columns = [np.asarray(track.get_data(name)) for name in ("frame", x, y, "xVelocity", "yVelocity")]
        corner = (
            [np.zeros(1)] * 2 if size is None else [np.asarray(track.get_data(name)) / 2 for name in size]
        )
        frame, px, py, vx, vy = columns
        px, py, speed = px + corner[0], py + corner[1], np.hypot(vx, vy)
        for row in range(len(frame)):
            theirs[int(one), int(frame[row])] = (float(px[row]), float(py[row]), float(speed[row]))
    return theirs


def test_lxd_io_reads_exid_alike(tmp_path: Path) -> None:
    pytest.importorskip("lxd_io")
    root = tmp_path / "exid-dataset-v2.0"
    root.mkdir()
    twins.write_exid(root / "data", twins.traffic())
    # Without a picture of the road lxd-io leaves a recording out.
    (root / "data" / "07_background.png").write_bytes(b"")
    assert_agreed(load_recording(root, cache=False), of_lxd_io(root, 7, "xCenter", "yCenter", None))


def test_lxd_io_reads_what_is_converted_to_highd(tmp_path: Path) -> None:
    pytest.importorskip("lxd_io")
    made = load_recording("highway-test")
    root = tmp_path / "highd-dataset-v1.0"
    write_highd(highd_content(made), root / "data")
    assert_agreed(load_recording(root, cache=False), of_lxd_io(root, 1, "x", "y", ("width", "height")))


def test_commonroad_reads_alike(tmp_path: Path) -> None:
    reader = pytest.importorskip("commonroad.common.file_reader")
    made = twins.traffic(rate=10.0)
    path = twins.write_commonroad(tmp_path / "twin.xml", made)
    scenario, _ = reader.CommonRoadFileReader(str(path)).open()
    theirs = {}
    for obstacle in scenario.dynamic_obstacles:
        for state in [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]:
            x, y = state.position
            theirs[obstacle.obstacle_id, state.time_step] = (float(x), float(y), float(state.velocity))
    assert_agreed(load_recording(path, cache=False), theirs)


@pytest.mark.parametrize("suffix", ["mcap", "osi"])
def test_betterosi_reads_alike(suffix: str, tmp_path: Path) -> None:
    osi = pytest.importorskip("betterosi")
    made = twins.traffic(rate=20.0)
    path = twins.write_osi(tmp_path / f"twin.{suffix}", made)
    read = load_recording(path, cache=False)
    assert_twins(read, load_recording(twins.write_twin(tmp_path / "twin", made), cache=False))
    theirs = {}
    for message in osi.read(str(path), osi_message_type="GroundTruth"):
        time = message.timestamp.seconds + message.timestamp.nanos / 1e9
        for item in message.moving_object:
            place, velocity = item.base.position, item.base.velocity
            speed = float(np.hypot(velocity.x, velocity.y))
            theirs[item.id.value, round(time * 20)] = (place.x, place.y, speed)
    assert_agreed(read, theirs)


ROUTES = (
    '<routes><vType id="saloon" vClass="passenger" length="4.6" width="1.9" sigma="0"/>'
    '<flow id="f" type="saloon" begin="0" end="40" period="3" from="road" to="road" departLane="random" '
    'departSpeed="20"/></routes>'
)


@pytest.mark.parametrize("suffix", ["xml", "csv", "parquet"])
def test_libsumo_drives_what_is_read(suffix: str, tmp_path: Path) -> None:
    libsumo = pytest.importorskip("libsumo")
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    sumo = pytest.importorskip("sumo")
    (tmp_path / "n.nod.xml").write_text(
        '<nodes><node id="a" x="0" y="0"/><node id="b" x="560" y="210"/></nodes>'
    )
    (tmp_path / "e.edg.xml").write_text(
        '<edges><edge id="road" from="a" to="b" numLanes="2" speed="30"/></edges>'
    )
    (tmp_path / "traffic.rou.xml").write_text(ROUTES)
    net, out = tmp_path / "made.net.xml", tmp_path / "out" / f"fcd.{suffix}"
    out.parent.mkdir()
    (out.parent / "traffic.rou.xml").write_text(ROUTES)
    netconvert = Path(sumo.SUMO_HOME) / "bin" / "netconvert"
    command = [
        str(netconvert),
        "-n",
        str(tmp_path / "n.nod.xml"),
        "-e",
        str(tmp_path / "e.edg.xml"),
        "-o",
        str(net),
    ]
    subprocess.run(command, check=True, capture_output=True)
    files = ["-n", str(net), "-r", str(tmp_path / "traffic.rou.xml"), "--fcd-output", str(out)]
    quiet = ["--no-step-log", "true", "--no-warnings", "true"]
    libsumo.start(["sumo", *files, *quiet, "--step-length", "0.1", "--precision", "4", "--seed", "3"])
    theirs = {}
    for step in range(450):
        libsumo.simulationStep()
        for name in libsumo.vehicle.getIDList():
            (x, y), speed = libsumo.vehicle.getPosition(name), libsumo.vehicle.getSpeed(name)
            heading = np.radians(90.0 - libsumo.vehicle.getAngle(name))
            half = libsumo.vehicle.getLength(name) / 2
            place = x - half * np.cos(heading), y - half * np.sin(heading)
            theirs[int(name.split(".")[1]), step] = (float(place[0]), float(place[1]), float(speed))
    libsumo.close()
    read = load_recording(out, cache=False)
    ids = {vehicle: number for number, vehicle in enumerate(sorted({one for one, _ in theirs}), start=1)}
    assert_agreed(read, {(ids[vehicle], step): state for (vehicle, step), state in theirs.items()})
    assert len(read.lanes) == 2
