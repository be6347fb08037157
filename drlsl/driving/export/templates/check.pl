@HEAD@
%
% Check the answers of rules.pl against @COUNT@ stored decisions: load both files, then ask drlsl_check. In SWI-Prolog
%     swipl -g drlsl_check -t halt rules.pl check.pl
% and in GNU Prolog
%     GLOBALSZ=1000000 gprolog --consult-file rules.pl --consult-file check.pl --query-goal drlsl_check,halt
% Tau Prolog and Trealla consult the text of the two files.

drlsl_check :-
    findall(N, drlsl_scene(N, _, _), All), drlsl_number_of(All, 0, Total),
    findall(N, drlsl_wrong(N), Wrong), drlsl_number_of(Wrong, 0, Bad), Right is Total - Bad,
    write(Right), write(' of '), write(Total), write(' decisions are the stored ones'), nl,
    drlsl_report(Wrong).

drlsl_report([]).
drlsl_report([N|_]) :- write('the first that differs is scene '), write(N), nl, fail.

drlsl_number_of([], N, N).
drlsl_number_of([_|Xs], N0, N) :- N1 is N0 + 1, drlsl_number_of(Xs, N1, N).

drlsl_wrong(N) :- drlsl_scene(N, Facts, Answer), \+ drlsl_is_right(Facts, Answer).

drlsl_is_right(Facts, Answer) :- drlsl_forget, drlsl_tell(Facts), drlsl_answers(Answer), !.

drlsl_tell([]).
drlsl_tell([Fact|Facts]) :- assertz(Fact), drlsl_tell(Facts).

% Forget the facts of the scene before.
@FORGET@
drlsl_forget.

% answer(Actions, Speed, Observation, FrontIsFree, Lane, Acceleration, Objections): each of the last three a list, empty without one.
drlsl_answers(answer(Actions, Speed, Observation, Free, Lanes, Accelerations, Objections)) :-
    findall(Action, safe_actions(Action), Found), drlsl_distinct(Found, [], Actions),
    longitudinal_velocity(Speed1), drlsl_near(Speed1, Speed),
    state(Observation1), drlsl_all_near(Observation1, Observation),
    (   front_is_free -> Free = true ; Free = false ),
    drlsl_lane(Lanes), drlsl_acceleration(Accelerations),
    drlsl_objections(Refused), drlsl_offered(Refused, Actions, Against),
    drlsl_each_among(Against, Objections), drlsl_each_among(Objections, Against).

@OPTIONAL@

drlsl_distinct([], _, []).
drlsl_distinct([X|Xs], Seen, Ys) :-
    (   drlsl_among(X, Seen) -> Ys = Rest ; Ys = [X|Rest] ),
    drlsl_distinct(Xs, [X|Seen], Rest).

drlsl_among(X, [Y|Ys]) :- (   drlsl_alike(X, Y) -> true ; drlsl_among(X, Ys) ).

drlsl_each_among([], _).
drlsl_each_among([X|Xs], Ys) :- drlsl_among(X, Ys), drlsl_each_among(Xs, Ys).

% Leave out what speaks against an action that is offered all the same.
drlsl_offered([], _, []).
drlsl_offered([Action-Reason|Found], Actions, Left) :-
    (   drlsl_among(Action, Actions) -> Left = Rest ; Left = [Action-Reason|Rest] ),
    drlsl_offered(Found, Actions, Rest).

drlsl_alike(X, Y) :- number(X), !, number(Y), drlsl_near(X, Y).
drlsl_alike(X, Y) :- atom(X), !, X == Y.
drlsl_alike(X, Y) :- compound(X), compound(Y), X =.. [Name|Xs], Y =.. [Name|Ys], drlsl_all_alike(Xs, Ys).

drlsl_all_alike([], []).
drlsl_all_alike([X|Xs], [Y|Ys]) :- drlsl_alike(X, Y), drlsl_all_alike(Xs, Ys).

drlsl_all_near([], []).
drlsl_all_near([X|Xs], [Y|Ys]) :- drlsl_near(X, Y), drlsl_all_near(Xs, Ys).

% Numbers are compared by value, whether integers or floats.
@NEAR@

@SCENES@
