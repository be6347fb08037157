% observation.pl - what the agent sees: ten numbers from 0 to 1. Included by highway.pl.

% state([Front, FrontRight, Right, BackRight, Back, BackLeft, Left, FrontLeft, Lane, Speed]): the gap to the nearest vehicle
% of each section divided by the radar range, the lane and the speed. Source: paper, State Space.
state([Front, FrontRight, Right, BackRight, Back, BackLeft, Left, FrontLeft, Lane, Speed]) :-
    section_room(front, Front), section_room(front_right, FrontRight), section_room(right, Right),
    section_room(back_right, BackRight), section_room(back, Back), section_room(back_left, BackLeft),
    section_room(left, Left), section_room(front_left, FrontLeft),
    lane_place(Lane), speed_share(Speed).

% section_room(Section, Room): the gap as a share of the radar range; 0 without a lane or with a vehicle alongside, 1 if free.
section_room(Section, 0.0) :- section(Section, Side, _), \+ way(Side, _, _), !.
section_room(Section, Room) :- nearest(Section, _, Gap), !, radar_range(R), Room is max(0.0, min(1.0, Gap / R)).
section_room(_, 1.0).

% lane_place(Place): the share of the other lanes of its direction that lie to the ego's right; 0 on a single lane.
lane_place(Place) :-
    lane(ego, Lane), road_lane(Lane, Direction, Y, _, _), heading(Direction, Sign),
    aggregate_all(count, road_lane(_, Direction, _, _, _), Lanes),
    aggregate_all(count, ( road_lane(_, Direction, Y1, _, _), Sign * (Y1 - Y) > 0.0 ), Rightward),
    Place is Rightward / max(1.0, Lanes - 1.0).

% speed_share(Share): the ego's speed divided by the highest limit of the road.
speed_share(Share) :-
    speed(ego, V), aggregate_all(max(Limit), road_lane(_, _, _, _, Limit), Highest),
    Share is max(0.0, min(1.0, V / Highest)).
