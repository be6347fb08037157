"""Files that are written whole take the place of files alone."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drlsl.errors import UserError
from drlsl.files import write_atomic


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_devices_pipes_and_folders_are_left(tmp_path: Path) -> None:
    pipe, folder = tmp_path / "pipe", tmp_path / "folder"
    os.mkfifo(pipe)
    folder.mkdir()
    for path, what in ((pipe, "a device or a pipe"), (folder, "a folder")):
        with pytest.raises(UserError, match=f"{path.name}: cannot write: is {what}, expected a file"):
            write_atomic(path, b"new")
    assert pipe.is_fifo()
    assert sorted(os.listdir(tmp_path)) == ["folder", "pipe"]


def test_a_link_stays_one(tmp_path: Path) -> None:
    file, link = tmp_path / "data" / "file", tmp_path / "latest"
    file.parent.mkdir()
    link.symlink_to(file)
    for content in (b"first", b"second"):
        write_atomic(link, content)
        assert link.is_symlink()
        assert file.read_bytes() == content
    assert os.listdir(file.parent) == ["file"]
