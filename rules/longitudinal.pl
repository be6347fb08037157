% longitudinal.pl - how fast to go: the speed that is safe, and the acceleration that is comfortable. Included by highway.pl.
%
% longitudinal_velocity/1 is a ceiling: whatever the ego drives below it is safe (docs/verify.md, "Following"). As far as it allows, the
% ego follows comfortable_acceleration/1 with bounded jerk (drlsl/driving/simulation/controllers.py), so the ceiling is seldom reached.

% Parameters

% comfortable_acceleration_limit(A), comfortable_braking(B), time_gap(T): the acceleration and the braking of a comfortable driver, and
% the time that it keeps behind a leader. Source: Kesting, Treiber and Helbing 2010, Table 1 (ACC).
comfortable_acceleration_limit(1.4).
comfortable_braking(2.0).
time_gap(1.5).

% queue_gap(D): the room that it keeps at standstill: a little more than the required gap there, which is 2.28 m.
queue_gap(3.0).

% giving_way(B): the braking with which the ego at least gives way: about what a car slows down by that neither drives nor brakes.
giving_way(0.3).

% Leaders

% leader(Side, Car, Gap, V): the gap to vehicle Car ahead in the way of Side, and its speed. An oncoming vehicle counts as standing at
% the place where it will stop, so the gap may be negative.
leader(Side, Car, Gap, V) :-
    target_vehicle(Car), place(ahead, Car, Gap0), in_way(Car, Side),
    velocity(Car, V0), oncoming_way(V0, S), Gap is Gap0 - S, V is max(0.0, V0).

% oncoming_way(V, S): how far a vehicle with velocity V still comes towards the ego until it stands; 0 if it is not oncoming.
oncoming_way(V, S) :- ( V < 0.0 -> V1 is -V, stopping_way(V1, S) ; S = 0.0 ).

% merging(Side, Car): Car is alongside, its centre ahead of the ego's, and in the way of Side: the ego lets it in.
merging(Side, Car) :- target_vehicle(Car), offset(Car, S), S > 0.0, place(alongside, Car, _), in_way(Car, Side).

% speed_limit(V): the limit of the lane that the ego is in.
speed_limit(V) :- lane(ego, Lane), road_lane(Lane, _, _, _, V).

% braking_needed(Gap, V1, V2, B): the braking with which the ego, from one time step on, stops behind a leader that brakes at its
% hardest from now on.
braking_needed(Gap, V1, V2, B) :-
    front_braking(B2), time_step(Dt), Room is Gap + V2 * V2 / (2 * B2) - V1 * Dt,
    ( Room > 0.0 -> B is V1 * V1 / (2 * Room) ; braking_limit(B) ).

% The speed that is safe

% longitudinal_velocity(V): the highest speed to drive next: not above the lane's limit, to which a faster ego brakes comfortably.
% Source: paper, v + a dt.
longitudinal_velocity(V) :-
    acceleration_x(A), speed(ego, V0), time_step(Dt), speed_limit(Limit), comfortable_braking(B),
    V is max(0.0, min(max(Limit, V0 - B * Dt), V0 + A * Dt)).

% acceleration_x(A): the highest acceleration that the road and the vehicles in front allow, within the ego's limits.
% Source: paper, Longitudinal Velocity Control.
acceleration_x(A) :-
    free_acceleration(Free),
    ( aggregate_all(min(A1), following_acceleration(_, A1), Following) -> Allowed is min(Free, Following) ; Allowed = Free ),
    in_limits(Allowed, A).

% in_limits(A, Limited): the acceleration that the ego can reach.
in_limits(A, Limited) :- acceleration_limit(Most), braking_limit(Hardest), Limited is max(-Hardest, min(Most, A)).

% free_acceleration(A): the acceleration that reaches the limit within one time step; a faster ego brakes comfortably.
% Source: paper, Eq. for front_is_free.
free_acceleration(A) :-
    speed_limit(Limit), speed(ego, V), time_step(Dt), comfortable_braking(B), A is max(-B, (Limit - V) / Dt).

% following_acceleration(Car, A): the acceleration that vehicle Car, whose body is in the ego's way, allows.
following_acceleration(Car, A) :-
    leader(now, Car, Gap, V2), speed(ego, V1),
    ( Gap > 0.0 -> follow(Gap, V1, V2, A) ; braking_limit(B), A is -B ).
following_acceleration(Car, A) :- merging(now, Car), giving_way(B), A is -B.

% follow(Gap, V1, V2, A): the acceleration that a leader at speed V2 allows. If the leader brakes at its hardest from now on, the ego
% can still stop behind it after the step. Nearer than the required gap it gives way, and likewise once it would need more than
% rear_braking/1. Source: paper, Longitudinal Velocity Control.
follow(Gap, V1, V2, A) :-
    required_gap(V1, V2, Required), braking_needed(Gap, V1, V2, Needed), rear_braking(Sure),
    ( at_the_last(Gap, V1, V2) -> braking_limit(B), A is -B
    ; Gap > Required, Needed =< Sure -> acceleration_limit(A)
    ; giving_way(Gently), A is -Gently
    ).

% at_the_last(Gap, V1, V2): unless the ego brakes as hard as it can, it may be too late one time step on. To stop in whole steps takes
% up to 1 m/s2 times the square of a step more than V1 * V1 / (2 * B).
at_the_last(Gap, V1, V2) :-
    front_braking(B2), braking_limit(B), time_step(Dt),
    Gap + V2 * V2 / (2 * B2) - V1 * Dt =< V1 * V1 / (2 * B) + Dt * Dt.

% The acceleration that is comfortable

% comfortable_acceleration(A): the acceleration that a comfortable driver wants: the least of those that the limit and the vehicles in
% front, or soon in front, suggest.
comfortable_acceleration(A) :-
    cruising_acceleration(Free),
    ( aggregate_all(min(A1), suggested_acceleration(_, A1), Least) -> Wanted is min(Free, Least) ; Wanted = Free ),
    in_limits(Wanted, A).

% cruising_acceleration(A): towards the limit, the lower one while the ego changes to a lane with another.
% Source: Intelligent Driver Model (Treiber and Kesting 2013, section 11.3), free road, exponent 4.
cruising_acceleration(A) :-
    speed_limit(Limit0), target_lane(Lane), road_lane(Lane, _, _, _, Limit1), speed(ego, V),
    comfortable_acceleration_limit(Most), comfortable_braking(B),
    Share is V / min(Limit0, Limit1), A is max(-B, Most * (1 - Share * Share * Share * Share)).

% suggested_acceleration(Car, A): behind vehicle Car, which is in the ego's way or will be soon; if it is there so suddenly that the
% ego would need more than rear_braking/1, firmer the more it would need; alongside, the ego lets it in.
suggested_acceleration(Car, A) :-
    leader(soon, Car, Gap, V2), speed(ego, V1),
    ( Gap > 0.0 -> keep_distance(Gap, V1, V2, A) ; braking_limit(B), A is -B ).
suggested_acceleration(Car, A) :- leader(now, Car, Gap, V2), speed(ego, V1), brake_firmly(Gap, V1, V2, A).
suggested_acceleration(Car, A) :- merging(soon, Car), comfortable_braking(B), A is -B.
suggested_acceleration(Car, A) :- merging(now, Car), rear_braking(B), A is -B.

% keep_distance(Gap, V1, V2, A): the interaction term of the Intelligent Driver Model. It overreacts to a vehicle that cuts in; so the
% ego brakes at most comfortable_braking/1 harder than a leader requires that keeps its speed.
% Source: Treiber and Kesting 2013, sections 11.3 and 11.3.8 (constant-acceleration heuristic, here without its smooth transition).
keep_distance(Gap, V1, V2, A) :-
    comfortable_acceleration_limit(Most), comfortable_braking(B), time_gap(T), queue_gap(D),
    Wanted is D + max(0.0, V1 * T + V1 * (V1 - V2) / (2 * sqrt(Most * B))),
    Closing is max(0.0, V1 - V2),
    A is max(Most * (1 - (Wanted / Gap) * (Wanted / Gap)), -Closing * Closing / (2 * Gap) - B).

% brake_firmly(Gap, V1, V2, A): between comfortable_braking/1, if the ego would need rear_braking/1, and full braking.
brake_firmly(Gap, V1, V2, A) :-
    braking_needed(Gap, V1, V2, Needed), rear_braking(Sure), Needed > Sure,
    comfortable_braking(B), braking_limit(Hardest), A is -B - (Hardest - B) * (Needed - Sure) / (Hardest - Sure).
