"""Tests of explanations: they agree with the solver, name clauses and lines, and stay within bounds."""

from __future__ import annotations

import io
import json
from textwrap import dedent

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.logic import Engine, ExistenceError, LimitExceeded, Limits
from drlsl.logic.explain import Explanation
from drlsl.logic.explain.explanation import Step
from drlsl.logic.explain.proof import MAX_REASONS

_RULES = """\
left_is_safe :- left_is_valid, \\+ left_is_busy.
left_is_valid :- lane(ego, L), Left is L + 1, lanes(N), Left =< N.
left_is_busy :- vehicle(V, _, _), too_near(V).
too_near(V) :-
    vehicle(V, Gap, Speed),
    critical_distance(Speed, D),
    Gap < D.
critical_distance(Speed, D) :- ( Speed > 20 -> D is Speed / 2.0 ; Speed > 0 -> D is 9.8 ; D = 0 ).
lane(ego, 1).
lanes(2).
action(left) :- left_is_safe.
action(keep) :- forall(vehicle(V, _, _), \\+ too_near(V)).
action(brake).
"""


def _engine(near: float = 4.2) -> Engine:
    engine = Engine(output=io.StringIO())
    engine.consult_text(_RULES, "rules.pl")
    engine.replace_facts("vehicle", 3, [("v23", near, 19.7), ("v7", 50.123456789, 31.3)])
    return engine


def _text(goal: str, engine: Engine | None = None) -> str:
    return (engine or _engine()).explain(goal).text()


def _all_steps(explanation: Explanation) -> list[Step]:
    found = list(explanation.steps)
    for step in found:
        found.extend(step.children)
    return found


def test_a_failing_comparison_is_shown_with_its_values_and_line() -> None:
    assert _text("too_near(v7)") == dedent(
        """\
        too_near(v7) fails
          - too_near(v7)
            rules.pl:4: too_near(V)
              - 50.1235<15.65  (Gap<D)  [rules.pl:7] with V = v7, Gap = 50.1235, Speed = 31.3, D = 15.65"""
    )


def test_a_negation_fails_because_of_a_proof() -> None:
    assert _text("left_is_safe") == dedent(
        """\
        left_is_safe fails
          - left_is_safe
            rules.pl:1: left_is_safe
              - \\+left_is_busy  [rules.pl:1]
                + left_is_busy  [rules.pl:3]
                  + vehicle(v23,4.2,19.7)  [rules.pl:3]
                  + too_near(v23)  [rules.pl:4]
                    + vehicle(v23,4.2,19.7)  [rules.pl:5]
                    + critical_distance(19.7,9.8)  [rules.pl:8]
                      - if 19.7>20  [rules.pl:8] with Speed = 19.7
                      + if 19.7>0  [rules.pl:8]
                      + 9.8 is 9.8  [rules.pl:8]
                    + 4.2<9.8  [rules.pl:7]"""
    )


def test_a_negation_holds_because_of_the_failures() -> None:
    text = _text("left_is_safe", _engine(near=40.0))
    assert text.startswith("left_is_safe holds\n  + left_is_safe  [rules.pl:1]\n")
    assert "      - left_is_busy  [rules.pl:1]" in text
    assert "40.0<9.8  (Gap<D)  [rules.pl:7] with V = v23" in text
    assert "with V = v7, Gap = 50.1235" in text


def test_forall_fails_by_a_case() -> None:
    text = _text("action(keep)")
    assert "- forall(vehicle(V,_" in text
    assert (
        "+ vehicle(v23,4.2,19.7)  [rules.pl:12]\n        - \\+too_near(v23)  [rules.pl:12] with V = v23"
        in text
    )


def test_variables_without_a_name_are_blank() -> None:
    engine = Engine()
    engine.consult_text("busy :- \\+ car(_, left).\ncar(v1, left).\n", "busy.pl")
    text = engine.explain("busy").text()
    assert "- \\+car(_,left)  [busy.pl:1]\n        + car(v1,left)  [busy.pl:2]" in text


def test_the_first_solution_is_the_one_explained() -> None:
    explanation = _engine().explain("action(A)")
    assert explanation.holds
    assert explanation.bindings == {"A": "brake"}
    assert [str(step.clause) for step in explanation.steps] == ["rules.pl:13"]


def test_json_has_the_same_and_exact_numbers() -> None:
    explanation = _engine().explain("too_near(v7)")
    found = json.loads(explanation.to_json())
    assert found == explanation.to_dict()
    (clause,) = found["steps"][0]["children"]
    assert clause["clause"] == "rules.pl:4"
    (reason,) = clause["children"]
    assert reason["place"] == "rules.pl:7"
    assert reason["bindings"]["Gap"] == 50.123456789


def test_what_matches_no_clause_or_fact() -> None:
    assert _text("action(fly)").endswith("- action(fly): none of 3 clauses matches")
    assert _text("vehicle(v9, G, S)").endswith("- vehicle(v9,G,S): none of 2 clauses matches")


def test_an_explanation_leaves_no_bindings_and_no_output() -> None:
    engine = _engine()
    assert engine.explain("vehicle(V, G, S), G > 10").bindings["V"] == "v7"
    assert engine.explain("vehicle(V, G, S), G > 10").bindings["V"] == "v7"


def test_errors_are_the_goals_own() -> None:
    with pytest.raises(ExistenceError, match="nothing/0"):
        _engine().explain("action(A), nothing")


def test_reasons_are_bounded() -> None:
    engine = Engine()
    engine.consult_text("far(V) :- gap(V, G), G > 100.\n", "far.pl")
    engine.replace_facts("gap", 2, [(f"v{number}", number) for number in range(50)])
    explanation = engine.explain("far(V)")
    (clause,) = explanation.steps[0].children
    assert len(clause.children) == MAX_REASONS + 1
    assert "and 44 more" in explanation.text()


def test_depth_is_bounded_and_the_rest_is_asked_of_the_solver() -> None:
    engine = Engine()
    engine.consult_text("down(0).\ndown(N) :- N > 0, M is N - 1, down(M).\n", "down.pl")
    explanation = engine.explain("down(5000)", max_depth=10)
    assert explanation.holds
    steps = _all_steps(explanation)
    assert max(step.goal for step in steps if step.kind == "goal") == "down(4990)"
    assert sum(step.kind == "rule" for step in steps) == 10


def test_lines_are_bounded() -> None:
    engine = Engine()
    engine.consult_text(
        "all :- forall(member(X, [1, 2]), ok(X)), " + ", ".join(["ok(1)"] * 50) + ".\nok(_).\n"
    )
    assert len(engine.explain("all").text(max_lines=12).splitlines()) == 13


def test_an_endless_search_is_stopped() -> None:
    engine = Engine()
    engine.consult_text("loop :- between(1, inf, X), step(X), X < 0.\nstep(_).\n")
    with pytest.raises(LimitExceeded):
        engine.explain("loop")
    engine.consult_text("spin :- spin.\n", "spin")
    with pytest.raises(LimitExceeded):
        engine.explain("spin", limits=Limits(inferences=10_000))


# Agreement with the solver, over programs without recursion.

_LEVELS = 4


def _goals(level: int) -> st.SearchStrategy[str]:
    simple = st.sampled_from(
        ["true", "fail", "!", "X = 1", "X = 2", "X > 1", "member(X, [1, 2, 3])", "fact(X)", "Y = X"]
    )
    if level < _LEVELS:
        simple |= st.sampled_from(
            [f"p{number}({argument})" for number in range(level + 1, _LEVELS + 1) for argument in "XY12"]
        )
    forms = [
        "({}, {})",
        "({} ; {})",
        "({} -> {} ; fail)",
        "({} *-> {} ; true)",
        "(\\+ {}, {})",
        "forall({}, {})",
    ]

    def combine(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        two = st.builds(lambda form, a, b: form.format(a, b), st.sampled_from(forms), inner, inner)
        three = st.builds("({} -> {} ; {})".format, inner, inner, inner)
        return two | three | st.builds("once({})".format, inner) | st.builds("call(({}))".format, inner)

    return st.recursive(simple, combine, max_leaves=6)


@st.composite
def _programs(draw: st.DrawFn) -> str:
    clauses = ["fact(2).", "fact(3)."]
    for level in range(_LEVELS + 1):
        bodies = draw(st.lists(st.lists(_goals(level), min_size=1, max_size=3), min_size=1, max_size=3))
        heads = ["X", "1", "2"]
        clauses += [
            f"p{level}({draw(st.sampled_from(heads))}) :- X = X, Y = Y, {', '.join(body)}." for body in bodies
        ]
    return "\n".join(clauses)


@settings(max_examples=80, deadline=None)
@given(_programs())
def test_explanations_agree_with_the_solver(program: str) -> None:
    engine = Engine()
    engine.consult_text(program)
    goal = "catch(p0(X), E, true)"
    solution = engine.once(goal)
    if solution is not None and str(solution["E"]) != "E":
        return
    explanation = engine.explain("p0(X)")
    assert explanation.holds is (solution is not None), explanation
    if solution is not None and isinstance(solution["X"], int):
        assert explanation.bindings == {"X": solution["X"]}
    assert json.loads(explanation.to_json())["holds"] is explanation.holds
    assert explanation.holds or explanation.steps
