"""The learner and the real environment together, on a few metres of the bundled recording."""

import json
import math
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.learning import RunFolder, Session
from drlsl.learning.config import make_config, merged

from .conftest import small_config
from .test_session import assert_same_outcome

SHORT = ["--preset", "tiny", "--episodes", "3", "--track-length", "60", "--device", "cpu"]


@pytest.mark.parametrize("method", ["dqn", "dqnsl"])
def test_train_and_eval_in_recorded_traffic(
    method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "run")
    assert run(["train", *SHORT, "--method", method, "--out", out]) == 0
    rows = RunFolder.open(tmp_path / "run").metrics()
    terms = rows[["reward_lane_change", "reward_velocity", "reward_collision", "reward_off_road"]]
    assert rows["episode"].tolist() == [1, 2, 3]
    assert terms.sum(axis=1).to_numpy() == pytest.approx(rows["return"].to_numpy())
    assert (rows["fail_safe"] == 0).all()
    ended = (rows["contact"] == 1) | (rows["off_road"] == 1) | (rows["distance"] >= 60.0)
    assert ended.all()
    assert (rows["mask_size"] == 3.0).all() == (method == "dqn")
    capsys.readouterr()
    assert run(["eval", out, "--episodes", "2", "--json", "--track-length", "30"]) == 0
    on, off = json.loads(capsys.readouterr().out)["evaluations"]
    assert (on["shield"], off["shield"]) == ("on", "off")
    assert on["totals"]["off_road"] == on["totals"]["fail_safe"] == on["totals"]["not_offered"] == 0
    asked = sum(round(item["interventions"]) for item in off["per_episode"])
    assert off["totals"]["not_offered"] == asked  # without the shield, it gets what it prefers
    assert all(math.isfinite(item["total_return"]) for item in on["per_episode"] + off["per_episode"])


@pytest.mark.parametrize("num_envs", ["1", "2"])
def test_a_stopped_training_resumes_bit_for_bit(tmp_path: Path, num_envs: str) -> None:
    assert run(["train", *SHORT, "--num-envs", num_envs, "--out", str(tmp_path / "whole")]) == 0
    session = Session.start(tmp_path / "stopped", RunFolder.open(tmp_path / "whole").config)
    for _ in session.run(lambda: session.trainer.total_steps >= 90):
        pass
    session.close()
    for _ in Session.resume(tmp_path / "stopped").run():
        pass
    assert_same_outcome(tmp_path / "whole", tmp_path / "stopped")


def test_a_run_whose_rules_were_changed_is_not_resumed_and_its_evaluation_tells(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = tmp_path / "mine.pl"
    text = ":- ensure_loaded('highway.pl').\n"
    rules.write_text(text)
    config = make_config(merged(small_config().model_dump(), {"env": {"rules": [str(rules)]}}), "test")
    with Session.start(tmp_path / "run", config) as session:
        next(iter(session.run()))
        session.checkpoint()
    capsys.readouterr()
    told = ["eval", str(tmp_path / "run"), "--episodes", "1", "--track-length", "30"]
    assert run(told) == 0
    assert "rules were changed" not in capsys.readouterr().err
    rules.write_text(text + "never_asked(1).\n")
    assert run(told) == 0
    assert "drlsl: the rules were changed after the training: mine.pl\n" in capsys.readouterr().err
    other = tmp_path / "other.pl"
    other.write_text(text)
    for named in (["--rules", str(rules)], ["--rules", str(other)], ["--set", f"env.rules=[{other}]"]):
        assert run([*told, *named]) == 0  # named on purpose
        assert "rules were changed" not in capsys.readouterr().err
    with pytest.raises(UserError, match=r"rules were changed after the checkpoint: mine\.pl; put them back"):
        Session.resume(tmp_path / "run")
    rules.write_text(text)
    with Session.resume(tmp_path / "run") as session:
        assert session.total_steps > 0
