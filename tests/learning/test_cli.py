import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from drlsl.cli import run
from drlsl.learning import RunFolder, load_state

from .test_session import assert_same_outcome

ROOT = Path(__file__).parents[2]
TINY = ["--preset", "tiny", "--device", "cpu", "--set", "env.track_length=400"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fake_driving: None) -> None:
    monkeypatch.chdir(tmp_path)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that a refused command prints."""
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


def test_train_then_eval(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["train", *TINY, "--out", "run"]) == 0
    out = capsys.readouterr().out
    assert "episode 4/4" in out
    assert "steps/s" in out
    assert "shield on" in out
    assert "drlsl eval run" in out
    assert "drlsl query --state examples/scene.json\n" in out
    assert {path.name for path in (tmp_path / "run").iterdir()} == {
        "config.yaml",
        "metrics.csv",
        "checkpoint.pt",
        "policy.pt",
        "evaluation.json",
        "figures",
        ".lock",
        ".evaluation.lock",
    }
    assert len(list((tmp_path / "run" / "figures").glob("*.png"))) == 5
    assert run(["eval", "run", "--episodes", "3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["evaluations"]
    assert [(item["shield"], item["episodes"]) for item in found] == [("on", 3), ("off", 3)]
    assert run(["eval", "run", "--episodes", "3", "--json", "--shield", "off"]) == 0
    assert json.loads(capsys.readouterr().out)["evaluations"] == found[1:]
    assert len(RunFolder.open(tmp_path / "run").evaluations()) == 4


def test_eval_prints_a_table_of_totals(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["train", *TINY, "--out", "run", "--set", "evaluation.episodes_after_training=0"]) == 0
    assert "shield on" not in capsys.readouterr().out
    assert run(["eval", "run", "--track-length", "300", "--direction", "left_to_right"]) == 0
    out = capsys.readouterr().out
    assert "2 episodes, highway-train, left_to_right" in out
    for label in (
        "lane changes",
        "at fault",
        "time saved",
        "[m/s]",
        "off-road",
        "interventions",
        "fail-safe",
    ):
        assert label in out
    (kept, _) = RunFolder.open(Path("run")).evaluations()
    assert kept["env"]["track_length"] == 300.0
    assert kept["env"]["direction"] == "left_to_right"


def test_a_terminal_shows_a_bar(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["train", *TINY, "--out", "run"]) == 0
    out = capsys.readouterr().out
    assert "4/4" in out
    assert "left" in out
    assert "episode 4/4  " not in out
    assert "steps/s  return " in out
    assert "contacts " in out


def printed_config(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    assert run(["train", "--print-config", *arguments]) == 0
    values: dict[str, object] = yaml.safe_load(capsys.readouterr().out)
    return values


def test_later_settings_win(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "my.yaml").write_text("episodes: 7\nseed: 7\nmethod: dqn\nthreads: 7\n")
    assert printed_config(capsys)["episodes"] == 300
    assert printed_config(capsys, "--preset", "paper")["episodes"] == 1_500
    found = printed_config(
        capsys,
        *["--preset", "tiny", "--config", "my.yaml", "--set", "seed=8", "--set", "threads=8"],
        *["--threads", "9", "--rules", "a.pl", "--rules", "b.pl", "--recording", "r", "--bootstrap", "all"],
    )
    assert (found["episodes"], found["seed"], found["threads"], found["method"]) == (7, 8, 9, "dqn")
    assert found["checkpoint_every"] == 2
    assert found["env"]["rules"] == ["a.pl", "b.pl"]  # type: ignore[index]
    assert found["env"]["recording"] == "r"  # type: ignore[index]
    assert found["learning"]["bootstrap"] == "all"  # type: ignore[index]
    assert not (tmp_path / "runs").exists()


def test_a_config_without_a_preset_starts_from_the_defaults(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "my.yaml").write_text("seed: 7\n")
    assert printed_config(capsys, "--config", "my.yaml")["episodes"] == 1_500


def test_a_printed_config_prints_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = printed_config(capsys, "--preset", "tiny", "--seed", "3")
    (tmp_path / "again.yaml").write_text(yaml.safe_dump(first))
    assert printed_config(capsys, "--config", "again.yaml") == first


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--episodes", "0"], "command line: episodes: input should be greater than or equal to 1, got 0"),
        (["--set", "learning.discout=1"], "did you mean 'learning.discount'?"),
        (["--set", "nonsense"], "expected KEY=VALUE"),
        (["--set", "=1"], "expected KEY=VALUE"),
        (["--set", "seed=[1"], "the value is not valid YAML"),
        (["--preset", "huge"], "'huge': no such preset; expected one of paper, paper-code, quick, tiny"),
        (["--config", "none.yaml"], "cannot read the configuration none.yaml"),
        (["--method", "ppo"], "ppo"),
        (["--episodes", "many"], "'--episodes'"),
        (["--resume"], "name the run to resume with --out"),
        (["--resume", "--out", "nowhere"], "nowhere: no run here"),
        (["--resume", "--out", "x", "--force"], "leave out --force"),
        (["--resume", "--out", "x", "--print-config"], "leave out --force"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], part: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert part in refused(capsys, "train", *arguments)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["train", *TINY, "--out", "run"]) == 0
    before = (tmp_path / "run" / "metrics.csv").read_text()
    capsys.readouterr()
    assert "--force replaces it" in refused(capsys, "train", *TINY, "--out", "run")
    assert (tmp_path / "run" / "metrics.csv").read_text() == before
    assert run(["train", *TINY, "--out", "run", "--force", "--seed", "5"]) == 0
    assert (tmp_path / "run" / "metrics.csv").read_text() != before


def test_runs_without_a_name_do_not_collide(tmp_path: Path) -> None:
    for _ in range(2):
        assert run(["train", *TINY]) == 0
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == ["dqnsl-seed0", "dqnsl-seed0-2"]


def test_resume_refuses_other_settings(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["train", *TINY, "--out", "run"]) == 0
    capsys.readouterr()
    assert "differs" in refused(capsys, "train", "--resume", "--out", "run", "--episodes", "9")
    assert "leave out --force, --config" in refused(
        capsys, "train", "--resume", "--out", "run", "--preset", "paper"
    )
    assert run(["train", "--resume", "--out", "run", "--seed", "0"]) == 0


def test_eval_refuses_what_is_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "expected a run folder" in refused(capsys, "eval", "nowhere")
    assert "episodes" in refused(capsys, "eval", "nowhere", "--episodes", "0")
    assert list(tmp_path.iterdir()) == []


def started(tmp_path: Path, name: str, *more: str, resume: bool = False) -> subprocess.Popen[str]:
    """A slow training in a process of its own, once it has finished three episodes, or just gone on."""
    metrics = tmp_path / name / "metrics.csv"
    settings = ["--resume"] if resume else [*TINY, *more]
    command = [sys.executable, "-m", "tests.learning.fake_cli", "train", *settings]
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path / name)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    deadline = time.monotonic() + 60
    while not resume and (not metrics.exists() or len(metrics.read_text().splitlines()) < 4):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


@pytest.mark.parametrize("num_envs", ["1", "3"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_stopped_process_resumes_bit_for_bit(number: signal.Signals, num_envs: str, tmp_path: Path) -> None:
    settings = ["--episodes", "20", "--num-envs", num_envs]
    process = started(tmp_path, "run", *settings)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    if number is signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert (process.returncode, err) == (128 + number, "")
        last = out.splitlines()[-1]
        assert last.endswith(f"resume with: drlsl train --out {tmp_path / 'run'} --resume")
        stored = load_state(tmp_path / "run" / "checkpoint.pt", "checkpoint")
        assert f"saved at step {stored['trainer']['total_steps']};" in last
    assert run(["train", "--resume", "--out", "run"]) == 0
    assert run(["train", *TINY, *settings, "--out", "whole"]) == 0
    assert_same_outcome(tmp_path / "whole", tmp_path / "run")


def test_a_run_has_one_process_at_a_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = ["--episodes", "20"]
    process = started(tmp_path, "run", *settings)
    for command in (["train", "--resume", "--out", "run"], ["train", *TINY, "--out", "run", "--force"]):
        told = refused(capsys, *command)
        assert f"run: process {process.pid} on " in told
        assert "is at work here (training); wait for it, or stop it" in told
    assert run(["eval", "run", "--episodes", "2"]) == 0
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    resumed = [started(tmp_path, "run", resume=True) for _ in range(2)]
    ended = [(one.communicate(timeout=60)[1], one.returncode) for one in resumed]
    # Both are welcome, if the one is done before the other looks.
    assert sorted(status for _, status in ended) in ([0, 2], [0, 0])
    assert ["is at work here (training)" in told for told, _ in ended] == [status == 2 for _, status in ended]
    assert run(["train", *TINY, *settings, "--out", "whole"]) == 0
    assert_same_outcome(tmp_path / "whole", tmp_path / "run")


def test_a_second_interrupt_stops_at_once(tmp_path: Path) -> None:
    process = started(tmp_path, "run", "--episodes", "20")
    process.send_signal(signal.SIGINT)
    time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    # where the second comes when all is done, Python ends by the signal itself, which shells call 130, too
    assert process.returncode in (130, -signal.SIGINT)
    assert "--resume" in out.splitlines()[-1]
    assert run(["train", "--resume", "--out", "run"]) == 0
    assert len((tmp_path / "run" / "metrics.csv").read_text().splitlines()) == 21


def test_starting_the_command_line_does_not_load_torch() -> None:
    code = "import sys, drlsl.cli; print('torch' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.strip() == "False"
