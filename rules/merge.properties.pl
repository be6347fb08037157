% merge.properties.pl - what must hold in every scene where lanes may end, besides most of properties.pl.
%
% Of properties.pl, some_action, nothing_hidden and oncoming_is_no_better do not hold here, and should not: keeping the lane is not
% offered where a lane that ends must be left, and is offered again if another vehicle is in the way. The first two properties replace
% them. docs/verify.md ("Where a lane ends") says what the properties mean together.
%
%   property(Name, Text), violates(Name)   a property, and that a scene breaks it, as in properties.pl
%   unknown(Name, Low, High, Text)         any number from Low to High, as in dynamics.pl
%   lane_end(Lane, X)                      Lane ends at X

:- ensure_loaded('properties.pl').

:- dynamic(lane_end/2).
:- dynamic(ego_speed_then/1).
:- dynamic(room_left/1).
:- dynamic(reached_speed/1).

unknown(ego_speed_then, 0, 70, 'the ego''s speed, m/s').
unknown(room_left, -1000, 1000, 'room up to the end of a lane, m').
unknown(reached_speed, 0, 71, 'the ego''s speed after a step, m/s').

property(some_action_or_other, 'some action is always offered').
violates(some_action_or_other) :- \+ safe_actions(_).

property(no_change_hidden, 'a vehicle that alone, or standing, would forbid a lane change forbids it among others, or oncoming, too').
violates(no_change_hidden) :- spec_change(Action), safe_actions(Action), \+ in(alone, safe_actions(Action)).
violates(no_change_hidden) :- spec_change(Action), safe_actions(Action), \+ in(standing, safe_actions(Action)).

property(leaves_in_time,
    'keeping a lane is not offered if it ends in less than the ego''s way in 5 s and that of a stop, and a lane change is offered').
violates(leaves_in_time) :-
    safe_actions(lane_keeping), spec_change(Action), safe_actions(Action), spec_own_end(Room), spec_speed(ego, V),
    Room < V * 5.0 + V * V / (2 * 6.0).

property(keeps_otherwise, 'keeping the lane is offered in a lane that goes on, and wherever no lane change is').
violates(keeps_otherwise) :- \+ safe_actions(lane_keeping), \+ spec_own_end(_).
violates(keeps_otherwise) :- \+ safe_actions(lane_keeping), \+ ( spec_change(Action), safe_actions(Action) ).

property(into_no_lane_that_ends, 'a lane change into a lane that ends is only offered from one that ends sooner').
violates(into_no_lane_that_ends) :-
    spec_offered(Side), spec_next_lane(Side, _, Low, High), road_lane(Lane, _, Y, _, _), Y > Low, Y < High,
    spec_ends(Lane, Room), \+ ( spec_own_end(Own), Own < Room ).

property(can_stop_at_entry_of_ramp, 'where the ego enters the road, it can stop before the end of its lane').
violates(can_stop_at_entry_of_ramp) :-
    entry_is_safe, spec_own_end(Room), spec_speed(ego, V), \+ spec_can_stop(Room, V, 0.0).

property(heeds_every_end,
    'the target speed is not above the one before a standing vehicle where a lane ends that the ego''s body is in, or will be').
violates(heeds_every_end) :-
    spec_end_in_path(Room), spec_speed(ego, V1), follow(Room, V1, 0.0, A), spec_step(V1, A, V), longitudinal_velocity(Most), Most > V.

property(can_stop_before_end, 'if the ego can stop before an end, it still can after a step to at most that speed').
violates(can_stop_before_end) :-
    ego_speed_then(V1), room_left(Room), spec_can_stop(Room, V1, 0.0), follow(Room, V1, 0.0, A), spec_step(V1, A, Most),
    reached_speed(V), time_step(Dt), V >= V1 - 8.0 * Dt, V =< Most, \+ spec_can_stop_after(Room, V1, V, 0.0).

property(brakes_fully_before_end, 'if the ego cannot stop before an end, that speed is the one of full braking').
violates(brakes_fully_before_end) :-
    ego_speed_then(V1), room_left(Room), \+ spec_can_stop(Room, V1, 0.0), follow(Room, V1, 0.0, A), spec_step(V1, A, Most),
    spec_step(V1, -8.0, Least), Most > Least.

% spec_step(V, A, V1): the speed after a step with acceleration A, at the hardest -8 m/s2, that ends at standstill.
spec_step(V, A, V1) :- time_step(Dt), V1 is max(0.0, V + max(-8.0, A) * Dt).

% spec_change(Action): Action is a lane change.
spec_change(left_lane_change).
spec_change(right_lane_change).

% spec_ends(Lane, Room): Lane ends Room ahead of the ego's front bumper.
spec_ends(Lane, Room) :-
    lane_end(Lane, X), vehicle(ego, _, X0, _, _, _, Length, _), spec_sign(Sign), Room is Sign * (X - X0) - Length / 2.

% spec_own_end(Room): the ego's lane does.
spec_own_end(Room) :- vehicle(ego, Lane, _, _, _, _, _, _), spec_ends(Lane, Room).

% spec_end_in_path(Room): a lane does that is of the ego's direction and overlaps, across the road, the ego's way to the middle of its
% target lane.
spec_end_in_path(Room) :-
    vehicle(ego, _, _, Y0, _, _, _, Width0), target_lane(Target), road_lane(Target, _, Centre, _, _),
    spec_direction(Direction), spec_ends(Lane, Room), road_lane(Lane, Direction, Y, Width, _),
    Y - Width / 2 < max(Y0, Centre) + Width0 / 2, Y + Width / 2 > min(Y0, Centre) - Width0 / 2.

% image(turned, Fact, Goal): adds the ends of lanes to the scene of properties.pl that is seen from the other side of the road.
image(turned, lane_end(Lane, X1), ( lane_end(Lane, X), X1 is -X )).
