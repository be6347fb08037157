% crossing.pl - which of highway-env's meta-actions are offered where traffic crosses: intersection-v0, roundabout-v0.
%
% An action is offered if it can be followed by a plan, to stop or to go on, in which the ego comes near to nobody. Others may take any
% branch, and keep their speed, speed up or slow down. The ego enters the crossing only if it can leave it again, stops before
% the line otherwise, and gives way to those who have it.
%
% Lengths are in m, speeds in m/s, times in s. Facts:
%
%   ego(V, Length, Width, Priority, Place)                     Place is approach, inside, exit, or ring_exit on a roundabout
%   car(Id, V, Length, Width, Priority, Place)                 the others; Place is own in the ego's own lane
%   ego_path(Action, Plan, Step, X, Y, Dx, Dy, Past)           where the ego is after so many steps, its direction as a unit vector, and how far
%                                                              its front is past the line: above 0 in the crossing, 0 behind it
%   path(Id, Branch, Manner, Step, X, Y, Dx, Dy)               where another may be; Manner is steady, speeding_up or slowing_down

:- dynamic ego/5, car/6, ego_path/8, path/8.

% ---------------------------------------------------------------------------------------------------- parameters

% room_along(D), room_across(D): the room kept between two vehicles, along the ego's direction and across it.
room_along(0.5).
room_across(0.4).

% gap_time(T): nobody who has the right of way may have to brake: the ego is not nearer in front of it than it drives in this time.
gap_time(0.5).

% last_step(N): the last step of the paths. near_line(D): how far before the line the ego takes up a gap in the traffic.
last_step(8).
near_line(25.0).

% ----------------------------------------------------------------------------------------------------- right of way

% has_way(Car): Car has the right of way over the ego: it is in the crossing already, or comes on a road of higher priority.
has_way(Car) :- ego(_, _, _, _, approach), car(Car, _, _, _, _, inside).
has_way(Car) :- ego(_, _, _, Priority0, approach), car(Car, _, _, _, Priority, approach), Priority > Priority0.

% follows(Car): Car is behind the ego in its lane and keeps its distance.
follows(Car) :-
    car(Car, _, _, _, _, own), ego_path(slower, stop, 1, X, Y, Dx, Dy, _), path(Car, 0, steady, 1, X1, Y1, _, _),
    (X1 - X) * Dx + (Y1 - Y) * Dy < 0.0.

% -------------------------------------------------------------------------------------------------------- conflicts

% conflict(Action, Plan, Car, Step): the ego and Car would be too near at that step.
conflict(Action, Plan, Car, Step) :-
    ego_path(Action, Plan, Step, X1, Y1, Dx1, Dy1, _), path(Car, _, Manner, Step, X2, Y2, Dx2, Dy2),
    Dx is X2 - X1, Dy is Y2 - Y1, abs(Dx) < 12.0, abs(Dy) < 12.0,
    expected(Manner, Alike), Dx1 * Dx2 + Dy1 * Dy2 > Alike,
    \+ follows(Car), car(Car, _, L2, W2, _, _), ego(_, L1, W1, _, _),
    Cos is abs(Dx1 * Dx2 + Dy1 * Dy2), Sin is abs(Dx1 * Dy2 - Dy1 * Dx2), room_along(Along), room_across(Across),
    abs(Dx * Dx1 + Dy * Dy1) < (L1 + L2 * Cos + W2 * Sin) / 2 + Along,
    abs(Dy * Dx1 - Dx * Dy1) < (W1 + L2 * Sin + W2 * Cos) / 2 + Across.
conflict(Action, Plan, Car, Step) :-
    has_way(Car), ego_path(Action, Plan, Step, X1, Y1, Dx1, Dy1, _), path(Car, _, steady, Step, X2, Y2, Dx2, Dy2),
    Dx is X1 - X2, Dy is Y1 - Y2, Ahead is Dx * Dx2 + Dy * Dy2, Ahead > 0.0,
    car(Car, V, L2, W2, _, _), ego(_, L1, W1, _, _), gap_time(T), room_across(Across),
    Cos is abs(Dx1 * Dx2 + Dy1 * Dy2), Sin is abs(Dx1 * Dy2 - Dy1 * Dx2),
    Ahead < (L2 + L1 * Cos + W1 * Sin) / 2 + V * T,
    abs(Dy * Dx2 - Dx * Dy2) < (W2 + L1 * Sin + W1 * Cos) / 2 + Across.

% expected(Manner, Alike): Manner is to be expected of vehicles whose direction is as much like the ego's as this cosine: who drives the ego's
% way may brake for others, who crosses it keeps its speed or speeds up.
expected(steady, -2.0).
expected(speeding_up, -2.0).
expected(slowing_down, 0.7).

% clear(Action, Plan): Action, and Plan after it, come near to nobody.
clear(Action, Plan) :- ego_path(Action, Plan, 1, _, _, _, _, _), \+ conflict(Action, Plan, _, _).

% safe(Action): the ego can go on through the crossing after Action, or come to stand before the line, or behind the crossing.
safe(Action) :- clear(Action, go).
safe(Action) :- clear(Action, through), last_step(N), ego_path(Action, through, N, _, _, _, _, Past), Past =< 0.0.
safe(Action) :- clear(Action, stop), last_step(N), ego_path(Action, stop, N, _, _, _, _, Past), Past =< 0.0.

% ------------------------------------------------------------------------------------------------------------ actions

% gap_is_free: the ego is at the line of an intersection, past it or on its way out, and can go. Then it does not stand or dawdle there.
gap_is_free :- ego(_, _, _, _, exit), clear(faster, go).
gap_is_free :- ego_path(slower, stop, 1, _, _, _, _, Past), near_line(D), Past > -D, Past =\= 0.0, clear(faster, go).

% offered(Action): what is safe; without it what comes to stand near nobody, wherever; without it what postpones a conflict longest.
offered(Action) :- safe(Action), \+ dawdles(Action).
offered(Action) :- \+ safe(_), clear(Action, stop), \+ (Action \== slower, clear(slower, stop)).
offered(Action) :- \+ safe(_), \+ clear(_, stop), latest(Action).

% dawdles(Action): Action leaves a free gap unused.
dawdles(slower) :- gap_is_free.
dawdles(idle) :- gap_is_free.

% first(Action, Plan, Step): the step of the first conflict. latest(Action): no action has a later one.
first(Action, Plan, Step) :- ego_path(Action, Plan, 1, _, _, _, _, _), aggregate_all(min(S), conflict(Action, Plan, _, S), Step).
latest(Action) :- aggregate_all(max(S), first(_, _, S), Best), first(Action, _, Best).

% objection(Action, Reason): why Action is not offered.
objection(Action, conflict(Plan, Car, Step)) :- unsafe(Action), conflict(Action, Plan, Car, Step).
objection(Action, stops_in_the_crossing) :- unsafe(Action), clear(Action, stop).
objection(Action, gap_is_free) :- dawdles(Action).

% unsafe(Action): an action of those that do anything that is not safe.
unsafe(Action) :- ego_path(Action, stop, 1, _, _, _, _, _), \+ safe(Action).
