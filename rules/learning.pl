% learning.pl - what drlsl rules learn builds rules from: highway.pl, and quantities of which more, or less, is never less safe.
%
%   learn(Quantity, Direction)   a quantity that learnt clauses may limit, and whether more or less of it is safer
%
% Quantity is a goal without its last argument, the number. A variable in it stands for the side of the lane change. A clause limits
% the number in all solutions, one for each vehicle in the way: forall(gap(Side, behind, Value), Value >= 20.0).
% Lengths are in m, speeds in m/s, times in s.

:- ensure_loaded('highway.pl').

learn(gap(_, behind), more, 0.5).
learn(gap(_, ahead), more, 0.5).
learn(gap(_, beyond), more, 1.0).
learn(gap(_, follower), more, 1.0).
learn(closing(_, behind), less, 0.5).
learn(closing(_, ahead), less, 0.5).
learn(headway(_, behind), more, 0.1).
learn(headway(_, ahead), more, 0.1).
learn(time_to_collision(_, behind), more, 0.2).
learn(time_to_collision(_, ahead), more, 0.2).

% end(End, Car): Car's centre is at that end of the ego: behind its centre or ahead of it.
end(behind, Car) :- offset(Car, S), S < 0.0.
end(ahead, Car) :- offset(Car, S), S >= 0.0.

% claims(Car, Side, End): Car is in the way of Side, at that end of the ego.
claims(Car, Side, End) :- target_vehicle(Car), in_way(Car, Side), end(End, Car).

% gap(Side, End, Gap): the gap to a vehicle from bumper to bumper; not above 0 where it is alongside.
gap(Side, End, Gap) :- claims(Car, Side, End), gap(Car, Gap).

gap(Side, beyond, Gap) :- beyond(Car, Side), gap(Car, Gap).
gap(_, follower, Gap) :- claims(Car, own, behind), gap(Car, Gap).

% beyond(Car, Side): Car's centre is in the lane beyond the target lane of that side, from where it may come into that lane, too.
beyond(Car, Side) :-
    side_lane(Side, Lane), road_lane(Lane, Direction, Y0, Width0, _),
    road_lane(Other, Direction, Y, Width, _), Other =\= Lane, \+ lane(ego, Other), abs(Y - Y0) < 0.75 * (Width0 + Width),
    target_vehicle(Car), lane(Car, Other).

% closing(Side, End, V): how fast the gap to a vehicle shrinks; negative where it grows.
closing(Side, End, V) :- claims(Car, Side, End), approach(End, Car, V).

% approach(End, Car, V): how fast the gap to Car at that end shrinks.
approach(behind, Car, V) :- velocity(Car, V1), speed(ego, V0), V is V1 - V0.
approach(ahead, Car, V) :- velocity(Car, V1), speed(ego, V0), V is V0 - V1.

% headway(Side, End, T): the gap to a vehicle divided by the speed of the rear one, which counts as 1 m/s at least.
headway(Side, behind, T) :- claims(Car, Side, behind), gap(Car, Gap), speed(Car, V), T is Gap / max(1.0, V).
headway(Side, ahead, T) :- claims(Car, Side, ahead), gap(Car, Gap), speed(ego, V), T is Gap / max(1.0, V).

% time_to_collision(Side, End, T): the gap to a vehicle that comes nearer, by more than 1 m/s, divided by how fast it does.
time_to_collision(Side, End, T) :- claims(Car, Side, End), approach(End, Car, V), V > 1.0, gap(Car, Gap), T is Gap / V.

% critical_change: on its way to the target lane, the ego is within the distance that highway.pl needs to a vehicle in that lane. The
% label rss calls a lane change unsafe in which this comes to hold.
critical_change :-
    target_lane(Lane), lane_strip(Lane, Low, High),
    target_vehicle(Car), vehicle(Car, _, _, Y, _, _, _, Width), Y - Width / 2 < High, Y + Width / 2 > Low,
    gap(Car, Gap), needed_gap(Car, Needed), Gap < Needed.
