% paper.pl - the published logic, for comparison with highway.pl: one fixed critical distance between centres, and the first
% vehicle that matches a section stands for all of them. Source: arXiv:2307.01316, SLP for AD, and its public code.
%
% Facts, units and required predicates are described at the head of highway.pl.

:- dynamic(vehicle/8).
:- dynamic(road_lane/5).
:- dynamic(target_lane/1).
:- dynamic(time_step/1).
:- dynamic(radar_range/1).
:- dynamic(acceleration_limit/1).
:- dynamic(braking_limit/1).

% critical_distance(C): the fixed distance between two centres. Source: the public code's 20 pixels at 3.25 pixels a metre.
critical_distance(6.15).

% lane(Car, Lane), position_x(Car, Px), position_y(Car, Py), velocity_x(Car, V): read from the facts; V is a magnitude.
lane(Car, Lane) :- vehicle(Car, Lane, _, _, _, _, _, _).
position_x(Car, Px) :- vehicle(Car, _, Px, _, _, _, _, _).
position_y(Car, Py) :- vehicle(Car, _, _, Py, _, _, _, _).
velocity_x(Car, V) :- vehicle(Car, _, _, _, Vx, _, _, _), V is abs(Vx).

% direction(Car, Direction): the direction of Car's lane, left_to_right or right_to_left.
direction(Car, Direction) :- lane(Car, Lane), road_lane(Lane, Direction, _, _, _).

% distance(Car1, Car2, D): the distance between the two centres.
distance(Car1, Car2, D) :-
    position_x(Car1, X1), position_x(Car2, X2), position_y(Car1, Y1), position_y(Car2, Y2),
    D is sqrt((X1 - X2) * (X1 - X2) + (Y1 - Y2) * (Y1 - Y2)).

% target_vehicle(Car): a vehicle other than the ego in radar range.
target_vehicle(Car) :-
    vehicle(Car, _, _, _, _, _, _, _), Car \== ego,
    distance(ego, Car, D), radar_range(R), D =< R.

% left_lane(Lane), right_lane(Lane): the next lane on that side in the ego's direction.
left_lane(Lane) :- neighbour_lane(Lane, Direction, Y0, Y), ( Direction = left_to_right, Y < Y0 ; Direction = right_to_left, Y > Y0 ).
right_lane(Lane) :- neighbour_lane(Lane, Direction, Y0, Y), ( Direction = left_to_right, Y > Y0 ; Direction = right_to_left, Y < Y0 ).

% neighbour_lane(Lane, Direction, Y0, Y): Lane, with centre Y, is next to the ego's, with centre Y0; both run in Direction.
neighbour_lane(Lane, Direction, Y0, Y) :-
    lane(ego, Lane0), road_lane(Lane0, Direction, Y0, Width0, _),
    road_lane(Lane, Direction, Y, Width, _), Lane \== Lane0,
    abs(Y - Y0) < 0.75 * (Width0 + Width).

% ahead(Car), behind(Car), alongside(Car): where Car is along the road; alongside where the two boxes overlap along it.
ahead(Car) :-
    direction(ego, Direction), position_x(ego, Px1), position_x(Car, Px2), \+ alongside(Car),
    ( Direction = right_to_left, Px2 < Px1 ; Direction = left_to_right, Px2 > Px1 ).
behind(Car) :-
    direction(ego, Direction), position_x(ego, Px1), position_x(Car, Px2), \+ alongside(Car),
    ( Direction = right_to_left, Px2 > Px1 ; Direction = left_to_right, Px2 < Px1 ).
alongside(Car) :-
    vehicle(ego, _, Px1, _, _, _, Length1, _), vehicle(Car, _, Px2, _, _, _, Length2, _),
    abs(Px1 - Px2) =< (Length1 + Length2) / 2.

% front(Car), front_right(Car), right(Car), back_right(Car), back(Car), back_left(Car), left(Car), front_left(Car): the first
% fact whose vehicle is in that section, which need not be the nearest.
front(Car) :- lane(ego, Lane), target_vehicle(Car), lane(Car, Lane), ahead(Car), !.
front_right(Car) :- right_lane(Lane), target_vehicle(Car), lane(Car, Lane), ahead(Car), !.
right(Car) :- right_lane(Lane), target_vehicle(Car), lane(Car, Lane), alongside(Car), !.
back_right(Car) :- right_lane(Lane), target_vehicle(Car), lane(Car, Lane), behind(Car), !.
back(Car) :- lane(ego, Lane), target_vehicle(Car), lane(Car, Lane), behind(Car), !.
back_left(Car) :- left_lane(Lane), target_vehicle(Car), lane(Car, Lane), behind(Car), !.
left(Car) :- left_lane(Lane), target_vehicle(Car), lane(Car, Lane), alongside(Car), !.
front_left(Car) :- left_lane(Lane), target_vehicle(Car), lane(Car, Lane), ahead(Car), !.

% front_is_busy, front_right_is_busy, right_is_busy, back_right_is_busy, back_is_busy, back_left_is_busy, left_is_busy,
% front_left_is_busy: a target vehicle is in that section. Source: paper, SLP for AD.
front_is_busy :- front(_).
front_right_is_busy :- front_right(_).
right_is_busy :- right(_).
back_right_is_busy :- back_right(_).
back_is_busy :- back(_).
back_left_is_busy :- back_left(_).
left_is_busy :- left(_).
front_left_is_busy :- front_left(_).

% front_is_free, front_right_is_free, right_is_free, back_right_is_free, back_is_free, back_left_is_free, left_is_free,
% front_left_is_free: no target vehicle is in that section. Source: paper, SLP for AD.
front_is_free :- \+ front_is_busy.
front_right_is_free :- \+ front_right_is_busy.
right_is_free :- \+ right_is_busy.
back_right_is_free :- \+ back_right_is_busy.
back_is_free :- \+ back_is_busy.
back_left_is_free :- \+ back_left_is_busy.
left_is_free :- \+ left_is_busy.
front_left_is_free :- \+ front_left_is_busy.

% near(Car): Car is inside the critical distance.
near(Car) :- distance(ego, Car, D), critical_distance(C), D =< C.

% left_is_valid, right_is_valid: the ego does not leave the road by changing to that side.
left_is_valid :- left_lane(_).
right_is_valid :- right_lane(_).

% left_is_safe, right_is_safe: no vehicle is alongside, and neither the vehicle found in front there nor that behind is near.
left_is_safe :- left_is_free, \+ ( front_left(Car), near(Car) ), \+ ( back_left(Follower), near(Follower) ).
right_is_safe :- right_is_free, \+ ( front_right(Car), near(Car) ), \+ ( back_right(Follower), near(Follower) ).

% safe_actions(Action), possible_actions(Actions): an action that may be offered to the agent; the list of all.
safe_actions(lane_keeping).
safe_actions(left_lane_change) :- left_is_valid, left_is_safe.
safe_actions(right_lane_change) :- right_is_valid, right_is_safe.

possible_actions(Actions) :- findall(Action, safe_actions(Action), Actions).

% entry_is_safe: the ego may be placed where it is.
entry_is_safe :-
    \+ ( target_vehicle(Car), lane(ego, Lane), lane(Car, Lane), ( alongside(Car) ; near(Car) ) ).

% objection(Action, Reason): why a lane change is not offered: no_lane, or too_close(Car, Distance, Needed) between centres.
objection(left_lane_change, no_lane) :- \+ left_is_valid.
objection(right_lane_change, no_lane) :- \+ right_is_valid.
objection(left_lane_change, Reason) :- left(Car), too_close(Car, Reason).
objection(left_lane_change, Reason) :- front_left(Car), near(Car), too_close(Car, Reason).
objection(left_lane_change, Reason) :- back_left(Car), near(Car), too_close(Car, Reason).
objection(right_lane_change, Reason) :- right(Car), too_close(Car, Reason).
objection(right_lane_change, Reason) :- front_right(Car), near(Car), too_close(Car, Reason).
objection(right_lane_change, Reason) :- back_right(Car), near(Car), too_close(Car, Reason).

% too_close(Car, Reason): the reason with the distance to Car and the one needed.
too_close(Car, too_close(Car, D, C)) :- distance(ego, Car, D), critical_distance(C).

% busy_section(Section, Car, Distance): the vehicle that the section's rule finds.
busy_section(front, Car, D) :- front(Car), distance(ego, Car, D).
busy_section(front_right, Car, D) :- front_right(Car), distance(ego, Car, D).
busy_section(right, Car, D) :- right(Car), distance(ego, Car, D).
busy_section(back_right, Car, D) :- back_right(Car), distance(ego, Car, D).
busy_section(back, Car, D) :- back(Car), distance(ego, Car, D).
busy_section(back_left, Car, D) :- back_left(Car), distance(ego, Car, D).
busy_section(left, Car, D) :- left(Car), distance(ego, Car, D).
busy_section(front_left, Car, D) :- front_left(Car), distance(ego, Car, D).

% speed_limit(V): the limit of the lane that the ego is in.
speed_limit(V) :- lane(ego, Lane), road_lane(Lane, _, _, _, V).

% acceleration_x(A): for a free road; a vehicle beyond the critical distance; a vehicle within it. Source: paper, Longitudinal
% Velocity Control. The last clause brakes to a stop before the other's centre.
acceleration_x(A) :-
    front_is_free, !,
    speed_limit(Limit), velocity_x(ego, V), time_step(Dt), A is (Limit - V) / Dt.
acceleration_x(A) :-
    front(Car), distance(ego, Car, D), critical_distance(C), D > C, !,
    velocity_x(ego, V1), velocity_x(Car, V2), A is (V2 * V2 - V1 * V1) / (2 * (D - C)).
acceleration_x(A) :-
    front(Car), distance(ego, Car, D),
    velocity_x(ego, V1), A is -(V1 * V1) / (2 * D).

% longitudinal_velocity(V): the speed to drive next, at most the lane's limit.
longitudinal_velocity(V) :-
    acceleration_x(A), velocity_x(ego, V0), time_step(Dt), speed_limit(Limit),
    V is max(0.0, min(Limit, V0 + A * Dt)).

% state(Observation): eight distances divided by the radar range, the lane and the speed. Source: paper, State Space.
state([Front, FrontRight, Right, BackRight, Back, BackLeft, Left, FrontLeft, Lane, Speed]) :-
    room(front, Front), room(front_right, FrontRight), room(right, Right), room(back_right, BackRight),
    room(back, Back), room(back_left, BackLeft), room(left, Left), room(front_left, FrontLeft),
    lane_place(Lane), speed_share(Speed).

% room(Section, Room): the distance to the section's vehicle divided by the radar range, at most 1; 1 if there is none.
room(Section, Room) :- busy_section(Section, _, D), !, radar_range(R), Room is min(1.0, D / R).
room(_, 1.0).

% lane_place(Place): the lane's rank from the top of the road divided by the number of lanes of both directions.
lane_place(Place) :-
    lane(ego, Lane), road_lane(Lane, _, Y, _, _),
    aggregate_all(count, road_lane(_, _, _, _, _), Lanes),
    aggregate_all(count, ( road_lane(_, _, Y1, _, _), Y1 =< Y ), Rank),
    Place is Rank / Lanes.

% speed_share(Share): the ego's speed divided by the highest limit of the road.
speed_share(Share) :-
    velocity_x(ego, V), aggregate_all(max(Limit), road_lane(_, _, _, _, Limit), Highest),
    Share is min(1.0, V / Highest).
