:- module(lists, [append/3, append/2, member/2, memberchk/2, reverse/2, nth0/3, nth1/3, nth0/4, nth1/4, last/2,
    sum_list/2, sumlist/2, max_list/2, min_list/2, max_member/2, min_member/2, select/3, selectchk/3, select/4,
    subtract/3, intersection/3, union/3, delete/3, permutation/2, flatten/2, subset/2, proper_length/2,
    same_length/2, prefix/2, is_set/1, clumped/2, predsort/3]).

append([], L, L).
append([H|T], L, [H|R]) :- append(T, L, R).

append(Lists, L) :- append_all(Lists, L).

append_all([], []).
append_all([L|Ls], As) :- append(L, Ws, As), append_all(Ls, Ws).

member(X, [Y|Ys]) :- member_(Ys, X, Y).

% The list comes first, so that the last element leaves no choice point.
member_(_, X, X).
member_([Y|Ys], X, _) :- member_(Ys, X, Y).

memberchk(X, L) :- member(X, L), !.

reverse(Xs, Ys) :- reverse_(Xs, [], Ys).

reverse_([], Ys, Ys).
reverse_([X|Xs], Rs, Ys) :- reverse_(Xs, [X|Rs], Ys).

nth0(I, L, E) :- integer(I), !, I >= 0, nth_fixed(I, L, E).
nth0(I, [H|T], E) :- var(I), !, nth_free(T, H, E, 0, I).
nth0(I, _, _) :- nonvar(I), throw(error(type_error(integer, I), _)).

nth1(I, L, E) :- integer(I), !, I >= 1, J is I - 1, nth_fixed(J, L, E).
nth1(I, [H|T], E) :- var(I), !, nth_free(T, H, E, 1, I).
nth1(I, _, _) :- nonvar(I), throw(error(type_error(integer, I), _)).

nth_fixed(0, [E|_], E) :- !.
nth_fixed(I, [_|T], E) :- J is I - 1, nth_fixed(J, T, E).

nth_free(_, H, H, B, B).
nth_free([H|T], _, E, B, I) :- B1 is B + 1, nth_free(T, H, E, B1, I).

nth0(I, L, E, R) :- integer(I), !, I >= 0, nth_take(I, L, E, R).
nth0(I, L, E, R) :- var(I), nth_any(L, E, R, 0, I).

nth1(I, L, E, R) :- integer(I), !, I >= 1, J is I - 1, nth_take(J, L, E, R).
nth1(I, L, E, R) :- var(I), nth_any(L, E, R, 1, I).

nth_take(0, [E|R], E, R) :- !.
nth_take(I, [H|T], E, [H|R]) :- J is I - 1, nth_take(J, T, E, R).

nth_any([E|R], E, R, B, B).
nth_any([H|T], E, [H|R], B, I) :- B1 is B + 1, nth_any(T, E, R, B1, I).

last([X|Xs], L) :- last_(Xs, X, L).

last_([], L, L).
last_([X|Xs], _, L) :- last_(Xs, X, L).

sum_list(Xs, S) :- sum_list_(Xs, 0, S).

sum_list_([], S, S).
sum_list_([X|Xs], S0, S) :- S1 is S0 + X, sum_list_(Xs, S1, S).

sumlist(Xs, S) :- sum_list(Xs, S).

max_list([X|Xs], M) :- max_list_(Xs, X, M).

max_list_([], M, M).
max_list_([X|Xs], M0, M) :- M1 is max(M0, X), max_list_(Xs, M1, M).

min_list([X|Xs], M) :- min_list_(Xs, X, M).

min_list_([], M, M).
min_list_([X|Xs], M0, M) :- M1 is min(M0, X), min_list_(Xs, M1, M).

max_member(M, [X|Xs]) :- max_member_(Xs, X, M).

max_member_([], M, M).
max_member_([X|Xs], M0, M) :- ( X @> M0 -> max_member_(Xs, X, M) ; max_member_(Xs, M0, M) ).

min_member(M, [X|Xs]) :- min_member_(Xs, X, M).

min_member_([], M, M).
min_member_([X|Xs], M0, M) :- ( X @< M0 -> min_member_(Xs, X, M) ; min_member_(Xs, M0, M) ).

select(X, [H|T], R) :- select_(T, H, X, R).

select_(T, H, H, T).
select_([H2|T], H, X, [H|R]) :- select_(T, H2, X, R).

selectchk(X, L, R) :- select(X, L, R), !.

select(X, Xs, Y, Ys) :- select4_(Xs, X, Y, Ys).

select4_([X|T], X, Y, [Y|T]).
select4_([H|T], X, Y, [H|T2]) :- select4_(T, X, Y, T2).

subtract([], _, []).
subtract([X|Xs], L, R) :- ( memberchk(X, L) -> subtract(Xs, L, R) ; R = [X|R1], subtract(Xs, L, R1) ).

intersection([], _, []).
intersection([X|Xs], L, R) :- ( memberchk(X, L) -> R = [X|R1], intersection(Xs, L, R1) ; intersection(Xs, L, R) ).

union([], L, L).
union([X|Xs], L, R) :- ( memberchk(X, L) -> union(Xs, L, R) ; R = [X|R1], union(Xs, L, R1) ).

delete([], _, []).
delete([X|Xs], E, R) :- ( X \= E -> R = [X|R1], delete(Xs, E, R1) ; delete(Xs, E, R) ).

permutation(Xs, Ys) :- permutation_lengths(Xs, Ys), permutation_(Xs, Ys).

permutation_lengths(Xs, Ys) :- is_list(Xs), !, length(Xs, N), length(Ys, N).
permutation_lengths(Xs, Ys) :- is_list(Ys), !, length(Ys, N), length(Xs, N).
permutation_lengths(Xs, Ys) :- length(Xs, N), length(Ys, N).

permutation_([], []).
permutation_(Xs, [Y|Ys]) :- select(Y, Xs, Rest), permutation_(Rest, Ys).

flatten(L, F) :- flatten_(L, [], F0), !, F = F0.

flatten_(V, T, [V|T]) :- var(V), !.
flatten_([], T, T) :- !.
flatten_([H|R], T, F) :- !, flatten_(H, F1, F), flatten_(R, T, F1).
flatten_(A, T, [A|T]).

subset([], _).
subset([X|Xs], L) :- memberchk(X, L), subset(Xs, L).

proper_length(L, N) :- is_list(L), length(L, N).

same_length([], []).
same_length([_|Xs], [_|Ys]) :- same_length(Xs, Ys).

prefix([], _).
prefix([X|Xs], [X|Ys]) :- prefix(Xs, Ys).

is_set(L) :- is_list(L), list_to_set(L, S), same_length(L, S).

clumped([], []).
clumped([H|T0], [H-C|T]) :- clumped_(T0, H, 1, C, T1), clumped(T1, T).

clumped_([H|T0], E, C0, C, T) :- E == H, !, C1 is C0 + 1, clumped_(T0, E, C1, C, T).
clumped_(L, _, C, C, L).

predsort(P, L, Sorted) :- '$check_list'(L), length(L, N), predsort_(N, P, L, _, Sorted0), !, Sorted = Sorted0.

predsort_(0, _, L, L, []) :- !.
predsort_(1, _, [X|L], L, [X]) :- !.
predsort_(N, P, L1, L3, R) :-
    N1 is N // 2, N2 is N - N1,
    predsort_(N1, P, L1, L2, R1),
    predsort_(N2, P, L2, L3, R2),
    predmerge(R1, R2, P, R).

predmerge([], R, _, R) :- !.
predmerge(R, [], _, R) :- !.
predmerge([H1|T1], [H2|T2], P, R) :- call(P, Order, H1, H2), predmerge_(Order, H1, T1, H2, T2, P, R).

predmerge_(<, H1, T1, H2, T2, P, [H1|R]) :- predmerge(T1, [H2|T2], P, R).
predmerge_(>, H1, T1, H2, T2, P, [H2|R]) :- predmerge([H1|T1], T2, P, R).
predmerge_(=, H1, T1, _, T2, P, R) :- predmerge([H1|T1], T2, P, R).
