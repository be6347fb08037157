"""Search: control constructs, cuts, exceptions, limits, and memory that stays bounded."""

from __future__ import annotations

import itertools
import signal
import threading
import tracemalloc

import pytest

from drlsl.logic import Compound, Engine, LimitExceeded, Limits, PrologError
from drlsl.logic.jit import tiering as tiers

PROGRAM = """
a(1). a(2). a(3).
first(X) :- a(X), !.
first(9).
local(X) :- call((a(X), !)).
local(9).
branch(X) :- ( a(Y), Y > 1 -> X = Y ; X = none ).
soft(X) :- ( a(Y), Y > 1 *-> X = Y ; X = none ).
negated(X) :- a(X), \\+ X = 2.
cut_in_condition(X) :- ( ( a(X), ! ; X = never ) -> true ; X = none ).
cut_in_condition(again).
cut_in_branch(X) :- ( true -> a(X), ! ; true ).
cut_in_branch(9).
count(0) :- !.
count(N) :- N > 0, M is N - 1, count(M).
two_clauses(N) :- N =:= 0.
two_clauses(N) :- N > 0, M is N - 1, two_clauses(M).
deep(0, z).
deep(N, s(T)) :- N > 0, M is N - 1, deep(M, T).
loop :- loop.
nested :- nested, a(_).
many(N) :- between(1, N, _).
many(N) :- many(N).
"""


@pytest.fixture(params=["plain", "compiled"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Engine:
    """An engine of each kind with the program above; the compiled one compiles at the first call."""
    monkeypatch.setattr(tiers, "PATIENCE", 0)
    engine = Engine(compiled=request.param == "compiled")
    engine.consult_text(PROGRAM)
    return engine


def values(engine: Engine, goal: str, name: str = "X") -> list[object]:
    return [solution[name] for solution in engine.query(goal)]


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ("a(X)", [1, 2, 3]),
        ("first(X)", [1]),
        ("local(X)", [1, 9]),
        ("branch(X)", [2]),
        ("soft(X)", [2, 3]),
        ("negated(X)", [1, 3]),
        ("cut_in_condition(X)", [1, "again"]),
        ("cut_in_branch(X)", [1]),
        ("a(X), X >= 2, !", [2]),
        ("(X = 1 ; X = 2 ; X = 3)", [1, 2, 3]),
        ("(fail ; X = 2)", [2]),
        ("once(a(X))", [1]),
        ("ignore((a(X), X > 1))", [2]),
        ("forall(a(Y), Y > 0), X = yes", ["yes"]),
        ("\\+ a(9), X = yes", ["yes"]),
        ("G = a(X), G", [1, 2, 3]),
        ("call(a, X)", [1, 2, 3]),
        ("catch(throw(ball(1)), ball(X), true)", [1]),
        ("catch(a(X), _, true)", [1, 2, 3]),
        ("catch((a(X), X > 1, throw(found(X))), found(Y), X = got(Y))", [Compound("got", (2,))]),
        ("catch(catch(throw(inner), outer, X = wrong), inner, X = right)", ["right"]),
        ("catch((member(Y, [1, 2]), true), _, true), Y > 1, X = Y", [2]),
        ("findall(Y, a(Y), X)", [[1, 2, 3]]),
        ("findall(Y, (a(Y), Y > 5), X)", [[]]),
    ],
)
def test_control(engine: Engine, goal: str, expected: list[object]) -> None:
    assert values(engine, goal) == expected


def test_exited_catch_does_not_catch(engine: Engine) -> None:
    with pytest.raises(PrologError, match="late"):
        engine.once("catch(a(X), late, true), throw(late)")


def test_reentered_catch_catches_again(engine: Engine) -> None:
    goal = "catch((a(Y), (Y < 2 -> true ; throw(again))), again, Y = caught), X = Y"
    assert values(engine, goal) == [1, "caught"]


def test_error_passes_a_catch_that_was_exited_with_choices_left(engine: Engine) -> None:
    goal = "catch((catch(a(Y), _, true), throw(oops(Y))), oops(X), true)"
    assert values(engine, goal) == [1]


def test_bindings_are_undone_before_recovery(engine: Engine) -> None:
    assert engine.once("catch((X = 1, throw(oops)), oops, var(X))") is not None


def test_cleanup_runs_once_goal_is_over(engine: Engine) -> None:
    engine.once("nb_setval(log, [])")
    note = "(nb_getval(log, L), nb_setval(log, [{}|L]))"
    engine.once(f"setup_call_cleanup(true, true, {note.format('exit')})")
    engine.once(f"(setup_call_cleanup(true, fail, {note.format('fail')}) ; true)")
    engine.once(f"catch(setup_call_cleanup(true, throw(x), {note.format('throw')}), x, true)")
    engine.once(f"setup_call_cleanup(true, a(_), {note.format('cut')}), !")
    assert values(engine, "nb_getval(log, X)") == [["cut", "throw", "fail", "exit"]]


def test_error_says_which_goal_and_where(engine: Engine) -> None:
    engine.consult_text("price(X, P) :-\n    P is X * rate.\n", name="shop.pl")
    with pytest.raises(PrologError) as raised:
        engine.once("price(3, P)")
    assert raised.value.clause == "shop.pl:1"
    assert "is 3*rate" in str(raised.value)


@pytest.mark.parametrize(
    ("goal", "limits", "resource"),
    [
        ("loop", Limits(inferences=10_000), "inferences"),
        ("loop", Limits(seconds=0.05), "seconds"),
        ("catch(loop, _, true)", Limits(inferences=10_000), "inferences"),
        ("repeat, fail", Limits(inferences=10_000), "inferences"),
        ("nested", Limits(depth=2_000), "depth"),
        ("many(100000), fail", Limits(seconds=0.05), "seconds"),
        ("length(L, N), N < 0", Limits(inferences=500), "inferences"),
        ("findall(X, repeat, L)", Limits(inferences=10_000), "inferences"),
    ],
)
def test_limits(engine: Engine, goal: str, limits: Limits, resource: str) -> None:
    with pytest.raises(LimitExceeded, match=resource):
        engine.once(goal, limits=limits)
    assert engine.holds("a(1)"), "the engine stays usable"


def test_default_limits_let_long_searches_run(engine: Engine) -> None:
    assert engine.holds("count(100000)")


def test_query_can_be_abandoned(engine: Engine) -> None:
    query = engine.query("repeat")
    assert len(list(itertools.islice(query, 5))) == 5
    query.close()
    assert values(engine, "a(X)") == [1, 2, 3]


def test_queries_interleave(engine: Engine) -> None:
    pairs = zip(engine.query("a(X)"), engine.query("a(Y), Y > 1"), strict=False)
    assert [(left["X"], right["Y"]) for left, right in pairs] == [(1, 2), (2, 3)]


@pytest.mark.parametrize("goal", ["count({})", "two_clauses({})", "catch(count({}), _, true)"])
def test_a_loop_needs_no_memory(engine: Engine, goal: str) -> None:
    engine.holds(goal.format(5_000))
    tracemalloc.start()
    try:
        assert engine.holds(goal.format(60_000))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 4_000_000


def test_queries_leave_nothing_behind(engine: Engine) -> None:
    query = engine.prepare("first(X), negated(Y)")
    for _ in range(300):
        query.once()
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(3_000):
            query.once()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 100_000


def test_deep_terms_and_long_lists_need_no_python_stack(engine: Engine) -> None:
    size = 20_000
    assert engine.holds(f"deep({size}, T), copy_term(T, U), T = U, T == U, ground(T), assertz(kept(T))")
    assert engine.holds("kept(T), kept(U), T = U")
    assert engine.holds(
        f"numlist(1, {size}, L), append(L, [end], M), last(M, end), msort(M, S), length(S, {size + 1}),"
        " copy_term(M, C), C = M, findall(L, true, [L])"
    )


def test_engines_run_in_threads_of_their_own() -> None:
    results: dict[int, object] = {}

    def work(number: int) -> None:
        engine = Engine()
        engine.consult_text(f"n({number}). " + PROGRAM)
        engine.holds("count(3000)")
        results[number] = values(engine, "n(X)")

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == {number: [number] for number in range(4)}


def test_interrupt_leaves_the_engine_usable(engine: Engine) -> None:
    def interrupt(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(KeyboardInterrupt):
            engine.holds("catch(loop, _, true)")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert values(engine, "a(X)") == [1, 2, 3]


def test_deep_heads_bind_their_variables() -> None:
    """Heads too deep to be walked by recursion: lists of more items than that, and terms nested so."""
    items = ", ".join(f"X{number}" for number in range(90))
    nested = "s(" * 90 + "X" + ")" * 90
    engine = Engine(compiled=False)
    engine.consult_text(f"all([{items}], X0, X89).\ninner({nested}, X).\nouter(p(X, {nested}), X).\n")
    values = ", ".join(str(number) for number in range(90))
    assert [dict(s) for s in engine.query(f"all([{values}], F, L)")] == [{"F": 0, "L": 89}]
    assert engine.holds("all(Xs, f, l), length(Xs, 90), nth0(0, Xs, f), nth0(89, Xs, l)")
    assert engine.holds(f"inner({nested.replace('X', 'v')}, V), V == v")
    assert engine.holds(f"inner(T, v), T == {nested.replace('X', 'v')}")
    assert engine.holds(f"outer(p(V, T), v), V == v, T == {nested.replace('X', 'v')}")
    assert not engine.holds(f"outer(p(w, {nested.replace('X', 'v')}), _)")
