:- module(solutions, [bagof/3, setof/3, (^)/2, aggregate_all/3, aggregate_all/4]).

bagof(T, G, L) :-
    '$check_partial_list'(L),
    '$free_variables'(T^G, Witness, Goal),
    bagof_(Witness, T, Goal, L).

bagof_([], T, G, L) :- !, findall(T, G, L0), L0 \== [], L = L0.
bagof_(Witness, T, G, L) :-
    findall(Witness-T, G, Answers), Answers \== [],
    '$solution_groups'(Answers, Witness, false, L).

setof(T, G, S) :-
    '$check_partial_list'(S),
    '$free_variables'(T^G, Witness, Goal),
    setof_(Witness, T, Goal, S).

setof_([], T, G, S) :- !, findall(T, G, L), L \== [], sort(L, S).
setof_(Witness, T, G, S) :-
    findall(Witness-T, G, Answers), Answers \== [],
    '$solution_groups'(Answers, Witness, true, S).

_ ^ G :- call(G).

aggregate_all(Spec, _, _) :- var(Spec), !, throw(error(instantiation_error, _)).
aggregate_all(count, G, C) :- !, findall(x, G, L), length(L, N), C = N.
aggregate_all(count(T), G, C) :- !, findall(T, G, L), length(L, N), C = N.
aggregate_all(sum(E), G, S) :- !, findall(E, G, L), sum_values(L, 0, S).
aggregate_all(bag(T), G, L) :- !, findall(T, G, L).
aggregate_all(set(T), G, S) :- !, findall(T, G, L), sort(L, S).
aggregate_all(max(X), G, M) :- !, findall(X, G, [V|Vs]), N is V, max_value(Vs, N, M).
aggregate_all(min(X), G, M) :- !, findall(X, G, [V|Vs]), N is V, min_value(Vs, N, M).
aggregate_all(max(X, W), G, R) :- !,
    findall(X-W, G, [V-VW|Vs]), N is V, max_witness(Vs, N, VW, M, MW), R = max(M, MW).
aggregate_all(min(X, W), G, R) :- !,
    findall(X-W, G, [V-VW|Vs]), N is V, min_witness(Vs, N, VW, M, MW), R = min(M, MW).
aggregate_all(Spec, G, R) :-
    aggregates(Spec, Name, Specs, Templates),
    findall(Templates, G, Rows),
    columns(Specs, Rows, Values), R =.. [Name|Values].

aggregate_all(Spec, _, _, _) :- var(Spec), !, throw(error(instantiation_error, _)).
aggregate_all(count, D, G, C) :- !, findall(D, G, L0), sort(L0, L), length(L, N), C = N.
aggregate_all(sum(E), D, G, S) :- !, findall(D-E, G, L0), sort(L0, L), strip_keys(L, Es), sum_values(Es, 0, S).
aggregate_all(max(E), D, G, M) :- !, findall(D-E, G, L0), sort(L0, L), strip_keys(L, [V|Vs]), N is V, max_value(Vs, N, M).
aggregate_all(min(E), D, G, M) :- !, findall(D-E, G, L0), sort(L0, L), strip_keys(L, [V|Vs]), N is V, min_value(Vs, N, M).
aggregate_all(bag(E), D, G, Es) :- !, findall(D-E, G, L0), sort(L0, L), strip_keys(L, Es).
aggregate_all(set(E), D, G, S) :- !, findall(D-E, G, L0), strip_keys(L0, Es), sort(Es, S).
aggregate_all(max(X, W), D, G, M) :- !, findall(D-(X-W), G, L0), sort(L0, L), strip_keys(L, Ps), aggregate(max(X, W), Ps, M).
aggregate_all(min(X, W), D, G, M) :- !, findall(D-(X-W), G, L0), sort(L0, L), strip_keys(L, Ps), aggregate(min(X, W), Ps, M).
aggregate_all(Spec, D, G, R) :-
    aggregates(Spec, Name, Specs, Templates),
    findall(D-Templates, G, L0), sort(L0, L), strip_keys(L, Rows),
    columns(Specs, Rows, Values), R =.. [Name|Values].

% aggregates(+Spec, -Name, -Specs, -Templates): a term whose arguments are aggregates, and what to find for each.
aggregates(Spec, _, _, _) :- \+ callable(Spec), !, throw(error(type_error(aggregate_template, Spec), _)).
aggregates(Spec, _, _, _) :- atom(Spec), !, throw(error(domain_error(aggregate_template, Spec), _)).
aggregates(Spec, Name, Specs, Templates) :-
    Spec =.. [Name|Specs],
    ( member(S, Specs), var(S) -> throw(error(domain_error(aggregate_template, Spec), _)) ; true ),
    templates(Specs, Templates).

templates([], []).
templates([Spec|Specs], [T|Ts]) :- template(Spec, T), templates(Specs, Ts).

template(count, x) :- !.
template(count(T), T) :- !.
template(sum(E), E) :- !.
template(bag(T), T) :- !.
template(set(T), T) :- !.
template(max(X), X) :- !.
template(min(X), X) :- !.
template(max(X, W), X-W) :- !.
template(min(X, W), X-W) :- !.
template(Spec, _) :- throw(error(domain_error(aggregate_template, Spec), _)).

columns([], _, []).
columns([Spec|Specs], Rows, [V|Vs]) :- column(Rows, Column, Rest), aggregate(Spec, Column, V), columns(Specs, Rest, Vs).

column([], [], []).
column([[X|Xs]|Rows], [X|Column], [Xs|Rest]) :- column(Rows, Column, Rest).

aggregate(count, L, N) :- length(L, N).
aggregate(count(_), L, N) :- length(L, N).
aggregate(sum(_), L, S) :- sum_values(L, 0, S).
aggregate(bag(_), L, L).
aggregate(set(_), L, S) :- sort(L, S).
aggregate(max(_), [V|Vs], M) :- N is V, max_value(Vs, N, M).
aggregate(min(_), [V|Vs], M) :- N is V, min_value(Vs, N, M).
aggregate(max(_, _), [V-W|Ps], max(M, MW)) :- N is V, max_witness(Ps, N, W, M, MW).
aggregate(min(_, _), [V-W|Ps], min(M, MW)) :- N is V, min_witness(Ps, N, W, M, MW).

strip_keys([], []).
strip_keys([_-E|Ps], [E|Es]) :- strip_keys(Ps, Es).

sum_values([], S, S).
sum_values([X|Xs], S0, S) :- S1 is S0 + X, sum_values(Xs, S1, S).

max_value([], M, M).
max_value([X|Xs], M0, M) :- M1 is max(M0, X), max_value(Xs, M1, M).

min_value([], M, M).
min_value([X|Xs], M0, M) :- M1 is min(M0, X), min_value(Xs, M1, M).

max_witness([], M, W, M, W).
max_witness([X-V|Xs], M0, W0, M, W) :-
    N is X,
    ( N > M0 -> max_witness(Xs, N, V, M, W) ; max_witness(Xs, M0, W0, M, W) ).

min_witness([], M, W, M, W).
min_witness([X-V|Xs], M0, W0, M, W) :-
    N is X,
    ( N < M0 -> min_witness(Xs, N, V, M, W) ; min_witness(Xs, M0, W0, M, W) ).
