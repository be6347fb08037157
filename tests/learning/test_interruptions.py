"""The script that interrupts a training and a study: a few times here, thirty by hand."""

from pathlib import Path

import pytest

from scripts import interruptions


@pytest.mark.slow
def test_a_training_and_a_study_end_as_if_nothing_had_happened(tmp_path: Path) -> None:
    assert interruptions.main([str(tmp_path), "--interruptions", "2", "--episodes", "200"]) == 0


def test_what_differs_is_told(tmp_path: Path) -> None:
    log = interruptions.Log(tmp_path / "log.json")
    log.add("SIGKILL, status -9")
    assert str(interruptions.Log(tmp_path / "log.json")) == "1 interruptions (1 SIGKILL)"
    with pytest.raises(SystemExit, match="done before the last interruption"):
        interruptions.check(0)
    with pytest.raises(SystemExit, match="status 2"):
        interruptions.check(2)
    assert dict(interruptions.leaves({"a": [1, {"b": 2}], "c": ()})) == {"/a/0": 1, "/a/1/b": 2}
