"""Engines share nothing, in one thread or in many, and leave nothing behind."""

from __future__ import annotations

import gc
import threading
from itertools import zip_longest

import pytest

from drlsl.logic import Engine, LimitExceeded, Limits, PrologError

PROGRAM = """
nrev([], []).
nrev([H|T], R) :- nrev(T, S), append(S, [H], R).
queens(N, Qs) :- numlist(1, N, Ns), permutation(Ns, Qs), safe(Qs).
safe([]).
safe([Q|Qs]) :- free(Q, Qs, 1), safe(Qs).
free(_, [], _).
free(Q, [P|Ps], D) :- Q =\\= P + D, Q =\\= P - D, E is D + 1, free(Q, Ps, E).
"""


def test_clauses_operators_flags_and_globals_are_an_engines_own() -> None:
    one, other = Engine(), Engine()
    one.consult_text("p(1). :- op(700, xfx, ===>). :- set_prolog_flag(double_quotes, atom). last(_, mine).")
    one.replace_facts("f", 1, [(1,)])
    assert one.holds("nb_setval(key, 1), assertz(q(1)), X = (a ===> b)")
    assert not other.defines("p", 1)
    assert not other.defines("f", 1)
    assert other.holds("current_prolog_flag(double_quotes, codes), last([1, 2], 2)")
    for goal in ("nb_getval(key, _)", "q(1)", "X = (a ===> b)"):
        with pytest.raises(PrologError):
            other.once(goal)


def test_random_numbers_are_an_engines_own() -> None:
    engines = [Engine(), Engine()]
    for engine in engines:
        engine.holds("set_random(seed(7))")
    goal = "random_between(1, 1000000, X)"
    first = [engines[0].once(goal) for _ in range(5)]
    assert [engines[1].once(goal) for _ in range(5)] == first


def test_interleaved_queries_of_two_engines() -> None:
    one, other = Engine(compiled=True), Engine(compiled=False)
    one.consult_text(PROGRAM)
    other.consult_text(PROGRAM + "extra.")
    pairs = list(zip_longest(one.query("queens(6, Qs)"), other.query("queens(6, Qs)")))
    assert len(pairs) == 4
    assert all(left == right for left, right in pairs)


def test_eight_threads_with_an_engine_each() -> None:
    results: dict[int, object] = {}
    start = threading.Barrier(8)

    def work(number: int) -> None:
        engine = Engine()
        start.wait()
        engine.consult_text(PROGRAM + f"mine({number}).")
        solved = engine.once(f"numlist(1, {20 + number}, L), nrev(L, [X|_]), mine(Y)")
        queens = sum(1 for _ in engine.query("queens(5, _Qs)"))
        results[number] = (dict(solved or {}).get("X"), dict(solved or {}).get("Y"), queens)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == {number: (20 + number, number, 10) for number in range(8)}


def check_no_leak(rounds: int) -> None:
    engine = Engine()
    engine.consult_text(PROGRAM)
    query = engine.prepare("nrev([1, 2, 3], [X|_]), catch(throw(a), a, true)")

    def work(times: int) -> None:
        for number in range(times):
            assert query.holds()
            if number % 20 == 0:
                engine.replace_facts("speed", 2, [("ego", float(number)), ("car", 1.0)])
                next(engine.query("member(X, [1, 2]), speed(ego, V)"))
                with pytest.raises(PrologError):
                    engine.once("X is a + 1")
                with pytest.raises(LimitExceeded):
                    engine.once("repeat, fail", limits=Limits(inferences=50))

    work(2_000)
    gc.collect()
    before = len(gc.get_objects())
    work(rounds)
    gc.collect()
    assert len(gc.get_objects()) - before < 200


def test_queries_leave_no_objects_behind() -> None:
    check_no_leak(5_000)


@pytest.mark.slow
def test_a_million_queries_leave_no_objects_behind() -> None:
    check_no_leak(1_000_000)


def test_engines_are_freed() -> None:
    def make() -> None:
        engine = Engine()
        engine.consult_text(PROGRAM)
        engine.holds("nrev([1, 2], _)")

    for _ in range(3):
        make()
    gc.collect()
    before = len(gc.get_objects())
    for _ in range(20):
        make()
    gc.collect()
    assert len(gc.get_objects()) - before < 500
