"""The loop: what goes wrong is learnt from, rounds are kept and resumed, and what cannot be met is told."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

import numpy as np
import pytest

from drlsl.assurance import DrivingRules, Score, load_table, run_cases
from drlsl.cli import run as command
from drlsl.driving import Counts
from drlsl.driving.drivers import Driver
from drlsl.driving.scene import Scene, load_scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.induction import LearningRun, Progress, covered
from drlsl.induction.lane_changes import (
    BadChange,
    ChangeExamples,
    Labelling,
    LaneChanges,
    LearningReport,
    LearnRequest,
    ReportRequest,
    Stressed,
    label_changes,
    learning_report,
    write_table,
)
from drlsl.induction.lane_changes.examination import broken_by, examined, stressed
from drlsl.induction.lane_changes.scene_bias import SIDES
from drlsl.traffic import load_recording
from drlsl.verify import Request, Result
from drlsl.verify.confirmation import Counterexample
from drlsl.workers import Crew
from tests.assurance.evidence import RULES

REQUEST = LearnRequest(
    recordings=("highway-test",),
    how=Labelling(changes=80, egos=16),
    seconds=0.5,
    must=(),
    episodes=10,
)
CLEAN = Counts(episodes=10, lane_changes=7, contacts=Counter(cut_off=3))


class Trouble:
    """Stress in which the first `times` rounds end at fault, after a lane change that the file offers."""

    def __init__(self, times: int, examples: ChangeExamples) -> None:
        self.times, self.rounds, self._examples = times, 0, examples

    def __call__(
        self,
        rules: Path,
        recordings: Sequence[str],
        episodes: int,
        seed: int,
        *,
        crew: Crew,
        progress: Progress,
    ) -> list[Stressed]:
        self.rounds += 1
        if self.rounds > self.times:
            return [Stressed(recordings[0], CLEAN, (), 0)]
        bad = BadChange(*self._offered(rules), f"stress of {recordings[0]}")
        return [Stressed(recordings[0], replace(CLEAN, contacts=Counter(at_fault=1, cut_off=3)), (bad,), 0)]

    def _offered(self, rules: Path) -> tuple[Scene, Any]:
        """Return a scene and side that the rules offer, as hard as any."""
        scenes = self._examples.scenes
        mask = Shield.from_files([rules], tier="numpy").decide_batch(scenes).action_mask
        mine = mask[np.arange(len(mask)), 1 + self._examples.choice] & (self._examples.eases < 2**31 - 1).any(
            1
        )
        place = int(mine.nonzero()[0][0])
        return scenes.scene(place), SIDES[int(self._examples.choice[place])]


@pytest.fixture(scope="module")
def examples(tmp_path_factory: pytest.TempPathFactory) -> ChangeExamples:
    domain = LaneChanges(REQUEST)
    return domain.examples(domain.label(tmp_path_factory.mktemp("labels"), lambda _: None), [])


def learn(
    out: Path, trouble: Trouble, monkeypatch: pytest.MonkeyPatch, request: LearnRequest = REQUEST
) -> tuple[Any, list[str]]:
    told: list[str] = []
    monkeypatch.setattr("drlsl.induction.lane_changes.lane_change_domain.stressed", trouble)
    return LearningRun(LaneChanges(request), out, told.append).run(), told


def test_what_goes_wrong_is_an_example_of_the_next_round(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "learnt.pl"
    result, told = learn(out, Trouble(2, examples), monkeypatch)
    assert [len(one.bad) for one in result.rounds] == [1, 1, 0]
    assert result.finished
    assert result.rounds[0].clauses != result.rounds[1].clauses
    assert not covered(result.clauses, result.examples.eases[result.examples.unsafe]).any()
    assert result.examples.origin[-1] == "stress of highway-test"
    assert sum("clauses offer" in line for line in told) == 3
    text = out.read_text()
    assert "and no unsafe one" in text
    mask = Shield.from_files([out], tier="numpy").decide_batch(result.examples.scenes).action_mask
    mine = mask[np.arange(len(mask)), 1 + result.examples.choice]
    assert (mine == covered(result.clauses, result.examples.eases)).all(), "the text is what was searched"


@pytest.mark.parametrize("jobs", [1, 2])
def test_labelling_shows_how_far_each_recording_is(jobs: int, tmp_path: Path) -> None:
    """From worker processes, too; the labels are the same."""
    bias = tmp_path / "unlabelled.pl"
    bias.write_text(f":- ensure_loaded('learning.pl').\n% {uuid4()}, so that no labels are kept\n")
    seen: list[tuple[str, int, int]] = []
    names = ("highway-test", "freeway")
    request = replace(REQUEST, recordings=names, bias=str(bias), crew=Crew(jobs))
    parts = LaneChanges(request, lambda *shown: seen.append(shown)).label(tmp_path, lambda _: None)
    for name, part in zip(request.recordings, parts, strict=True):
        counts = [done for what, done, total in seen if (what, total) == (f"labelling {name}", 80)]
        assert counts == sorted(counts)
        assert len(set(counts)) > 3
        assert len(part) == 80
        alone = label_changes(request.how, request.bias, load_recording(name))
        assert np.array_equal(part.unsafe, alone.unsafe)
        assert np.array_equal(part.scenes.x, alone.scenes.x)


def test_rounds_are_resumed_and_other_settings_refused(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, _ = learn(tmp_path / "whole.pl", Trouble(2, examples), monkeypatch)

    class Stopped(Trouble):
        def __call__(self, *given: Any, **options: Any) -> list[Stressed]:
            if self.rounds == 1:
                raise KeyboardInterrupt
            return super().__call__(*given, **options)

    out = tmp_path / "parts.pl"
    with pytest.raises(KeyboardInterrupt):
        learn(out, Stopped(2, examples), monkeypatch)
    assert "opening(Side) :-" in out.read_text(), "the best so far is left"
    assert [file.name for file in sorted(out.with_suffix(".rounds").iterdir())] == [
        *("round-01.json", "settings.json")
    ]
    rest, told = learn(out, Trouble(1, examples), monkeypatch)
    assert rest.rounds == whole.rounds
    assert sum("clauses offer" in line for line in told) == 2
    text = out.read_text()
    again, told = learn(out, Trouble(9, examples), monkeypatch)
    assert (again.rounds, out.read_text()) == (rest.rounds, text), "nothing is left to do"
    with pytest.raises(UserError, match="holds the rounds of other settings"):
        LearningRun(LaneChanges(LearnRequest(recordings=("freeway",))), out, print)


def test_a_limit_of_rounds_leaves_what_holds_of_the_last_file(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "learnt.pl"
    limited = replace(REQUEST, rounds=2)
    result, _ = learn(out, Trouble(9, examples), monkeypatch, limited)
    assert not result.finished
    assert len(result.rounds) == 2
    assert not covered(result.clauses, result.examples.eases[result.examples.unsafe]).any()
    assert "the last one still brought examples" in out.read_text()


def test_other_settings_begin_anew_where_nothing_was_learnt(tmp_path: Path) -> None:
    """As after "label more": the same file may be named again."""
    out = tmp_path / "learnt.pl"
    LearningRun(LaneChanges(REQUEST), out, print)
    LearningRun(LaneChanges(replace(REQUEST, episodes=11)), out, print)
    settings = json.loads((tmp_path / "learnt.rounds" / "settings.json").read_text())
    assert settings["episodes"] == 11


def test_the_file_of_a_user_is_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "mine.pl"
    out.write_text("a.\n")
    with pytest.raises(UserError, match=r"mine\.pl exists; name a new file"):
        LearningRun(LaneChanges(REQUEST), out, print)
    assert out.read_text() == "a.\n"


def test_stress_keeps_the_lane_changes_that_ended_at_fault(tmp_path: Path) -> None:
    (tmp_path / "bold.pl").write_text(
        ":- ensure_loaded('highway.pl').\n:- abolish(obstacle/4).\nobstacle(_, _, _, _) :- fail.\n"
    )
    (found,) = stressed(tmp_path / "bold.pl", ["highway-test"], 24, 3, tier="numpy")
    assert not found.clean
    assert len(found.bad) + found.unexplained == found.counts.contacts_at_fault > 0
    assert found.bad
    offered = Shield.from_files([tmp_path / "bold.pl"])
    for one in found.bad:
        assert one.side in {action.atom.split("_")[0] for action in offered.decide(one.scene).safe_actions}


def test_a_counterexample_says_which_lane_change_breaks_a_property(tmp_path: Path) -> None:
    """Only a change to the right is offered with a vehicle alongside there."""
    rules = tmp_path / "right.pl"
    rules.write_text(
        ":- ensure_loaded('highway.pl').\n:- abolish(objection/2).\n"
        "objection(A, changing_lanes) :- lane_change(A, _), \\+ settled.\n"
        "objection(A, no_lane) :- lane_change(A, S), \\+ side_lane(S, _).\n"
        "objection(left_lane_change, too_close(C, G, N)) :- obstacle(left, C, G, N).\n"
    )
    (result,) = examined(rules, (), ["nobody_alongside"])
    assert result.status == "refuted"
    found = list(broken_by(rules, (), result))
    assert [(one.side, one.origin) for one in found] == [("right", "property nobody_alongside")]


@pytest.mark.slow
def test_a_property_that_no_clause_can_meet_is_told(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    properties = tmp_path / "mine.properties.pl"
    properties.write_text(
        ":- ensure_loaded('properties.pl').\n"
        "property(never_slow, 'the target speed is never below 10 m/s').\n"
        "violates(never_slow) :- longitudinal_velocity(V), V < 10.0.\n"
    )
    request = replace(REQUEST, must=("never_slow",), properties=(properties,))
    with pytest.raises(UserError, match="--must never_slow: it is refuted, but not by the offer"):
        learn(tmp_path / "learnt.pl", Trouble(0, examples), monkeypatch, request)


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--clauses", "0"], "--clauses 0: expected 1 or more"),
        (["--literals", "0"], "--literals 0: expected 1 or more"),
        (["--bias", "highway.pl"], "highway.pl declares nothing to learn from"),
        (["--must", "nobody_knows"], "there is no property nobody_knows"),
        (["no-such-recording"], "no-such-recording"),
    ],
)
def test_wrong_arguments_are_one_line(
    arguments: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "learnt.pl"
    assert command(["rules", "learn", *arguments, "--out", str(out), "--changes", "30", "--jobs", "1"]) == 2
    assert why in capsys.readouterr().err.splitlines()[-1]


def test_a_result_is_read_back_as_it_was(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, _ = learn(tmp_path / "learnt.pl", Trouble(1, examples), monkeypatch)
    for one in result.rounds:
        kept = json.loads(json.dumps(one.as_json(result.domain)))
        assert type(one).of_json(kept, "round", result.domain) == one


@pytest.mark.slow
def test_the_table_has_both_sides_of_the_limits_and_notices_mutants(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "learnt.pl"
    result, _ = learn(out, Trouble(0, examples), monkeypatch)
    found = write_table(out, result.clauses, result.examples)
    assert found.unexplained == []
    assert found.killed > 0.8 * len(found.verdicts)
    shield = Shield.from_files([out])
    cases = load_table(out.with_suffix(".test.yaml"), shield.observation.names)
    outcome = run_cases(DrivingRules(shield), cases, ["numpy"])
    assert not outcome.failures
    text = out.with_suffix(".test.yaml").read_text()
    assert text.count("row: just,") >= 1


@pytest.mark.slow
def test_the_report_has_rounds_proofs_stress_and_time_saved(
    tmp_path: Path, examples: ChangeExamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "learnt.pl"
    result, _ = learn(out, Trouble(1, examples), monkeypatch)
    told: list[str] = []
    monkeypatch.setattr("drlsl.induction.lane_changes.learning_report.verify", _one_refutation)
    monkeypatch.setattr("drlsl.induction.lane_changes.learning_report.stressed", _no_stress)
    report = LearningReport(out, REQUEST, result, Score((), {}, {}), told.append)
    path = report.write(ReportRequest(held_out=("freeway",), episodes=5, drives=2))
    text = path.read_text()
    assert "| 1 | " in text
    assert "| 2 | " in text
    assert "| nobody_alongside | refuted |" in text
    assert (path.parent / "nobody_alongside.png").exists()
    assert "| learnt.pl | freeway* |" in text
    assert "| highway.pl | highway-test |" in text
    assert text.count("| mobil | ") == 6


def _one_refutation(request: Request) -> Any:
    scene = load_scene(Path(__file__).parents[2] / "examples" / "scene.json")
    found = Result("nobody_alongside", "nobody", 1, status="refuted", counterexample=Counterexample(scene))
    return SimpleNamespace(results=[found])


def _no_stress(rules: Path, recordings: Sequence[str], *rest: Any, **options: Any) -> list[Stressed]:
    return [Stressed(name, replace(CLEAN, distance=Fraction(1000)), (), 0) for name in recordings]


def test_two_examples_that_contradict_the_declared_directions_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bias = tmp_path / "wrong.pl"
    bias.write_text(":- ensure_loaded('highway.pl').\nlearn(speed_of_all(_), more).\nspeed_of_all(_, 1.0).\n")
    run = LearningRun(LaneChanges(replace(REQUEST, bias=str(bias))), tmp_path / "learnt.pl", print)
    with pytest.raises(UserError, match=r"this one was safe \(highway-test.*and this one was not \(highway-"):
        run.run()


def test_an_agent_that_does_not_fit_the_rules_does_not_end_the_report(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(name: str, *_: object) -> Driver:
        raise UserError(f"{name}: the agent observes what the rules do not give")

    monkeypatch.setattr("drlsl.induction.lane_changes.learning_report.load_driver", refuse)
    what = ReportRequest(drives=1, agents=("run",))
    mobil, agent = learning_report._driven(RULES / "paper.pl", "freeway", what)
    assert mobil.startswith("| mobil | paper.pl | freeway |")
    assert agent.startswith("| run | paper.pl | freeway | not driven: run: the agent observes")
    assert agent.count("|") == mobil.count("|")


def test_a_mistyped_recording_begins_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["rules", "learn", "nowhere", "--out", str(tmp_path / "learnt.pl")]) == 2
    assert "nowhere" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
