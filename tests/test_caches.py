"""The cache folder is kept small, and nothing goes that is in use."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from drlsl.errors import UserError
from drlsl.files import make_room

MEGABYTE = 1_000_000


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DRLSL_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("DRLSL_CACHE_GB", raising=False)
    return tmp_path / "cache"


def put(path: Path, days: float, size: int = MEGABYTE) -> Path:
    """A file that was last used so many days ago."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(bytes(size))
    used = time.time() - 86400 * days
    os.utime(path, (used, used))
    return path


def left(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_what_was_not_used_for_a_month_goes(folder: Path) -> None:
    put(folder / "recordings" / "new.film", 0.1)
    put(folder / "recordings" / "lately.film", 29.0)
    put(folder / "recordings" / "long-ago.film", 31.0)
    put(folder / "of-an-older-version.npy", 40.0)
    put(folder / "code" / "__pycache__" / "look.nbi", 31.0)
    make_room()
    assert left(folder) == {"recordings/new.film", "recordings/lately.film"}


def test_above_the_limit_the_longest_unused_goes_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for days in (2, 3, 4, 5):
        put(folder / "recordings" / f"{days}.film", days)
    make_room()
    assert len(left(folder)) == 4
    monkeypatch.setenv("DRLSL_CACHE_GB", "0.0025")
    make_room()
    assert left(folder) == {"recordings/2.film", "recordings/3.film"}


def test_what_was_used_within_a_day_stays_above_any_limit(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DRLSL_CACHE_GB", "0.000001")
    put(folder / "recordings" / "today.film", 0.5)
    put(folder / "recordings" / "before.film", 2.0)
    make_room()
    assert left(folder) == {"recordings/today.film"}


def test_an_unpacked_archive_is_kept_or_removed_whole(folder: Path) -> None:
    put(folder / "unpacked" / "used" / "data" / "01_tracks.csv", 1.5)
    put(folder / "unpacked" / "used" / "data" / "02_tracks.csv", 90.0)
    put(folder / "unpacked" / "unused" / "data" / "01_tracks.csv", 31.0)
    make_room()
    assert left(folder) == {f"unpacked/used/data/0{number}_tracks.csv" for number in (1, 2)}
    assert [path.name for path in (folder / "unpacked").iterdir()] == ["used"]


@pytest.mark.parametrize("limit", ["many", "0", "-1", "nan"])
def test_a_limit_that_is_no_number_is_refused(monkeypatch: pytest.MonkeyPatch, limit: str) -> None:
    monkeypatch.setenv("DRLSL_CACHE_GB", limit)
    with pytest.raises(UserError, match=r"DRLSL_CACHE_GB is .*; expected a number of gigabytes above 0"):
        make_room()


def test_an_absent_folder_needs_no_room() -> None:
    make_room()
