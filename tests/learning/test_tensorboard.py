"""Event files for TensorBoard hold the metrics, also of a run that was stopped, killed or resumed."""

import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.learning import RunFolder, Session
from drlsl.learning.config import TrainConfig
from drlsl.learning.tensorboard import NOT_SHOWN, tag_of

event_accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
pytestmark = pytest.mark.usefixtures("fake_driving")


def shown(root: Path) -> dict[str, list[tuple[int, float]]]:
    """What TensorBoard reads: steps and values by name."""
    log = event_accumulator.EventAccumulator(str(root / "tensorboard"), size_guidance={"scalars": 0})
    log.Reload()
    return {tag: [(item.step, item.value) for item in log.Scalars(tag)] for tag in log.Tags()["scalars"]}


def recorded(root: Path) -> dict[str, list[tuple[int, Any]]]:
    """The same from the rows of the metrics, in the precision of the event files."""
    rows = RunFolder.open(root).episodes()
    return {
        tag_of(name): [
            (row["total_steps"], pytest.approx(float(row[name]), rel=1e-6))
            for row in rows
            if row[name] is not None
        ]
        for name in rows[0]
        if name not in NOT_SHOWN
    }


def test_every_number_of_every_episode_is_shown(tmp_path: Path, tiny_config: TrainConfig) -> None:
    with Session.start(tmp_path / "run", tiny_config, tensorboard=True) as session:
        for _ in session.run():
            pass
    found = shown(tmp_path / "run")
    assert found == recorded(tmp_path / "run")
    assert {"episode/return", "reward/collision", "learning/epsilon", "learning/loss"} <= found.keys()
    assert len(found["episode/return"]) == 6


def test_a_killed_run_shows_each_episode_once(tmp_path: Path, tiny_config: TrainConfig) -> None:
    session = Session.start(tmp_path / "run", tiny_config, tensorboard=True)
    for _ in session.run():
        if session.trainer.finished == 5:
            shutil.copytree(tmp_path / "run", tmp_path / "killed")
            break
    with Session.resume(tmp_path / "killed") as resumed:
        for _ in resumed.run():
            pass
    found = shown(tmp_path / "killed")
    assert found == recorded(tmp_path / "killed")
    assert len(found["episode/return"]) == 6


def test_a_run_without_begins_when_it_is_resumed(tmp_path: Path, tiny_config: TrainConfig) -> None:
    with Session.start(tmp_path / "run", tiny_config) as session:
        for _ in session.run(lambda: session.trainer.finished == 2):
            pass
    assert not (tmp_path / "run" / "tensorboard").exists()
    with Session.resume(tmp_path / "run", tensorboard=True) as resumed:
        for _ in resumed.run():
            pass
    assert shown(tmp_path / "run") == recorded(tmp_path / "run")


def test_the_command_says_how_to_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    tiny = ["--preset", "tiny", "--device", "cpu", "--set", "env.track_length=400", "--out", "run"]
    assert run(["train", *tiny, "--tensorboard"]) == 0
    assert "tensorboard --logdir run/tensorboard\n" in capsys.readouterr().out
    assert shown(Path("run")) == recorded(Path("run"))
    assert run(["train", *tiny, "--force"]) == 0
    assert not Path("run/tensorboard").exists()


def test_without_tensorboard_nothing_is_begun(
    tmp_path: Path, tiny_config: TrainConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    with pytest.raises(UserError, match=r"pip install 'drlsl\[tensorboard\]'"):
        Session.start(tmp_path / "run", tiny_config, tensorboard=True)
    assert not (tmp_path / "run").exists()
