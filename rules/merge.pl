% merge.pl - highway.pl where a lane ends: leave it in time, or stop before its end.
%
% Besides the facts of highway.pl:
%
%   lane_end(Lane, X)     Lane ends at X; there is none for a lane that goes on
%
% Running past the end of a lane is leaving the road. As long as the ego's body is in a lane that ends, or will be on its way to the
% target lane, the end is for it a leader that stands, so that it can always stop before it (docs/verify.md, "Where a lane ends").
% The ego's limit in such a lane falls towards the end; own_limit of the observation shows that.

:- ensure_loaded('highway.pl').
:- abolish(safe_actions/1).    % redefined here
:- abolish(entry_is_safe/0).   % likewise
:- abolish(speed_limit/1).     % likewise

:- dynamic(lane_end/2).

% Parameters

% leaving_time(T): the time that a lane change takes until the ego's body is in the new lane alone, about 2.3 s, and some more.
leaving_time(3.0).

% hesitation(T): for how long the ego may go on in a lane that ends, though it can leave it, at the last.
hesitation(2.0).

% crawling_speed(V): so slowly the ego may go on up to the end.
crawling_speed(0.1).

% Where the lane ends

% room_to_end(Lane, Room): Lane, of the ego's direction, ends Room ahead of the ego's front bumper; negative behind it.
room_to_end(Lane, Room) :-
    lane_end(Lane, X), direction(ego, Direction), road_lane(Lane, Direction, _, _, _), ego_heading(Sign),
    vehicle(ego, _, Px, _, _, _, Length, _), Room is Sign * (X - Px) - Length / 2.

% own_end(Room): the ego's lane ends.
own_end(Room) :- lane(ego, Lane), room_to_end(Lane, Room).

% end_in_way(Room): the ego's body, on its way to the target lane's centre, is in a lane that ends.
end_in_way(Room) :-
    room_to_end(Lane, Room), lane_strip(Lane, Low, High),
    vehicle(ego, _, _, Y, _, _, _, Width), target_lane(Target), road_lane(Target, _, Centre, _, _),
    min(Y, Centre) - Width / 2 < High, max(Y, Centre) + Width / 2 > Low.

% Safe actions

% safe_actions(Action): every action to which there is no objection. Keeping the lane is offered wherever no lane change is.
safe_actions(Action) :- known_action(Action), \+ objection(Action, _).

% known_action(Action): Action is one of the agent's.
known_action(lane_keeping).
known_action(Action) :- lane_change(Action, _).

% objection(Action, Reason): adds lane_ends(Room), to a lane that ends, unless the ego's own lane ends sooner; and must_leave(Room, Way)
% against staying in a lane that ends, where it can be left and Room is less than Way.
objection(Action, lane_ends(Room)) :-
    lane_change(Action, Side), side_lane(Side, Lane), room_to_end(Lane, Room), \+ ends_sooner(Room).
objection(lane_keeping, must_leave(Room, Way)) :- own_end(Room), leaving_way(Way), Room < Way, may_leave.

% ends_sooner(Room): the ego's own lane ends before the one that ends Room ahead.
ends_sooner(Room) :- own_end(Own), Own < Room.

% leaving_way(Way): what the ego needs to leave its lane: its way while it hesitates and changes lanes, and the one to a stop.
leaving_way(Way) :-
    speed(ego, V), hesitation(T1), leaving_time(T2), rear_braking(B), Way is V * (T1 + T2) + V * V / (2 * B).

% may_leave: a lane change is offered.
may_leave :- lane_change(Action, _), \+ objection(Action, _).

% entry_is_safe: highway.pl's, and the ego can stop before the end of the lane that it enters.
entry_is_safe :- \+ obstacle(entry, _, _, _), \+ end_too_near.

% end_too_near: the ego's lane ends nearer than a standing vehicle may be.
end_too_near :- own_end(Room), speed(ego, V), required_gap(V, 0.0, Needed), Room =< Needed.

% Speed

% speed_limit(V): the limit of the lane that the ego is in, and in one that ends at most the speed from which the ego stops comfortably
% before the end.
speed_limit(V) :-
    lane(ego, Lane), road_lane(Lane, _, _, _, Limit),
    ( own_end(Room) -> stopping_speed(Room, Most), V is min(Limit, Most) ; V = Limit ).

% stopping_speed(Room, V): the speed from which the ego stops within Room, but for the room at standstill, braking comfortably; at least
% the crawling speed.
stopping_speed(Room, V) :-
    comfortable_braking(B), standstill_gap(D), crawling_speed(Least), V is max(Least, sqrt(2 * B * max(0.0, Room - D))).

% following_acceleration(Car, A): adds the one that the end of a lane allows.
following_acceleration(end_of_lane, A) :- end_in_way(Room), speed(ego, V), follow(Room, V, 0.0, A).
