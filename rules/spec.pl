% spec.pl - predicates for properties: sides, lanes, gaps and speeds, independent of the rules under test. Loaded by properties.pl
% and dynamics.pl. Facts and units are those at the head of highway.pl; the numbers are repeated on purpose, so that a change of
% the rules is noticed.

:- dynamic(focus/1).

% image(alone, Fact, Goal), focus(Car): a scene with only the ego and one vehicle, which may be any.
image(alone, vehicle(Id, Lane, X, Y, Vx, Vy, Length, Width),
    ( vehicle(Id, Lane, X, Y, Vx, Vy, Length, Width), ( Id == ego -> true ; focus(Id) ) )).

% spec_offered(Side): a lane change to that side is offered.
spec_offered(left) :- safe_actions(left_lane_change).
spec_offered(right) :- safe_actions(right_lane_change).

% spec_direction(Direction), spec_sign(Sign): the direction of the ego's lane, and its sign along x.
spec_direction(Direction) :- vehicle(ego, Lane, _, _, _, _, _, _), road_lane(Lane, Direction, _, _, _).
spec_sign(1) :- spec_direction(left_to_right).
spec_sign(-1) :- spec_direction(right_to_left).

% spec_to_side(Side, Y, D): how far Y is to that side of the middle of the ego's lane.
spec_to_side(right, Y, D) :- vehicle(ego, Lane, _, _, _, _, _, _), road_lane(Lane, _, Y0, _, _), spec_sign(Sign), D is Sign * (Y - Y0).
spec_to_side(left, Y, D) :- spec_to_side(right, Y, Right), D is -Right.

% spec_next_lane(Side, Direction, Low, High): the nearest lane on that side, of either direction, and its range of y.
spec_next_lane(Side, Direction, Low, High) :-
    road_lane(_, Direction, Y, Width, _), spec_to_side(Side, Y, D), D > 0.0,
    \+ ( road_lane(_, _, Y1, _, _), spec_to_side(Side, Y1, D1), D1 > 0.0, D1 < D ),
    Low is Y - Width / 2, High is Y + Width / 2.

% spec_claims(Car, Side): Car's body is in the next lane on that side, or drifts into it within 3 s.
spec_claims(Car, Side) :-
    spec_next_lane(Side, _, Low, High),
    vehicle(Car, _, _, Y, _, Vy, _, Width), Car \== ego,
    min(Y, Y + 3.0 * Vy) - Width / 2 < High, max(Y, Y + 3.0 * Vy) + Width / 2 > Low.

% spec_in_own_lane(Car): Car's body is in the ego's lane, or drifts into it within 3 s.
spec_in_own_lane(Car) :-
    vehicle(ego, Lane, _, _, _, _, _, _), road_lane(Lane, _, Y0, Width0, _),
    vehicle(Car, _, _, Y, _, Vy, _, Width), Car \== ego,
    min(Y, Y + 3.0 * Vy) - Width / 2 < Y0 + Width0 / 2, max(Y, Y + 3.0 * Vy) + Width / 2 > Y0 - Width0 / 2.

% spec_in_path(Car): Car's body overlaps, across the road, the ego's way to the middle of its target lane.
spec_in_path(Car) :-
    vehicle(ego, _, _, Y0, _, _, _, Width0), target_lane(Target), road_lane(Target, _, Centre, _, _),
    vehicle(Car, _, _, Y, _, _, _, Width), Car \== ego,
    Y - Width / 2 < max(Y0, Centre) + Width0 / 2, Y + Width / 2 > min(Y0, Centre) - Width0 / 2.

% spec_gap(Car, Offset, Gap): how far Car's centre is ahead of the ego's, and the gap from bumper to bumper.
spec_gap(Car, Offset, Gap) :-
    vehicle(ego, _, X0, _, _, _, Length0, _), vehicle(Car, _, X, _, _, _, Length, _), spec_sign(Sign),
    Offset is Sign * (X - X0), Gap is abs(Offset) - (Length0 + Length) / 2.

% spec_velocity(Car, V), spec_speed(Car, V): in the ego's direction; for an oncoming vehicle, negative and 0.
spec_velocity(Car, V) :- vehicle(Car, _, _, _, Vx, _, _, _), spec_sign(Sign), V is Sign * Vx.
spec_speed(Car, V) :- spec_velocity(Car, V0), V is max(0.0, V0).

% spec_along(Car, V): Car stands or drives in the ego's direction at speed V.
spec_along(Car, V) :- spec_velocity(Car, V0), V0 >= 0.0, spec_speed(Car, V).

% spec_coming(Car, V): Car is oncoming at speed V.
spec_coming(Car, V) :- spec_velocity(Car, V0), V0 < 0.0, V is -V0.

% spec_rear_stop(V, S): the farthest that a vehicle goes until it stands: 0.35 s at 3 m/s2 until it responds, then braking at
% 6 m/s2.
spec_rear_stop(V, S) :- S is V * 0.35 + 3.0 * 0.35 * 0.35 / 2 + (V + 3.0 * 0.35) * (V + 3.0 * 0.35) / (2 * 6.0).

% spec_critical(Rear, Front, D): the least safe gap behind a front vehicle that brakes at 8 m/s2. Source: RSS (Shalev-Shwartz et
% al. 2017), Definition 1.
spec_critical(Rear, Front, D) :- spec_rear_stop(Rear, S), D is S - Front * Front / (2 * 8.0).

% spec_opposite(V1, V2, D): the least safe gap between two vehicles that drive towards each other. Source: RSS, Definition 2.
spec_opposite(V1, V2, D) :- spec_rear_stop(V1, S1), spec_rear_stop(V2, S2), D is S1 + S2.

% spec_too_near(Car, Offset, Gap): Car is alongside, or within the critical distance of the rear one, or oncoming and too near.
spec_too_near(_, _, Gap) :- Gap =< 0.0.
spec_too_near(Car, Offset, Gap) :-
    Offset > 0.0, spec_speed(ego, V1), spec_speed(Car, V2), spec_critical(V1, V2, Critical), Gap < Critical.
spec_too_near(Car, Offset, Gap) :-
    Offset < 0.0, spec_speed(ego, V1), spec_speed(Car, V2), spec_critical(V2, V1, Critical), Gap < Critical.
spec_too_near(Car, Offset, Gap) :- spec_comes_too_near(Car, Offset, Gap).

% spec_comes_too_near(Car, Offset, Gap): Car is ahead and oncoming, within the distance for opposite directions.
spec_comes_too_near(Car, Offset, Gap) :-
    Offset > 0.0, spec_speed(ego, V1), spec_coming(Car, V2), spec_opposite(V1, V2, Distance), Gap < Distance.

% spec_can_stop(Gap, V1, V2): the ego at speed V1 can stop behind a vehicle that brakes at its hardest from speed V2.
spec_can_stop(Gap, V1, V2) :- Gap > 0.0, spec_stop(V1, S), Gap + V2 * V2 / (2 * 8.0) > S.

% spec_can_stop_after(Gap, V1, V, V2): the same after a step from speed V1 to V, during which that vehicle brakes at its hardest too.
spec_can_stop_after(Gap, V1, V, V2) :- time_step(Dt), spec_stop(V, S), Gap + V2 * V2 / (2 * 8.0) - (V1 + V) / 2 * Dt > S.

% spec_stop(V, S): the distance in which the ego stops by braking at 8 m/s2, or a little more if it stops within a step.
spec_stop(V, S) :- time_step(Dt), V > 4.0 * Dt, S is V * V / (2 * 8.0) + Dt * Dt.
spec_stop(V, S) :- time_step(Dt), V =< 4.0 * Dt, S is V * Dt / 2.

% spec_evading_way(Response, B, V1, V2, T, S): how far a vehicle goes in the time T that keeps its speed V1 for the time Response and
% then brakes by B down to V2; if V1 is not above V2, it keeps its speed.
spec_evading_way(_, _, V1, V2, T, S) :- V1 =< V2, S is V1 * T.
spec_evading_way(Response, _, V1, V2, T, S) :- V1 > V2, T =< Response, S is V1 * T.
spec_evading_way(Response, B, V1, V2, T, S) :-
    V1 > V2, T > Response, T1 is T - Response, B * T1 =< V1 - V2, S is V1 * Response + V1 * T1 - B * T1 * T1 / 2.
spec_evading_way(Response, B, V1, V2, T, S) :-
    V1 > V2, T1 is T - Response, B * T1 > V1 - V2,
    S is V1 * Response + (V1 * V1 - V2 * V2) / (2 * B) + V2 * (T1 - (V1 - V2) / B).
