% straight_road_learning.pl - what drlsl rules learn --domain highway_env builds rules from: gaps and closing speeds in the lanes.
%
% The facts and the ways of telling who is in the way are those of straight_road.pl; its conclusions are not used.

:- ensure_loaded('straight_road.pl').
:- abolish(action/1).

learn(lane_change(_), either).
learn(gap(_, ahead), more, 1.0).
learn(gap(_, behind), more, 1.0).
learn(gap(_, passed), more, 1.0).
learn(gap(_, beyond), more, 1.0).
learn(closing(_, ahead), less, 1.0).
learn(closing(_, behind), less, 1.0).
learn(time(_, ahead), more, 0.5).
learn(time(_, behind), more, 0.5).
learn(time(_, passed), more, 0.5).

% action(Action): the actions that do anything.
action(Action) :- aim(Action, _, _).

% at(Action, Place, Car): Car is ahead or behind in the lane that Action aims at, passed on the way there, or beyond that lane.
at(Action, ahead, Car) :- ahead(Action, stays, Car, _, _).
at(Action, behind, Car) :- ego(X1, _, _, _, _, _), vehicle(Car, X2, _, _, _, _, _, _, _), X2 < X1, in_way(Action, stays, Car).
at(Action, passed, Car) :- ahead(Action, leaves, Car, _, _).
at(Action, beyond, Car) :-
    lane_change(Action), ego(_, Y1, _, _, _, _), aim(Action, Y, _), vehicle(Car, _, Y2, _, _, _, _, _, _),
    (Y2 - Y) * (Y - Y1) > 0.0, beside(D), abs(Y2 - Y) < D.

% gap(Action, Place, Gap): the gap from bumper to bumper.
gap(Action, Place, Gap) :- at(Action, Place, Car), gap(Car, Gap).

% closing(Action, Place, V): how fast that gap shrinks at the speed that Action steers for.
closing(Action, Place, V) :- at(Action, Place, Car), vehicle(Car, _, _, V2, _, _, _, _, _), aim(Action, _, V1), approach(Place, V1, V2, V).

% approach(Place, V1, V2, V): how fast the gap to a vehicle at V2 shrinks at V1.
approach(ahead, V1, V2, V) :- V is V1 - V2.
approach(passed, V1, V2, V) :- V is V1 - V2.
approach(behind, V1, V2, V) :- V is V2 - V1.

% time(Action, Place, T): the time until that gap is gone, if it shrinks by more than 0.5 m/s.
time(Action, Place, T) :-
    at(Action, Place, Car), vehicle(Car, _, _, V2, _, _, _, _, _), aim(Action, _, V1), approach(Place, V1, V2, V), V > 0.5,
    gap(Car, Gap), T is max(0.0, Gap) / V.

% otherwise(Action): where no action is learnt to be safe, those that leave the most time.
otherwise(Action) :- soonest(Action, T), \+ ( soonest(_, More), More > T + 0.01 ).

% soonest(Action, T): the least time until some gap is gone; 100 s without one.
soonest(Action, T) :- action(Action), aggregate_all(min(One), time(Action, _, One), T).
soonest(Action, 100.0) :- action(Action), \+ time(Action, _, _).
