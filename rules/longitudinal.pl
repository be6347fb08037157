% longitudinal.pl - how fast to go: the acceleration asked of the ego and the speed that follows. Included by highway.pl.

% comfortable_braking(B): the hardest braking while the gap in front is longer than required.
comfortable_braking(3.0).

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

% following_acceleration(Car, A): what vehicle Car in front calls for. Beyond the required gap, the acceleration that has
% the leader's speed when the gap is down to it; within it, the braking that stops behind a leader braking at its hardest.
% Source: paper, Longitudinal Velocity Control, with the leader's stopping distance of RSS added where the gap is short.
following_acceleration(Car, A) :-
    busy_section(front, Car, Gap), speed(ego, V1), speed(Car, V2), required_gap(V1, V2, Required),
    ( Gap > Required ->
        comfortable_braking(B), A is max(-B, (V2 * V2 - V1 * V1) / (2 * (Gap - Required)))
    ;   front_braking(B), A is -(V1 * V1) / (2 * (Gap + V2 * V2 / (2 * B)))
    ).

% longitudinal_velocity(V): the speed to drive next, from 0 to the lane's limit. Source: paper, v + a dt.
longitudinal_velocity(V) :-
    acceleration_x(A), speed(ego, V0), time_step(Dt), speed_limit(Limit),
    V is max(0.0, min(Limit, V0 + A * Dt)).
