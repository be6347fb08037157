"""Runs of several seeds in one folder: each as if it had been trained alone."""

import json
import shutil
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.learning import RunFolder, Session, StackedSession
from drlsl.learning.config import TrainConfig, make_config, merged

from .test_cli import TINY, refused
from .test_session import assert_same_outcome, train_whole

pytestmark = pytest.mark.usefixtures("fake_driving")

SEEDS = 3


def alone(root: Path, config: TrainConfig) -> None:
    for seed in range(SEEDS):
        train_whole(root / f"seed{seed}", make_config(merged(config.model_dump(), {"seed": seed}), "test"))


def assert_same_runs(one: Path, other: Path) -> None:
    for seed in range(SEEDS):
        assert_same_outcome(one / f"seed{seed}", other / f"seed{seed}")


@pytest.mark.parametrize("stop_after", [1, 90, 100_000])
def test_stopped_and_resumed_each_run_is_bit_identical_to_one_alone(
    tmp_path: Path, tiny_config: TrainConfig, stop_after: int
) -> None:
    config = make_config(merged(tiny_config.model_dump(), {"num_envs": 2}), "test")
    alone(tmp_path / "alone", config)
    finished: list[int] = []
    with StackedSession.start(tmp_path / "stack", config, SEEDS) as session:
        for event in session.run(lambda: session.total_steps >= stop_after):
            finished += [episode.finished for episode in event.ended]
        assert session.saved_steps == session.total_steps
    with StackedSession.resume(tmp_path / "stack") as session:
        for event in session.run():
            finished += [episode.finished for episode in event.ended]
        assert session.finished == session.episodes == SEEDS * config.episodes
    assert finished == list(range(1, SEEDS * config.episodes + 1))
    assert_same_runs(tmp_path / "alone", tmp_path / "stack")


def test_killed_runs_go_back_to_their_checkpoints(tmp_path: Path, tiny_config: TrainConfig) -> None:
    alone(tmp_path / "alone", tiny_config)
    with StackedSession.start(tmp_path / "stack", tiny_config, SEEDS) as session:
        for event in session.run():
            # What a kill at this moment leaves is what is on disk.
            if event.ended and session.finished == 8:
                shutil.copytree(tmp_path / "stack", tmp_path / "killed")
                break
    with StackedSession.resume(tmp_path / "killed") as session:
        assert session.finished < 8
        for _ in session.run():
            pass
    assert_same_runs(tmp_path / "alone", tmp_path / "killed")


def test_a_run_of_a_stack_goes_on_alone(tmp_path: Path, tiny_config: TrainConfig) -> None:
    alone(tmp_path / "alone", tiny_config)
    with StackedSession.start(tmp_path / "stack", tiny_config, SEEDS) as session:
        for _ in session.run(lambda: session.total_steps > 100):
            pass
    for seed in range(SEEDS):
        with Session.resume(tmp_path / "stack" / f"seed{seed}") as one:
            for _ in one.run():
                pass
    assert_same_runs(tmp_path / "alone", tmp_path / "stack")


def test_an_environment_that_cannot_be_made_leaves_no_folder(
    tmp_path: Path, tiny_config: TrainConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drlsl import driving

    def fail(*arguments: object, **_: object) -> None:
        raise UserError("no such recording")

    monkeypatch.setitem(vars(driving), "make_vec", fail)
    with pytest.raises(UserError, match="no such recording"):
        StackedSession.start(tmp_path / "stack", tiny_config, SEEDS)
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_cannot_be_opened_leaves_none_locked(tmp_path: Path, tiny_config: TrainConfig) -> None:
    StackedSession.start(tmp_path / "stack", tiny_config, SEEDS).close()
    (tmp_path / "stack" / "seed2" / "checkpoint.pt").unlink()
    with pytest.raises(UserError, match=r"seed2.*cannot read the checkpoint"):
        StackedSession.resume(tmp_path / "stack")
    Session.resume(tmp_path / "stack" / "seed0").close()


def test_the_command_trains_resumes_and_replaces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["train", *TINY, "--seeds", "2", "--seed", "5", "--out", "two"]) == 0
    out = capsys.readouterr().out
    assert "start two: dqnsl, highway-train, seeds 5, 6" in out
    assert "episode 8/8" in out
    assert "drlsl eval two/seed5" in out
    for name in ("seed5", "seed6"):
        assert len(RunFolder.open(tmp_path / "two" / name).evaluations()) == 2
        assert (tmp_path / "two" / name / "figures").is_dir()
    assert run(["eval", "two/seed6", "--episodes", "2"]) == 0
    capsys.readouterr()
    assert run(["runs", "list", "two", "--json"]) == 0
    assert [one["seed"] for one in json.loads(capsys.readouterr().out)] == [5, 6]
    assert run(["train", "--resume", "--out", "two"]) == 0
    assert "resume two" in capsys.readouterr().out
    assert "the folder exists" in refused(
        capsys, "train", *TINY, "--seeds", "2", "--seed", "5", "--out", "two"
    )
    assert "begun with 2 --seeds" in refused(capsys, "train", "--resume", "--out", "two", "--seeds", "3")
    assert "differs" in refused(capsys, "train", "--resume", "--out", "two", "--episodes", "9")
    replaced = ["train", *TINY, "--episodes", "2", "--seed", "5", "--out", "two", "--force"]
    assert "holds the run of another seed, seed6" in refused(capsys, *replaced, "--seeds", "1")
    assert run([*replaced, "--seeds", "2"]) == 0
    assert RunFolder.open(tmp_path / "two" / "seed6").config.episodes == 2


def test_what_is_no_stack_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    two = ("train", *TINY, "--seeds", "2", "--out")
    assert "learning.overlap is true" in refused(capsys, *two, "stack", "--set", "learning.overlap=true")
    assert not (tmp_path / "stack").exists()
    (tmp_path / "file").touch()
    assert "file: a file is in the way" in refused(capsys, *two, "file")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "my.txt").touch()
    assert "holds something else, my.txt" in refused(capsys, *two, "notes", "--force")
    StackedSession.start(tmp_path / "damaged", TrainConfig(episodes=1), 2).close()
    names = tmp_path / "damaged" / "seeds.json"
    names.write_text(names.read_text().replace("0", "7"))
    assert "seeds.json: cannot be read" in refused(capsys, "train", "--resume", "--out", "damaged")
    shutil.rmtree(tmp_path / "damaged" / "seed1")
    names.write_text('{"seeds": [0, 1]}')
    assert "the run of seed1 is missing" in refused(capsys, "train", "--resume", "--out", "damaged")
