"""Every format loads to the recording of its twin in highD's layout, within 1 cm and 0.05 m/s."""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.traffic import Recording, load_recording, load_recordings
from drlsl.traffic.edit import rows_of
from tests.traffic import twins
from tests.traffic.twins import Traffic, traffic
from tests.traffic.writing import FOOT

LANE = 12 * FOOT
needs_pyarrow = pytest.mark.skipif(
    importlib.util.find_spec("pyarrow") is None, reason="needs the extra parquet"
)

FORMATS: dict[str, tuple[Callable[[Path, Traffic], Path], str, Traffic]] = {
    "exiD": (twins.write_exid, "", traffic()),
    "SUMO FCD, XML": (twins.write_fcd_xml, "", traffic(rate=10.0)),
    "SUMO FCD, CSV": (twins.write_fcd_csv, "", traffic(rate=10.0)),
    "SUMO FCD, Parquet": (twins.write_fcd_parquet, "", traffic(rate=10.0)),
    "TGSIM I-90": (
        lambda path, made: twins.write_tgsim(path, made, "I-90"),
        "#2",
        traffic(rate=10.0, directions=(1,)),
    ),
    "TGSIM I-294": (
        lambda path, made: twins.write_tgsim(path, made, "I-294"),
        "#1",
        traffic(rate=10.0, directions=(1,)),
    ),
    "TGSIM I-395": (lambda path, made: twins.write_tgsim(path, made, "I-395"), "#1", traffic(rate=10.0)),
    "I-24 MOTION": (twins.write_i24, "", traffic(width=LANE, median=2 * LANE)),
    "CommonRoad 2020a": (twins.write_commonroad, "", traffic()),
    "CommonRoad 2018b": (
        lambda path, made: twins.write_commonroad(path, made, version="2018b"),
        "",
        traffic(),
    ),
    "CommonRoad without speeds": (
        lambda path, made: twins.write_commonroad(path, made, speeds=False),
        "",
        traffic(),
    ),
    "AUTOMATUM": (twins.write_automatum, "", traffic()),
    "AUTOMATUM, vehicle's frame": (
        lambda path, made: twins.write_automatum(path, made, world=False),
        "",
        traffic(),
    ),
    "OSI": (twins.write_osi, "", traffic(rate=20.0)),
    "OSI without speeds": (
        lambda path, made: twins.write_osi(path, made, speeds=False),
        "",
        traffic(rate=20.0),
    ),
    "OSI without roads": (
        lambda path, made: twins.write_osi(path, made, roads=False),
        "",
        traffic(rate=20.0),
    ),
}
SUFFIX = {"I-24": ".json", "Comm": ".xml", "TGSI": ".csv", "OSI": ".mcap", "OSI ": ".mcap"}


def written(name: str, folder: Path) -> tuple[Path, str, Traffic]:
    write, part, made = FORMATS[name]
    if name == "SUMO FCD, Parquet":
        pytest.importorskip("pyarrow")
    if name.startswith("OSI"):
        pytest.importorskip("betterosi")
    return write(folder / f"made{SUFFIX.get(name[:4], '')}", made), part, made


def assert_twins(read: Recording, twin: Recording, metres: float = 0.01, speed: float = 0.05) -> None:
    """The same vehicles, places and speeds; x from the rearmost box, y from the uppermost border."""
    assert read.frame_rate == pytest.approx(twin.frame_rate)
    assert [lane.direction for lane in read.lanes] == [lane.direction for lane in twin.lanes]
    mine, true = rows_of(read), rows_of(twin)
    top = [one.lanes[0].centre - one.lanes[0].width / 2 for one in (read, twin)]
    for lane, other in zip(read.lanes, twin.lanes, strict=True):
        assert lane.centre - top[0] == pytest.approx(other.centre - top[1], abs=metres)
        assert lane.width == pytest.approx(other.width, abs=2 * metres)
    assert mine.frame.tolist() == true.frame.tolist()
    ids = dict(zip(mine.vehicle.tolist(), true.vehicle.tolist(), strict=True))
    assert len(set(ids.values())) == len(ids) == len(twin.vehicle_class)
    assert {ids[vehicle]: kind for vehicle, kind in read.vehicle_class.items()} == dict(twin.vehicle_class)
    for name, near in (
        ("x", metres),
        ("y", metres),
        ("vx", speed),
        ("vy", speed),
        ("length", 1e-3),
        ("width", 1e-3),
    ):
        one, other = getattr(mine, name), getattr(true, name)
        if name in "xy":
            one = one - (read.x_min if name == "x" else top[0])
            other = other - (twin.x_min if name == "x" else top[1])
        assert np.abs(one - other).max() <= near, name


def told(recording: Recording) -> str:
    return "; ".join([*recording.notes, *(f"{item.rows} {item.reason}" for item in recording.dropped)])


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_loads_to_its_twin(name: str, tmp_path: Path) -> None:
    path, part, made = written(name, tmp_path)
    read = load_recording(f"{path}{part}", cache=False)
    assert_twins(read, load_recording(twins.write_twin(tmp_path / "twin", made), cache=False))


@pytest.mark.parametrize("name", ["exiD", "CommonRoad 2020a"])
def test_nothing_is_noted_of_files_in_order(name: str, tmp_path: Path) -> None:
    path, _, _ = written(name, tmp_path)
    assert told(load_recording(path, cache=False)) == ""


def test_sentinels_are_known_by_name(tmp_path: Path) -> None:
    fcd = told(load_recording(twins.write_fcd_xml(tmp_path / "fcd", traffic(rate=10.0)), cache=False))
    assert re.search(r"\d+ beside the road: SUMO's position -1073741824", fcd)
    exid = told(load_recording(twins.write_exid(tmp_path / "exid", traffic(), pedestrian=True), cache=False))
    assert exid == "9 a pedestrian, bicycle or animal"


def test_estimates_are_noted(tmp_path: Path) -> None:
    i24, _, _ = written("I-24 MOTION", tmp_path)
    assert "velocities are slopes of the positions" in told(load_recording(i24, cache=False))
    path, _, _ = written("CommonRoad without speeds", tmp_path)
    assert "velocities of 16 vehicles are slopes" in told(load_recording(path, cache=False))
    fcd = twins.write_fcd_csv(tmp_path / "fcd", traffic(rate=10.0))
    (fcd.parent / "traffic.rou.xml").unlink()
    assert "sizes are SUMO's defaults for vehicle type lorry, saloon" in told(
        load_recording(fcd, cache=False)
    )


@pytest.mark.parametrize(
    "write",
    [twins.write_fcd_xml, twins.write_fcd_csv, pytest.param(twins.write_fcd_parquet, marks=needs_pyarrow)],
)
def test_a_changed_file_beside_is_read_again(write: Callable[[Path, Traffic], Path], tmp_path: Path) -> None:
    """Vehicle types and roads come from files beside SUMO's, which belong to what the cache is a copy of."""
    fcd = write(tmp_path / "fcd", traffic(rate=10.0))
    (fcd.parent / "traffic.rou.xml").rename(fcd.parent / "types.add.xml")

    def lengths() -> set[float]:
        found = load_recording(fcd).frames
        return set(found.length[found.valid].round(3).tolist())

    assert lengths() == {4.5, 14.0}
    edit(fcd.parent / "types.add.xml", '"4.5"', '"4.75"')
    assert lengths() == {4.75, 14.0}
    (fcd.parent / "more.rou.xml").write_text(
        '<routes><vType id="lorry" vClass="truck" length="16.5"/></routes>'
    )
    assert lengths() == {4.75, 14.0}, "of two definitions the last file's is taken"
    (fcd.parent / "types.add.xml").unlink()
    assert 16.5 in lengths()


def test_runs_of_a_table(tmp_path: Path) -> None:
    path = twins.write_tgsim(tmp_path / "t.csv", traffic(rate=10.0, directions=(1,)))
    with pytest.raises(UserError, match="holds runs 1, 2; choose one"):
        load_recording(path, cache=False)
    assert len(load_recordings(f"{path}#*", cache=False)) == 2


def edit(path: Path, old: str, new: str, count: int = 1) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


INTERVAL = "<velocity><intervalStart>20</intervalStart><intervalEnd>30</intervalEnd></velocity>"

BAD: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "no lanelets": (
        "exiD",
        lambda p: edit(p / "07_tracks.csv", "laneletId", "lane"),
        "no column laneletId: this is inD",
    ),
    "exiD limit": (
        "exiD",
        lambda p: edit(p / "07_recordingMeta.csv", "-1.0", "120"),
        "speed limit 120: expected m/s",
    ),
    "exiD class": (
        "exiD",
        lambda p: edit(p / "07_tracksMeta.csv", ",van", ",tram"),
        "class 'tram' is none of car, van",
    ),
    "FCD cut": ("SUMO FCD, XML", lambda p: p.write_text(p.read_text()[:-300]), "malformed XML"),
    "FCD number": ("SUMO FCD, XML", lambda p: edit(p, 'speed="', 'speed="fast'), "speed: 'fast"),
    "FCD column": (
        "SUMO FCD, CSV",
        lambda p: edit(p, "vehicle_lane", "vehicle_x2"),
        "missing column vehicle_lane",
    ),
    "FCD line": ("SUMO FCD, CSV", lambda p: p.write_text(p.read_text()[:-20]), "cells, expected 10"),
    "TGSIM column": ("TGSIM I-90", lambda p: edit(p, "lane_kf", "lane_kfx"), "unknown format"),
    "TGSIM type": ("TGSIM I-90", lambda p: edit(p, "small-vehicle", "tram", 10**6), "type 'tram': expected"),
    "I-24 key": ("I-24 MOTION", lambda p: edit(p, '"direction"', '"way"'), "document 1 has no direction"),
    "I-24 cut": ("I-24 MOTION", lambda p: p.write_text(p.read_text()[:-30]), "malformed JSON"),
    "I-24 class": (
        "I-24 MOTION",
        lambda p: edit(p, 'class": 0', 'class": 9'),
        "coarse_vehicle_class 9: expected 0 to 6",
    ),
    "CommonRoad cut": ("CommonRoad 2020a", lambda p: p.write_text(p.read_text()[:-30]), "malformed XML"),
    "CommonRoad interval": (
        "CommonRoad 2020a",
        lambda p: p.write_text(re.sub(r"<velocity>.*?</velocity>", INTERVAL, p.read_text(), count=1)),
        "obstacle 1: velocity: expected an exact value",
    ),
    "CommonRoad shape": (
        "CommonRoad 2020a",
        lambda p: edit(p, "rectangle", "circle", 2),
        "its shape is no rectangle",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_end_in_one_line(name: str, tmp_path: Path) -> None:
    which, spoil, message = BAD[name]
    path, part, _ = written(which, tmp_path)
    spoil(path)
    with pytest.raises(UserError) as caught:
        load_recording(f"{path}{part}", cache=False)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_a_crossing_cannot_be_straightened(tmp_path: Path) -> None:
    path = twins.write_commonroad(tmp_path / "c.xml", traffic())
    text = path.read_text()
    for vehicle in (1, 2, 3, 5, 6, 7):  # they drive across
        obstacle = re.search(rf'<dynamicObstacle id="{vehicle}">.*?</dynamicObstacle>', text, re.DOTALL)
        assert obstacle
        turned = re.sub(
            r"<point><x>(.*?)</x><y>(.*?)</y></point>", r"<point><x>\2</x><y>\1</y></point>", obstacle[0]
        )
        text = text.replace(obstacle[0], turned)
    path.write_text(text)
    with pytest.raises(UserError, match="vehicles drive in all directions, as at a crossing"):
        load_recording(path, cache=False)


def test_a_bend_is_straightened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    radius = 1500.0

    def bent(x: float, y: float) -> tuple[float, float]:
        angle = x / radius
        return (radius + y) * np.sin(angle), -(radius + y) * np.cos(angle) + radius * 0

    made = traffic()
    monkeypatch.setattr(twins, "on_map", bent)
    monkeypatch.setattr(
        twins,
        "velocity_on_map",
        lambda row: (
            row.vx * (1 + row.y / radius) * np.cos(row.x / radius) + row.vy * np.sin(row.x / radius),
            row.vx * (1 + row.y / radius) * np.sin(row.x / radius) - row.vy * np.cos(row.x / radius),
        ),
    )
    read = load_recording(twins.write_exid(tmp_path / "e", made), cache=False)
    assert "road straightened: its axis is up to" in told(read)
    twin = load_recording(twins.write_twin(tmp_path / "twin", made), cache=False)
    mine, true = rows_of(read), rows_of(twin)
    assert np.abs(mine.y - true.y).max() < 0.3
    assert np.abs(mine.x - true.x).max() < 4.0, "outer lanes of a bend are longer than its axis"
    assert [lane.direction for lane in read.lanes] == [lane.direction for lane in twin.lanes]


def test_i24_documents_are_a_list(tmp_path: Path) -> None:
    path = tmp_path / "t.json"
    path.write_text(json.dumps({"x_position": [1.0]}))
    with pytest.raises(UserError, match="expected a list of documents"):
        load_recording(path, cache=False)
