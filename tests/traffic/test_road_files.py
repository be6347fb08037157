"""The lanes of a road from a file beside the recording: SUMO's networks, and OpenDRIVE through netconvert."""

from __future__ import annotations

import gzip
import importlib.util
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.traffic import load_recording
from drlsl.traffic.formats.sumo_net import read_road
from drlsl.traffic.road_beside import road_beside
from tests.traffic import twins
from tests.traffic.test_formats import assert_twins
from tests.traffic.twins import traffic

MADE = traffic(rate=10.0)
needs_netconvert = pytest.mark.skipif(
    shutil.which("netconvert") is None and importlib.util.find_spec("sumo") is None,
    reason="needs netconvert on the PATH, or the extra sumo",
)


@pytest.mark.parametrize("ending", [".net.xml", ".net.xml.gz"])
def test_a_network_is_the_road(ending: str, tmp_path: Path) -> None:
    """The lane that nobody drives in is there; those for pedestrians, and the street above, are not."""
    whole = load_recording(twins.write_twin(tmp_path / "twin", MADE), cache=False)
    quiet = replace(MADE, rows=tuple(row for row in MADE.rows if row.lane not in (1, 4)))
    path = twins.write_fcd_xml(tmp_path / "fcd", quiet)
    assert len(load_recording(path, cache=False).lanes) == 2
    net = twins.write_net(path.parent / f"road{ending}", MADE)
    if ending.endswith("gz"):
        net.write_bytes(gzip.compress(net.read_bytes()))
    read = load_recording(path, cache=False)
    assert read.name == "fcd.xml"
    for lane, other in zip(read.lanes, whole.lanes, strict=True):
        assert lane.direction is other.direction
        assert lane.centre == pytest.approx(other.centre, abs=0.01)
        assert lane.width == pytest.approx(other.width, abs=0.01)
        assert lane.speed_limit == twins.LIMIT


@pytest.mark.parametrize("write", [twins.write_fcd_xml, twins.write_fcd_csv])
def test_with_a_network_tracks_are_those_of_the_twin(write, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = write(tmp_path / "fcd", MADE)
    twins.write_net(path.parent / "fcd.net.xml", MADE)
    twins.write_net(path.parent / "other.net.xml", traffic(rate=10.0, width=3.0))
    twin = load_recording(twins.write_twin(tmp_path / "twin", MADE), cache=False)
    assert_twins(load_recording(path, cache=False), twin)


def test_a_road_is_the_one_called_alike_or_the_only_one(tmp_path: Path) -> None:
    path = tmp_path / "one.mcap"
    assert road_beside(path) is None
    (tmp_path / "b.xodr").write_text("")
    assert road_beside(path) == tmp_path / "b.xodr"
    (tmp_path / "a.net.xml").write_text("")
    assert road_beside(path) is None
    (tmp_path / "one.net.xml.gz").write_text("")
    assert road_beside(path) == tmp_path / "one.net.xml.gz"


def test_another_road_is_another_recording_in_the_cache(tmp_path: Path) -> None:
    path = twins.write_fcd_xml(tmp_path / "fcd", MADE)
    widths = [load_recording(path).lanes[0].width]
    for width in (4.0, 3.9):
        twins.write_net(path.parent / "road.net.xml", replace(MADE, upper=(0.0, width, 8.0)))
        widths.append(load_recording(path).lanes[0].width)
    assert widths[1:] == [pytest.approx(one, abs=0.01) for one in (4.0, 3.9)]


LANE = '<lane id="a_0" speed="30" length="9" shape="0,0 9,0"/>'


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("<net><edge", "malformed XML"),
        ("<net/>", "no lane for cars"),
        (f"<net><edge>{LANE.replace('0,0 9,0', '0,0')}</edge></net>", "a shape of two points"),
        (f"<net><edge>{LANE.replace('0,0', 'x,0')}</edge></net>", "is no number"),
        (f"<net><edge>{LANE.replace('30', 'inf')}</edge></net>", "expected a width, a speed"),
        (f"<net><edge>{LANE}</edge></net>", "no lane of this road lies under the vehicles"),
    ],
)
def test_a_faulty_network_is_refused_in_one_line(content: str, problem: str, tmp_path: Path) -> None:
    path = twins.write_fcd_xml(tmp_path / "fcd", MADE)
    (path.parent / "road.net.xml").write_text(content)
    with pytest.raises(UserError, match=problem) as caught:
        load_recording(path, cache=False)
    assert str(caught.value).startswith(str(path.parent / "road.net.xml"))
    assert "\n" not in str(caught.value)


def test_without_netconvert_it_is_said_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    if importlib.util.find_spec("sumo") is not None:
        monkeypatch.setitem(__import__("sys").modules, "sumo", None)
    path = twins.write_fcd_xml(tmp_path / "fcd", MADE)
    twins.write_xodr(path.parent / "road.xodr", MADE)
    with pytest.raises(UserError, match=r"road\.xodr: OpenDRIVE .*pip install 'drlsl\[sumo\]'"):
        load_recording(path, cache=False)


def test_what_netconvert_says_of_a_road_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tool = tmp_path / "bin" / "netconvert"
    tool.parent.mkdir()
    tool.write_text("#!/bin/sh\necho 'Error: the road is icy' >&2\necho more >&2\nexit 1\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tool.parent}:/bin:/usr/bin")
    path = twins.write_xodr(tmp_path / "a,b.xodr", MADE)
    with pytest.raises(UserError, match=r"a,b\.xodr: netconvert cannot convert this road: the road is icy$"):
        read_road(path)
    tool.write_text("#!/bin/sh\nexit 0\n")
    with pytest.raises(UserError, match="cannot convert this road: no message"):
        read_road(path)


@needs_netconvert
def test_an_opendrive_road_is_that_of_the_twin(tmp_path: Path) -> None:
    quiet = replace(MADE, rows=tuple(row for row in MADE.rows if row.lane not in (1, 4)))
    path = twins.write_fcd_xml(tmp_path / "fcd", quiet)
    twins.write_xodr(path.parent / "a, b.xodr", MADE)
    read = load_recording(path, cache=False)
    twin = load_recording(twins.write_twin(tmp_path / "twin", MADE), cache=False)
    for lane, other in zip(read.lanes, twin.lanes, strict=True):
        assert lane.direction is other.direction
        assert lane.centre == pytest.approx(other.centre, abs=0.01)
        assert lane.width == pytest.approx(other.width, abs=0.01)
    assert {lane.speed_limit for lane in read.lanes} == {130 / 3.6}


@needs_netconvert
def test_traces_of_osi_take_an_opendrive_road(tmp_path: Path) -> None:
    pytest.importorskip("betterosi")
    made = traffic(rate=20.0)
    path = twins.write_osi(tmp_path / "one.mcap", made, roads=False)
    twins.write_xodr(tmp_path / "one.xodr", made)
    twin = load_recording(twins.write_twin(tmp_path / "twin", made), cache=False)
    assert_twins(load_recording(path, cache=False), twin)


@needs_netconvert
def test_lanes_of_a_bend_lie_where_opendrive_says(tmp_path: Path) -> None:
    """A straight of 100 m, then an arc to the left with a radius of 400 m."""
    path, radius = tmp_path / "bend.xodr", 400.0
    twins.write_xodr(path, MADE)
    text = path.read_text()
    begin, end = text.index("<geometry"), text.index("</planView>")
    bend = (
        '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
        f'<geometry s="100" x="100" y="0" hdg="0" length="200"><arc curvature="{1 / radius}"/></geometry>'
    )
    path.write_text(text[:begin] + bend + text[end:])
    offsets = {}
    for lane in read_road(path):
        x, y = lane.line.T
        right = np.where(x <= 100, -y, np.hypot(x - 100, y - radius) - radius)
        assert np.ptp(right) < 0.01
        offsets[lane.id] = float(np.median(right))
        assert lane.width == 4.0
        assert np.hypot(*np.diff(lane.line, axis=0).T).sum() > 290
    median = MADE.lower[0] - MADE.upper[-1]
    wanted = [-6.0, -2.0, median + 2.0, median + 6.0]
    assert sorted(offsets.values()) == [pytest.approx(one, abs=0.01) for one in wanted]
    assert math.isclose(sum(wanted), 2 * median)
