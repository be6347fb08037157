"""The cache gives back what was loaded, and notices when it must not."""

from __future__ import annotations

import mmap
import os
import random
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import drlsl.traffic.cache
import drlsl.traffic.load
from drlsl.files import cache_folder as folder_of_caches
from drlsl.traffic import Recording, find_source, load_recording
from drlsl.traffic.cache import FOLDER, HEAD, read_cached
from drlsl.traffic.packed_frames import UNIT
from tests.traffic.writing import Row, write_highd, write_ngsim_csv

ROWS = [
    Row(frame, vehicle, 50.0 + frame, 22.0 + vehicle)
    for frame in range(9)
    for vehicle in range(4)
    if frame != 4
]


def assert_equal(one: Recording, other: Recording) -> None:
    for field in ("name", "frame_rate", "lanes", "x_min", "x_max", "vehicle_class", "dropped", "notes"):
        assert getattr(one, field) == getattr(other, field), field
    for (name, left), (_, right) in zip(one.frames.arrays(), other.frames.arrays(), strict=True):
        assert left.dtype == right.dtype, name
        assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f"), name


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_highd(tmp_path / "h", [*ROWS, ROWS[0]], trucks=[2])


def no_parsing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> Recording:
        raise AssertionError("the files were read again")

    monkeypatch.setattr(drlsl.traffic.load, "read", refuse)


def test_the_second_load_is_equal_and_reads_no_table(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = load_recording(folder)
    no_parsing(monkeypatch)
    second = load_recording(folder)
    second.validate()
    assert_equal(first, second)
    assert first.dropped


def test_a_loaded_recording_is_the_file_itself(folder: Path, cache_folder: Path) -> None:
    """Its pages are shared by processes, and stay when another process replaces or removes the file."""
    for _ in range(2):
        film = load_recording(folder).film
        for name in ("cells", "pieces"):
            array = getattr(film, name)
            while isinstance(array, np.ndarray):
                array = array.base
            assert isinstance(array.obj, mmap.mmap), name
    before = film.cells.copy()
    (path,) = (cache_folder / FOLDER).iterdir()
    path.unlink()
    load_recording(folder)
    assert np.array_equal(film.cells, before)


def test_processes_that_load_at_once_do_not_disturb_each_other(folder: Path, cache_folder: Path) -> None:
    code = (
        "import sys, hashlib; from drlsl.traffic import load_recording; "
        f"film = load_recording({str(folder)!r}).film; "
        "print(hashlib.sha256(film.cells.tobytes()).hexdigest())"
    )
    started = [
        subprocess.Popen([sys.executable, "-W", "error", "-c", code], stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    told = {process.communicate()[0] for process in started}
    assert [process.returncode for process in started] == [0] * 4
    assert len(told) == 1
    assert [path.suffix for path in (cache_folder / FOLDER).iterdir()] == [".film"]


def test_an_array_that_does_not_begin_at_a_number_is_not_mapped(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as changed:
        changed.setattr(drlsl.traffic.cache, "HEAD", 9)
        with pytest.warns(UserWarning, match="does not begin at a number"):
            first = load_recording(folder)
    assert_equal(first, load_recording(folder, cache=False))


def test_loading_marks_the_time_of_use(folder: Path, cache_folder: Path) -> None:
    load_recording(folder)
    (path,) = (cache_folder / FOLDER).iterdir()
    os.utime(path, (1e9, 1e9))
    load_recording(folder)
    assert path.stat().st_mtime > 1.5e9


def test_an_ngsim_table_is_cached_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_ngsim_csv(tmp_path / "t.csv", [Row(frame, 1, 5.0 + 1.5 * frame, 1.8) for frame in range(50)])
    first = load_recording(path)
    no_parsing(monkeypatch)
    assert_equal(first, load_recording(path))


def test_without_cache_nothing_is_kept(folder: Path, cache_folder: Path) -> None:
    load_recording(folder, cache=False)
    assert list(cache_folder.iterdir()) == []


@pytest.mark.parametrize("file", ["01_tracks.csv", "01_tracksMeta.csv", "01_recordingMeta.csv"])
def test_a_changed_file_is_read_again(folder: Path, cache_folder: Path, file: str) -> None:
    load_recording(folder)
    status = (folder / file).stat()
    old, new = {
        "01_tracks.csv": ("\n0,0,", "\n8,9,"),
        "01_tracksMeta.csv": ("2,Truck", "2,Car\n9,Car"),
        "01_recordingMeta.csv": ("25.0", "10.0"),
    }[file]
    if file == "01_tracks.csv":
        (folder / "01_tracksMeta.csv").write_text("id,class\n" + "".join(f"{n},Car\n" for n in range(10)))
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))
    os.utime(folder / file, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert_equal(load_recording(folder), load_recording(folder, cache=False))
    assert len(list((cache_folder / FOLDER).iterdir())) == 1


@pytest.mark.parametrize("line", [1, -2])
def test_a_change_at_either_end_of_a_long_file_is_noticed(tmp_path: Path, line: int) -> None:
    folder = write_highd(
        tmp_path / "h", [Row(frame, 1, 50.0 + 1.25 * frame, 22.0, vx=31.25) for frame in range(6000)]
    )
    path = folder / "01_tracks.csv"
    assert path.stat().st_size > 3 * drlsl.traffic.cache.SAMPLE
    load_recording(folder)
    status, lines = path.stat(), path.read_text().split("\n")
    lines[line] = lines[line].replace(",31.25,", ",31.75,")
    path.write_text("\n".join(lines))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert path.stat().st_size == status.st_size
    assert 31.75 in load_recording(folder).frames.vx


def test_equal_names_elsewhere_are_not_confused(tmp_path: Path) -> None:
    one = write_highd(tmp_path / "a" / "h", [Row(1, 1, 50.0, 22.0)])
    other = write_highd(tmp_path / "b" / "h", [Row(1, 1, 60.0, 22.0)])
    assert load_recording(one).frame(0).x.tolist() == [50.0]
    assert load_recording(other).frame(0).x.tolist() == [60.0]
    assert load_recording(one).frame(0).x.tolist() == [50.0]


def damage(path: Path, how: str) -> None:
    content = bytearray(path.read_bytes())
    path.unlink()  # a file that is mapped into memory must not change
    if how == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "text":
        path.write_text("not an archive")
    elif how == "pickle":
        with open(path, "wb") as file:
            file.write(bytes(HEAD))
            np.save(file, np.array([{"a": 1}], dtype=object))
    elif how == "other":
        with open(path, "wb") as file:
            file.write(bytes(HEAD))
            np.save(file, np.zeros(3))
            np.save(file, np.zeros(3))
    else:
        place = {"position": np.int32(53 / UNIT).tobytes(), "speed limit": b"36.11"}[how]
        content[content.index(place)] ^= 1
        path.write_bytes(content)


@pytest.mark.parametrize("how", ["truncated", "empty", "text", "pickle", "other", "position", "speed limit"])
def test_a_damaged_cache_is_rebuilt_with_a_warning(folder: Path, cache_folder: Path, how: str) -> None:
    first = load_recording(folder)
    (path,) = (cache_folder / FOLDER).iterdir()
    damage(path, how)
    with pytest.warns(UserWarning, match="damaged cache file, rebuilt"):
        second = load_recording(folder)
    assert_equal(first, second)
    assert_equal(first, load_recording(folder))


def test_a_flipped_bit_of_a_cached_recording_changes_nothing(folder: Path, cache_folder: Path) -> None:
    first = load_recording(folder)
    source = find_source(str(folder))
    (path,) = (cache_folder / FOLDER).iterdir()
    content = path.read_bytes()
    # What the arrays mean stands in their headers: a number read with its bytes in reverse is another one.
    headers = [match.start() + 1 for match in re.finditer(rb"'[<|>]\w", content)]
    draw = random.Random(12)
    places = [8 * at + bit for at in headers for bit in range(8)]
    places += [draw.randrange(8 * len(content)) for _ in range(300)]
    refused = 0
    for place in places:
        copy = bytearray(content)
        copy[place // 8] ^= 1 << place % 8
        path.unlink()  # a file that is mapped into memory must not change
        path.write_bytes(copy)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = read_cached(source)
        refused += found is None
        if found is not None:
            assert_equal(first, found)
    assert refused > len(places) / 2


def test_another_loader_version_reads_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_recording(folder)
    monkeypatch.setattr(drlsl.traffic.cache, "LOADER_VERSION", -1)
    no_parsing(monkeypatch)
    with pytest.raises(AssertionError, match="read again"):
        load_recording(folder)


def test_a_cache_folder_that_cannot_be_written_only_warns(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("DRLSL_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(UserWarning, match="cannot be cached there"):
        recording = load_recording(folder)
    assert recording.frame_count == 9


def test_a_cached_recording_needs_no_pandas(folder: Path) -> None:
    load_recording(folder)
    code = (
        "import sys; from drlsl.traffic.load import load_recording; "
        f"load_recording({str(folder)!r}); sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_folder_is_the_platforms(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DRLSL_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    assert folder_of_caches() == tmp_path / "drlsl"
