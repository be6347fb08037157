% longitudinal.pl - how fast to go: the acceleration of the ego and the speed that results. Included by highway.pl.

% comfortable_braking(B): the braking with which the ego plans to slow down to a leader's speed.
comfortable_braking(1.5).

% acceleration_x(A): the least acceleration that the road and the vehicles in front require, within the ego's limits.
% Source: paper, Longitudinal Velocity Control.
acceleration_x(A) :-
    free_acceleration(Free),
    ( aggregate_all(min(A1), following_acceleration(_, A1), Following) -> Wanted is min(Free, Following) ; Wanted = Free ),
    acceleration_limit(Most), braking_limit(Hardest),
    A is max(-Hardest, min(Most, Wanted)).

% speed_limit(V): the limit of the lane that the ego is in.
speed_limit(V) :- lane(ego, Lane), road_lane(Lane, _, _, _, V).

% free_acceleration(A): the acceleration that reaches the limit within one time step. Source: paper, Eq. for front_is_free.
free_acceleration(A) :- speed_limit(Limit), speed(ego, V), time_step(Dt), A is (Limit - V) / Dt.

% following_acceleration(Car, A): the acceleration that vehicle Car in front requires.
following_acceleration(Car, A) :-
    leader(Car, Gap, V2), speed(ego, V1),
    ( Gap > 0.0 -> follow(Gap, V1, V2, A) ; braking_limit(B), A is -B ).

% The ego gives way to a vehicle alongside whose centre is ahead and that comes into the ego's way.
following_acceleration(Car, A) :-
    target_vehicle(Car), offset(Car, S), S > 0.0, place(alongside, Car, _), in_way(Car, own),
    rear_braking(B), A is -B.

% leader(Car, Gap, V): the gap to vehicle Car in front, and its speed. An oncoming vehicle counts as standing at the place where it
% will stop, so the gap may be negative.
leader(Car, Gap, V) :-
    busy_section(front, Car, Gap0), velocity(Car, V0), oncoming_way(V0, S), Gap is Gap0 - S, V is max(0.0, V0).

% oncoming_way(V, S): how far a vehicle with velocity V still comes towards the ego until it stands; 0 if it is not oncoming.
oncoming_way(V, S) :- ( V < 0.0 -> V1 is -V, stopping_way(V1, S) ; S = 0.0 ).

% follow(Gap, V1, V2, A): the acceleration that a leader at speed V2 requires. Source: paper, Longitudinal Velocity Control; here the
% ego may be so fast that comfortable braking still brings it down to the leader's speed at the required gap. If it is faster, or the
% gap is short, it gives way, and always brakes at least as hard as needed once that exceeds rear_braking/1.
follow(Gap, V1, V2, A) :-
    required_gap(V1, V2, Required), comfortable_braking(B), time_step(Dt),
    GiveWay is min(-B, (V2 * V2 - V1 * V1) / (2 * Gap)),
    ( Gap > Required ->
        Wanted is max(GiveWay, (sqrt(V2 * V2 + 2 * B * (Gap - Required)) - V1) / Dt)
    ;   Wanted = GiveWay
    ),
    braking_needed(Gap, V1, V2, Needed), rear_braking(Sure),
    ( Needed > Sure -> A is min(Wanted, -Needed) ; A = Wanted ).

% braking_needed(Gap, V1, V2, B): the braking with which the ego, from one time step on, stops behind a leader that brakes at its
% hardest from now on. As long as this is below the braking that the ego certainly reaches, it can give way gently.
braking_needed(Gap, V1, V2, B) :-
    front_braking(B2), time_step(Dt), Room is Gap + V2 * V2 / (2 * B2) - V1 * Dt,
    ( Room > 0.0 -> B is V1 * V1 / (2 * Room) ; braking_limit(B) ).

% longitudinal_velocity(V): the speed to drive next, from 0 to the lane's limit. Source: paper, v + a dt.
longitudinal_velocity(V) :-
    acceleration_x(A), speed(ego, V0), time_step(Dt), speed_limit(Limit),
    V is max(0.0, min(Limit, V0 + A * Dt)).
