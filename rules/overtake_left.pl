% overtake_left.pl - the law on top of highway.pl: no lane change to the right in order to overtake.
%
% StVO (German road traffic regulations):
%   section 5 (1)   overtaking is on the left.
%   section 2 (2)   otherwise keep to the right; a driver who could stay there for less than about 20 s need not move over.
%   section 7 (2a)  a queue on the left that stands or moves slowly may be passed on the right, slightly faster, with care.
% Not shown by the facts, so not allowed here: section 7 (2) (queues on both sides), section 7a (entry and exit lanes), signs.

:- ensure_loaded('highway.pl').

% stay(T): a shorter stay in a lane to the right does not count as keeping to the right. Source: courts on StVO section 2 (2).
stay(20.0).

% queue_speed(V): a queue up to this speed moves slowly. Source: BGH, 3 May 1968, 4 StR 242/67 (60 km/h), for StVO section 7 (2a).
queue_speed(V) :- V is 60 / 3.6.

% queue_excess(V): how much faster a queue may be passed. Source: the same (20 km/h).
queue_excess(V) :- V is 20 / 3.6.

% objection(Action, Reason): adds would_overtake_on_the_right(Car, T), where T is the time until the ego would be past Car.
objection(right_lane_change, would_overtake_on_the_right(Car, T)) :- overtaken_on_the_right(Car, Way, Excess), T is Way / Excess.

% overtaken_on_the_right(Car, Way, Excess): Car is ahead, in the lane that the ego would leave or further left. Gaining Way on Car,
% faster by Excess, the ego would pass it in less than a stay. Car is not in a queue that may be passed, nor is it oncoming: moving
% right to avoid an oncoming vehicle is not overtaking.
overtaken_on_the_right(Car, Way, Excess) :-
    on_the_left(Car), offset(Car, S), S > 0.0,
    vehicle(ego, _, _, _, _, _, Length1, _), vehicle(Car, _, _, _, _, _, Length2, _), Way is S + (Length1 + Length2) / 2,
    speed_on_the_right(S, V1), velocity(Car, V2), V2 >= 0.0, Excess is V1 - V2,
    stay(T), Way < Excess * T,
    \+ may_be_passed(V2, Excess).

% on_the_left(Car): target vehicle Car is in the ego's lane or in a lane to its left that runs the same way.
on_the_left(Car) :-
    lane(ego, Lane0), road_lane(Lane0, Direction, Y0, _, _), heading(Direction, Sign),
    target_vehicle(Car), lane(Car, Lane), road_lane(Lane, Direction, Y, _, _), Sign * (Y0 - Y) >= 0.0.

% speed_on_the_right(S, V): the highest speed V of the ego in the lane to its right until it passes a vehicle S ahead: the lane's
% limit, or the speed of the leader in that lane, if that is lower and the leader is at most S ahead.
speed_on_the_right(S, V) :-
    once(( side_lane(right, Lane), road_lane(Lane, _, _, _, Limit) )),
    ( nearest(front_right, Leader, _), offset(Leader, S1), S1 =< S -> speed(Leader, V1), V is min(Limit, V1) ; V = Limit ).

% may_be_passed(V, Excess): the ego is in a queue, V is at most the speed of a queue, and the ego would be only slightly faster.
may_be_passed(V, Excess) :-
    queue_speed(Slow), V =< Slow, queue_excess(Most), Excess =< Most, in_a_queue.

% in_a_queue: the ego is the third vehicle or a later one of a queue in its lane.
in_a_queue :-
    nearest(front, Car1, Gap1), queues(Car1), busy_section(front, Car2, Gap2), Gap2 > Gap1, queues(Car2).

% queues(Car): Car is in the ego's lane and no faster than a queue.
queues(Car) :- lane(ego, Lane), lane(Car, Lane), speed(Car, V), queue_speed(Slow), V =< Slow.
