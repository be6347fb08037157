% What ISO Prolog lacks

drlsl_forall(Condition, Action) :- \+ (call(Condition), \+ call(Action)).

drlsl_ignore(Goal) :- (call(Goal) -> true ; true).

drlsl_member(X, [X|_]).
drlsl_member(X, [_|Xs]) :- drlsl_member(X, Xs).

drlsl_memberchk(X, Xs) :- drlsl_member(X, Xs), !.

drlsl_append([], Xs, Xs).
drlsl_append([X|Xs], Ys, [X|Zs]) :- drlsl_append(Xs, Ys, Zs).

drlsl_length(Xs, N) :- drlsl_length(Xs, 0, N).

drlsl_length([], N, N).
drlsl_length([_|Xs], N0, N) :- N1 is N0 + 1, drlsl_length(Xs, N1, N).

drlsl_between(Low, High, Low) :- Low =< High.
drlsl_between(Low, High, N) :- Low < High, Next is Low + 1, drlsl_between(Next, High, N).

drlsl_sum_list(Xs, Sum) :- drlsl_sum_list(Xs, 0, Sum).

drlsl_sum_list([], Sum, Sum).
drlsl_sum_list([X|Xs], Sum0, Sum) :- Sum1 is Sum0 + X, drlsl_sum_list(Xs, Sum1, Sum).

drlsl_max_list([X|Xs], Most) :- Most0 is X, drlsl_max_list(Xs, Most0, Most).

drlsl_max_list([], Most, Most).
drlsl_max_list([X|Xs], Most0, Most) :- Most1 is max(Most0, X), drlsl_max_list(Xs, Most1, Most).

drlsl_min_list([X|Xs], Least) :- Least0 is X, drlsl_min_list(Xs, Least0, Least).

drlsl_min_list([], Least, Least).
drlsl_min_list([X|Xs], Least0, Least) :- Least1 is min(Least0, X), drlsl_min_list(Xs, Least1, Least).

drlsl_count(Goal, N) :- findall(x, Goal, Xs), drlsl_length(Xs, N).

drlsl_sum(X, Goal, Sum) :- findall(X, Goal, Xs), drlsl_sum_list(Xs, Sum).

drlsl_max(X, Goal, Most) :- findall(X, Goal, Xs), drlsl_max_list(Xs, Most).

drlsl_min(X, Goal, Least) :- findall(X, Goal, Xs), drlsl_min_list(Xs, Least).

drlsl_max(X, Witness, Goal, Most, Best) :-
    findall(X-Witness, Goal, [X0-Best0|Xs]), Most0 is X0, drlsl_best(Xs, 1, Most0, Best0, Most, Best).

drlsl_min(X, Witness, Goal, Least, Best) :-
    findall(X-Witness, Goal, [X0-Best0|Xs]), Least0 is X0, drlsl_best(Xs, -1, Least0, Best0, Least, Best).

% Of equal ones the first is kept.
drlsl_best([], _, X, Best, X, Best).
drlsl_best([X1-Best1|Xs], Sign, X0, Best0, X, Best) :-
    (   Sign * X1 > Sign * X0
    ->  X2 is X1, drlsl_best(Xs, Sign, X2, Best1, X, Best)
    ;   drlsl_best(Xs, Sign, X0, Best0, X, Best)
    ).
