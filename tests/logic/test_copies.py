"""Engines copied and pickled: all that answers depend on goes along, and nothing is shared."""

from __future__ import annotations

import copy
import io
import pickle
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drlsl.logic import Engine, LimitExceeded, Limits, PrologError
from drlsl.logic.engine import EngineBusyError
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import NotLowerable

WAYS: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),  # noqa: S301  (made here)
}
RULES = Path(__file__).parents[2] / "rules"


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest) -> Callable[[Any], Any]:
    return WAYS[request.param]


def answers(engine: Engine, goal: str) -> list[str]:
    """The solutions as text, in which variables are named by their order."""
    told = []
    for solution in engine.query(goal):
        names: dict[str, str] = {}
        text = str(dict(solution))
        told.append(re.sub(r"_G\d+", lambda name: names.setdefault(name[0], f"_{len(names)}"), text))  # noqa: B023
    return told


def test_clauses_operators_flags_facts_and_globals_go_along(way: Callable[[Any], Any]) -> None:
    engine = Engine(flags={"unknown": "fail"}, compiled=False)
    engine.consult_text(
        ":- op(700, xfx, ===>). :- dynamic(seen/2). :- set_prolog_flag(double_quotes, atom). "
        'p(X) :- q(X), \\+ X = 2. q(1). q(2). q(f(_, [a|T], T, 1.5)). r((a ===> b), "text"). seen(1, 2). '
        "member(mine, _)."
    )
    engine.replace_facts("fact", 3, [("a", 1, 2.5), ("b", 2, -0.0)])
    engine.holds("nb_setval(key, g(X, Y, X)), assertz(seen(3, 4)), retract(seen(1, 2))")
    goals = ["p(X)", "q(X)", "r(X, Y)", "seen(X, Y)", "fact(X, Y, Z)", "nb_getval(key, X)", "member(X, [1])"]
    goals += [
        "undefined(X)",
        "current_op(P, T, ===>)",
        "clause(seen(X, Y), B)",
        "predicate_property(seen(_, _), P)",
    ]
    expected = [answers(engine, goal) for goal in goals]
    twin = way(engine)
    assert [answers(twin, goal) for goal in goals] == expected
    assert twin.compiled is False
    assert twin.format(twin.once("r(X, _)")["X"]) == "a===>b"
    twin.consult_text("p(9). seen(5, 6).")
    twin.holds("nb_setval(key, 1), assertz(seen(7, 8)), op(0, xfx, ===>), set_prolog_flag(unknown, error)")
    twin.replace_facts("fact", 3, [])
    assert [answers(engine, goal) for goal in goals] == expected
    engine.holds("retractall(seen(_, _))")
    assert [solution["X"] for solution in twin.query("seen(X, _)")] == [3, 5, 7]


def test_errors_and_proofs_name_the_same_places(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    engine.consult_text(
        "p(X) :-\n  q(X),\n  ( X > 1 -> true ; Y is a + X, r(Y) ).\nq(1). q(2).\n"
        "s(X) :-\n  q(X),\n  ( X > 1 -> X > 5\n  ; \\+ X = 1 ).",
        "my.pl",
    )

    def told(one: Engine) -> tuple[str, str]:
        with pytest.raises(PrologError) as caught:
            one.holds("p(1)")
        return str(caught.value), str(one.explain("s(X)"))

    assert told(way(engine)) == told(engine)
    assert "my.pl:" in told(way(engine))[0]


def test_terms_may_be_deep_shared_and_cyclic(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    numbers = ", ".join(map(str, range(20_000)))
    engine.consult_text(f"long([{numbers}]). shared(f(X, X, Y), g(Y)).")
    engine.holds("numlist(1, 50000, L), nb_setval(list, L), X = f(X), b_setval(loop, X), nb_setval(atom, [])")
    engine.globals["shared"] = engine.globals["list"]
    twin = way(engine)
    assert twin.once("long(L), length(L, N), last(L, X), nb_getval(list, M), length(M, K)") is not None
    assert dict(twin.once("long(_L), length(_L, N), last(_L, X)")) == {"N": 20_000, "X": 19_999}
    assert dict(twin.once("nb_getval(list, _M), length(_M, K), sum_list(_M, S)")) == {
        "K": 50_000,
        "S": 1_250_025_000,
    }
    assert twin.globals["shared"] is twin.globals["list"]
    assert twin.holds("shared(f(1, A, B), g(C)), A == 1, B == C")


def test_random_numbers_go_on_alike(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    engine.holds("set_random(seed(7)), random_between(1, 10, _)")
    twin = way(engine)
    goal = "findall(X, (between(1, 20, _), random_between(1, 1000000, X)), L)"
    assert answers(engine, goal) == answers(twin, goal)


def test_a_query_under_way_stays_with_its_engine(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    engine.consult_text(":- dynamic(p/1). p(1). p(2). p(3).")
    solutions = engine.query("p(X), b_setval(now, X)")
    assert next(solutions)["X"] == 1
    twin = way(engine)
    twin.holds("assertz(p(4))")
    assert [solution["X"] for solution in solutions] == [2, 3]
    assert answers(twin, "b_getval(now, X)") == ["{'X': 1}"]
    assert twin.holds("p(4)")
    assert not engine.holds("p(4)")


def test_a_prepared_query_asks_the_copy_of_its_engine(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    engine.consult_text("p(1, a). p(2, b).")
    pair = (engine, engine.prepare("p(X, Y), Z = f(X, _W)"))
    same_engine, query = copy.deepcopy(pair) if way is copy.copy else way(pair)
    same_engine.consult_text("p(3, c).")
    assert [solution["X"] for solution in query.solutions()] == [3]
    assert query.once(Limits(inferences=1_000)) is not None
    assert len(answers(engine, "p(X, Y), Z = f(X, _W)")) == 2


def test_a_copy_of_rules_is_compiled_anew_and_answers_alike(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    engine.consult(RULES / "highway.pl", [RULES])
    engine.consult_text("nrev([], []). nrev([H|T], R) :- nrev(T, S), append(S, [H], R).")
    goal = "numlist(1, 60, L), nrev(L, R), nth0(0, R, X)"
    for _ in range(30):
        engine.holds(goal)
    twin = way(engine)
    for _ in range(30):
        assert answers(twin, goal) == answers(engine, goal)
    assert {key for key, one in twin.program.predicates.items() if one.defined} == {
        key for key, one in engine.program.predicates.items() if one.defined
    }
    assert twin.loaded == engine.loaded
    assert list(map(str, twin.warnings)) == list(map(str, engine.warnings))


def test_what_is_written_goes_to_the_copys_own_text(way: Callable[[Any], Any]) -> None:
    engine = Engine(output=io.StringIO())
    engine.holds("write(before)")
    twin = way(engine)
    twin.holds("format('~t~w~10|~n', [x])")
    engine.holds("write(after)")
    assert engine.output.getvalue() == "beforeafter"  # type: ignore[attr-defined]
    assert twin.output.getvalue() == "before   x\n"


def test_an_engine_that_writes_to_a_file(tmp_path: Path) -> None:
    with (tmp_path / "out").open("w") as file:
        engine = Engine(output=file)
        assert copy.deepcopy(engine).output is file
        with pytest.raises(TypeError, match="cannot pickle"):
            pickle.dumps(engine)


def test_an_engine_at_work_in_another_thread_is_not_copied() -> None:
    engine = Engine()
    found: list[BaseException] = []

    def work() -> None:
        try:
            copy.deepcopy(engine)
        except EngineBusyError as error:
            found.append(error)

    with engine.alone:
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert len(found) == 1


ERRORS = [
    "X is a + 1",
    "apend([1], Y, Z)",
    "findall(X, Y)",
    "atom_length(X, Y)",
    "throw(my(Ball))",
    "atom_to_term('p(', T, B)",
    "number_codes(X, [0'a])",
]


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("goal", ERRORS)
def test_errors_can_be_sent(goal: str, way: Callable[[Any], Any]) -> None:
    engine = Engine()
    with pytest.raises(PrologError) as caught:
        engine.holds(goal)
    assert_sent(caught.value, way)


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("text", ["p(.", "p(. q(. r(1).", "append(1).\n:- append(1)."])
def test_errors_of_texts_can_be_sent(text: str, way: Callable[[Any], Any]) -> None:
    with pytest.raises(PrologError) as caught:
        Engine().consult_text(f"{text} :- foo(X).")
    assert_sent(caught.value, way)


def assert_sent(error: Exception, way: Callable[[Any], Any]) -> None:
    twin = way(error)
    assert type(twin) is type(error)
    assert str(twin) == str(error)
    assert vars(twin).keys() == vars(error).keys()


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_other_errors_can_be_sent(way: Callable[[Any], Any]) -> None:
    for error in (EngineBusyError(), NotLowerable("p/1", None, "it is too deep"), LimitExceeded(Atom("x"))):
        assert_sent(error, way)


def test_tabled_predicates_stay_tabled(way: Callable[[Any], Any]) -> None:
    engine = Engine()
    engine.consult_text(
        ":- table(path/2). :- dynamic(edge/2). edge(a, b). edge(b, c). edge(c, a). "
        "path(X, Y) :- path(X, Z), edge(Z, Y). path(X, Y) :- edge(X, Y)."
    )
    assert engine.holds("path(a, c)")
    twin = way(engine)
    twin.holds("assertz(edge(c, d))")
    assert sorted(str(one["Y"]) for one in twin.query("path(a, Y)")) == ["a", "b", "c", "d"]
    assert sorted(str(one["Y"]) for one in engine.query("path(a, Y)")) == ["a", "b", "c"]
