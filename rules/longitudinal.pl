% longitudinal.pl - how fast to go: the acceleration asked of the ego and the speed that follows. Included by highway.pl.

% comfortable_braking(B): the braking that the ego plans with to come down to a leader's speed.
comfortable_braking(1.5).

% acceleration_x(A): the least acceleration that the road and the vehicles in front call for, within the ego's limits.
% Source: paper, Longitudinal Velocity Control.
acceleration_x(A) :-
    free_acceleration(Free),
    ( aggregate_all(min(A1), following_acceleration(_, A1), Following) -> Wanted is min(Free, Following) ; Wanted = Free ),
    acceleration_limit(Most), braking_limit(Hardest),
    A is max(-Hardest, min(Most, Wanted)).

% speed_limit(V): the limit of the lane that the ego is in.
speed_limit(V) :- lane(ego, Lane), road_lane(Lane, _, _, _, V).

% free_acceleration(A): to the limit within one time step. Source: paper, Eq. for front_is_free.
free_acceleration(A) :- speed_limit(Limit), speed(ego, V), time_step(Dt), A is (Limit - V) / Dt.

% following_acceleration(Car, A): what vehicle Car in front calls for.
following_acceleration(Car, A) :-
    leader(Car, Gap, V2), speed(ego, V1),
    ( Gap > 0.0 -> follow(Gap, V1, V2, A) ; braking_limit(B), A is -B ).

% A vehicle alongside whose centre is ahead, and that comes into the ego's way, is let in.
following_acceleration(Car, A) :-
    target_vehicle(Car), offset(Car, S), S > 0.0, place(alongside, Car, _), in_way(Car, own),
    rear_braking(B), A is -B.

% leader(Car, Gap, V): the gap to vehicle Car in front, and its speed. One that comes the other way counts as standing where it
% comes to a stop: there may be no room before that place.
leader(Car, Gap, V) :-
    busy_section(front, Car, Gap0), velocity(Car, V0), oncoming_way(V0, S), Gap is Gap0 - S, V is max(0.0, V0).

% oncoming_way(V, S): how far a vehicle of velocity V still comes towards the ego: not at all, if it does not drive the other way.
oncoming_way(V, S) :- ( V < 0.0 -> V1 is -V, stopping_way(V1, S) ; S = 0.0 ).

% follow(Gap, V1, V2, A): what a leader at speed V2 calls for. Source: paper, Longitudinal Velocity Control; here the ego may be
% as fast as lets it come down to the leader's speed at the required gap by comfortable braking. If it is faster, or the gap is
% short, it gives way; no softer in any case than the braking needed.
follow(Gap, V1, V2, A) :-
    required_gap(V1, V2, Required), comfortable_braking(B), time_step(Dt),
    GiveWay is min(-B, (V2 * V2 - V1 * V1) / (2 * Gap)),
    ( Gap > Required ->
        Wanted is max(GiveWay, (sqrt(V2 * V2 + 2 * B * (Gap - Required)) - V1) / Dt)
    ;   Wanted = GiveWay
    ),
    braking_needed(Gap, V1, V2, Needed), rear_braking(Sure),
    ( Needed > Sure -> A is min(Wanted, -Needed) ; A = Wanted ).

% braking_needed(Gap, V1, V2, B): the braking by which the ego, one time step from now, stops behind a leader that brakes at
% its hardest from now on. Until it needs the braking that the ego is sure to reach, there is time to give way gently.
braking_needed(Gap, V1, V2, B) :-
    front_braking(B2), time_step(Dt), Room is Gap + V2 * V2 / (2 * B2) - V1 * Dt,
    ( Room > 0.0 -> B is V1 * V1 / (2 * Room) ; braking_limit(B) ).

% longitudinal_velocity(V): the speed to drive next, from 0 to the lane's limit. Source: paper, v + a dt.
longitudinal_velocity(V) :-
    acceleration_x(A), speed(ego, V0), time_step(Dt), speed_limit(Limit),
    V is max(0.0, min(Limit, V0 + A * Dt)).
