"""Goals and files that want all time or all memory: each ends within its limits, with an answer or an error.

A case is a goal with a program, which is empty for most. Families vary the builtin, the shape of the term and
what is around the call.
"""

from __future__ import annotations

from dataclasses import dataclass
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


_WHOLE: Final = """
repeat, fail
loop
count(0)
grow([])
deeper(0)
fact(0)
queue(0)
between(1, inf, X), X < 0
length(L, N), N < 0
\\+ \\+ (repeat, fail)
findall(X, repeat, L)
findall(X, between(1, inf, X), L)
findall(f(X, Y), (repeat, length(X, 100)), L)
bagof(X, between(1, inf, X), L)
setof(X, between(1, inf, X), L)
aggregate_all(count, repeat, N)
aggregate_all(bag(X), between(1, inf, X), L)
aggregate_all(max(X), between(1, inf, X), L)
forall(repeat, true)
forall(between(1, inf, X), atom_length(abc, 3))
phrase(endless, L)
phrase(left, [a])
text(60, A), atom_codes(A, L), phrase(words, L), fail
codes(200, L), findall(x, phrase(words, L), Xs)
maplist([X]>>loop, [1, 2])
foldl([X, A, B]>>(B = [A, A]), [1|T], x, R)
call_cleanup(fail, loop)
call_cleanup(true, loop)
call_cleanup(throw(a), loop)
setup_call_cleanup(true, member(X, [1, 2]), loop)
setup_call_cleanup(loop, true, true)
setup_call_cleanup(true, loop, loop)
setup_call_cleanup(true, loop, (between(1, 20, _), loop))
setup_call_cleanup(true, call_cleanup(fail, loop), loop)
call_cleanup(fail, call_cleanup(fail, loop))
call_cleanup(fail, call_cleanup(loop, loop))
call_cleanup(fail, catch(loop, _, loop))
findall(X, (between(1, 1000, X), call_cleanup(fail, count(0))), L)
call_cleanup(member(X, [1, 2, 3]), loop), X > 1, !
catch(call_cleanup(throw(x), loop), x, true)
call_cleanup(length(L, 3000000), findall(X, repeat, _))
X is 7 ^ 7 ^ 7 ^ 7
X is 7 ** 70000000
X is 3 ^ 8000000
X is 2 ** (1 << 40)
X is 1 << (1 << 40)
X is (1 << 16000000) * (1 << 16000000)
X is (3 ^ 3000000) * (7 ^ 2000000)
X is (3 ^ 5000000) // (7 ^ 2000000)
X is (3 ^ 5000000) mod (7 ^ 2000000)
X is (3 ^ 5000000) / (7 ^ 2000000)
X is (3 ^ 5000000) rem (7 ^ 2000000)
X is (3 ^ 5000000) div (7 ^ 2000000)
X is gcd(3 ^ 3000000, 7 ^ 2000000)
X is lcm(3 ^ 3000000, 7 ^ 2000000)
X is powm(3, 1 << 200000, (1 << 200000) - 1)
X is powm(3, 1 << 20000, (1 << 20000) - 1)
X is powm(2, -1, 4)
X is powm(3, 1 << 10000000, 7)
X is msb(1 << 16000000) + popcount((1 << 16000000) - 1)
X is getbit(5, 1 << 100)
X is getbit(5, -1)
X is 5 >> (1 << 100)
X is (-1) >> (1 << 100)
X is 0 << (1 << 100)
X is float(1 << 16000000)
X is sqrt(1 << 16000000)
X is log(3 ^ 5000000)
X is truncate(1.0e308) * truncate(1.0e308)
X is cot(1 << 16000000)
X is random(1 << 16000000)
X is max(1 << 16000000, 1.0e308)
power(40, 3, X)
power(100, 12345678901234567890, X)
X is 1 << 16000000, adds(100000, X)
numlist(1, 300000, L), foldl([A, B, C]>>(C is A * B), L, 1, X)
numlist(1, 300000, L), sum_list(L, S), foldl([A, B, C]>>(C is B * 10 + A), L, 1, X)
X is 7 ^ 4000000, write(X)
X is 7 ^ 1000000, print(X), writeq(X), write_canonical(X)
X is 7 ^ 4000000, atom_number(A, X)
X is 7 ^ 4000000, number_codes(X, L)
X is 7 ^ 4000000, format("~d ~D ~a ~w ~8r", [X, X, X, X, X])
X is 7 ^ 300000, format("~D", [X])
X is 7 ^ 300000, format("~36r", [X])
X is 7 ^ 300000, format("~2d", [X])
X is 7 ^ 300000, format("~e", [X])
X is 7 ^ 300000, format("~4f", [X])
X is 7 ^ 300000, number_string(X, S)
X is 7 ^ 300000, atom_length(X, N)
X is 7 ^ 300000, term_to_atom(X, A), term_to_atom(Y, A), X =:= Y
X is 7 ^ 4000000, throw(X)
X is 7 ^ 4000000, atom_length(X, X)
text(4300, A), atom_number(A, X), Y is X + 1
text(100000, A), atom_number(A, X)
text(3000000, A), atom_number(A, X)
text(200000, A), atom_concat(A, '.0e-200000', B), atom_number(B, X)
text(200000, A), atom_concat('36\\'', A, B), atom_number(B, X)
text(200000, A), atom_concat('0x', A, B), atom_number(B, X)
codes(300000, L), number_codes(X, L), Y is X * X
text(300000, A), term_to_atom(T, A)
length(L, 3000000)
length(L, 100000000)
length(L, 1 << 62)
length(L, 2000000), length(L, N)
length(L, 500000), copy_term(L, M), L = M, L == M
length(L, 300000), sort(L, M)
length(L, 300000), msort(L, M), length(M, N)
length(L, 100000), sort(0, @>=, L, M)
length(L, 50000), predsort([O, A, B]>>compare(O, A, B), L, M)
length(L, 300000), list_to_set(L, M)
length(L, 8000), list_to_set(L, M)
length(L, 8000), maplist([f(_)]>>true, L), list_to_set(L, M)
findall(f(X), (between(1, 8000, X)), L), list_to_set(L, M)
findall(K-V, (between(1, 300000, V), K is V mod 7), L), keysort(L, M)
findall(X, (between(1, 200000, Y), X is Y * 7919 mod 200003), L), sort(L, M)
findall(f(X, Z), (between(1, 200000, Y), X is Y * 7919 mod 200003), L), sort(L, M)
findall(X-Y, (between(1, 3000, X), between(1, 1000, Y)), L)
setof(X-Y, (between(1, 3000, X), between(1, 1000, Y)), L)
bagof(X, member(X-Y, [1-A, 2-B, 3-C]), L), grow(L)
numlist(1, 5000000, L)
numlist(1, 1000000000000, L)
numlist(1, 300000, L), atomic_list_concat(L, ', ', A), atomic_list_concat(M, ', ', A)
numlist(1, 300000, L), sumlist(L, S), max_list(L, X), nth0(299999, L, Y), last(L, Z), reverse(L, R)
numlist(1, 300000, L), append(X, [Y], L)
numlist(1, 100000, L), append(X, Y, L), length(X, N), N > 100000
numlist(1, 30000, L), subtract(L, L, M)
numlist(1, 30000, L), permutation(L, M), fail
numlist(1, 3000, L), delete(L, 5, M), exclude([X]>>(X > 5), L, K), nb_setval(k, L), fail
numlist(1, 1000000, L), T =.. [f|L], T =.. M
numlist(1, 1000000, L), T =.. [f|L], copy_term(T, U), T == U, ground(T)
functor(T, f, 10000000)
functor(T, f, 16777217)
functor(T, f, 3000000), copy_term(T, U), T = U
functor(T, f, 1000000), term_variables(T, L), numbervars(T, 0, N)
functor(T, f, 100000), arg(N, T, foo), fail
functor(T, f, 300000), write(T)
functor(T, f, 300000), assertz(T), retract(T)
functor(T, f, 300000), findall(T, member(X, [1, 2, 3, 4]), L)
twice(40, abc, A)
twice(28, abc, A), atom_length(A, N)
twice(26, abc, A), atom_codes(A, L)
twice(22, abc, A), atom_chars(A, L)
twice(25, abc, A), upcase_atom(A, B), atom_length(B, N)
twice(22, abc, A), sub_atom(A, B, 3, C, zzz)
twice(12, abc, A), sub_atom(A, B, B, B, X)
twice(12, abc, A), findall(X, sub_atom(A, _, _, _, X), L)
twice(16, abc, A), atom_concat(X, Y, A), fail
twice(16, abc, A), atom_concat(X, X, A), fail
twice(20, ab, A), term_to_atom(T, A)
twice(20, 'a, ', A), atom_concat(A, a, B), term_to_atom(T, B)
twice(20, '- ', A), atom_concat(A, a, B), term_to_atom(T, B)
twice(18, '(', A), term_to_atom(T, A)
twice(18, '[', A), term_to_atom(T, A)
twice(18, 'f(', A), term_to_atom(T, A)
twice(18, 'X ', A), term_to_atom(T, A)
twice(20, '"', A), term_to_atom(T, A)
twice(20, '/*', A), term_to_atom(T, A)
strings(40, "abc", S)
strings(16, "abc", S), string_concat(X, Y, S), fail
strings(20, ",", S), split_string(S, ",", "", L), length(L, N)
strings(20, ",", S), split_string(S, ",", " ", L), length(L, N)
strings(18, ", ", S), split_string(S, ",", " ", L), length(L, N)
strings(20, "a", S), string_code(5, S, C), sub_string(S, B, 1, 0, X), fail
strings(22, "a", S), string_codes(S, L), string_chars(T, L), string_to_atom(T, A)
strings(14, "a", S), sub_string(S, B, L, A, "b")
with_output_to(atom(A), (repeat, write(abc), fail))
with_output_to(string(S), forall(between(1, 3000000, X), write(X)))
with_output_to(codes(L), (numlist(1, 300000, M), write(M)))
forall(between(1, 300000, X), put_char(a))
tab(1000000000)
tab(1 << 100)
format("~*c", [1000000000, 0'a])
format("~*c", [1 << 100, 0'a])
format("~1000000000c", [0'a])
format("~t~w~1000000000|", [abc])
format("~`xt~1000000000|")
format("~w~1000000000+~w", [a, b])
format("~1000000000d", [5])
format("~1000000000f", [5.5])
format("~100000e", [5.5])
format("~1000000000n")
format("~1000000000i~w", [a])
text(300000, A), format(A, [])
twice(18, '~w', A), format(A, [])
twice(16, '~t~w~10|', A), length(L, 65536), maplist(=(x), L), format(A, L)
shared(T), shared(U), T = U
shared(T), shared(U), T == U
shared(T), shared(U), compare(O, T, U)
shared(T), shared(U), T @< U
shared(T), shared(U), T =@= U
shared(T), shared(U), unify_with_occurs_check(T, U)
shared(T), shared(U), T \\= U
shared(T), copy_term(T, U)
shared(T), ground(T)
shared(T), term_variables(T, L)
shared(T), findall(T, member(X, [1, 2, 3]), L)
shared(T), assertz(kept(T, T, T)), kept(A, B, C)
shared(T), assertz((foo(T) :- bar(T))), clause(foo(X), Y)
shared(T), nb_setval(k, T), nb_getval(k, U)
shared(T), write(T)
shared(T), writeq(T)
shared(T), print(T)
shared(T), write_canonical(T)
shared(T), write_term(T, [max_depth(5)])
shared(T), term_to_atom(T, A)
shared(T), format("~w", [T])
shared(T), portray_clause(T)
shared(T), throw(T)
shared(T), catch(throw(T), U, true)
shared(T), atom_length(T, N)
shared(T), X is T
doubled(30, 1, T), X is T
doubled(300, 1, T), X is T
doubled(300, 1.0, T), T > 1
doubled(300, V, T), V = 1, T =:= T
shared(T), call(T)
shared(T), length(T, N)
shared(T), msort([T, T, a], L)
shared(T), sort([T, T], L)
shared(T), subsumes_term(T, T), subsumes_term(X, T)
shared(T), numbervars(T, 0, N)
shared(T), T =.. L, U =.. L, U == T
shared(T), setof(X, member(X, [T, T]), L)
shared(T), memberchk(T, [a, b, T])
shared(T), must_be(ground, T), must_be(integer, T)
open(T), copy_term(T, U), T = U
open(T), open(U), T = U
open(T), open(U), T =@= U
open(T), open(U), T == U
open(T), term_variables(T, L)
open(T), ground(T)
open(T), findall(T, member(X, [1, 2, 3]), L)
open(T), assertz(kept(T, a, b)), kept(X, Y, Z)
open(T), assertz((foo(X) :- X = T)), foo(Y)
open(T), numbervars(T, 0, N), write(T)
open(T), bagof(X, member(X-T, [1-T, 2-T]), L)
open(T), unify_with_occurs_check(X, T), unify_with_occurs_check(T, f(T))
open(T), T = f(X, Y), X = Y, copy_term(X-Y, Z)
open(T), catch(throw(T), U, true)
X = f(X), write(X)
X = f(X), print(X)
X = f(X), write_canonical(X)
X = f(X), write_term(X, [max_depth(3)])
X = f(X), format("~w ~q ~p", [X, X, X])
X = f(X), portray_clause(X)
X = f(X), term_to_atom(X, A)
X = f(X), Y is X
X = X + 1, Y is X
X = - X, Y is X
X = 1 - X, Y =:= X
X = f(X), call(X)
X = (a, X), call(X)
X = (true, X), call(X)
X = (X, true), call(X)
X = (true ; X), call(X)
X = (X ; true), call(X)
X = (X -> true), call(X)
X = (true -> X ; fail), call(X)
X = (\\+ X), call(X)
X = call(X), call(X)
X = once(X), call(X)
X = findall(_, X, _), call(X)
X = catch(X, _, true), call(X)
X = forall(true, X), call(X)
X = call_cleanup(true, X), call(X)
X = f(X), Y = f(Y), X = Y
X = f(X), Y = f(Y), X == Y
X = f(X), Y = f(f(Y)), X == Y
X = f(X), Y = f(Y), X =@= Y
X = f(X), Y = f(Y), compare(O, X, Y)
X = f(X, Y), Y = f(Y, X), X = Y
X = f(X), copy_term(X, Y), X == Y
X = f(X), unify_with_occurs_check(X, f(f(f(X))))
X = f(X), findall(X, member(_, [1, 2]), L)
X = f(X), bagof(Z, member(Z, [X, X]), L)
X = f(X), assertz(kept(X, X, X))
X = f(X), assertz((foo :- X))
X = (foo, X), assertz((foo :- X))
X = f(X), nb_setval(k, X), b_setval(k, X)
X = f(X), ground(X), term_variables(X, L)
X = f(X, _), numbervars(X, 0, N)
X = f(X), throw(X)
X = f(X), catch(throw(X), Y, true)
X = f(X), atom_length(X, N)
X = f(X), T =.. [g, X, X], write(T)
X = f(X), msort([X, f(X), a], L)
X = f(X), list_to_set([X, X, a], L)
X = f(X), subsumes_term(f(_), X)
X = f(X), must_be(integer, X)
X = [a|X], length(X, N)
X = [a|X], write(X)
X = [a|X], print(X)
X = [0'a|X], atom_codes(A, X)
X = [a|X], atom_chars(A, X)
X = [a|X], atomic_list_concat(X, A)
X = [a|X], msort(X, L)
X = [a|X], list_to_set(X, L)
X = [a|X], T =.. X
X = [a|X], is_list(X)
X = [a|X], append(X, [b], L)
X = [a|X], reverse(X, L)
X = [a|X], nth0(1000000000, X, Y)
X = [a|X], last(X, Y)
X = [1|X], sum_list(X, S)
X = [a|X], maplist(atom, X)
X = [a|X], member(b, X)
X = [a|X], format("~w", X)
X = [a|X], phrase(endless, X)
X = [a|X], atom_to_term(X, T, B)
X = "a", Y = [X|Y], atomics_to_string(Y, Z)
X = f(X), copy_term(X, Y), write_canonical(Y)
X = f(X), retract(X)
X = f(X), clause(X, B)
X = f(X), op(700, xfx, X)
X = f(X), atom_codes(X, L)
X = [X], flatten(X, Y)
X = [X|X], length(X, N)
X = a-X, keysort([X], L)
X = '$VAR'(X), print(X)
X = {X}, writeq(X)
X = [X|a], writeq(X)
X = (X :- X), assertz(X)
X = (X --> X), dcg_translate_rule(X, Y)
X = f(X), sub_atom(X, A, B, C, D)
nest(20000, '\\\\+', true, G), call(G)
nest(100000, call, true, G), call(G)
nest(200000, '\\\\+', loop, G), call(G)
nest(1000000, f, a, T), T = U, copy_term(T, V), U == V
nest(300000, f, a, T), write(T)
nest(300000, -, 1, T), X is T
nest(300000, -, a, T), writeq(T)
nest(300000, f, a, T), assertz(kept(T, T, T)), kept(X, Y, Z)
nest(100000, f, X, T), term_to_atom(T, A), term_to_atom(U, A)
nest(20000, once, loop, G), call(G)
nest(20000, findnsols, true, G), call(G)
lonely
"""

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
    lines = [line for line in _WHOLE.strip().split("\n") if line]
    for number, line in enumerate(lines):
        program = PROGRAM + STRINGS if line.startswith("strings(") else PROGRAM
        cases.append(Case(line, line, program))
        if number % 4 == 0:
            around = _AROUND[number // 4 % len(_AROUND)].format(line)
            cases.append(Case(around, around, program, compiled=number % 8 == 0))
    return cases


def _file(name: str, text: str, goal: str = "true") -> Case:
    return Case(f"file: {name}", goal, text)


def files() -> list[Case]:
    """Programs whose loading is hostile."""
    deep = 20_000
    return [
        _file("an endless directive", ":- repeat, fail."),
        _file("an endless initialization", ":- initialization((repeat, fail))."),
        _file("an endless cleanup", ":- call_cleanup(fail, (repeat, fail))."),
        _file("a directive that catches", ":- catch((repeat, fail), _, true)."),
        _file("many endless directives", ":- catch((repeat, fail), _, true).\n" * 1000),
        _file("a directive that fills memory", ":- findall(X, repeat, _)."),
        _file("a directive that halts", ":- halt."),
        _file("a goal that halts", "p :- halt(3).", "p"),
        _file("a directive that prints millions of digits", ":- X is 7 ^ 4000000, write(X)."),
        _file("an integer of millions of digits", "p(" + "1" * 6_000_000 + ")."),
        _file("many long integers", ("p(" + "7" * 200_000 + ").\n") * 20),
        _file("a hexadecimal integer of millions of digits", "p(0x" + "f" * 3_000_000 + ")."),
        _file("a float of a million digits", "p(1." + "5" * 1_000_000 + ")."),
        _file("a float beyond all", "p(1.0e" + "9" * 1_000 + ")."),
        _file("megabytes of operators", "".join(f":- op(700, xfx, o{n}).\n" for n in range(100_000))),
        _file("an operand of prefix operators", "p(" + "- " * 300_000 + "a)."),
        _file("negations", "p :- " + "\\+ " * deep + "fail.", "p"),
        _file("conditions on the left", "p :- " + "(" * deep + "true" + " -> true)" * deep + ".", "p"),
        _file("conditions on the right", "p :- " + "(true -> " * deep + "true" + ")" * deep + ".", "p"),
        _file("alternatives", "p :- " + "(fail ; " * deep + "true" + ")" * deep + ".", "p, p, p"),
        _file("conjunctions", "p :- " + "(" * deep + "true" + ", true)" * deep + ".", "p"),
        _file("a grammar", "p --> " + "(" * deep + "[]" + ", [])" * deep + ".", "phrase(p, [])"),
        _file("a negated grammar", "p --> " + "\\+ " * deep + "[a].", "phrase(p, []) ; true"),
        _file("nested findall", "p :- " + "findall(x, " * deep + "true" + ", _)" * deep + ".", "p"),
        _file("nested catch", "p :- " + "catch(" * deep + "true" + ", _, true)" * deep + ".", "p"),
        _file("brackets never closed", "p(" * 300_000),
        _file("lists never closed", "p([" * 300_000 + "."),
        _file("a list of half a million", "p([" + "a," * 500_000 + "a]).", "p(X), length(X, N), N > 0"),
        _file("a deep term", "p(" + "f(" * 200_000 + "X" + ")" * 200_000 + ", X).", "p(T, a), ground(T)"),
        _file("a term of many variables", "p(" + ",".join(f"X{n}" for n in range(100_000)) + ")."),
        _file("a clause of many goals", "p :- " + "q, " * 100_000 + "true. q.", "p"),
        _file("hot code of many goals", "p :- " + "q(X), " * 3_000 + "true. q(_).", "repeat, p, fail"),
        _file("many clauses", "".join(f"p({n}, {n % 7}).\n" for n in range(60_000)), "p(X, 3), X > 59990"),
        _file("many predicates", "".join(f"p{n} :- p{n + 1}.\n" for n in range(30_000)), "p0"),
        _file("many errors", "p( .\n" * 30_000),
        _file("many singletons", "".join(f"p(X{n}) :- q(Y{n}).\n" for n in range(20_000))),
        _file("an atom of megabytes", "p('" + "a" * 20_000_000 + "').", "p(X), atom_length(X, N), N > 0"),
        _file("a string of megabytes", 'p("' + "a" * 1_000_000 + '").', "p(X), length(X, N), N > 0"),
        _file("a comment of megabytes", "/*" + "a" * 20_000_000 + "*/ p."),
        _file("a comment never closed", "/*" + "a" * 5_000_000),
        _file("a quote never closed", "'" + "a" * 5_000_000),
        _file("one line of nonsense", "@ # $ " * 300_000),
        _file("full stops", ". " * 200_000),
        _file("left recursion", "p --> p, [a]. p --> [].", "phrase(p, [b])"),
        _file("a clause that grows", ":- dynamic(p/1). p(X) :- assertz(p(f(X))), p(X).", "p(a)"),
        _file(
            "a large term built each time",
            "p :- q(" + "f(X, " * 100_000 + "a" + ")" * 100_000 + "), p. q(_).",
            "p",
        ),
        _file(
            "wide terms built each time",
            "p(N) :- q(f(" + ",".join(f"X{n}" for n in range(5_000)) + ")), M is N + 1, p(M). q(_).",
            "p(0)",
        ),
        _file(
            "a loop of large numbers",
            "p(N, B) :- C is B + 1, M is N + 1, p(M, C).",
            "X is 1 << 16000000, p(0, X)",
        ),
        _file("a loop that sorts", "p(L) :- msort(L, M), p(M).", "numlist(1, 100000, L), p(L)"),
        _file("a loop that copies", "p(L) :- copy_term(L, M), p(M).", "length(L, 100000), p(L)"),
        _file("a loop that measures", "p(L) :- length(L, N), N > 0, p(L).", "length(L, 300000), p(L)"),
        _file(
            "a loop that joins",
            "p(A) :- atom_concat(A, x, B), atom_length(B, N), N > 0, p(B).",
            "length(L, 100000), maplist(=(a), L), atomic_list_concat(L, A), p(A)",
        ),
        _file(
            "a loop of new atoms",
            "p(N) :- atom_number(A, N), atom_length(A, L), L > 0, M is N + 1, p(M).",
            "p(0)",
        ),
        _file(
            "a failing loop of new atoms",
            "p :- between(1, inf, N), atom_number(A, N), atom_length(A, 0).",
            "p",
        ),
        _file("a loop that writes", "p :- write(abc), p.", "with_output_to(atom(A), p)"),
        _file("a loop of global variables", "p(N) :- nb_setval(k, f(N, N)), M is N + 1, p(M).", "p(0)"),
        _file(
            "a loop of new global variables",
            "p(N) :- atom_number(A, N), nb_setval(A, N), M is N + 1, p(M).",
            "p(0)",
        ),
        _file(
            "a loop of cleanups", "p :- call_cleanup(true, q), p. q :- between(1, 3, _), fail ; true.", "p"
        ),
        _file("cleanups that pile up", "p :- call_cleanup(member(_, [1, 2]), q), p. q :- q.", "p"),
        _file("a cleanup of cleanups", "p :- call_cleanup(fail, p).", "p"),
        _file("errors in a loop", "p :- catch(atom_length(_, _), _, true), p.", "p"),
        _file("errors in errors", "p :- catch(throw(a), _, p).", "p"),
        _file("catches that pile up", "p :- catch(p, x, true), q. q.", "p"),
        _file("negations that pile up", "p :- \\+ p.", "p"),
        _file("findall in findall", "p(L) :- findall(X, p(X), L).", "p(L)"),
        _file("bagof without end", "p(X) :- q(X). p(X) :- p(Y), X is Y + 1. q(0).", "setof(X, p(X), L)"),
        _file("a flag that hides errors", ":- set_prolog_flag(unknown, fail). p :- q ; p.", "p"),
        _file(
            "a conversion of characters",
            ":- char_conversion(a, b), set_prolog_flag(char_conversion, on).\n" + "p(a).\n" * 20_000,
        ),
    ]


CASES: Final = [*goals(), *files()]
