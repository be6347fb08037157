% overtake_left.pl - the law on top of highway.pl: no lane change to the right in order to overtake.
%
% StVO (German road traffic regulations):
%   section 5 (1)   overtaking is on the left.
%   section 2 (2)   otherwise keep to the right; who could stay there for less than some 20 s need not move over.
%   section 7 (2a)  a queue on the left that stands or moves slowly may be passed on the right, slightly faster, with care.
% Not told by the facts, and so not allowed here: section 7 (2) (queues on both sides), section 7a (entry and exit lanes), signs.

:- ensure_loaded('highway.pl').

% stay(T): a stay in a lane to the right that ends sooner is no keeping to the right. Source: courts on StVO section 2 (2).
stay(20.0).

% queue_speed(V): a queue that is no faster moves slowly. Source: BGH, 3 May 1968, 4 StR 242/67 (60 km/h), for StVO section 7 (2a).
queue_speed(V) :- V is 60 / 3.6.

% queue_excess(V): how much faster a queue may be passed. Source: the same (20 km/h).
queue_excess(V) :- V is 20 / 3.6.

% objection(Action, Reason): also would_overtake_on_the_right(Car, T), T being the time until the ego would be past Car.
objection(right_lane_change, would_overtake_on_the_right(Car, T)) :- overtaken_on_the_right(Car, Way, Excess), T is Way / Excess.

% overtaken_on_the_right(Car, Way, Excess): Car is ahead, in the lane that the ego would leave or further left, and the ego would
% come past it, Way further than Car and faster by Excess, in less than a stay; and it is in no queue that may be passed. Who comes
% the other way is not overtaken but got out of the way of.
overtaken_on_the_right(Car, Way, Excess) :-
    on_the_left(Car), offset(Car, S), S > 0.0,
    vehicle(ego, _, _, _, _, _, Length1, _), vehicle(Car, _, _, _, _, _, Length2, _), Way is S + (Length1 + Length2) / 2,
    speed_on_the_right(S, V1), velocity(Car, V2), V2 >= 0.0, Excess is V1 - V2,
    stay(T), Way < Excess * T,
    \+ may_be_passed(V2, Excess).

% on_the_left(Car): target vehicle Car is in the ego's lane or in one to its left, of the same direction.
on_the_left(Car) :-
    lane(ego, Lane0), road_lane(Lane0, Direction, Y0, _, _), heading(Direction, Sign),
    target_vehicle(Car), lane(Car, Lane), road_lane(Lane, Direction, Y, _, _), Sign * (Y0 - Y) >= 0.0.

% speed_on_the_right(S, V): how fast the ego may become in the lane to its right, up to a vehicle S ahead: as the one that it
% comes to follow there, if that is no farther ahead, and no faster than the limit.
speed_on_the_right(S, V) :-
    once(( side_lane(right, Lane), road_lane(Lane, _, _, _, Limit) )),
    ( nearest(front_right, Leader, _), offset(Leader, S1), S1 =< S -> speed(Leader, V1), V is min(Limit, V1) ; V = Limit ).

% may_be_passed(V, Excess): the ego is in a queue, a vehicle with speed V is as slow as one, and the ego would be slightly faster.
may_be_passed(V, Excess) :-
    queue_speed(Slow), V =< Slow, queue_excess(Most), Excess =< Most, in_a_queue.

% in_a_queue: the ego is the third vehicle or a later one of a queue in its lane.
in_a_queue :-
    nearest(front, Car1, Gap1), queues(Car1), busy_section(front, Car2, Gap2), Gap2 > Gap1, queues(Car2).

% queues(Car): Car is in the ego's lane, and no faster than a queue.
queues(Car) :- lane(ego, Lane), lane(Car, Lane), speed(Car, V), queue_speed(Slow), V =< Slow.
