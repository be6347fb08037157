% straight_road.pl - which of highway-env's five meta-actions are offered on a road along x: highway-v0, highway-fast-v0, merge-v0.
%
% The ego cannot go slower than the least of its speeds, however slow the vehicle in front is. So it is not enough to brake in time: it
% must not come behind such a vehicle without a way out, and must take the way out while there is one.
%
% Lengths are in m, speeds in m/s, accelerations in m/s2, times in s. y grows to the right of travel. Facts:
%
%   ego(X, Y, Vx, Vy, Length, Width)                        the centre of the ego, its velocity and size
%   vehicle(Id, X, Y, Vx, Vy, Length, Width, Goal, Sees)    whatever is within 100 m along the road, things that stand in the way too; Goal is
%                                                           the Y of the lane that it must come over to because its own ends, or its own Y;
%                                                           Sees is no of a driver who does not see the ego, for it is on another segment
%   aim(Action, Y, V)                                       the actions that do anything, with the centre line and the speed that each steers for
%   speeds(Low, Step)                                       the least of the ego's speeds, and the distance between them
%   period(T, Fade)                                         the time from decision to decision, and what is left after it of the difference
%                                                           between the ego's speed and the one that it steers for, 1 being all

:- dynamic ego/6, vehicle/9, aim/3, speeds/2, period/2.

% Parameters

% lag(T): the ego's speed approaches the one that it steers for with this time constant. Source: ControlledVehicle.TAU_ACC.
lag(0.6).

% room(Part, D), braking(Part, B): the room to keep to a vehicle ahead, and how hard it may brake, in the lane where the ego stays, in the
% lane that it leaves, and beside a vehicle that may cut in. Vehicles brake by up to 6 m/s2, but rarely for long.
room(stays, 3.0).
room(leaves, 2.0).
room(squeezes, 0.5).
room(beside, 2.0).
braking(stays, 5.0).
braking(leaves, 3.0).
braking(squeezes, 3.0).
braking(beside, 3.0).

% time_in(Part, T): for how long a vehicle ahead there concerns the ego. It has left a lane within 1.2 s, and just clears a body within 0.8 s.
time_in(leaves, 1.2).
time_in(squeezes, 0.8).
time_in(beside, 2.0).

% room_behind(D), follower_time(T), follower_braking(B): the room for a vehicle behind, which brakes after T by B.
room_behind(3.0).
follower_time(0.7).
follower_braking(3.0).

% side_margin(M): the room between the sides of two vehicles that pass. drift_time(T): for how long a sideways motion is extrapolated.
side_margin(0.5).
drift_time(1.5).

% beside(D): the distance between centre lines at which a vehicle is in the same lane or the next.
beside(5.0).

% patience(T): a slower vehicle that the ego would reach sooner than this is one that it must get away from.
patience(20.0).

% lane_change(Action): Action steers for another lane.
lane_change(lane_left).
lane_change(lane_right).

% Ways along the road

% way(V0, V, T, Fade, S), speed_after(V0, V, Fade, V1): how far the ego comes in T from V0 if it steers for V, and how fast it is then, where
% Fade is what is left after T of the difference of speeds.
way(V0, V, T, Fade, S) :- lag(L), S is V * T + (V0 - V) * L * (1.0 - Fade).
speed_after(V0, V, Fade, V1) :- V1 is V + (V0 - V) * Fade.

% ego_way(Action, Part, T, S): how far the ego comes within T. Where it stays that is three decisions: Action, and then as slow as it can.
ego_way(Action, stays, T, S) :-
    ego(_, _, V0, _, _, _), aim(Action, _, A), speeds(Low, Step), period(P, Fade), T is 3 * P,
    way(V0, A, P, Fade, S1), speed_after(V0, A, Fade, V1), B is max(Low, A - Step),
    way(V1, B, P, Fade, S2), speed_after(V1, B, Fade, V2), C is max(Low, B - Step),
    way(V2, C, P, Fade, S3), S is S1 + S2 + S3.
ego_way(Action, Part, T, S) :-
    ego(_, _, V0, _, _, _), aim(Action, _, V), time_in(Part, T), lag(L), Fade is exp(-T / L), way(V0, V, T, Fade, S).

% braking_way(V, B, T, S): how far a vehicle comes within T if it brakes by B.
braking_way(V, B, T, S) :- T1 is min(T, max(V, 0.0) / B), S is max(V, 0.0) * T1 - B * T1 * T1 / 2.

% gap(Car, Gap): the gap from bumper to bumper.
gap(Car, Gap) :- ego(X1, _, _, _, L1, _), vehicle(Car, X2, _, _, _, L2, _, _, _), Gap is abs(X2 - X1) - (L1 + L2) / 2.

% strip(Action, Part, Low, High): the range of y that the ego needs: of the lane that it aims at, and on the way there.
strip(Action, stays, Low, High) :-
    ego(_, _, _, _, _, W), aim(Action, Y, _), side_margin(M), Low is Y - W / 2 - M, High is Y + W / 2 + M.
strip(Action, leaves, Low, High) :-
    ego(_, Y0, _, _, _, W), aim(Action, Y, _), side_margin(M), abs(Y0 - Y) > M,
    Low is min(Y0, Y) - W / 2 - M, High is max(Y0, Y) + W / 2 + M.

% band(Car, Low, High): the range of y that Car is in, drifts to or comes over to.
band(Car, Low, High) :-
    vehicle(Car, _, Y, _, Vy, _, W, Goal, _), drift_time(T), Drifted is Y + Vy * T,
    Low is min(Goal, min(Y, Drifted)) - W / 2, High is max(Goal, max(Y, Drifted)) + W / 2.

% in_way(Action, Part, Car): Car is, or will be, in the strip.
in_way(Action, Part, Car) :- strip(Action, Part, Low, High), band(Car, Low1, High1), Low1 < High, High1 > Low.

% ahead(Action, Part, Car, V, Gap): Car is in the way in front of the ego's centre.
ahead(Action, Part, Car, V, Gap) :-
    ego(X1, _, _, _, _, _), vehicle(Car, X2, _, V, _, _, _, _, _), X2 >= X1, in_way(Action, Part, Car), gap(Car, Gap).

% Dangers

% needed(Action, Part, V, Gap): the gap that the ego needs to a vehicle ahead that drives at V.
needed(Action, Part, V, Gap) :-
    ego_way(Action, Part, T, S1), braking(Part, B), braking_way(V, B, T, S2), room(Part, D), Gap is max(0.0, S1 - S2) + D.

% danger(Action, Reason): Action is not safe. A vehicle beyond the lane that the ego changes to may change to it at the same time.
danger(Action, too_near_ahead(Car, Gap, Needed)) :- too_near(Action, _, Car, Gap, Needed).
danger(Action, too_near_behind(Car, Gap, Needed)) :- too_near_behind(Action, Car, Gap, Needed).
danger(Action, may_cut_in(Car, Gap, Needed)) :-
    vehicle(Car, X2, Y2, V, _, _, _, _, no), ego(X1, _, _, _, _, _), X2 >= X1, aim(Action, Y, _),
    beside(D), abs(Y2 - Y) < D, gap(Car, Gap), needed(Action, beside, V, Needed), Gap < Needed.

danger(Action, may_meet(Car, Gap, Needed)) :-
    lane_change(Action), ego(X1, Y1, _, _, _, _), aim(Action, Y, _), vehicle(Car, X2, Y2, V, _, _, _, _, _),
    (Y2 - Y) * (Y - Y1) > 0.0, beside(D), abs(Y2 - Y) < D, gap(Car, Gap),
    ( X2 >= X1 -> needed(Action, beside, V, Needed) ; room(beside, Needed) ), Gap < Needed.

% too_near(Action, Part, Car, Gap, Needed), too_near_behind(Action, Car, Gap, Needed): the gap to Car, ahead or behind, is less than needed.
too_near(Action, Part, Car, Gap, Needed) :- ahead(Action, Part, Car, V, Gap), needed(Action, Part, V, Needed), Gap < Needed.

too_near_behind(Action, Car, Gap, Needed) :-
    lane_change(Action), ego(X1, _, V1, _, _, _), vehicle(Car, X2, _, V2, _, _, _, _, _), X2 < X1, in_way(Action, stays, Car),
    aim(Action, _, V), gap(Car, Gap), follower_time(T), follower_braking(B), room_behind(D),
    Closing is max(0.0, V2 - min(V1, V)), Needed is Closing * T + Closing * Closing / (2 * B) + D, Gap < Needed.

% safe(Action): Action is in no danger.
safe(Action) :- aim(Action, _, _), \+ danger(Action, _).

% Vehicles that are too slow

% reached(Action, Car, T): the time until the ego, at its slowest, is at the bumper of a vehicle ahead that is slower.
reached(Action, Car, T) :- speeds(Low, _), ahead(Action, stays, Car, V, Gap), V < Low, room(leaves, D), T is max(0.0, Gap - D) / (Low - V).

% trapped(Action, Car, T): Action leaves the ego behind a vehicle that it will reach before long.
trapped(Action, Car, T) :- patience(P), reached(Action, Car, T), T < P.

% good(Action): Action is safe and leads behind no vehicle that is too slow.
good(Action) :- action(Action), safe(Action), \+ trapped(Action, _, _).

% way_out(Action): a lane change that gains time where no action is good; if none is safe, one that beats running into the vehicle ahead.
way_out(Action) :-
    lane_change(Action), safe(Action), aggregate_all(min(T), reached(slower, _, T), T0), \+ sooner(Action, T0).
way_out(Action) :-
    \+ safe(_), lane_change(Action), aim(Action, _, _), aggregate_all(min(T), contact(slower, T), T0), \+ contact_sooner(Action, T0),
    \+ too_near_behind(Action, _, _, _), \+ squeezed(Action).

% sooner(Action, T0), contact_sooner(Action, T0): Action gains less than a second on T0.
sooner(Action, T0) :- patience(P), reached(Action, _, T), T < min(P, T0 + 1.0).
contact_sooner(Action, T0) :- patience(P), contact(Action, T), T < min(P, T0 + 1.0).

% contact(Action, T): the time until the ego, at its speed, is at the bumper of a vehicle ahead.
contact(Action, T) :-
    ahead(Action, stays, _, V2, Gap), ego(_, _, V0, _, _, _), aim(Action, _, V), room(leaves, D),
    T is max(0.0, Gap - D) / max(0.1, max(V0, V) - V2).

% squeezed(Action): the ego would touch a vehicle that it passes on its way into the other lane.
squeezed(Action) :-
    ahead(Action, leaves, _, V, Gap), ego_way(Action, squeezes, T, S1), braking(squeezes, B), braking_way(V, B, T, S2), room(squeezes, D),
    Gap < S1 - S2 + D.

% Actions

% offered(Action): all good actions; without one the ways out; without one to go slower.
offered(Action) :- good(Action).
offered(Action) :- \+ good(_), way_out(Action).
offered(slower) :- \+ good(_), \+ way_out(_).

% objection(Action, Reason): why Action is not offered.
objection(Action, Reason) :- danger(Action, Reason).
objection(Action, reaches_slow_vehicle(Car, T)) :- trapped(Action, Car, T).
objection(Action, no_effect) :- action(Action), \+ aim(Action, _, _).

% action(Action): the five meta-actions.
action(lane_left).
action(idle).
action(lane_right).
action(faster).
action(slower).
