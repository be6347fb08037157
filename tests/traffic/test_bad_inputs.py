"""Every bad input gives one line that says where it is wrong and what was expected."""

from __future__ import annotations

import gzip
import lzma
from collections.abc import Callable
from pathlib import Path

import pytest

from drlsl.errors import UserError
from drlsl.traffic import load_recording
from tests.traffic.writing import NGSIM, Row, ngsim_cells, write_highd, write_ngsim_csv, write_ngsim_text

ROWS = [Row(1, 1, 50.0, 22.0), Row(2, 1, 51.0, 22.0), Row(2, 2, 90.0, 26.0)]


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text, f"{old!r} is not in {path}"
    path.write_text(text.replace(old, new, 1))


def cell(path: Path, line: int, column: int, value: str) -> None:
    lines = path.read_text().splitlines()
    cells = lines[line - 1].split(",")
    cells[column] = value
    lines[line - 1] = ",".join(cells)
    path.write_text("\n".join([*lines, ""]))


HighdFault = tuple[Callable[[Path], object], str]

HIGHD: dict[str, HighdFault] = {
    "no tracks": (lambda f: (f / "01_tracks.csv").unlink(), "no recording in this folder"),
    "no tracksMeta": (lambda f: (f / "01_tracksMeta.csv").unlink(), "01_tracksMeta.csv: no such file"),
    "no recordingMeta": (
        lambda f: (f / "01_recordingMeta.csv").unlink(),
        "01_recordingMeta.csv: no such file",
    ),
    "empty tracks": (lambda f: (f / "01_tracks.csv").write_text(""), "01_tracks.csv: the file is empty"),
    "header only": (
        lambda f: (f / "01_tracks.csv").write_text("frame,id,x,y,width,height,xVelocity,yVelocity\n"),
        "01_tracks.csv: no vehicle",
    ),
    "missing columns": (
        lambda f: edit(f / "01_tracks.csv", "width,height", "w,h"),
        "01_tracks.csv: missing columns width, height; found frame, id, x, y, w, h,",
    ),
    "nan": (
        lambda f: cell(f / "01_tracks.csv", 3, 2, "nan"),
        "01_tracks.csv:3: column x: 'nan' is not a finite",
    ),
    "inf": (
        lambda f: cell(f / "01_tracks.csv", 4, 6, "inf"),
        "01_tracks.csv:4: column xVelocity: 'inf' is not",
    ),
    "no number": (
        lambda f: cell(f / "01_tracks.csv", 2, 3, "abc"),
        "01_tracks.csv:2: column y: 'abc' is not",
    ),
    "empty cell": (
        lambda f: cell(f / "01_tracks.csv", 2, 3, ""),
        "01_tracks.csv:2: column y: '' is not a finite",
    ),
    "fraction": (
        lambda f: cell(f / "01_tracks.csv", 3, 0, "1.5"),
        "01_tracks.csv:3: column frame: '1.5' is not a whole",
    ),
    "negative id": (
        lambda f: cell(f / "01_tracks.csv", 3, 1, "-4"),
        "01_tracks.csv:3: column id: '-4' is not a whole",
    ),
    "huge frame": (
        lambda f: cell(f / "01_tracks.csv", 3, 0, "9e18"),
        "01_tracks.csv:3: column frame: '9e18'",
    ),
    "absurd frame": (lambda f: cell(f / "01_tracks.csv", 3, 0, "2000000000"), "check the frame numbers"),
    "no length": (
        lambda f: cell(f / "01_tracks.csv", 3, 4, "0"),
        "01_tracks.csv:3: column width: '0' is not a number above 0",
    ),
    "short line": (lambda f: edit(f / "01_tracks.csv", ",0\n", "\n"), "01_tracks.csv:2: 8 cells, expected 9"),
    "cut off": (
        lambda f: (f / "01_tracks.csv").write_text((f / "01_tracks.csv").read_text()[:-20]),
        "01_tracks.csv:4: ",
    ),
    "binary": (
        lambda f: (f / "01_tracks.csv").write_bytes(b"\x00\xff\xfe\x80" * 40),
        "01_tracks.csv: cannot be read",
    ),
    "vehicle unknown": (
        lambda f: edit(f / "01_tracksMeta.csv", "2,Car\n", ""),
        "01_tracksMeta.csv: no row for vehicle 2",
    ),
    "class unknown": (
        lambda f: edit(f / "01_tracksMeta.csv", "2,Car", "2,Tram"),
        "01_tracksMeta.csv: vehicle 2: class 'Tram' is none of Car, Truck, Motorcycle",
    ),
    "markings": (
        lambda f: edit(f / "01_recordingMeta.csv", "20.0;24.0;28.0", "20.0;x;28.0"),
        "01_recordingMeta.csv:2: column lowerLaneMarkings: '20.0;x;28.0' is not two or more increasing",
    ),
    "markings fall": (
        lambda f: edit(f / "01_recordingMeta.csv", "20.0;24.0", "24.0;20.0"),
        "increasing numbers",
    ),
    "one marking": (lambda f: edit(f / "01_recordingMeta.csv", "20.0;24.0;28.0", "20.0"), "two or more"),
    "no markings": (lambda f: edit(f / "01_recordingMeta.csv", "20.0;24.0;28.0", ""), "no lane markings"),
    "sides swapped": (
        lambda f: edit(f / "01_recordingMeta.csv", ",,20.0;24.0;28.0", ",40.0;44.0,20.0;24.0;28.0"),
        "upper lane markings must lie above",
    ),
    "frame rate": (
        lambda f: edit(f / "01_recordingMeta.csv", "25.0", "0"),
        "01_recordingMeta.csv:2: column frameRate: '0'",
    ),
    "two metas": (
        lambda f: (f / "01_recordingMeta.csv").write_text(
            (f / "01_recordingMeta.csv").read_text() + "2,25,-1,,20;24\n"
        ),
        "2 rows, expected the one row",
    ),
}


@pytest.mark.parametrize("name", HIGHD)
def test_bad_highd(tmp_path: Path, name: str) -> None:
    spoil, message = HIGHD[name]
    folder = write_highd(tmp_path / "h", ROWS)
    load_recording(folder, cache=False)
    spoil(folder)
    assert_one_line(folder, message)


def assert_one_line(path: Path | str, message: str) -> None:
    with pytest.raises(UserError) as caught:
        load_recording(path, cache=False)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("suffix", "pack"), [(".gz", gzip.compress), (".xz", lzma.compress)])
@pytest.mark.parametrize("damage", ["truncated", "garbled", "not compressed"])
def test_bad_compression(tmp_path: Path, suffix: str, pack: Callable[[bytes], bytes], damage: str) -> None:
    rows = [Row(frame, 1, 50.0 + frame, 22.0) for frame in range(400)]
    folder = write_highd(tmp_path / "h", rows)
    plain = (folder / "01_tracks.csv").read_bytes()
    packed = pack(plain)
    spoiled = {
        "truncated": packed[: len(packed) // 2],
        "garbled": packed[:200] + bytes(100) + packed[300:],
        "not compressed": plain,
    }[damage]
    (folder / "01_tracks.csv").unlink()
    (folder / f"01_tracks.csv{suffix}").write_bytes(spoiled)
    assert_one_line(folder, f"01_tracks.csv{suffix}: cannot be read")


NGSIM_FAULTS: dict[str, HighdFault] = {
    "missing column": (lambda p: edit(p, "Local_Y", "Lokal_Y"), "missing column Local_Y; found Vehicle_ID"),
    "nan": (lambda p: cell(p, 3, 4, "NaN"), "t.csv:3: column Local_X: 'NaN' is not a finite number"),
    "no number": (lambda p: cell(p, 5, 11, "fast"), "t.csv:5: column v_Vel: 'fast' is not a finite number"),
    "fraction": (lambda p: cell(p, 2, 0, "1.5"), "t.csv:2: column Vehicle_ID: '1.5' is not a whole number"),
    "class": (lambda p: cell(p, 2, 10, "9"), "v_Class 9: expected 1 (motorcycle), 2 (car) or 3 (truck)"),
    "header only": (lambda p: p.write_text(NGSIM + "\n"), "t.csv: no vehicle"),
    "empty": (lambda p: p.write_text(""), "t.csv: the file is empty"),
    "long line": (lambda p: edit(p, ",2,", ",2,,,"), "t.csv:2: 20 cells, expected 18"),
    "other table": (lambda p: p.write_text("a,b\n1,2\n"), "unknown format; expected"),
    "words": (lambda p: p.write_text("once upon a time\n"), "unknown format; expected"),
    "binary": (lambda p: p.write_bytes(b"\xff\xfe\x00\x80" * 40), "t.csv: cannot be read"),
}


@pytest.mark.parametrize("name", NGSIM_FAULTS)
def test_bad_ngsim(tmp_path: Path, name: str) -> None:
    spoil, message = NGSIM_FAULTS[name]
    path = write_ngsim_csv(tmp_path / "t.csv", [Row(frame, 1, 5.0 + 1.5 * frame, 1.8) for frame in range(20)])
    load_recording(path, cache=False)
    spoil(path)
    assert_one_line(path, message)


def test_bad_ngsim_text(tmp_path: Path) -> None:
    rows = [Row(frame, 1, 5.0 + 1.5 * frame, 1.8) for frame in range(20)]
    path = write_ngsim_text(tmp_path / "t.txt", rows)
    edit(path, "  ".join(ngsim_cells(rows[4])), "  ".join(ngsim_cells(rows[4])[:-1]))
    assert_one_line(path, "t.txt:5: 17 cells, expected 18")


def test_every_row_without_a_size(tmp_path: Path) -> None:
    path = write_ngsim_csv(tmp_path / "t.csv", [Row(1, 1, 5.0, 1.8, width=0.0)])
    assert_one_line(path, "no vehicle: every row has a length or width of 0")


def test_an_empty_location(tmp_path: Path) -> None:
    path = write_ngsim_csv(tmp_path / "t.csv", [Row(1, 1, 5.0, 1.8), Row(2, 1, 6.0, 1.8)], site="us-101")
    cell(path, 3, 18, "")
    assert_one_line(path, "column Location is empty in 1 row")


def test_nothing_there(tmp_path: Path) -> None:
    assert_one_line(tmp_path / "nope", "no such file or folder, and no bundled recording (those are freeway,")
    assert_one_line(f"{tmp_path / 'nope'}#01", "no such file or folder")
    assert_one_line(tmp_path, "no recording in this folder")


def steady(kind: str, path: Path, frames: int = 60) -> Path:
    """Two vehicles in one lane each, that drive as their velocities say."""
    rate = {"highd": 25.0, "ngsim": 10.0}[kind]
    rows = [
        Row(frame, vehicle, 40.0 * vehicle + 30.0 * frame / rate, 4.0 * vehicle + 18.0, lane=vehicle)
        for vehicle in (1, 2)
        for frame in range(1, frames + 1)
    ]
    return write_highd(path, rows) if kind == "highd" else write_ngsim_csv(path, rows)


def test_a_position_at_the_end_of_the_world(tmp_path: Path) -> None:
    path = steady("ngsim", tmp_path / "t.csv")
    cell(path, 9, 5, "1000000")
    assert_one_line(path, "t.csv:9: vehicle 1 in frame 8 is 305 km away from the others, along the road")


def test_a_road_that_one_row_makes_long_is_noted(tmp_path: Path) -> None:
    path = steady("ngsim", tmp_path / "t.csv")
    cell(path, 9, 5, "60000")
    recording = load_recording(path, cache=False)
    assert len(recording.lanes) == 2
    assert any("1 row more than 1 km away from the others along the road" in one for one in recording.notes)


def test_quoted_decimal_commas_are_no_thousands(tmp_path: Path) -> None:
    path = steady("ngsim", tmp_path / "t.csv")
    lines = path.read_text().splitlines()
    lines[1:] = [",".join([*line.split(",")[:8], '"5,600"', *line.split(",")[9:]]) for line in lines[1:]]
    path.write_text("\n".join([*lines, ""]))
    assert_one_line(path, "t.csv: column v_length: '5,600': does its comma separate decimals or thousands?")


def test_two_periods_whose_times_are_rounded(tmp_path: Path) -> None:
    rows = [
        Row(frame, 1, 5.0 + 1.5 * frame, 1.8, vx=15.0 + period)
        for period in (0, 1)
        for frame in range(1, 800)
    ]
    path = write_ngsim_csv(tmp_path / "t.csv", rows)
    lines = path.read_text().splitlines()
    lines[1:] = [",".join([*line.split(",")[:3], "1.11885E+12", *line.split(",")[4:]]) for line in lines[1:]]
    path.write_text("\n".join([*lines, ""]))
    assert_one_line(path, "t.csv: column Global_Time does not run with Frame_ID, 100 ms a frame")


@pytest.mark.parametrize("every", [2, 5])
def test_thinned_frames_are_those_of_their_true_times(tmp_path: Path, every: int) -> None:
    whole = load_recording(steady("highd", tmp_path / "h", 200), cache=False)
    lines = (tmp_path / "h" / "01_tracks.csv").read_text().splitlines()
    lines[1:] = [line for line in lines[1:] if int(line.split(",")[0]) % every == 1]
    (tmp_path / "h" / "01_tracks.csv").write_text("\n".join([*lines, ""]))
    thinned = load_recording(tmp_path / "h", cache=False)
    assert thinned.frame_rate == 25 / every
    assert thinned.frames.x[:, 0].tolist() == whole.frames.x[::every, 0].tolist()
    assert (thinned.frames.first == 0).all()
    assert any("only every" in note for note in thinned.notes)


def test_missing_frames_are_noted_and_the_others_keep_their_times(tmp_path: Path) -> None:
    whole = load_recording(steady("highd", tmp_path / "h"), cache=False)
    lines = (tmp_path / "h" / "01_tracks.csv").read_text().splitlines()
    lines[1:] = [line for line in lines[1:] if not 20 <= int(line.split(",")[0]) <= 30]
    (tmp_path / "h" / "01_tracks.csv").write_text("\n".join([*lines, ""]))
    cut = load_recording(tmp_path / "h", cache=False)
    assert "11 frames without a vehicle, the first of them 20" in cut.notes
    assert "2 gaps in tracks; a vehicle that reappears counts as a new appearance" in cut.notes
    assert cut.frames.x[40].tolist() == whole.frames.x[40].tolist()


def test_limits_in_kilometres_an_hour(tmp_path: Path) -> None:
    folder = steady("highd", tmp_path / "h")
    edit(folder / "01_recordingMeta.csv", "-1.0", "120")
    assert_one_line(folder, "speed limit 120: expected m/s, at most 50, or -1 for none")


def test_two_classes_of_one_vehicle(tmp_path: Path) -> None:
    folder = steady("highd", tmp_path / "h")
    edit(folder / "01_tracksMeta.csv", "2,Car\n", "2,Car\n2,Truck\n")
    assert_one_line(folder, "vehicle 2 has two classes, car and truck")
