"""What notices slips in the rules that ship: their tables, and for highway.pl the oracle besides."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest

from drlsl.assurance import DrivingRules, load_table, reasons_of, score
from drlsl.assurance.answers import WRONG, Asker, Generated, Interpreter
from drlsl.assurance.checks import Case, Holds, Offered, shown
from drlsl.assurance.clause_text import clause_texts
from drlsl.assurance.driving_rules import DRIVING
from drlsl.assurance.mutants import mutants_of
from drlsl.assurance.mutation import LIMITS, MutantTester
from drlsl.assurance.tested_rules import Question, Solutions
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.lowering.ir import NotLowerable
from drlsl.workers import Crew
from tests.assurance.evidence import RULES, generated_scenes, oracle_cases, table_cases
from tests.driving.test_shield import SCENE

NAMES = Shield.default().observation.names
HIGHWAY, LEFT, PAPER = RULES / "highway.pl", RULES / "overtake_left.pl", RULES / "paper.pl"
EVERY = 40


@pytest.mark.parametrize("program", [HIGHWAY, LEFT, PAPER], ids=lambda path: path.name)
def test_some_mutants_are_noticed_or_explained(program: Path) -> None:
    tester = MutantTester(DrivingRules.of([program]), table_cases(program))
    assert {Path(text.clause.source or "") for text in tester.clauses} == {program}
    reasons = reasons_of([program])
    for mutant in tester.mutants[::EVERY]:
        verdict = tester.verdict(mutant)
        assert (verdict.killed_by is None) == (verdict.name in reasons), verdict


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "least"),
    [(HIGHWAY, 0.97), (LEFT, 0.99), (PAPER, 0.95)],
    ids=["highway.pl", "overtake_left.pl", "paper.pl"],
)
def test_the_tables_notice_every_mutant_that_can_be_noticed(program: Path, least: float) -> None:
    found = score(DrivingRules.of([program]), table_cases(program), reasons_of([program]))
    assert found.share >= least
    assert [verdict.name for verdict in found.unexplained] == []


@pytest.mark.slow
def test_what_the_tables_cannot_notice_the_oracle_cannot_either() -> None:
    """A survivor with a reason is as the rules say in every scene, or the reason is wrong."""
    tester = MutantTester(DrivingRules.of([HIGHWAY]), oracle_cases(300))
    reasons = reasons_of([HIGHWAY])
    survivors = [mutant for mutant in tester.mutants if mutant.name in reasons]
    assert len(survivors) == len(reasons)
    assert [(m.name, tester.verdict(m).killed_by) for m in survivors] == [(m.name, None) for m in survivors]


@pytest.mark.slow
@pytest.mark.parametrize("program", [HIGHWAY, PAPER], ids=lambda path: path.name)
def test_generated_code_answers_as_the_interpreter_does_with_a_slip_too(program: Path) -> None:
    """Mutants are programs that nobody wrote, near those that ship: the tiers must agree on them as well."""
    tester = MutantTester(DrivingRules.of([program]), table_cases(program)[:1])
    scenes = generated_scenes(40)[20:]
    for mutant in tester.mutants[5::20]:
        with tester.mutated(mutant) as rules:
            interpreter = Interpreter(rules, LIMITS)
            generated = Generated(rules, interpreter)
            for question in (*DRIVING, Question("objection(Action, Reason)", "all")):
                try:
                    generated.prepare(question)
                except NotLowerable:
                    continue
                for scene in scenes:
                    found = [answers(asker, scene, question) for asker in (interpreter, generated)]
                    assert found[0] == found[1], f"{mutant.name}: {question.goal} in {scene}"


def answers(asker: Asker, scene: Scene, question: Question) -> object:
    try:
        return [dict(row) for row in asker.ask(scene, question)]
    except WRONG as error:
        return type(error)


PROGRAM = """
safe_actions(lane_keeping).
safe_actions(left_lane_change) :- far(40), \\+ near.
front_is_free.
longitudinal_velocity(V) :- V is 10.0.
state([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5]).
entry_is_safe.
far(D) :- D > 30.
near :- fail.
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    path = tmp_path / "mine.pl"
    path.write_text(PROGRAM)
    return path


def case(*wanted: str) -> Case:
    return Case("t:1", "t", SCENE, (Offered("actions", Question("safe_actions(A)", "all"), wanted),))


def test_survivors_are_told_with_place_and_text(program: Path) -> None:
    found = score(DrivingRules.of([program]), [case("lane_keeping", "left_lane_change")])
    survivors = {verdict.name: verdict for verdict in found.survivors}
    boundary = survivors["far/1 clause 1: D > 30 ==> D >= 30"]
    assert boundary.place == f"{program}:8:13"
    assert (boundary.before, boundary.after) == ("D > 30", "D >= 30")
    assert "far/1 clause 1: D > 30 ==> D < 30" not in survivors
    assert "entry_is_safe/0 clause 1: left out" in survivors, "no case asks for it"
    killed = {verdict.name: verdict.killed_by for verdict in found.verdicts if verdict.killed_by}
    assert killed["safe_actions/1 clause 2: \\+ near ==> near"] == "t:1 actions"
    assert killed["safe_actions/1 clause 1: left out"] == "t:1 actions"
    assert killed["far/1 clause 1: left out"] == "t:1 actions", "a call of what nobody defines"


def test_a_row_that_would_notice_a_survivor(tmp_path: Path) -> None:
    table = tmp_path / "t.yaml"
    table.write_text("scenes:\n  - {scene: a free road, ego: {lane: 2}, target_speed: 20.12}\n")
    cases = load_table(table, NAMES)
    tester = MutantTester(DrivingRules.of([HIGHWAY]), cases)
    (mutant,) = (
        m
        for m in tester.mutants
        if m.name == "front_braking/1 clause 1: front_braking(8.0) ==> front_braking(9.0)"
    )
    assert tester.verdict(mutant).killed_by is None
    witness = tester.witness(mutant)
    assert witness is not None
    assert witness.rules != witness.mutant
    table.write_text(f"scenes:\n  - {{scene: told, goals: {{x: true}}, rows: [{witness.row}]}}\n")
    (case,) = load_table(table, NAMES)
    found = Interpreter(DrivingRules(Shield.default())).ask(case.state, Question(witness.goal, "all"))
    assert witness.rules in " | ".join(", ".join(map(shown, row.values())) for row in found)


def test_processes_share_the_work(program: Path) -> None:
    cases = [case("lane_keeping", "left_lane_change")]
    alone = score(DrivingRules.of([program]), cases)
    assert len(alone.witnesses) > 1
    assert score(DrivingRules.of([program]), cases, crew=Crew(2)) == alone


@dataclass(frozen=True)
class Deadly(Offered):
    """A check that ends its process, once."""

    alive: Path

    def agrees(self, found: Solutions) -> bool:
        if self.alive.exists():
            self.alive.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().agrees(found)


def test_the_mutants_of_a_lost_process_are_tested_again(program: Path, tmp_path: Path) -> None:
    (usual,) = case("lane_keeping", "left_lane_change").checks
    deadly = Deadly("actions", usual.question, ("lane_keeping", "left_lane_change"), tmp_path / "alive")
    cases = [Case("t:1", "t", SCENE, (deadly,))]
    alone = score(DrivingRules.of([program]), cases)
    reasons = {verdict.name: "not asked for" for verdict in alone.survivors}
    deadly.alive.touch()
    with pytest.warns(UserWarning, match="done again: the process was ended by SIGKILL"):
        found = score(DrivingRules.of([program]), cases, reasons, crew=Crew(2))
    assert found.verdicts == alone.verdicts


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("far/1 clause 1: D > 30 ==> D < 30", "t:1 actions notices it"),
        ("far/1 clause 1: D > 31 ==> D < 31", "which does not exist; did you mean 'far/1 clause 1: D > 30"),
    ],
)
def test_a_reason_for_what_is_no_survivor_is_an_error(program: Path, name: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        score(DrivingRules.of([program]), [case("lane_keeping", "left_lane_change")], {name: "because"})


def test_the_program_is_as_before_when_all_mutants_were_tried(program: Path) -> None:
    tester = MutantTester(DrivingRules.of([program]), [case("lane_keeping", "left_lane_change")])
    for number in range(len(tester.clauses)):
        tester.test_clause(number)
    fresh = mutants_of(clause_texts(Shield.from_files([program]).engine))
    assert [mutant.name for mutant in tester.mutants] == [mutant.name for mutant in fresh]
    unchanged = next(
        mutant for mutant in tester.mutants if mutant.name == "far/1 clause 1: D > 30 ==> D >= 30"
    )
    assert tester.verdict(unchanged).killed_by is None


def test_a_mutant_that_never_ends_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "loop.pl"
    path.write_text(PROGRAM + "left_turn :- right_turn.\nright_turn :- fail.\n")
    cases = [Case("t:1", "t", SCENE, (Holds("turn", Question("left_turn", "holds"), False),))]
    tester = MutantTester(DrivingRules.of([path]), cases)
    endless = next(m for m in tester.mutants if m.name == "left_turn/0 clause 1: right_turn ==> left_turn")
    assert tester.verdict(endless).killed_by == "t:1 turn"
