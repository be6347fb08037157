"""drlsl rules verify, as a user calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.driving.shield import default_rules

PAPER = default_rules()[0].parent / "paper.pl"

FAST = (
    "property(fast, 'the ego is slow'). violates(fast) :- vehicle(ego, _, _, _, V, _, _, _), abs(V) > 30.0."
)


@pytest.fixture
def fast(tmp_path: Path) -> str:
    path = tmp_path / "fast.pl"
    path.write_text(FAST, encoding="utf-8")
    return str(path)


def test_json(fast: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["rules", "verify", "--property", fast, "--vehicles", "1", "--jobs", "1", "--json"]
    assert run(arguments) == 1
    printed = json.loads(capsys.readouterr().out)
    (result,) = printed["results"]
    assert result.keys() == {
        "property",
        "status",
        "vehicles",
        "any_number",
        "seconds",
        "reason",
        "counterexample",
        "confirmed",
        "unanswered",
        "prover_error",
        "floats",
        "amount",
        "attack",
    }
    assert (result["property"], result["status"], result["vehicles"]) == ("fast", "refuted", 1)
    assert abs(result["counterexample"]["scene"]["ego"]["vx_mps"]) > 30
    assert printed["ranges"]["ego_speed"] == [0, 70]


def test_scenes_answer_to_drlsl_query_as_the_report_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scenes"
    arguments = [str(PAPER), "--only", "nothing_hidden", "--vehicles", "2", "--jobs", "1", "--out", str(out)]
    assert run(["rules", "verify", *arguments]) == 1
    assert "refuted  nothing_hidden" in capsys.readouterr().out
    actions = {}
    for name in ("nothing_hidden", "nothing_hidden.alone"):
        assert run(["query", "--state", str(out / f"{name}.json"), "--rules", str(PAPER), "--json"]) == 0
        actions[name] = json.loads(capsys.readouterr().out)["safe_actions"]
    assert set(actions["nothing_hidden"]) > set(actions["nothing_hidden.alone"])
    assert (out / "nothing_hidden.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "nonsense"], "there is no property nonsense; there are lane_exists"),
        (["--property", "missing.pl"], "cannot read the rule file missing.pl"),
        (["missing.pl"], "cannot read the rule file missing.pl"),
        (["--vehicles", "-1"], "--vehicles"),
        (["--out", "."], ". exists; name a new folder"),
    ],
)
def test_bad_calls(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "verify", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_status_is_0_where_all_is_proved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "keep.pl"
    path.write_text("property(keep, 'keep'). violates(keep) :- \\+ safe_actions(lane_keeping).")
    assert run(["rules", "verify", "--property", str(path), "--vehicles", "0", "--jobs", "2"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("proved   keep                     any number of vehicles")
    assert "attacked with 200,000 scenes: 200,000 reached the last goal of violates" in printed


def test_an_overflow_next_to_0_is_what_the_margin_says_or_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "near.pl"
    path.write_text(
        "property(near, 'near'). property(always, 'always'). "
        "violates(near) :- vehicle(ego, _, _, _, V, _, _, _), V > 0.0, X is 1.0 / V, X < 0.0. "
        "violates(always) :- vehicle(ego, _, _, _, V, _, _, _), V > 1.0, X is 1.0 / (V * 1.0e-320), X < 0.0."
    )
    arguments = ["rules", "verify", "--property", str(path), "--vehicles", "0", "--attack", "4000"]
    assert run([*arguments, "--jobs", "1", "--json"]) == 1
    near, always = json.loads(capsys.readouterr().out)["results"]
    assert (near["status"], near["prover_error"], near["counterexample"]) == ("proved", False, None)
    assert (near["floats"]["margin"], near["floats"]["divisors"]) == (1e-9, True)
    assert (always["status"], always["prover_error"]) == ("proved in real arithmetic only", False)
    assert "may overflow: no margin keeps its divisor far enough from 0; a scene" in always["reason"]
    assert "float_overflow" in always["counterexample"]["error"]
    assert run([*arguments, "--jobs", "1", "--only", "near"]) == 0
    assert "in its unit, of its limit, or a divisor that close to 0; otherwise" in capsys.readouterr().out


def test_what_rounding_breaks_is_proved_in_real_arithmetic_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "far.pl"
    path.write_text(
        "property(far, 'far'). "
        "violates(far) :- vehicle(ego, _, _, _, V, _, _, _), V > 1.0, X is (V + 1.0e17) - 1.0e17, X =< 0.5."
    )
    arguments = ["rules", "verify", "--property", str(path), "--vehicles", "1", "--attack", "4000"]
    found = []
    for jobs in ("1", "2"):
        assert run([*arguments, "--jobs", jobs, "--json"]) == 1
        (result,) = json.loads(capsys.readouterr().out)["results"]
        assert result["status"] == "proved in real arithmetic only"
        assert result["amount"] > 0.5
        assert result["floats"]["margin"] is None
        assert result["floats"]["error"] == pytest.approx(8)
        assert result["floats"]["comparison"].startswith("X =< 0.5 (")
        assert result["counterexample"]["scene"]["ego"]["vx_mps"] != 0
        assert not result["prover_error"]
        assert result["attack"]["scenes"] == 4000
        found.append((result["amount"], result["counterexample"], result["attack"]["broken"]))
    assert found[0] == found[1]
    assert run([*arguments, "--jobs", "1"]) == 1
    printed = capsys.readouterr().out
    assert "proved in real arithmetic only far" in printed
    assert "may be off by 8; a scene breaks it in floats only: a comparison that lies " in " ".join(
        printed.split()
    )
    assert run([*arguments, "--jobs", "1", "--attack", "0"]) == 1
    assert "not attacked" in capsys.readouterr().out
