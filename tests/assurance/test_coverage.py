"""What of a program was reached, without a change of what it answers."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.assurance import DrivingRules, measure
from drlsl.assurance.checks import Case, Holds, Solves
from drlsl.assurance.coverage import Instrumented
from drlsl.assurance.tested_rules import Question
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from tests.assurance.evidence import RULES, table_cases
from tests.driving.test_shield import SCENE
from tests.scenes import scenes


@pytest.mark.parametrize("program", ["highway.pl", "overtake_left.pl", "paper.pl"])
def test_the_tables_reach_every_clause_and_branch(program: str) -> None:
    path = RULES / program
    rules = DrivingRules.of([path])
    shield = rules.shield
    clauses = [clause for key in shield.engine.predicates() for clause in shield.engine.clauses(*key)]
    own = sum(Path(clause.source or "") == path for clause in clauses)
    reached, _ = measure(rules, table_cases(path))
    assert [str(point) for point in reached.missed] == []
    assert sum(point.is_clause for point in reached.reached) == own > 0
    assert not all(point.is_clause for point in reached.reached)


def test_what_a_file_is_on_top_of_counts_only_where_it_is_named() -> None:
    base, top = RULES / "highway.pl", RULES / "overtake_left.pl"
    cases = table_cases(top)[:1]

    def files(*named: Path) -> set[str]:
        reached, _ = measure(DrivingRules(Shield.from_files([top]), named), cases)
        return {Path(point.file).name for point in (*reached.reached, *reached.missed)}

    included = {"longitudinal.pl", "observation.pl"}
    assert files(top) == {"overtake_left.pl"}
    assert files(base) == {"highway.pl", *included}
    assert files(top, base) == files() == {"overtake_left.pl", "highway.pl", *included}


REST = """
safe_actions(lane_keeping).
front_is_free.
longitudinal_velocity(10.0).
state([]).
entry_is_safe.
"""

PROGRAM = """
p(X) :- X > 0, ( X > 5 -> q(big) ; q(small) ).
p(X) :- ( X =:= 1 ; X =:= 2 ).
q(big).
q(small).
r(X) :- \\+ p(X).
s(L) :- findall(X, ( member(X, [1, 2]), \\+ X > 1 ), L).
t :- forall(member(X, [1]), ( X > 0 -> true ; fail )).
u(X) :- ( X > 0 -> true ).
v :- !, fail.
v.
"""


def missed(tmp_path: Path, *goals: str) -> set[str]:
    path = tmp_path / "rules.pl"
    path.write_text(PROGRAM + REST)
    checks = tuple(Holds(goal, Question(goal, "holds"), True) for goal in goals)
    reached, _ = measure(DrivingRules(Shield.from_files([path])), [Case("t:1", "t", SCENE, checks)])
    assert {point.file for point in (*reached.reached, *reached.missed)} == {str(path)}
    rest = [point for point in reached.missed if point.line <= PROGRAM.count("\n")]
    return {f"{point.line}:{point.column} {point.what}" for point in rest}


ALL = {
    "2:1 answers", "2:27 then", "2:36 else", "3:1 answers", "3:11 alternative", "3:21 alternative",
    "4:1 answers", "5:1 answers", "6:1 answers", "6:12 negation holds", "6:12 negation fails",
    "7:1 answers", "7:44 negation holds", "7:44 negation fails",
    "8:1 answers", "8:40 then", "8:47 else", "9:1 answers", "9:20 then", "10:1 answers", "11:1 answers",
}  # fmt: skip


@pytest.mark.parametrize(
    ("goals", "reached"),
    [
        ((), set()),
        (("q(big)",), {"4:1 answers"}),
        (("p(6)",), {"2:1 answers", "2:27 then", "4:1 answers"}),
        (("p(3)",), {"2:1 answers", "2:36 else", "5:1 answers"}),
        (("p(0)",), set()),
        (
            ("p(X) = p(1), p(X), X > 9",),
            {"2:1 answers", "2:36 else", "5:1 answers", "3:1 answers", "3:11 alternative"},
        ),
        (("r(0)",), {"6:1 answers", "6:12 negation holds"}),
        (("r(6)",), {"2:1 answers", "2:27 then", "4:1 answers", "6:12 negation fails"}),
        (("s(L)",), {"7:1 answers", "7:44 negation holds", "7:44 negation fails"}),
        (("t",), {"8:1 answers", "8:40 then"}),
        (("u(0)",), set()),
        (("u(1)",), {"9:1 answers", "9:20 then"}),
        (("v",), set()),
    ],
)
def test_what_goals_reach(tmp_path: Path, goals: tuple[str, ...], reached: set[str]) -> None:
    assert missed(tmp_path, *goals) == ALL - reached


def test_the_clauses_that_each_check_tries(tmp_path: Path) -> None:
    path = tmp_path / "rules.pl"
    path.write_text(PROGRAM + REST)
    checks = tuple(Solves(goal, Question(goal, "all"), (), 0.0) for goal in ("q(big)", "p(0)"))
    _, traces = measure(DrivingRules(Shield.from_files([path])), [Case("t:1", "t", SCENE, checks)])
    assert traces == {(0, 0): {("q/1", 1)}, (0, 1): {("p/1", 1), ("p/1", 2)}}


INSTRUMENTED = {name: Shield.from_files([RULES / name]) for name in ("highway.pl", "paper.pl")}
for shield in INSTRUMENTED.values():
    Instrumented(shield.engine)
PLAIN = {name: Shield.from_files([RULES / name]) for name in INSTRUMENTED}


@pytest.mark.parametrize("program", INSTRUMENTED)
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_an_instrumented_program_answers_as_before(program: str, scene: Scene) -> None:
    assert INSTRUMENTED[program].decide(scene) == PLAIN[program].decide(scene)
    for goal in (
        "objection(A, R)",
        "busy_section(S, C, G)",
        "acceleration_x(A)",
        "lane(C, L), front_is_free",
    ):
        found = [[dict(row) for row in each[program].engine.query(goal)] for each in (INSTRUMENTED, PLAIN)]
        assert found[0] == found[1]
