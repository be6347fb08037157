import errno
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from drlsl.errors import UserError
from drlsl.files import write_atomic
from drlsl.learning import load_state
from drlsl.learning.checkpoint import as_arrays, as_tensors, save_state


def test_a_state_comes_back(tmp_path: Path) -> None:
    state = {"weights": torch.arange(4.0), "count": 2**70, "name": "x", "nested": {"none": None}}
    save_state(tmp_path / "state.pt", "checkpoint", state)
    found = load_state(tmp_path / "state.pt", "checkpoint")
    assert torch.equal(found.pop("weights"), torch.arange(4.0))
    assert found == {"count": 2**70, "name": "x", "nested": {"none": None}, "format": 3, "kind": "checkpoint"}
    assert os.listdir(tmp_path) == ["state.pt"]


def test_arrays_come_back_of_the_same_kind_and_stand_alone(tmp_path: Path) -> None:
    arrays: list[Any] = [
        np.arange(3),
        np.array([[True, False]]),
        np.linspace(0, 1, 4),
        np.array([1.5], np.float32),
    ]
    state = {"arrays": tuple(arrays), "big": 2**127, "nested": {"list": [arrays[0], "text", None]}}
    save_state(tmp_path / "state.pt", "checkpoint", as_tensors(state))
    arrays[0][:] = 9
    found = as_arrays(load_state(tmp_path / "state.pt", "checkpoint"))
    assert found["nested"]["list"][0].tolist() == found["arrays"][0].tolist() == [0, 1, 2]
    for mine, theirs in zip(found["arrays"][1:], arrays[1:], strict=True):
        assert mine.dtype == theirs.dtype
        np.testing.assert_array_equal(mine, theirs)
    assert found["nested"]["list"][1:] == ["text", None]
    assert found["big"] == 2**127
    found["arrays"][0][:] = 5
    assert found["nested"]["list"][0].tolist() == [0, 1, 2]


def test_a_missing_file_is_a_user_error(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="No such file"):
        load_state(tmp_path / "none.pt", "checkpoint")


@pytest.mark.parametrize("keep", [0, 1, 100, -10])
def test_a_cut_file_is_a_user_error(tmp_path: Path, keep: int) -> None:
    path = tmp_path / "state.pt"
    save_state(path, "checkpoint", {"weights": torch.zeros(1_000)})
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(UserError, match="damaged"):
        load_state(path, "checkpoint")


def test_another_kind_is_a_user_error(tmp_path: Path) -> None:
    path = tmp_path / "state.pt"
    save_state(path, "policy", {})
    with pytest.raises(UserError, match="expected a checkpoint, found policy"):
        load_state(path, "checkpoint")
    torch.save([1], path)
    with pytest.raises(UserError, match="expected a checkpoint, found list"):
        load_state(path, "checkpoint")
    torch.save({"kind": "checkpoint", "format": 99}, path)
    with pytest.raises(UserError, match="format 99"):
        load_state(path, "checkpoint")


class Harmful:
    """Runs code when it is unpickled without care."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> Any:
        return (Path.touch, (self._mark,))


@pytest.mark.filterwarnings("ignore:Detected pickle protocol")
@pytest.mark.parametrize("plain", [True, False])
def test_a_harmful_file_runs_nothing(tmp_path: Path, plain: bool) -> None:
    path, mark = tmp_path / "state.pt", tmp_path / "mark"
    if plain:
        path.write_bytes(pickle.dumps(Harmful(mark)))
    else:
        torch.save({"kind": "checkpoint", "format": 2, "x": Harmful(mark)}, path)
    with pytest.raises(UserError, match="damaged"):
        load_state(path, "checkpoint")
    assert not mark.exists()


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    write_atomic(path, b"old")

    def fail(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(UserError, match="cannot write: No space left"):
        write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file"]


def test_a_written_file_follows_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "file"
    before = os.umask(0o027)
    try:
        write_atomic(path, b"")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640
