% overtake_left.properties.pl - what must hold in every scene where overtaking is on the left, besides most of properties.pl.
%
% Of properties.pl, left_is_as_right, nothing_hidden and oncoming_is_no_better do not hold here, and should not: the law
% distinguishes left from right; what a vehicle on the left forbids alone may be allowed behind a leader on the right; and
% an oncoming vehicle is not overtaken. The last two properties replace the first two.
%
%   property(Name, Text), violates(Name)   a property, and that a scene breaks it, as in properties.pl

:- ensure_loaded('properties.pl').

property(no_overtaking_on_the_right,
    'no lane change to the right is offered that lets the ego pass, within 20 s, a vehicle on its left that is not slow').
violates(no_overtaking_on_the_right) :-
    safe_actions(right_lane_change), spec_could_pass(Car, 0.0), spec_speed(Car, V), V > 60 / 3.6.

property(slowly_past_a_queue,
    'no lane change to the right is offered that lets the ego pass a vehicle on its left within 20 s, over 20 km/h faster').
violates(slowly_past_a_queue) :- safe_actions(right_lane_change), spec_could_pass(_, 20 / 3.6).

property(only_past_a_queue,
    'no lane change to the right is offered that lets the ego pass a vehicle on its left within 20 s, unless behind two slow ones').
violates(only_past_a_queue) :-
    safe_actions(right_lane_change), spec_could_pass(_, 0.0),
    \+ ( spec_slow_ahead(Car1, Offset1), spec_slow_ahead(Car2, Offset2), Car1 \== Car2, Offset1 =< Offset2 ).

property(back_to_the_right,
    'if only oncoming vehicles are ahead on the left, a change to the right is offered wherever the mirrored one to the left would be').
violates(back_to_the_right) :-
    in(mirrored, safe_actions(left_lane_change)), \+ safe_actions(right_lane_change),
    \+ ( spec_ahead_on_the_left(Car, _), spec_along(Car, _) ).

property(right_is_left_at_most, 'a change to the right is only offered if its mirror image is, and mirroring keeps the target speed').
violates(right_is_left_at_most) :- safe_actions(right_lane_change), \+ in(mirrored, safe_actions(left_lane_change)).
violates(right_is_left_at_most) :- longitudinal_velocity(V), in(mirrored, longitudinal_velocity(V1)), V =\= V1.

property(nothing_too_close_hidden, 'a vehicle that alone is too close on a side forbids a lane change to that side among others too').
violates(nothing_too_close_hidden) :- safe_actions(left_lane_change), in(alone, obstacle(left, _, _, _)).
violates(nothing_too_close_hidden) :- safe_actions(right_lane_change), in(alone, obstacle(right, _, _, _)).

% spec_ahead_on_the_left(Car, Offset): Car is ahead, in the ego's lane or in a lane to its left that runs the same way.
spec_ahead_on_the_left(Car, Offset) :-
    vehicle(ego, Lane0, _, _, _, _, _, _), road_lane(Lane0, Direction, _, Width0, _),
    vehicle(Car, Lane, _, Y, _, _, _, _), Car \== ego, road_lane(Lane, Direction, _, _, _),
    spec_to_side(right, Y, D), D =< Width0 / 2, spec_gap(Car, Offset, _), Offset > 0.0.

% spec_could_pass(Car, Excess): within 20 s the ego could pass Car, which is not oncoming, on the right, faster by more than Excess,
% at the limit of the lane there: every vehicle ahead in that lane, and no further than Car, is fast enough for that.
spec_could_pass(Car, Excess) :-
    spec_ahead_on_the_left(Car, Offset), spec_along(Car, V),
    vehicle(ego, _, _, _, _, _, Length0, _), vehicle(Car, _, _, _, _, _, Length, _), Way is Offset + (Length0 + Length) / 2,
    spec_limit_on_the_right(Limit), (Limit - V) * 20.0 > Way, Limit - V > Excess,
    \+ ( spec_claims(Other, right), spec_gap(Other, Offset1, _), Offset1 > 0.0, Offset1 =< Offset,
         spec_speed(Other, V1), ( (V1 - V) * 20.0 =< Way ; V1 - V =< Excess ) ).

% spec_limit_on_the_right(Limit): the speed limit of the lane that the ego would be in.
spec_limit_on_the_right(Limit) :-
    road_lane(_, _, Y, _, Limit), spec_to_side(right, Y, D), D > 0.0,
    \+ ( road_lane(_, _, Y1, _, _), spec_to_side(right, Y1, D1), D1 > 0.0, D1 < D ).

% spec_slow_ahead(Car, Offset): Car is ahead in the ego's lane, no faster than 60 km/h.
spec_slow_ahead(Car, Offset) :-
    vehicle(ego, Lane, _, _, _, _, _, _), vehicle(Car, Lane, _, _, _, _, _, _), Car \== ego,
    spec_gap(Car, Offset, _), Offset > 0.0, spec_speed(Car, V), V =< 60 / 3.6.
