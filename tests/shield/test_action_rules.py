"""Rules asked about facts on every tier: the interpreter's answer is the right one."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

import drlsl.shield.action_rules
from drlsl.errors import UserError
from drlsl.logic import Limits
from drlsl.lowering import Relation, Rows, Schema
from drlsl.shield import ActionRules, Facts, Offer
from drlsl.shield.tiers import array_compiler
from tests.lowering import programs
from tests.lowering.plain import compile_plain
from tests.lowering.tiers import to_rows

ACTIONS = ("keep", "left", "right")
LIMITS = Limits(inferences=20_000, depth=5_000)


@st.composite
def rule_texts(draw: st.DrawFn) -> str:
    """A program that offers actions by any goals, with an objection or two."""
    text, known = draw(programs.programs())
    del known
    lines = [":- dynamic car/4, slot/3, seen/2, limit/1, steps/1.", text]
    for _ in range(draw(st.integers(1, 4))):
        action = draw(st.sampled_from(ACTIONS))
        lines.append(f"offered({action}) :- {draw(programs.bodies(programs.Scope(), [], 2, most=3))}.")
    if draw(st.booleans()):
        lines.append("offered(Action) :- member(Action, [right, keep]), limit(L), L > 0.0.")
    lines.append(f"objection(left, told) :- {draw(programs.bodies(programs.Scope(), [], 1, most=2))}.")
    return "\n".join(lines)


@pytest.fixture(scope="module", autouse=True)
def _uncompiled() -> Any:
    """Have the text that Numba compiles run by Python: one program takes seconds to compile."""
    with pytest.MonkeyPatch.context() as patch:

        def compiler(name: str) -> Callable[[Any], Any]:
            return compile_plain if name == "numba" else array_compiler(name)

        patch.setattr(drlsl.shield.action_rules, "array_compiler", compiler)
        yield


def known(offer: Offer) -> Any:
    return offer.actions, offer.failure


def in_arrays(rules: ActionRules, scenes: Sequence[Any]) -> dict[tuple[str, int], Rows]:
    class Codes:
        code = staticmethod(rules.code)

    codes: Any = Codes
    return to_rows(codes, programs.SCHEMA, scenes)


def check(text: str, scenes: Sequence[Any], *, inferred: bool) -> None:
    schema = None if inferred else programs.SCHEMA
    reference = ActionRules(text, ACTIONS, fallback="keep", tier="interpreter", schema=schema, limits=LIMITS)
    expected = [reference.offer(facts) for facts in scenes]
    reasons = [reference.objections(facts, "left") for facts in scenes]
    for tier in ("scalar", "numpy", "numba", "auto"):
        try:
            rules = ActionRules(text, ACTIONS, fallback="keep", tier=tier, schema=schema, limits=LIMITS)
            given = [rules.offer(facts) for facts in scenes]
        except UserError as refusal:
            if tier == "auto" or "cannot run" not in str(refusal):
                raise
            event(f"{tier} refused")
            continue
        assert [known(one) for one in given] == [known(one) for one in expected], tier
        assert [rules.objections(facts, "left") for facts in scenes] == reasons
        forms: list[Any] = [list(scenes)] if inferred else [list(scenes), in_arrays(rules, scenes)]
        for form in forms:
            offers = rules.offers(form)
            for index, offer in enumerate(expected):
                found = tuple(name for name, there in zip(ACTIONS, offers.mask[index], strict=True) if there)
                assert (found, offers.failures.get(index, "")) == known(offer), tier
        event(f"{tier} answered")
        counted = 2 + (not inferred)
        assert rules.counts.decisions == counted * len(scenes)
        assert rules.counts.fail_safes == counted * sum(bool(one.failure) for one in expected)


WALK = """
:- dynamic at/1, free/1.
offered(left) :- at(Place), free(Place).
offered(right) :- at(_).
"""


def test_names_in_arrays_are_texts_or_codes() -> None:
    schema = Schema([Relation("at", ("atom",), single=True), Relation("free", ("atom",))])
    places, free = np.array(["a", "b", "new"]), np.array([["a", "c"]])
    expected = [[False, True, True], [False, False, True], [False, False, True]]
    for tier in ("scalar", "numpy", "numba"):
        rules = ActionRules(WALK, ACTIONS, fallback="keep", tier=tier, schema=schema)
        texts = rules.offers({("at", 1): Rows([places]), ("free", 1): Rows([free])})
        assert texts.mask.tolist() == expected
        coded = [np.vectorize(rules.code)(names) for names in (places, free)]
        codes = rules.offers({("at", 1): Rows([coded[0]]), ("free", 1): Rows([coded[1]])})
        assert codes.mask.tolist() == expected
    with pytest.raises(UserError, match="need a `schema`"):
        ActionRules(WALK, ACTIONS, fallback="keep").code("a")


def test_a_state_with_two_rows_of_a_single_relation_is_left_to_the_interpreter() -> None:
    schema = Schema([Relation("at", ("atom",), single=True), Relation("free", ("atom",))])
    scenes = [{("at", 1): [(each,) for each in at], ("free", 1): [("a",)]} for at in ("a", "ba", "", "b")]
    for tier in ("interpreter", "scalar", "numpy", "numba"):
        rules = ActionRules(WALK, ACTIONS, fallback="keep", tier=tier, schema=schema)
        offers = rules.offers(scenes)
        assert offers.mask.astype(int).tolist() == [[0, 1, 1], [0, 1, 1], [1, 0, 0], [0, 0, 1]]
        assert offers.failures == {2: "the rules offer no action"}
        assert rules.counts.interpreted == (0 if tier == "interpreter" else 2)


def test_facts_that_no_state_differs_in_are_of_all() -> None:
    rules = ActionRules(WALK, ACTIONS, fallback="keep", tier="numpy")
    shared = {("at", 1): Rows([np.array([["a"]])]), ("free", 1): Rows([np.array([["a"]] * 4)])}
    assert rules.offers(shared).mask.tolist() == [[False, True, True]] * 4
    alone = ActionRules(WALK.replace(", free(Place)", ""), ACTIONS, fallback="keep", tier="numpy")
    assert alone.offers(shared).mask.tolist() == [[False, True, True]] * 4


def test_no_states_have_no_offers() -> None:
    for tier in ("interpreter", "scalar", "numpy"):
        assert ActionRules(WALK, ACTIONS, fallback="keep", tier=tier).offers([]).mask.shape == (0, 3)


def test_threads_that_share_rules_are_told_of_their_own_states() -> None:
    for tier in ("interpreter", "scalar"):
        rules = ActionRules(WALK, ACTIONS, fallback="keep", tier=tier)
        wrong: list[str] = []

        def ask(name: str, rules: ActionRules = rules, wrong: list[str] = wrong) -> None:
            for _ in range(200):
                offer = rules.offer({("at", 1): [(name,)], ("free", 1): [("a",)]})
                if ("left" in offer.actions) != (name == "a"):
                    wrong.append(name)

        threads = [threading.Thread(target=ask, args=(name,)) for name in "abab"]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert wrong == []
        assert rules.counts.decisions == 800


def test_facts_that_never_come_are_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    text = ":- dynamic a/1, b/2, c/1.\noffered(keep).\n"
    rules = ActionRules(text, ACTIONS, fallback="keep")
    for _ in range(200):
        rules.offer({("a", 1): [(1,)], ("b", 2): [], ("c", 1): []})
    assert rules.tier == "interpreter"
    (warning,) = [one.getMessage() for one in caplog.records if "no facts" in one.getMessage()]
    assert "in 100 states there were no facts of b/2, c/1, so the kinds" in warning
    caplog.clear()
    rules.offer({("a", 1): [(1,)], ("b", 2): [(0.5, 1)], ("c", 1): [(1,)]})
    assert rules.tier == "scalar"


def test_rules_that_cannot_be_lowered_run_on_the_interpreter(caplog: pytest.LogCaptureFixture) -> None:
    """What is tabled is forgotten with the facts."""
    text = """
    :- dynamic at/1, road/2.
    :- table reach/2.
    reach(From, To) :- road(From, To).
    reach(From, To) :- reach(From, Over), road(Over, To).
    offered(left) :- at(Place), reach(Place, home).
    offered(right) :- at(Place), \\+ reach(Place, home).
    """
    rules = ActionRules(text, ACTIONS, fallback="keep")
    for road, offered in (("ab bh", "left"), ("ab ba", "right"), ("ab ba bh", "left"), ("", "right")):
        rows = [(each[0], {"h": "home"}.get(each[1], each[1])) for each in road.split()]
        for _ in range(2):
            assert rules.offer({("at", 1): [("a",)], ("road", 2): rows}).actions == (offered,)
    assert rules.tier == rules.tier_for_many == "interpreter"
    assert "the rules run on the interpreter, which is slow" in caplog.text


def test_answers_without_constants_have_no_form_as_arrays(caplog: pytest.LogCaptureFixture) -> None:
    text = ":- dynamic choice/1.\noffered(A) :- choice(A)."
    rules = ActionRules(text, ACTIONS, fallback="keep")
    facts = {("choice", 1): [("left",)]}
    assert rules.offers([facts]).mask.tolist() == [[False, True, False]]
    assert (rules.tier, rules.tier_for_many) == ("scalar", "scalar")
    assert "one state at a time" in caplog.text
    with pytest.raises(UserError, match="the action up, which is not among keep, left, right"):
        rules.offer({("choice", 1): [("up",)]})


def test_limits_hold_for_each_decision() -> None:
    text = ":- dynamic n/1.\noffered(left) :- n(N), down(N).\ndown(0). down(N) :- N > 0, M is N - 1, down(M)."
    rules = ActionRules(text, ACTIONS, fallback="keep", limits=Limits(inferences=1_000))
    for _ in range(3):
        assert rules.offer({("n", 1): [(100,)]}).actions == ("left",)
        failed = rules.offer({("n", 1): [(100_000,)]})
        assert failed.actions == ("keep",)
        assert failed.failure == (
            "the rules went beyond the limit of 1,000 inferences for one question; "
            "does a predicate call itself without end?"
        )
    assert rules.counts.fail_safes == 3


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow])
@given(text=rule_texts(), scenes=st.lists(programs.facts(), min_size=1, max_size=4), inferred=st.booleans())
def test_the_tiers_offer_the_same(text: str, scenes: list[Any], inferred: bool) -> None:
    check(text, scenes, inferred=inferred)


@pytest.mark.slow
@settings(deadline=None, max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
@given(text=rule_texts(), scenes=st.lists(programs.facts(), min_size=1, max_size=12), inferred=st.booleans())
def test_the_tiers_offer_the_same_in_many(text: str, scenes: list[Any], inferred: bool) -> None:
    check(text, scenes, inferred=inferred)


COUNTING = """
:- dynamic at/1.
:- dynamic(asked/1).
offered(Action) :- at(X), assertz(asked(X)), ( X < 3 -> member(Action, [keep, left]) ; Action = right ).
objection(Action, nearby(X)) :- at(X), assertz(asked(X)), member(Action, [left, right]).
"""


def remembering(most: Any, text: str = COUNTING) -> ActionRules:
    schema = Schema([Relation("at", ("int",))])
    return ActionRules(
        text, ACTIONS, fallback="keep", tier="interpreter", schema=schema, limits=LIMITS, remember=most
    )


def times_asked(rules: ActionRules) -> int:
    return len(rules._engine.clauses("asked", 1))


def test_what_the_rules_said_of_a_state_is_remembered() -> None:
    rules, forgetful = remembering(2), remembering(0)
    states = [{("at", 1): [(np.int64(place),)]} for place in (1, 5, 1, 1, 5)]
    offers = [rules.offer(each) for each in states]
    assert offers == [forgetful.offer(each) for each in states]
    assert rules.counts.decisions == forgetful.counts.decisions == len(states)
    assert (times_asked(rules), times_asked(forgetful)) == (2, len(states))
    reasons = {action: [rules.objections(each, action) for each in states[:2]] for action in ACTIONS}
    assert reasons == {"keep": [(), ()], "left": [("nearby(1)",), ("nearby(5)",)]} | {
        "right": reasons["left"]
    }
    assert times_asked(rules) == 2 + 2


def test_many_states_are_remembered_as_single_ones_are() -> None:
    rules, forgetful = remembering(5), remembering(0)
    states: list[Facts] = [{("at", 1): [(place,)]} for place in (1, 5, 1, 5, 2)]
    for _ in range(2):
        ours, theirs = rules.offers(states), forgetful.offers(states)
        assert (ours.mask == theirs.mask).all()
        assert ours.failures == theirs.failures == {}
    assert rules.counts.decisions == forgetful.counts.decisions == 10
    assert (times_asked(rules), times_asked(forgetful)) == (3, 10)
    failing = remembering(5, ":- dynamic at/1.\noffered(left) :- at(X), X > 1.")
    offers = failing.offers(states)
    assert offers.mask.tolist() == [[True, False, False], [False, True, False]] * 2 + [[False, True, False]]
    assert dict(offers.failures) == dict.fromkeys((0, 2), "the rules offer no action")
    assert failing.counts.fail_safes == 2


def test_the_oldest_state_is_forgotten_first() -> None:
    rules = remembering(2)
    for place, asked in ((1, 1), (2, 2), (1, 2), (3, 3), (2, 3), (1, 4), (3, 4)):
        rules.offer({("at", 1): [(place,)]})
        assert times_asked(rules) == asked, place


def test_a_failure_is_not_remembered_and_facts_that_fit_no_state_are_refused() -> None:
    rules = remembering(5, ":- dynamic at/1.\noffered(keep) :- at(X), X > a.")
    for times in (1, 2):
        assert rules.offer({("at", 1): [(1,)]}).failure
        assert rules.counts.fail_safes == times
    with pytest.raises(UserError, match="facts do not fit"):
        rules.offer({("at", 1): [([1],)]})


@pytest.mark.parametrize("most", [-1, 1.5, "all", True, None])
def test_how_much_is_remembered_is_checked(most: Any) -> None:
    with pytest.raises(UserError, match=r"remember is .* expected a number of states"):
        remembering(most)
