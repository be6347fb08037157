% properties.pl - what must hold in every scene, for any rules: proved by drlsl rules verify.
%
%   property(Name, Text)        a property and its meaning
%   violates(Name)              the scene breaks the property
%   image(Image, Fact, Goal)    another scene, in which Fact holds where Goal holds here; in(Image, Goal) queries Goal in it
%   focus(Car)                  any one of the vehicles
%   range(Quantity, Low, High)  narrows or widens a range; docs/verify.md lists the ranges
%
% Facts and units are those at the head of highway.pl. Of the rules under test, only the predicates that every rule program must
% have are used; the numbers are repeated on purpose, so that a change of the rules is noticed.

:- ensure_loaded('spec.pl').

:- discontiguous(property/2).
:- discontiguous(violates/1).

% Lane changes

property(lane_exists, 'a lane change is only offered to a side where the road has a lane').
violates(lane_exists) :- spec_offered(Side), \+ spec_next_lane(Side, _, _, _).

property(own_direction, 'a lane change is only offered into a lane of the ego''s direction').
violates(own_direction) :- spec_offered(Side), spec_next_lane(Side, Direction, _, _), \+ spec_direction(Direction).

property(one_change_at_a_time, 'no lane change is offered while the ego is changing lanes').
violates(one_change_at_a_time) :- spec_offered(_), target_lane(Target), vehicle(ego, Lane, _, _, _, _, _, _), Target =\= Lane.

property(nobody_alongside, 'no lane change is offered with a vehicle alongside in, or drifting into, the target lane').
violates(nobody_alongside) :- spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, _, Gap), Gap =< 0.0.

property(critical_distance_front, 'no lane change is offered with a vehicle ahead in the target lane within its critical distance').
violates(critical_distance_front) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), Offset > 0.0,
    spec_speed(ego, V1), spec_speed(Car, V2), spec_critical(V1, V2, Critical), Gap < Critical.

property(critical_distance_back, 'no lane change is offered with a vehicle behind in the target lane within its critical distance').
violates(critical_distance_back) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), Offset < 0.0,
    spec_speed(ego, V1), spec_speed(Car, V2), spec_critical(V2, V1, Critical), Gap < Critical.

property(opposite_distance,
    'no lane change is offered with an oncoming vehicle in the target lane within the distance for opposite directions').
violates(opposite_distance) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), spec_comes_too_near(Car, Offset, Gap).

property(oncoming_is_no_better, 'an oncoming vehicle forbids every lane change that it would forbid if it stood').
violates(oncoming_is_no_better) :- safe_actions(Action), \+ in(standing, safe_actions(Action)).

property(nothing_hidden, 'a vehicle that alone would forbid a lane change forbids it among others too').
violates(nothing_hidden) :- safe_actions(Action), \+ in(alone, safe_actions(Action)).

property(some_action, 'keeping the lane is always offered').
violates(some_action) :- \+ safe_actions(lane_keeping).

property(lane_to_keep, 'lane keeping steers for the target lane or for the lane that the ego is in').
violates(lane_to_keep) :- \+ lane_to_keep(_).
violates(lane_to_keep) :-
    lane_to_keep(Lane), target_lane(Target), vehicle(ego, Home, _, _, _, _, _, _), Lane =\= Target, Lane =\= Home.

property(safe_entry, 'the ego never enters the road alongside a vehicle of its lane, or within one of these distances').
violates(safe_entry) :- entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), spec_too_near(Car, Offset, Gap).

% Speed

property(speed_in_limits,
    'there is a target speed, not negative and not above the lane''s limit; a faster ego brakes at least comfortably (2 m/s2)').
violates(speed_in_limits) :- \+ longitudinal_velocity(_).
violates(speed_in_limits) :- longitudinal_velocity(V), V < 0.0.
violates(speed_in_limits) :-
    longitudinal_velocity(V), vehicle(ego, Lane, _, _, _, _, _, _), road_lane(Lane, _, _, _, Limit), V > Limit,
    spec_speed(ego, V0), time_step(Dt), V > V0 - 2.0 * Dt.

property(acceleration_in_limits, 'the target speed is never above what the ego can reach').
violates(acceleration_in_limits) :-
    longitudinal_velocity(V), spec_speed(ego, V0), acceleration_limit(A), time_step(Dt), V > V0 + A * Dt.

property(gives_way, 'with a vehicle ahead within the distance for its direction the target speed is below the ego''s, or 0').
violates(gives_way) :-
    longitudinal_velocity(V), V > 0.0, spec_speed(ego, V1), V >= V1,
    spec_in_path(Car), spec_gap(Car, Offset, Gap), Gap > 0.0, spec_too_near(Car, Offset, Gap), Offset > 0.0.

property(nobody_overlooked, 'the target speed is not above the one that any vehicle alone requires').
violates(nobody_overlooked) :- longitudinal_velocity(V), in(alone, longitudinal_velocity(V1)), V > V1.

property(front_is_free, 'the front is free exactly where no vehicle alone makes it busy').
violates(front_is_free) :- front_is_free, \+ in(alone, front_is_free).

% Observation, symmetry

% Programs without state_names/1 and state_bounds/1 have those of the paper: ten numbers from 0 to 1.
property(observation_in_range, 'the observation is a number for each name, within its bounds').
violates(observation_in_range) :- state_bounds(Bounds), \+ ( state(Numbers), spec_within(Numbers, Bounds) ).

property(left_is_as_right, 'in the mirror image, left and right change places and nothing else changes').
violates(left_is_as_right) :- spec_mirrored_action(Action, Other), safe_actions(Action), \+ in(mirrored, safe_actions(Other)).
violates(left_is_as_right) :- spec_mirrored_action(Action, Other), in(mirrored, safe_actions(Action)), \+ safe_actions(Other).
violates(left_is_as_right) :- longitudinal_velocity(V), in(mirrored, longitudinal_velocity(V1)), V =\= V1.
violates(left_is_as_right) :-
    state_names(Names), state(Numbers), in(mirrored, state(Others)), \+ spec_mirrored(Names, Numbers, Names, Others).

property(both_directions_alike, 'with the road turned round nothing changes').
violates(both_directions_alike) :- safe_actions(Action), \+ in(turned, safe_actions(Action)).
violates(both_directions_alike) :- in(turned, safe_actions(Action)), \+ safe_actions(Action).
violates(both_directions_alike) :- longitudinal_velocity(V), in(turned, longitudinal_velocity(V1)), V =\= V1.
violates(both_directions_alike) :-
    state(Numbers), in(turned, state(Others)), \+ spec_alike(Numbers, Others).

% spec_within(Numbers, Bounds): there is a number for each of the bounds, and it lies within.
spec_within([], []).
spec_within([Number|Numbers], [Low - High|Bounds]) :- Number >= Low, Number =< High, spec_within(Numbers, Bounds).

% spec_alike(Numbers, Others): the numbers are equal one by one.
spec_alike([], []).
spec_alike([Number|Numbers], [Other|Others]) :- Number =:= Other, spec_alike(Numbers, Others).

% spec_mirrored(Names, Numbers, OtherNames, Others): each number equals the one of the other name that is its mirror image.
spec_mirrored([], [], _, _).
spec_mirrored([Name|Names], [Number|Numbers], OtherNames, Others) :-
    ( spec_mirrored_name(Name, Other) -> spec_named(Other, OtherNames, Others, Number1), Number =:= Number1 ; true ),
    spec_mirrored(Names, Numbers, OtherNames, Others).

% spec_named(Name, Names, Numbers, Number): the number of this name.
spec_named(Name, [Name|_], [Number|_], Number).
spec_named(Name, [_|Names], [_|Numbers], Number) :- spec_named(Name, Names, Numbers, Number).

% Images; spec.pl has "alone" too

% mirrored: the scene in a mirror along the road.
image(mirrored, vehicle(Id, Lane, X, Y1, Vx, Vy1, Length, Width),
    ( vehicle(Id, Lane, X, Y, Vx, Vy, Length, Width), Y1 is -Y, Vy1 is -Vy )).
image(mirrored, road_lane(Lane, Direction, Y1, Width, Limit),
    ( road_lane(Lane, Direction, Y, Width, Limit), Y1 is -Y )).

% standing: the scene with all oncoming vehicles standing.
image(standing, vehicle(Id, Lane, X, Y, Vx1, Vy, Length, Width),
    ( vehicle(Id, Lane, X, Y, Vx, Vy, Length, Width), spec_sign(Sign), Vx1 is Sign * max(0.0, Sign * Vx) )).

% turned: the scene seen from the other side of the road.
image(turned, vehicle(Id, Lane, X1, Y1, Vx1, Vy1, Length, Width),
    ( vehicle(Id, Lane, X, Y, Vx, Vy, Length, Width), X1 is -X, Y1 is -Y, Vx1 is -Vx, Vy1 is -Vy )).
image(turned, road_lane(Lane, Direction1, Y1, Width, Limit),
    ( road_lane(Lane, Direction, Y, Width, Limit), Y1 is -Y, spec_turned(Direction, Direction1) )).

% spec_turned(Direction, Other): the other direction.
spec_turned(left_to_right, right_to_left).
spec_turned(right_to_left, left_to_right).

% spec_mirrored_action(Action, Other): Other is the mirror image of Action.
spec_mirrored_action(lane_keeping, lane_keeping).
spec_mirrored_action(left_lane_change, right_lane_change).
spec_mirrored_action(right_lane_change, left_lane_change).

% spec_mirrored_name(Name, Other): what is Name of an observation is Other in the mirror image; the place of the lane has no such name.
spec_mirrored_name(front, front).
spec_mirrored_name(back, back).
spec_mirrored_name(speed, speed).
spec_mirrored_name(front_faster, front_faster).
spec_mirrored_name(back_faster, back_faster).
spec_mirrored_name(own_limit, own_limit).
spec_mirrored_name(left, right).
spec_mirrored_name(right, left).
spec_mirrored_name(front_left, front_right).
spec_mirrored_name(front_right, front_left).
spec_mirrored_name(back_left, back_right).
spec_mirrored_name(back_right, back_left).
spec_mirrored_name(front_left_faster, front_right_faster).
spec_mirrored_name(front_right_faster, front_left_faster).
spec_mirrored_name(back_left_faster, back_right_faster).
spec_mirrored_name(back_right_faster, back_left_faster).
spec_mirrored_name(left_limit, right_limit).
spec_mirrored_name(right_limit, left_limit).
spec_mirrored_name(left_offered, right_offered).
spec_mirrored_name(right_offered, left_offered).
