"""One front door: files, folders, archives, data sets, patterns and parts, in any number."""

from __future__ import annotations

import gzip
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from drlsl.cli import run
from drlsl.cli.data import app
from drlsl.errors import UserError
from drlsl.traffic import (
    FORMATS,
    find_source,
    find_sources,
    load_recording,
    load_recordings,
    recording_names,
)
from drlsl.traffic.source import matching
from tests.traffic.test_ngsim import traffic
from tests.traffic.writing import Row, write_highd, write_ngsim_csv


@pytest.fixture
def data_set(tmp_path: Path) -> Path:
    """The root of a data set of twelve, which are in `data`, beside a page about it."""
    root = tmp_path / "highD"
    for number in range(1, 13):
        write_highd(root / "data", [Row(1, 1, 50.0 + number, 22.0)], part=f"{number:02d}")
    (root / "README.txt").write_text("Recordings of traffic.\n")
    return root


def names(path: Path | str) -> list[str]:
    return [source.name for source in find_sources(path)]


def test_a_data_set_is_all_its_recordings(data_set: Path) -> None:
    assert names(data_set) == [f"highD#{number:02d}" for number in range(1, 13)]
    assert [one.frame(0).x[0] for one in load_recordings(data_set)] == [50.0 + n for n in range(1, 13)]


@pytest.mark.parametrize(
    ("part", "numbers"),
    [("7", [7]), ("07", [7]), ("1*", [10, 11, 12]), ("0[2-4]", [2, 3, 4]), ("*", list(range(1, 13)))],
)
def test_parts_and_patterns(data_set: Path, part: str, numbers: list[int]) -> None:
    assert names(f"{data_set}#{part}") == [f"highD#{number:02d}" for number in numbers]


def test_one_of_several_must_be_chosen_where_one_is_needed(data_set: Path) -> None:
    with pytest.raises(UserError, match=f"holds recordings 01, 02, .*choose one, as in {data_set}#01"):
        find_source(data_set)
    assert load_recording(f"{data_set}#3").frame(0).x.tolist() == [53.0]
    with pytest.raises(UserError, match="no recording 13; it holds 01, 02"):
        find_sources(f"{data_set}#13")


def test_each_recording_has_a_name_of_its_own(data_set: Path, tmp_path: Path) -> None:
    table = tmp_path / "all.csv"
    us101 = write_ngsim_csv(tmp_path / "a.csv", traffic(3), site="us-101").read_text()
    i80 = write_ngsim_csv(tmp_path / "b.csv", traffic(2), site="i-80").read_text()
    table.write_text(us101 + i80.split("\n", 1)[1])
    archive = tmp_path / "highD.zip"
    with zipfile.ZipFile(archive, "w") as zipped:
        for path in sorted((data_set / "data").iterdir())[:6]:
            zipped.write(path, path.name)
    twice = tmp_path / "both"
    for folder in ("a", "b"):
        write_highd(twice / folder, [Row(1, 1, 50.0, 22.0)])
    for whole, count in (
        (data_set, 12),
        (f"{data_set}#1*", 3),
        (f"{data_set}/data/0*_tracks.csv", 9),
        (f"{data_set}#7", 1),
        (archive, 2),
        (twice, 2),
        (f"{table}#*", 2),
        ("freeway", 1),
    ):
        found = recording_names(whole)
        assert len(set(found)) == len(found) == count
        apart, together = [find_source(one) for one in found], find_sources(whole)
        assert [(one.files, one.part) for one in apart] == [(one.files, one.part) for one in together]
    assert recording_names(data_set)[:2] == [f"{data_set}#01", f"{data_set}#02"]


def test_recordings_of_one_number_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    root = tmp_path / "sites"
    for x, (folder, part) in enumerate((("a", "01"), ("a", "02"), ("b", "01"), ("c [1]", "01"))):
        write_highd(root / folder, [Row(1, 1, 50.0 + x, 22.0)], part=part)
    assert names(root) == ["sites#a/01", "sites#02", "sites#b/01", "sites#c [1]/01"]
    places = [load_recording(f"{root}#{part}").frame(0).x[0] for part in ("A/1", "2", "b/01", "c [1]/01")]
    assert places == [50.0, 51.0, 52.0, 53.0]
    assert recording_names(root) == [f"{root}#{part}" for part in ("a/01", "02", "b/01", "c [1]/01")]
    assert names(f"{root}#*01") == ["sites#a/01", "sites#b/01", "sites#c [1]/01"]
    with pytest.raises(UserError, match=rf"holds recordings a/01, 02, .*; choose one, as in {root}#a/01"):
        find_source(root)
    with pytest.raises(UserError, match="no recording 01; it holds a/01, 02, b/01"):
        find_source(f"{root}#01")


@pytest.mark.parametrize("name", ["plain", "of [1]", "a #1 b", "50 %?"])
def test_names_may_have_the_marks_of_parts_and_patterns(tmp_path: Path, name: str) -> None:
    for folder in (name, "other"):
        write_highd(tmp_path / name / folder, [Row(1, 1, 50.0, 22.0)])
    write_highd(tmp_path / "alone" / name, [Row(1, 1, 50.0, 22.0)])
    root = tmp_path / name
    assert recording_names(root) == sorted(f"{root}#{folder}/01" for folder in (name, "other"))
    assert [names(one) for one in recording_names(root)] == [[one] for one in names(root)]
    assert names(f"{tmp_path}/alone/{name}#1") == [f"{name}#01"]
    assert names(f"{root}#*") == names(root)
    assert names(f"{tmp_path}/al*/*#0*") == [f"{name}#01"]


@pytest.mark.parametrize("name", ["", "#01"])
def test_an_empty_name_is_not_the_working_folder(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(write_highd(tmp_path, [Row(1, 1, 50.0, 22.0)]))
    with pytest.raises(UserError, match=f"{name or 'an empty name'}: no such file or folder"):
        find_sources(name)
    assert len(find_sources(".")) == len(find_sources(".#01")) == 1


def test_one_of_a_pattern_is_chosen_by_its_file(data_set: Path) -> None:
    folder = data_set / "data"
    with pytest.raises(UserError, match=rf"holds recordings .*; choose one, as in {folder}/01_tracks\.csv"):
        find_source(f"{folder}/0*_tracks.csv")


def test_files_of_one_number_are_told_apart_by_their_names(tmp_path: Path) -> None:
    folder = write_highd(tmp_path / "h", [Row(1, 1, 50.0, 22.0)])
    for path in list(folder.iterdir()):
        (folder / f"{path.name}.gz").write_bytes(gzip.compress(path.read_bytes()))
    assert names(folder) == ["h#01_tracks.csv", "h#01_tracks.csv.gz"]
    packed = find_source(f"{folder}#01_tracks.csv.gz")
    assert [path.suffix for path in packed.files] == [".gz"] * 3
    assert packed.files == find_source(folder / "01_tracks.csv.gz").files


def test_rules_are_learnt_from_all_of_a_data_set(data_set: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("clingo")
    from drlsl.induction import lane_changes

    asked: list[Any] = []

    def refuse(request: Any, _progress: Any) -> Any:
        asked.append(request)
        raise UserError("no more")

    monkeypatch.setattr(lane_changes, "LaneChanges", refuse)
    assert run(["rules", "learn", "freeway", f"{data_set}#1*", "freeway"]) == 2
    assert asked[0].recordings == ("freeway", *(f"{data_set}#{number}" for number in (10, 11, 12)))


def test_patterns_of_paths(data_set: Path) -> None:
    assert len(names(f"{data_set}/data/0*_tracks.csv")) == 9
    with pytest.raises(UserError, match="no file or folder is called so"):
        find_sources(f"{data_set}/data/x*")


def test_an_archive_is_unpacked_once(data_set: Path, tmp_path: Path, cache_folder: Path) -> None:
    archive = tmp_path / "highD.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted((data_set / "data").iterdir()):
            file.write(path, f"highD/data/{path.name}")
    assert names(archive) == [f"highD.zip#{number:02d}" for number in range(1, 13)]
    assert load_recording(f"{archive}#7").frame(0).x.tolist() == [57.0]
    assert len(list((cache_folder / "unpacked").iterdir())) == 1


def test_an_empty_archive(tmp_path: Path) -> None:
    zipfile.ZipFile(tmp_path / "e.zip", "w").close()
    with pytest.raises(UserError, match=r"e\.zip: cannot be unpacked: the archive is empty"):
        find_sources(tmp_path / "e.zip")


@pytest.mark.parametrize("spoil", ["cut", "no archive", "outside"])
def test_a_bad_archive(data_set: Path, tmp_path: Path, spoil: str) -> None:
    archive = tmp_path / "highD.zip"
    with zipfile.ZipFile(archive, "w") as file:
        file.write(data_set / "README.txt", "../../escaped.txt" if spoil == "outside" else "README.txt")
    if spoil == "cut":
        archive.write_bytes(archive.read_bytes()[:-30])
    elif spoil == "no archive":
        archive.write_text("Sign in, please.\n")
    with pytest.raises(
        UserError, match="no recording in this" if spoil == "outside" else "cannot be unpacked"
    ):
        find_sources(archive)
    assert not (tmp_path.parent / "escaped.txt").exists()


def test_sites_and_periods_of_a_table_as_people_spell_them(tmp_path: Path) -> None:
    us101 = write_ngsim_csv(tmp_path / "a.csv", traffic(3), site="us-101").read_text()
    i80 = write_ngsim_csv(tmp_path / "b.csv", traffic(2), site="i-80").read_text()
    path = tmp_path / "all.csv"
    path.write_text(us101 + i80.split("\n", 1)[1])
    assert len(load_recording(f"{path}#us101").lanes) == 3
    assert len(load_recording(f"{path}#I-80").lanes) == 2
    assert [len(one.lanes) for one in load_recordings(f"{path}#*")] == [2, 3]


def test_names_match_as_people_spell_them() -> None:
    assert matching("us101", ["i-80", "us-101"]) == ["us-101"]
    assert matching("10", ["01", "10", "100"]) == ["10"]
    assert matching("i-80/*", ["i-80/1", "i-80/2", "us-101"]) == ["i-80/1", "i-80/2"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "recordingId,trackId,frame,xCenter,yCenter\n",
            "it looks like columns of exiD; its files are called",
        ),
        ("frame,id,x,y,xVelocity\n", "it looks like columns of highD; its files are called 01_tracks.csv"),
        ("<!DOCTYPE html><html>\n", "it looks like a page of a web site, no data"),
        ("version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS, no data; fetch it"),
        (
            '{\n  "road": {},\n  "ego": {}\n}\n',
            r"no recording, but a scene, which `drlsl query --state .* reads",
        ),
        ("a,b\n1,2\n", "unknown format; expected a folder or a file of"),
    ],
)
def test_an_unknown_layout_is_named(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(UserError, match=expected):
        find_sources(path)


@pytest.mark.parametrize("content", [b"", b"PK\5\6", b"no archive\n", None])
def test_what_is_no_episode_is_called_none(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "positions.npz"
    if content is None:
        np.savez(path, x=np.arange(3))
    else:
        path.write_bytes(content)
    for named in (path, tmp_path):
        with pytest.raises(UserError) as raised:
            find_sources(named)
        assert "drlsl view" not in str(raised.value)


def test_formats_have_names_of_their_own() -> None:
    assert len({row.name for row in FORMATS}) == len(FORMATS)


def test_info_of_several(data_set: Path) -> None:
    result = CliRunner().invoke(
        app, ["info", f"{data_set}#0[12]", "freeway", "--json"], catch_exceptions=False
    )
    reports = json.loads(result.output)
    assert [report["name"] for report in reports] == ["highD#01", "highD#02", "freeway"]
