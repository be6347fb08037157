% observation.pl - what the agent sees: the paper's ten numbers, how the nearest vehicles move, and what the ego may do and gain.
% Included by highway.pl; paper_observation.pl gives the ten alone.

% state_names(Names): the numbers of state/1 by name. The first ten are the paper's: the eight sections, the lane and the speed.
% Then how much faster than the ego the nearest vehicle of a section is; how much faster than now the ego may drive in its lane and
% in those beside it; and which lane changes are offered.
state_names([
    front, front_right, right, back_right, back, back_left, left, front_left, lane, speed,
    front_faster, front_right_faster, back_right_faster, back_faster, back_left_faster, front_left_faster,
    own_limit, right_limit, left_limit,
    left_offered, right_offered
]).

% state_bounds(Bounds): the least and the greatest value of each of these numbers.
state_bounds([
    0 - 1, 0 - 1, 0 - 1, 0 - 1, 0 - 1, 0 - 1, 0 - 1, 0 - 1, 0 - 1, 0 - 1,
    -1 - 1, -1 - 1, -1 - 1, -1 - 1, -1 - 1, -1 - 1,
    -1 - 1, -1 - 1, -1 - 1,
    0 - 1, 0 - 1
]).

% state(Observation): these numbers. Source: paper, State Space, for the first ten; speeds are shares of the road's highest limit.
state([
    Front, FrontRight, Right, BackRight, Back, BackLeft, Left, FrontLeft, Lane, Speed,
    FrontFaster, FrontRightFaster, BackRightFaster, BackFaster, BackLeftFaster, FrontLeftFaster,
    OwnLimit, RightLimit, LeftLimit,
    LeftOffered, RightOffered
]) :-
    highest_limit(Highest),
    section_view(front, Front, V1), section_view(front_right, FrontRight, V2), section_room(right, Right),
    section_view(back_right, BackRight, V3), section_view(back, Back, V4), section_view(back_left, BackLeft, V5),
    section_room(left, Left), section_view(front_left, FrontLeft, V6),
    lane_place(Lane), speed_share(Speed),
    signed_share(V1, Highest, FrontFaster), signed_share(V2, Highest, FrontRightFaster),
    signed_share(V3, Highest, BackRightFaster), signed_share(V4, Highest, BackFaster),
    signed_share(V5, Highest, BackLeftFaster), signed_share(V6, Highest, FrontLeftFaster),
    speed_limit(Limit), speed(ego, V), signed_share(Limit - V, Highest, OwnLimit),
    side_limit(right, Highest, RightLimit), side_limit(left, Highest, LeftLimit),
    offered(left_lane_change, LeftOffered), offered(right_lane_change, RightOffered).

% section_view(Section, Room, V): the gap as a share of the radar range, 0 without a lane or with a vehicle alongside, 1 if free; and
% how much faster than the ego the nearest vehicle is, in m/s, 0 without one.
section_view(Section, 0.0, 0.0) :- section(Section, Side, _), \+ way(Side, _, _), !.
section_view(Section, Room, V) :-
    nearest(Section, Car, Gap), !,
    radar_range(R), Room is max(0.0, min(1.0, Gap / R)),
    velocity(Car, V1), speed(ego, V2), V is V1 - V2.
section_view(_, 1.0, 0.0).

% section_room(Section, Room): the gap alone.
section_room(Section, Room) :- section_view(Section, Room, _).

% lane_place(Place): the share of the other lanes of its direction that lie to the ego's right; 0 on a single lane.
lane_place(Place) :-
    lane(ego, Lane), road_lane(Lane, Direction, Y, _, _), heading(Direction, Sign),
    aggregate_all(count, road_lane(_, Direction, _, _, _), Lanes),
    aggregate_all(count, ( road_lane(_, Direction, Y1, _, _), Sign * (Y1 - Y) > 0.0 ), Rightward),
    Place is Rightward / max(1.0, Lanes - 1.0).

% speed_share(Share): the ego's speed divided by the highest limit of the road.
speed_share(Share) :- speed(ego, V), highest_limit(Highest), Share is max(0.0, min(1.0, V / Highest)).

% highest_limit(V): the highest limit of the road.
highest_limit(Highest) :- aggregate_all(max(Limit), road_lane(_, _, _, _, Limit), Highest).

% signed_share(V, Highest, Share): the difference V of two speeds divided by the highest limit, from -1 to 1.
signed_share(V, Highest, Share) :- Share is max(-1.0, min(1.0, V / Highest)).

% side_limit(Side, Highest, Share): how far the limit of the lane to that side is above the ego's speed, as such a share; -1 without
% a lane.
side_limit(Side, Highest, Share) :-
    side_lane(Side, Lane), !, road_lane(Lane, _, _, _, Limit), speed(ego, V), signed_share(Limit - V, Highest, Share).
side_limit(_, _, -1.0).

% offered(Action, Share): 1 if Action is offered, else 0.
offered(Action, 1.0) :- safe_actions(Action), !.
offered(_, 0.0).
