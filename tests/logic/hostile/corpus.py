"""Goals and files that want all time or all memory: each ends within its limits, with an answer or an error.

A case is a goal with a program, which is empty for most. Families vary the builtin, the shape of the term and
what is around the call; the goals themselves are lines of goals.txt.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

PROGRAM: Final = """
loop :- loop.
count(N) :- M is N + 1, count(M).
grow(L) :- grow([x|L]).
deeper(N) :- M is N + 1, deeper(M), true(M).
true(_).
double(0, T, T) :- !.
double(N, T, R) :- M is N - 1, double(M, f(T, T), R).
shared(T) :- double(30, a, T).
open(T) :- double(30, _, T).
nest(0, _, G, G) :- !.
nest(N, K, G, R) :- M is N - 1, F =.. [K, G], nest(M, K, F, R).
twice(0, A, A) :- !.
twice(N, A, R) :- M is N - 1, atom_concat(A, A, B), twice(M, B, R).
strings(0, S, S) :- !.
strings(N, S, R) :- M is N - 1, string_concat(S, S, T), strings(M, T, R).
doubled(0, T, T) :- !.
doubled(N, T, R) :- M is N - 1, doubled(M, T + T, R).
power(0, X, X) :- !.
power(N, X, R) :- M is N - 1, Y is X * X, power(M, Y, R).
adds(0, _) :- !.
adds(N, X) :- Y is X + 1, M is N - 1, adds(M, Y).
codes(N, L) :- length(L, N), maplist(=(0'1), L).
text(N, A) :- codes(N, L), atom_codes(A, L).
words --> word, words.
words --> [].
word --> "1" ; "11" ; "111".
endless --> [a], endless.
left --> left, [a].
fact(N) :- assertz(kept(N, N, N)), M is N + 1, fact(M).
queue(N) :- assertz(q(N)), retract(q(_)), M is N + 1, queue(M).
lonely :- atom_length(abc, N), N > 3.
:- dynamic(kept/3).
:- dynamic(q/1).
"""


# The goals about strings are read with this.
STRINGS: Final = ":- set_prolog_flag(double_quotes, string).\n"


@dataclass(frozen=True)
class Case:
    """A hostile goal; `program` is loaded before, and `compiled` says whether hot code is compiled."""

    name: str
    goal: str
    program: str = PROGRAM
    compiled: bool = True


_AROUND: Final = (
    "catch(({}), _, true)",
    "catch(({}), error(_, _), loop)",
    "findall(x, ({}), _), loop",
    "\\+ \\+ ({}), loop",
    "forall(member(_, [1, 2, 3]), ({}))",
    "call_cleanup(fail, ({}))",
    "once(({})), loop",
)


def goals() -> list[Case]:
    """The goals, every fourth also inside another control construct or without compiled code."""
    cases: list[Case] = []
    lines = Path(__file__).with_name("goals.txt").read_text("utf-8").splitlines()
    for number, line in enumerate(lines):
        program = PROGRAM + STRINGS if line.startswith("strings(") else PROGRAM
        cases.append(Case(line, line, program))
        if number % 4 == 0:
            around = _AROUND[number // 4 % len(_AROUND)].format(line)
            cases.append(Case(around, around, program, compiled=number % 8 == 0))
    return cases


Files = dict[str, tuple[str, str]]
"""By its name, the text of a program and the goal that is asked of it."""

_DEEP: Final = 20_000

_DIRECTIVES: Final[Files] = {
    "an endless directive": (":- repeat, fail.", "true"),
    "an endless initialization": (":- initialization((repeat, fail)).", "true"),
    "an endless cleanup": (":- call_cleanup(fail, (repeat, fail)).", "true"),
    "a directive that catches": (":- catch((repeat, fail), _, true).", "true"),
    "many endless directives": (":- catch((repeat, fail), _, true).\n" * 1000, "true"),
    "a directive that fills memory": (":- findall(X, repeat, _).", "true"),
    "a directive that halts": (":- halt.", "true"),
    "a goal that halts": ("p :- halt(3).", "p"),
    "a directive that prints millions of digits": (":- X is 7 ^ 4000000, write(X).", "true"),
}
"""Directives and goals that do not end, fill memory or halt."""

_TEXTS: Final[Files] = {
    "an integer of millions of digits": ("p(" + "1" * 6_000_000 + ").", "true"),
    "many long integers": (("p(" + "7" * 200_000 + ").\n") * 20, "true"),
    "a hexadecimal integer of millions of digits": ("p(0x" + "f" * 3_000_000 + ").", "true"),
    "a float of a million digits": ("p(1." + "5" * 1_000_000 + ").", "true"),
    "a float beyond all": ("p(1.0e" + "9" * 1_000 + ").", "true"),
    "megabytes of operators": ("".join(f":- op(700, xfx, o{n}).\n" for n in range(100_000)), "true"),
    "an operand of prefix operators": ("p(" + "- " * 300_000 + "a).", "true"),
    "brackets never closed": ("p(" * 300_000, "true"),
    "lists never closed": ("p([" * 300_000 + ".", "true"),
    "a list of half a million": ("p([" + "a," * 500_000 + "a]).", "p(X), length(X, N), N > 0"),
    "a deep term": ("p(" + "f(" * 200_000 + "X" + ")" * 200_000 + ", X).", "p(T, a), ground(T)"),
    "a term of many variables": ("p(" + ",".join(f"X{n}" for n in range(100_000)) + ").", "true"),
    "a clause of many goals": ("p :- " + "q, " * 100_000 + "true. q.", "p"),
    "hot code of many goals": ("p :- " + "q(X), " * 3_000 + "true. q(_).", "repeat, p, fail"),
    "many clauses": ("".join(f"p({n}, {n % 7}).\n" for n in range(60_000)), "p(X, 3), X > 59990"),
    "many predicates": ("".join(f"p{n} :- p{n + 1}.\n" for n in range(30_000)), "p0"),
    "many errors": ("p( .\n" * 30_000, "true"),
    "many singletons": ("".join(f"p(X{n}) :- q(Y{n}).\n" for n in range(20_000)), "true"),
    "an atom of megabytes": ("p('" + "a" * 20_000_000 + "').", "p(X), atom_length(X, N), N > 0"),
    "a string of megabytes": ('p("' + "a" * 1_000_000 + '").', "p(X), length(X, N), N > 0"),
    "a comment of megabytes": ("/*" + "a" * 20_000_000 + "*/ p.", "true"),
    "a comment never closed": ("/*" + "a" * 5_000_000, "true"),
    "a quote never closed": ("'" + "a" * 5_000_000, "true"),
    "one line of nonsense": ("@ # $ " * 300_000, "true"),
    "full stops": (". " * 200_000, "true"),
}
"""Texts that are long, or have long parts."""

_NESTED: Final[Files] = {
    "negations": ("p :- " + "\\+ " * _DEEP + "fail.", "p"),
    "conditions on the left": ("p :- " + "(" * _DEEP + "true" + " -> true)" * _DEEP + ".", "p"),
    "conditions on the right": ("p :- " + "(true -> " * _DEEP + "true" + ")" * _DEEP + ".", "p"),
    "alternatives": ("p :- " + "(fail ; " * _DEEP + "true" + ")" * _DEEP + ".", "p, p, p"),
    "conjunctions": ("p :- " + "(" * _DEEP + "true" + ", true)" * _DEEP + ".", "p"),
    "a grammar": ("p --> " + "(" * _DEEP + "[]" + ", [])" * _DEEP + ".", "phrase(p, [])"),
    "a negated grammar": ("p --> " + "\\+ " * _DEEP + "[a].", "phrase(p, []) ; true"),
    "nested findall": ("p :- " + "findall(x, " * _DEEP + "true" + ", _)" * _DEEP + ".", "p"),
    "nested catch": ("p :- " + "catch(" * _DEEP + "true" + ", _, true)" * _DEEP + ".", "p"),
}
"""Clauses whose bodies are nested deeply."""

_LOOPS: Final[Files] = {
    "left recursion": ("p --> p, [a]. p --> [].", "phrase(p, [b])"),
    "a clause that grows": (":- dynamic(p/1). p(X) :- assertz(p(f(X))), p(X).", "p(a)"),
    "a large term built each time": (
        "p :- q(" + "f(X, " * 100_000 + "a" + ")" * 100_000 + "), p. q(_).",
        "p",
    ),
    "wide terms built each time": (
        "p(N) :- q(f(" + ",".join(f"X{n}" for n in range(5_000)) + ")), M is N + 1, p(M). q(_).",
        "p(0)",
    ),
    "a loop of large numbers": ("p(N, B) :- C is B + 1, M is N + 1, p(M, C).", "X is 1 << 16000000, p(0, X)"),
    "a loop that sorts": ("p(L) :- msort(L, M), p(M).", "numlist(1, 100000, L), p(L)"),
    "a loop that copies": ("p(L) :- copy_term(L, M), p(M).", "length(L, 100000), p(L)"),
    "a loop that measures": ("p(L) :- length(L, N), N > 0, p(L).", "length(L, 300000), p(L)"),
    "a loop that joins": (
        "p(A) :- atom_concat(A, x, B), atom_length(B, N), N > 0, p(B).",
        "length(L, 100000), maplist(=(a), L), atomic_list_concat(L, A), p(A)",
    ),
    "a loop of new atoms": ("p(N) :- atom_number(A, N), atom_length(A, L), L > 0, M is N + 1, p(M).", "p(0)"),
    "a failing loop of new atoms": ("p :- between(1, inf, N), atom_number(A, N), atom_length(A, 0).", "p"),
    "a loop that writes": ("p :- write(abc), p.", "with_output_to(atom(A), p)"),
    "a loop of global variables": ("p(N) :- nb_setval(k, f(N, N)), M is N + 1, p(M).", "p(0)"),
    "a loop of new global variables": (
        "p(N) :- atom_number(A, N), nb_setval(A, N), M is N + 1, p(M).",
        "p(0)",
    ),
    "a loop of cleanups": ("p :- call_cleanup(true, q), p. q :- between(1, 3, _), fail ; true.", "p"),
    "cleanups that pile up": ("p :- call_cleanup(member(_, [1, 2]), q), p. q :- q.", "p"),
    "a cleanup of cleanups": ("p :- call_cleanup(fail, p).", "p"),
    "errors in a loop": ("p :- catch(atom_length(_, _), _, true), p.", "p"),
    "errors in errors": ("p :- catch(throw(a), _, p).", "p"),
    "catches that pile up": ("p :- catch(p, x, true), q. q.", "p"),
    "negations that pile up": ("p :- \\+ p.", "p"),
    "findall in findall": ("p(L) :- findall(X, p(X), L).", "p(L)"),
    "bagof without end": ("p(X) :- q(X). p(X) :- p(Y), X is Y + 1. q(0).", "setof(X, p(X), L)"),
    "a flag that hides errors": (":- set_prolog_flag(unknown, fail). p :- q ; p.", "p"),
    "a conversion of characters": (
        ":- char_conversion(a, b), set_prolog_flag(char_conversion, on).\n" + "p(a).\n" * 20_000,
        "true",
    ),
}
"""Predicates that go on for ever, each in another way."""


def files() -> list[Case]:
    """Programs whose loading is hostile, or what they do then."""
    groups = (_DIRECTIVES, _TEXTS, _NESTED, _LOOPS)
    return [Case(f"file: {name}", goal, text) for group in groups for name, (text, goal) in group.items()]


CASES: Final = [*goals(), *files()]
