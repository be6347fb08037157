% highway.pl - what is safe on a highway, and how fast to go: the default rule program.
%
% The rules see one moment of traffic as facts. Lengths are in m, speeds in m/s, accelerations in m/s2, times in s.
% x runs along the road and y across it, downward, so a driver heading right (+x) has smaller y on the left.
%
%   vehicle(Id, Lane, Px, Py, Vx, Vy, Length, Width)   the ego and every vehicle in radar range: box centre, velocity, size
%   road_lane(Lane, Direction, Py, Width, SpeedLimit)  every lane of the road: its centre line, width and limit
%   target_lane(Lane)                                  the lane that the ego is steering for
%   time_step(Dt)                                      the time until the rules are asked again
%   radar_range(R)                                     how far the ego sees
%   acceleration_limit(A), braking_limit(B)            the hardest that the ego can accelerate and brake
%   centre_tolerance(D)                                how near to its lane's centre line the ego may start a lane change
%
% Assumptions, as in RSS: a vehicle in front brakes by at most 8 m/s2; a vehicle behind, or an oncoming one, accelerates by at most
% 3 m/s2 for 0.35 s and then brakes by at least 6 m/s2. No vehicle turns round. The same is assumed of the ego where it is the one
% behind or in front, or meets an oncoming vehicle. The distance to an oncoming vehicle can only be kept as far as the ego sees:
% at 30 m/s and 40 m/s, 247.6 m from bumper to bumper are needed (docs/driving.md).
%
% Every program must have: safe_actions(Action), possible_actions(Actions), front_is_free, longitudinal_velocity(V),
% state(Observation), entry_is_safe.  Optional: state_names(Names) and state_bounds(Bounds), without which state/1 gives the paper's
% ten numbers from 0 to 1; lane_to_keep(Lane), comfortable_acceleration(A), objection(Action, Reason), busy_section(S, Car, Gap).

:- dynamic(vehicle/8).
:- dynamic(road_lane/5).
:- dynamic(target_lane/1).
:- dynamic(time_step/1).
:- dynamic(radar_range/1).
:- dynamic(acceleration_limit/1).
:- dynamic(braking_limit/1).
:- dynamic(centre_tolerance/1).

:- multifile(objection/2).    % a file on top of this one may add clauses
:- multifile(following_acceleration/2).    % likewise

:- include('longitudinal.pl').
:- include('observation.pl').

% Parameters

% response_time(T): the time before a rear or oncoming vehicle reacts. Source: UN R157, 5.2.5.2 (0.35 s).
response_time(0.35).

% response_acceleration(A): how hard it may accelerate before it reacts. Source: RSS, a_max,accel.
response_acceleration(3.0).

% rear_braking(B): the braking that a rear vehicle, or either of two oncoming ones, certainly reaches.
% Source: RSS, a_min,brake and a_min,brake,correct; UN R157 (6 m/s2).
rear_braking(6.0).

% front_braking(B): the hardest braking to expect of a vehicle in front. Source: RSS, a_max,brake; dry road.
front_braking(8.0).

% standstill_gap(D): the room kept between bumpers on top of the critical distance.
standstill_gap(2.0).

% lateral_margin(M): the room kept between the sides of two vehicles that pass each other.
lateral_margin(0.3).

% side_time(T): a vehicle that will be beside the ego within this time counts as beside it already.
side_time(1.0).

% drift_horizon(Side, T): for how long a vehicle's sideways motion is extrapolated to see whether it enters the way of Side.
% A lane change, or entering the road, needs the lane for a while; the ego's own lane is checked again at every step. How fast to go is
% decided by who is in the way now, and comfortably by who will soon be.
drift_horizon(now, 0.0).
drift_horizon(own, 1.0).
drift_horizon(soon, 3.0).
drift_horizon(home, 1.0).
drift_horizon(entry, 3.0).
drift_horizon(left, 3.0).
drift_horizon(right, 3.0).

% Reading the facts

% lane(Car, Lane): Car's centre is in Lane.
lane(Car, Lane) :- vehicle(Car, Lane, _, _, _, _, _, _).

% position_x(Car, Px), position_y(Car, Py): the centre of Car's box.
position_x(Car, Px) :- vehicle(Car, _, Px, _, _, _, _, _).
position_y(Car, Py) :- vehicle(Car, _, _, Py, _, _, _, _).

% direction(Car, Direction): the direction of the lane that Car is in, left_to_right or right_to_left.
direction(Car, Direction) :- lane(Car, Lane), road_lane(Lane, Direction, _, _, _).

% heading(Direction, Sign): the sign of the velocity along x.
heading(left_to_right, 1).
heading(right_to_left, -1).

% ego_heading(Sign): the sign of the ego's motion along x.
ego_heading(Sign) :- direction(ego, Direction), heading(Direction, Sign).

% velocity(Car, V): Car's velocity in the ego's direction; negative for an oncoming vehicle.
velocity(Car, V) :- vehicle(Car, _, _, _, Vx, _, _, _), ego_heading(Sign), V is Sign * Vx.

% speed(Car, V): Car's speed in the ego's direction; 0 for a standing or oncoming vehicle.
speed(Car, V) :- velocity(Car, V0), V is max(0.0, V0).

% distance(Car1, Car2, D): the distance between the two centres. Source: paper, SLP for AD.
distance(Car1, Car2, D) :-
    position_x(Car1, X1), position_x(Car2, X2), position_y(Car1, Y1), position_y(Car2, Y2),
    D is sqrt((X1 - X2) * (X1 - X2) + (Y1 - Y2) * (Y1 - Y2)).

% target_vehicle(Car): a vehicle other than the ego in radar range. Source: paper, SLP for AD.
target_vehicle(Car) :-
    vehicle(Car, _, _, _, _, _, _, _), Car \== ego,
    distance(ego, Car, D), radar_range(R), D =< R.

% offset(Car, S): how far Car's centre is ahead of the ego's (negative: behind).
offset(Car, S) :- position_x(ego, X1), position_x(Car, X2), ego_heading(Sign), S is Sign * (X2 - X1).

% gap(Car, Gap): the gap to the ego from bumper to bumper along the road; negative where the two overlap along it.
gap(Car, Gap) :-
    offset(Car, S),
    vehicle(ego, _, _, _, _, _, Length1, _), vehicle(Car, _, _, _, _, _, Length2, _),
    Gap is abs(S) - (Length1 + Length2) / 2.

% Lanes and ways

% side_lane(Side, Lane): Lane is next to the ego's lane on that side and runs the same way.
side_lane(Side, Lane) :-
    lane(ego, Lane0), road_lane(Lane0, Direction, Y0, Width0, _),
    heading(Direction, Sign),
    road_lane(Lane, Direction, Y, Width, _),
    leftward(Side, Turn), Offset is Turn * Sign * (Y0 - Y),
    Offset > 0.0, Offset < 0.75 * (Width0 + Width).

% leftward(Side, Turn): +1 to the driver's left, -1 to the right.
leftward(left, 1).
leftward(right, -1).

% way(Side, Low, High): the range of y that must be free: what the ego's body covers on its way to the target lane's centre, with
% the lateral margin ("own", "now" and "soon"); the whole lane it is in ("home", and "entry" where it enters the road); or the lane to a side.
way(own, Low, High) :- ego_way(Low, High).
way(now, Low, High) :- ego_way(Low, High).
way(soon, Low, High) :- ego_way(Low, High).
way(home, Low, High) :- lane(ego, Lane), lane_strip(Lane, Low, High).
way(entry, Low, High) :- lane(ego, Lane), lane_strip(Lane, Low, High).
way(left, Low, High) :- side_lane(left, Lane), lane_strip(Lane, Low, High).
way(right, Low, High) :- side_lane(right, Lane), lane_strip(Lane, Low, High).

% ego_way(Low, High): from where the ego's body is to the target lane's centre.
ego_way(Low, High) :-
    vehicle(ego, _, _, Y, _, _, _, Width), target_lane(Lane), road_lane(Lane, _, Centre, _, _), lateral_margin(Margin),
    Low is min(Y, Centre) - Width / 2 - Margin, High is max(Y, Centre) + Width / 2 + Margin.

% lane_strip(Lane, Low, High): the range of y that Lane covers.
lane_strip(Lane, Low, High) :- road_lane(Lane, _, Y, Width, _), Low is Y - Width / 2, High is Y + Width / 2.

% in_way(Car, Side): Car's body, now or as it drifts sideways, reaches into the way of Side.
in_way(Car, Side) :-
    way(Side, Low, High),
    vehicle(Car, _, _, Y, _, Vy, _, Width), drift_horizon(Side, T), Drifted is Y + Vy * T,
    min(Y, Drifted) - Width / 2 < High, max(Y, Drifted) + Width / 2 > Low.

% settled: the ego is not changing lanes.
settled :-
    target_lane(Lane), lane(ego, Lane), road_lane(Lane, _, Centre, _, _), position_y(ego, Y),
    centre_tolerance(Tolerance), abs(Y - Centre) =< Tolerance.

% The eight sections

% section(Section, Side, Place): the paper's eight sections around the ego.
section(front, own, ahead).
section(front_right, right, ahead).
section(right, right, alongside).
section(back_right, right, behind).
section(back, own, behind).
section(back_left, left, behind).
section(left, left, alongside).
section(front_left, left, ahead).

% place(Place, Car, Gap): where Car is along the road, and the gap to it.
place(ahead, Car, Gap) :- offset(Car, S), S > 0.0, gap(Car, Gap), Gap > 0.0.
place(alongside, Car, Gap) :- gap(Car, Gap), Gap =< 0.0.
place(behind, Car, Gap) :- offset(Car, S), S < 0.0, gap(Car, Gap), Gap > 0.0.

% busy_section(Section, Car, Gap): target vehicle Car is in Section.
busy_section(Section, Car, Gap) :-
    section(Section, Side, Place),
    target_vehicle(Car), place(Place, Car, Gap), in_way(Car, Side).

% nearest(Section, Car, Gap): the vehicle with the least gap in Section; of several, the first fact.
nearest(Section, Car, Gap) :-
    aggregate_all(min(Gap1, Car1), busy_section(Section, Car1, Gap1), min(Gap, Car)).

% front_is_busy, front_right_is_busy, right_is_busy, back_right_is_busy, back_is_busy, back_left_is_busy, left_is_busy,
% front_left_is_busy: a target vehicle is in that section. Source: paper, SLP for AD.
front_is_busy :- busy_section(front, _, _).
front_right_is_busy :- busy_section(front_right, _, _).
right_is_busy :- busy_section(right, _, _).
back_right_is_busy :- busy_section(back_right, _, _).
back_is_busy :- busy_section(back, _, _).
back_left_is_busy :- busy_section(back_left, _, _).
left_is_busy :- busy_section(left, _, _).
front_left_is_busy :- busy_section(front_left, _, _).

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

% Safe distances

% stopping_way(V, S): how far a vehicle goes at most until it stands: it may accelerate until it reacts, and then brakes as hard as
% it certainly can.
stopping_way(V, S) :-
    response_time(T), response_acceleration(A), rear_braking(B),
    S is V * T + A * T * T / 2 + (V + A * T) * (V + A * T) / (2 * B).

% critical_distance(VRear, VFront, C): the least gap from which the rear vehicle, after its response time, can stop behind
% a front vehicle that brakes at its hardest. Source: RSS (Shalev-Shwartz et al. 2017), Definition 1.
critical_distance(VRear, VFront, C) :-
    stopping_way(VRear, S), front_braking(B), C is max(0.0, S - VFront * VFront / (2 * B)).

% opposite_distance(V1, V2, C): the least gap from which two vehicles that drive towards each other at V1 and V2 can both stop.
% Source: RSS, Definition 2.
opposite_distance(V1, V2, C) :- stopping_way(V1, S1), stopping_way(V2, S2), C is S1 + S2.

% required_gap(VRear, VFront, Gap): the distance of RSS plus the room kept at standstill; VFront is negative if the front vehicle
% drives towards the rear one.
required_gap(VRear, VFront, Gap) :-
    ( VFront < 0.0 -> V is -VFront, opposite_distance(VRear, V, C) ; critical_distance(VRear, VFront, C) ),
    standstill_gap(D), Gap is C + D.

% needed_gap(Car, Gap): the gap that Car and the ego need between them, whichever of the two is in front. A vehicle behind the ego
% that drives away from it counts as standing there.
needed_gap(Car, Gap) :- offset(Car, S), S >= 0.0, speed(ego, V1), velocity(Car, V2), required_gap(V1, V2, Gap).
needed_gap(Car, Gap) :- offset(Car, S), S < 0.0, speed(ego, V1), speed(Car, V2), required_gap_behind(V2, V1, Gap).

% required_gap_behind(VRear, VEgo, Gap): the gap that a vehicle behind needs to the ego, which comes into its lane. A file on top of
% this one may replace it.
required_gap_behind(VRear, VEgo, Gap) :- required_gap(VRear, VEgo, Gap).

% obstacle(Side, Car, Gap, Needed): Car is in the way of Side with a gap smaller than needed.
obstacle(Side, Car, Gap, Needed) :-
    target_vehicle(Car), in_way(Car, Side), gap(Car, Gap), needed_gap(Car, Needed), Gap < Needed.

% Safe actions

% lane_change(Action, Side): Action is the lane change to that side.
lane_change(left_lane_change, left).
lane_change(right_lane_change, right).

% safe_actions(Action): Action may be offered to the agent: a lane change to which there is no objection, or keeping the lane, which
% is always offered since the longitudinal rules brake. Source: paper, SLP for AD.
safe_actions(lane_keeping).
safe_actions(Action) :- lane_change(Action, _), \+ objection(Action, _).

% possible_actions(Actions): the list of all safe actions. Source: paper, SLP for AD.
possible_actions(Actions) :- findall(Action, safe_actions(Action), Actions).

% objection(Action, Reason): Reason speaks against a lane change, which is then not offered. A file on top of this one may add
% clauses.
objection(Action, changing_lanes) :- lane_change(Action, _), \+ settled.
objection(Action, no_lane) :- lane_change(Action, Side), \+ side_lane(Side, _).
objection(Action, too_close(Car, Gap, Needed)) :- lane_change(Action, Side), obstacle(Side, Car, Gap, Needed).

% entry_is_safe: the ego may enter the road where it is: the gap to each vehicle in or drifting into its lane is large enough.
entry_is_safe :- \+ obstacle(entry, _, _, _).

% Giving up a lane change

% lane_to_keep(Lane): the lane that lane_keeping steers for: the target lane; or, while the ego's centre is still in the lane that it
% came from, that lane again if the target lane is taken and no vehicle is beside the ego in the old one.
lane_to_keep(Home) :-
    lane(ego, Home), target_lane(Target), Target \== Home,
    side_lane(Side, Target), taken(Side), \+ beside(home, _), !.
lane_to_keep(Target) :- target_lane(Target).

% taken(Side): a vehicle is beside the ego in the way of Side, or catches up with it there.
taken(Side) :- beside(Side, _).
taken(Side) :- catches_up(Side, _).

% beside(Side, Car): Car is in the way of Side and alongside the ego, or will be within the side time.
beside(Side, Car) :-
    target_vehicle(Car), in_way(Car, Side),
    gap(Car, Gap), closing_speed(Car, V), side_time(T), standstill_gap(D),
    Gap < D + V * T.

% catches_up(Side, Car): Car, behind in the way of Side, is so fast that it would come nearer than the room at standstill before it has
% braked, after its response time, down to the ego's speed. Source: UN R157, 5.2.5.2 (time to collision of a vehicle that cuts in).
catches_up(Side, Car) :-
    target_vehicle(Car), in_way(Car, Side), place(behind, Car, Gap),
    closing_speed(Car, V), response_time(T), rear_braking(B), standstill_gap(D),
    Gap < D + V * (V / (2 * B) + T).

% closing_speed(Car, V): how fast the gap between Car and the ego shrinks; 0 where it grows.
closing_speed(Car, V) :- offset(Car, S), S >= 0.0, speed(ego, V1), velocity(Car, V2), V is max(0.0, V1 - V2).
closing_speed(Car, V) :- offset(Car, S), S < 0.0, speed(ego, V1), velocity(Car, V2), V is max(0.0, V2 - V1).
