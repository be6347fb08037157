"""A policy remembers what it observes, and is never read with other numbers."""

import json
import shutil
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.driving.shield import PAPER_OBSERVATION, Shield
from drlsl.files import seal_text
from drlsl.learning import CHECKPOINT, Kind, RunFolder, dump_yaml, load_state
from drlsl.learning.checkpoint import save_state

SHORT = ["--preset", "tiny", "--episodes", "1", "--track-length", "20", "--device", "cpu"]
EVAL = ["--episodes", "1", "--shield", "on", "--track-length", "20"]
TEN = ["--rules", "paper_observation.pl"]


def refused(capsys: pytest.CaptureFixture[str], *command: str) -> str:
    capsys.readouterr()
    assert run(command) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


def of_before(root: Path, *, rules: tuple[str, ...] = ()) -> Path:
    """Make a run one of before there were names: its files name nothing, and these are its rules."""
    folder = RunFolder.open(root)
    files: list[tuple[Path, Kind]] = [(folder.policy, "policy"), (folder.checkpoint, "checkpoint")]
    for path, kind in files:
        state = load_state(path, kind)
        assert tuple(state.pop("observes")) == PAPER_OBSERVATION.names
        del state["format"], state["kind"]
        if kind == "checkpoint":
            state["config"]["env"]["rules"] = list(rules)
        save_state(path, kind, state)
    env = folder.config.env.model_copy(update={"rules": rules})
    text = dump_yaml(folder.config.model_copy(update={"env": env}))
    (root / "config.yaml").write_text(seal_text(text), encoding="utf-8")
    assert RunFolder.open(root).config.env.rules == rules
    return root


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that observes the paper's ten."""
    root = tmp_path_factory.mktemp("runs") / "ten"
    assert run(["train", *SHORT, *TEN, "--out", str(root)]) == 0
    return root


def test_a_run_remembers_what_it_observes(tmp_path: Path) -> None:
    root = tmp_path / "run"
    assert run(["train", *SHORT, "--out", str(root)]) == 0
    names = Shield.default().observation.names
    folder = RunFolder.open(root)
    assert tuple(load_state(folder.policy, "policy")["observes"]) == names
    assert tuple(load_state(root / CHECKPOINT, "checkpoint")["observes"]) == names
    assert run(["eval", str(root), *EVAL]) == 0


def test_a_policy_of_before_is_refused_by_name_and_drives_with_the_ten_as_it_did(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert run(["eval", str(trained), *EVAL, "--json"]) == 0
    before = json.loads(capsys.readouterr().out)["evaluations"]
    root = of_before(Path(shutil.copytree(trained, tmp_path / "run")))
    error = refused(capsys, "eval", str(root), *EVAL)
    assert "the agent observes 10 numbers, the rules give 21" in error
    assert f"drlsl eval {root} --rules paper_observation.pl" in error
    assert run(["eval", str(root), *EVAL, *TEN, "--json"]) == 0
    (after,) = json.loads(capsys.readouterr().out)["evaluations"]
    assert after["per_episode"] == before[0]["per_episode"]


def test_a_run_of_before_is_not_resumed_with_other_numbers(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = of_before(Path(shutil.copytree(trained, tmp_path / "run")))
    error = refused(capsys, "train", "--out", str(root), "--resume")
    assert "checkpoint.pt: the agent observes 10 numbers, the rules give 21" in error
    assert "--rules paper_observation.pl" in error


def test_a_run_of_before_is_resumed_where_the_rules_give_the_ten(trained: Path, tmp_path: Path) -> None:
    root = of_before(Path(shutil.copytree(trained, tmp_path / "run")), rules=("paper_observation.pl",))
    assert run(["train", "--out", str(root), "--resume"]) == 0


def test_numbers_by_other_names_are_refused(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As many numbers, but not the same: the weights would fit and mean nothing."""
    rules = tmp_path / "mine.pl"
    names = ", ".join(["rear", *PAPER_OBSERVATION.names[1:]])
    rules.write_text(f":- ensure_loaded('paper_observation.pl').\nstate_names([{names}]).\n")
    error = refused(capsys, "eval", str(trained), *EVAL, "--rules", str(rules))
    assert "the agent observes front, which the rules do not give" in error
    swapped = [*PAPER_OBSERVATION.names[:-2], "speed", "lane"]
    rules.write_text(f":- ensure_loaded('paper_observation.pl').\nstate_names([{', '.join(swapped)}]).\n")
    assert "in another order" in refused(capsys, "eval", str(trained), *EVAL, "--rules", str(rules))
