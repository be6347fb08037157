% dynamics.pl - what follows from a decision as long as all vehicles keep to the assumptions of RSS: proved by
% drlsl rules verify --property dynamics.pl. docs/verify.md ("Dynamics") says what the properties mean together.
%
%   property(Name, Text)              a property and its meaning
%   violates(Name)                    the scene, with some values of the unknowns, breaks the property
%   unknown(Name, Low, High, Text)    any number from Low to High, given as the fact Name(Number)
%   in(alone, Goal)                   Goal in a scene with only the ego and the vehicle of focus(Car), which may be any
%
% Assumptions: A vehicle behind, the ego or another, and each of two that drive towards each other, accelerates by at most 3 m/s2
% for its response time of 0.35 s and then brakes by at least 6 m/s2 until it stands. A vehicle in front brakes by at most 8 m/s2.
% No vehicle turns round. Only the vehicles that spec_claims/2 names (in the lane, or drifting into it within 3 s) come into the lane
% that the ego changes to.

:- ensure_loaded('spec.pl').

:- dynamic(moment/1).
:- dynamic(later/1).
:- dynamic(acceleration/1).
:- dynamic(way_so_far/1).
:- dynamic(speed_by_then/1).
:- dynamic(rear_speed/1).
:- dynamic(front_speed/1).
:- dynamic(gap_between/1).
:- dynamic(reached_speed/1).
:- dynamic(step_share/1).
:- dynamic(farther_gap/1).
:- discontiguous(property/2).
:- discontiguous(violates/1).

unknown(moment, 0, 1000, 'time after the decision, s').
unknown(later, 0, 1000, 'time after that moment, s').
unknown(acceleration, -100, 100, 'acceleration from that moment on, m/s2').
unknown(way_so_far, 0, 100000, 'distance driven until that moment, m').
unknown(speed_by_then, 0, 1000, 'speed at that moment, m/s').
unknown(rear_speed, 0, 70, 'speed of a vehicle behind, m/s').
unknown(front_speed, 0, 70, 'speed of a vehicle in front, m/s').
unknown(gap_between, 0, 1000, 'gap between the two, m').
unknown(reached_speed, 0, 71, 'the ego''s speed after a step, m/s').
unknown(step_share, 0, 1, 'share of a time step that has passed').
unknown(farther_gap, 0, 1000, 'a larger gap, m').

% How far vehicles go

% By induction over steps of constant acceleration of any length: a vehicle within the bounds so far stays within them.

property(front_comes_so_far, 'a vehicle in front braking by at most 8 m/s2 never falls below spec_front_way/3 or spec_front_speed/3').
violates(front_comes_so_far) :-
    front_speed(V), moment(T), spec_front_way(V, T, S), spec_front_speed(V, T, U),
    way_so_far(S0), S0 >= S, speed_by_then(U0), U0 >= U,
    later(T1), acceleration(A), A >= -8.0, U1 is U0 + A * T1, U1 >= 0.0,
    T2 is T + T1, spec_front_way(V, T2, S2), S0 + U0 * T1 + A * T1 * T1 / 2 < S2.
violates(front_comes_so_far) :-
    front_speed(V), moment(T), spec_front_speed(V, T, U), speed_by_then(U0), U0 >= U,
    later(T1), acceleration(A), A >= -8.0, U1 is U0 + A * T1, U1 >= 0.0,
    T2 is T + T1, spec_front_speed(V, T2, U2), U1 < U2.

property(rear_comes_no_further, 'a vehicle behind that keeps the assumptions never exceeds spec_rear_way/3 or spec_rear_speed/3').
violates(rear_comes_no_further) :-
    rear_speed(V), moment(T), spec_rear_way(V, T, S), spec_rear_speed(V, T, U),
    way_so_far(S0), S0 =< S, speed_by_then(U0), U0 =< U,
    later(T1), spec_rear_accelerates(T, T1, U0, A), U0 + A * T1 >= 0.0,
    T2 is T + T1, spec_rear_way(V, T2, S2), S0 + U0 * T1 + A * T1 * T1 / 2 > S2.
violates(rear_comes_no_further) :-
    rear_speed(V), moment(T), spec_rear_speed(V, T, U), speed_by_then(U0), U0 =< U,
    later(T1), spec_rear_accelerates(T, T1, U0, A), U0 + A * T1 >= 0.0,
    T2 is T + T1, spec_rear_speed(V, T2, U2), U0 + A * T1 > U2.

% spec_front_way(V, T, S), spec_front_speed(V, T, U): the least distance driven in the time T from speed V, and the least speed then.
spec_front_way(V, T, S) :- 8.0 * T < V, S is V * T - 8.0 * T * T / 2.
spec_front_way(V, T, S) :- 8.0 * T >= V, S is V * V / (2 * 8.0).
spec_front_speed(V, T, U) :- U is max(0.0, V - 8.0 * T).

% spec_rear_way(V, T, S), spec_rear_speed(V, T, U): the greatest distance driven in the time T from speed V, and the highest speed.
spec_rear_way(V, T, S) :- T =< 0.35, spec_speeds_up(A), S is V * T + A * T * T / 2.
spec_rear_way(V, T, S) :-
    T > 0.35, U is V + 3.0 * 0.35, T1 is T - 0.35, 6.0 * T1 < U,
    S is V * 0.35 + 3.0 * 0.35 * 0.35 / 2 + U * T1 - 6.0 * T1 * T1 / 2.
spec_rear_way(V, T, S) :- T > 0.35, 6.0 * (T - 0.35) >= V + 3.0 * 0.35, spec_rear_stop(V, S).
spec_rear_speed(V, T, U) :- T =< 0.35, spec_speeds_up(A), U is V + A * T.
spec_rear_speed(V, T, U) :- T > 0.35, U is max(0.0, V + 3.0 * 0.35 - 6.0 * (T - 0.35)).

% spec_speeds_up(A): 3 m/s2 less a billionth, because 3.0 * 0.35 in floating point is a little less than 1.05.
spec_speeds_up(2.999999999).

% spec_rear_accelerates(T, T1, U, A): a vehicle that is at speed U at the time T may accelerate by A for the next T1.
spec_rear_accelerates(T, T1, _, A) :- T + T1 =< 0.35, acceleration(A), spec_speeds_up(Most), A =< Most.
spec_rear_accelerates(T, _, _, A) :- T >= 0.35, acceleration(A), A =< -6.0.
spec_rear_accelerates(T, _, U, 0.0) :- T >= 0.35, U =< 0.0.

% Lane changes

property(nearest_at_the_ends, 'from a decision until both vehicles stand, their gap is smallest at the beginning or at the end').
violates(nearest_at_the_ends) :-
    rear_speed(V1), front_speed(V2), moment(T), spec_front_way(V2, T, Front), spec_rear_way(V1, T, Rear),
    spec_least_gap(0.0, V1, V2, Least), Front - Rear < Least.

property(nearest_when_both_stand, 'the gap between two vehicles that drive towards each other is smallest at the end').
violates(nearest_when_both_stand) :-
    rear_speed(V1), front_speed(V2), moment(T), spec_rear_way(V1, T, S1), spec_rear_way(V2, T, S2),
    spec_opposite(V1, V2, Distance), S1 + S2 > Distance.

property(keeps_apart_ahead, 'after a lane change is offered, the gap to a vehicle ahead there is at no moment under 2 m').
violates(keeps_apart_ahead) :-
    spec_moves_in(Car, Offset, Gap), Offset > 0.0, spec_speed(ego, V1), spec_speed(Car, V2),
    spec_least_gap(Gap, V1, V2, Least), Least < 2.0.

property(keeps_apart_behind, 'after a lane change is offered, the gap to a vehicle behind there is at no moment under 2 m').
violates(keeps_apart_behind) :-
    spec_moves_in(Car, Offset, Gap), Offset < 0.0, spec_speed(Car, V1), spec_speed(ego, V2),
    spec_least_gap(Gap, V1, V2, Least), Least < 2.0.

property(keeps_apart_oncoming, 'after a lane change is offered, the gap to an oncoming vehicle there is at no moment under 2 m').
violates(keeps_apart_oncoming) :-
    spec_moves_in(Car, Offset, Gap), Offset > 0.0, spec_speed(ego, V1), spec_coming(Car, V2),
    spec_opposite(V1, V2, Distance), Gap - Distance < 2.0.

% spec_moves_in(Car, Offset, Gap): Car is in, or drifts into, a lane that the ego may change to.
spec_moves_in(Car, Offset, Gap) :- spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap).

% spec_least_gap(Gap, V1, V2, Least): the smaller of Gap, now at speed V1 behind and V2 in front, and the gap when both stand.
spec_least_gap(Gap, V1, V2, Least) :- spec_rear_stop(V1, Rear), Least is min(Gap, Gap + V2 * V2 / (2 * 8.0) - Rear).

% The safe distances

property(distance_is_enough, 'from a gap above the critical distance there is at no moment a contact').
violates(distance_is_enough) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), Gap > 0.0, critical_distance(V1, V2, Critical), Gap > Critical,
    moment(T), spec_front_way(V2, T, Front), spec_rear_way(V1, T, Rear), Gap + Front - Rear =< 0.0.

property(distance_is_least, 'from any smaller gap there is a contact if both do the worst that is assumed of them').
violates(distance_is_least) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), critical_distance(V1, V2, Critical), Gap < Critical,
    spec_rear_stop(V1, Rear), Front is V2 * V2 / (2 * 8.0), Gap + Front - Rear >= 0.0.

property(opposite_is_enough, 'from a gap above the distance for opposite directions there is at no moment a contact').
violates(opposite_is_enough) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), opposite_distance(V1, V2, Distance), Gap > Distance,
    moment(T), spec_rear_way(V1, T, S1), spec_rear_way(V2, T, S2), Gap - S1 - S2 =< 0.0.

property(opposite_is_least, 'from any smaller gap there is a contact if both do the worst that is assumed of them').
violates(opposite_is_least) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), opposite_distance(V1, V2, Distance), Gap < Distance,
    spec_rear_stop(V1, S1), spec_rear_stop(V2, S2), Gap - S1 - S2 >= 0.0.

% Following

% In a step the ego reaches a speed by constant acceleration, as in drlsl.driving.simulation.controllers.move_forward, braking by at
% most 8 m/s2. A vehicle ahead that brakes by 8 m/s2 all the time stops V * V / 16 further on; one that brakes less stops further on,
% and has gone at least (V * V - U * U) / 16 when its speed is U: both follow from front_comes_so_far. An oncoming vehicle counts as
% standing where it will stop. That place is no nearer than the one that spec_leader/4 computes at any moment after its response:
% either the ego can stop even before that one, or it brakes as hard as it can.

property(can_stop_after_step,
    'if the ego can stop behind a vehicle ahead, it still can after a step to at most the speed that this vehicle requires').
violates(can_stop_after_step) :-
    spec_in_path(Car), focus(Car), spec_gap(Car, Offset, Gap), Offset > 0.0, spec_speed(ego, V1), spec_along(Car, V2),
    spec_can_stop(Gap, V1, V2), spec_reaches(V1, V), in(alone, longitudinal_velocity(Most)), V =< Most,
    \+ spec_can_stop_after(Gap, V1, V, V2).

property(can_stop_before_oncoming,
    'if the ego can stop before an oncoming vehicle, it still can after a step to at most the speed that this vehicle requires').
violates(can_stop_before_oncoming) :-
    spec_in_path(Car), focus(Car), spec_gap(Car, Offset, Gap), Offset > 0.0, spec_speed(ego, V1), spec_coming(Car, V2),
    spec_rear_stop(V2, Way), Room is Gap - Way,
    spec_can_stop(Room, V1, 0.0), spec_reaches(V1, V), in(alone, longitudinal_velocity(Most)), V =< Most,
    \+ spec_can_stop_after(Room, V1, V, 0.0).

property(brakes_fully_where_it_cannot, 'if the ego cannot stop behind a vehicle ahead, this vehicle requires full braking').
violates(brakes_fully_where_it_cannot) :-
    spec_in_path(Car), focus(Car), spec_gap(Car, Offset, Gap), Offset > 0.0, Gap > 0.0, spec_speed(ego, V1),
    spec_leader(Car, Gap, Room, V2), \+ spec_can_stop(Room, V1, V2),
    in(alone, longitudinal_velocity(Most)), time_step(Dt), Most > max(0.0, V1 - 8.0 * Dt).

property(nearer_is_no_softer,
    'the nearer a vehicle stands or will stop, if at least 1 mm away, the harder the ego brakes, up to full braking').
violates(nearer_is_no_softer) :-
    rear_speed(V), gap_between(Gap), Gap > 0.001, farther_gap(Farther), Farther > Gap,
    follow(Gap, V, 0.0, A), follow(Farther, V, 0.0, A1), max(-8.0, A) > max(-8.0, A1).

property(can_stop_after_full_braking,
    'if the ego can stop behind a vehicle ahead, it still can after a step of full braking').
violates(can_stop_after_full_braking) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), spec_can_stop(Gap, V1, V2), time_step(Dt), V is max(0.0, V1 - 8.0 * Dt),
    \+ spec_can_stop_after(Gap, V1, V, V2).

property(no_contact_within_step,
    'if the ego can stop after a step, it never touches a vehicle ahead that is no faster during the step').
violates(no_contact_within_step) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), spec_reaches(V1, V), spec_can_stop_after(Gap, V1, V, V2),
    step_share(Share), time_step(Dt), W is V1 + (V - V1) * Share, speed_by_then(U), U =< W,
    Gap + (V2 * V2 - U * U) / (2 * 8.0) - (V1 + W) / 2 * Share * Dt =< 0.0.

property(can_stop_after_change, 'one step after a lane change is offered, the ego can stop behind every vehicle ahead there').
violates(can_stop_after_change) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), Offset > 0.0,
    spec_speed(ego, V1), spec_leader(Car, Gap, Room, V2), spec_reaches(V1, V), time_step(Dt), V =< V1 + 3.0 * Dt,
    \+ spec_can_stop_after(Room, V1, V, V2).

property(can_stop_at_entry, 'where the ego enters the road, it can stop behind every vehicle ahead in its lane').
violates(can_stop_at_entry) :-
    entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), Offset > 0.0,
    spec_speed(ego, V1), spec_leader(Car, Gap, Room, V2), \+ spec_can_stop(Room, V1, V2).

% spec_leader(Car, Gap, Room, V): the room up to Car ahead, and its speed; if Car is oncoming, the room up to the nearest place where
% it may stop, and 0.
spec_leader(Car, Gap, Gap, V) :- spec_along(Car, V).
spec_leader(Car, Gap, Room, 0.0) :- spec_coming(Car, V), spec_rear_stop(V, Way), Room is Gap - Way.

% spec_reaches(V1, V): V is no lower than the speed to which full braking slows the ego from V1 within a step.
spec_reaches(V1, V) :- reached_speed(V), time_step(Dt), V >= V1 - 8.0 * Dt.
