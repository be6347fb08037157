% un_r157.properties.pl - what must hold in every scene with the critical distance of un_r157.pl, besides most of properties.pl.
%
% Of properties.pl, critical_distance_front, critical_distance_back, safe_entry and gives_way do not hold here, and should not:
% they demand the distance of RSS. The properties below demand that of UN R157 instead, and say what it guarantees. UN R157 is about
% vehicles that drive the same way; to an oncoming vehicle the distance of RSS is kept (opposite_distance).
% property/2 and violates/1 are as in properties.pl, unknown/4 as in dynamics.pl.

:- ensure_loaded('properties.pl').

:- dynamic(moment/1).
:- dynamic(rear_speed/1).
:- dynamic(front_speed/1).
:- dynamic(gap_between/1).

unknown(moment, 0, 1000, 'time after the decision, s').
unknown(rear_speed, 0, 70, 'speed of a vehicle behind, m/s').
unknown(front_speed, 0, 70, 'speed of a vehicle in front, m/s').
unknown(gap_between, 0, 1000, 'gap between the two, m').

property(r157_front,
    'no lane change is offered with a vehicle ahead in the target lane at less than the time to collision of UN R157').
violates(r157_front) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), Offset > 0.0,
    spec_speed(ego, V1), spec_speed(Car, V2), spec_collides_too_soon(Gap, V1, V2).

property(r157_back,
    'no lane change is offered with a vehicle behind in the target lane at less than the time to collision of UN R157').
violates(r157_back) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), Offset < 0.0,
    spec_speed(Car, V1), spec_speed(ego, V2), spec_collides_too_soon(Gap, V1, V2).

property(r157_entry,
    'the ego never enters the road alongside a vehicle of its lane, at less than that time, or too near to an oncoming one').
violates(r157_entry) :- entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, _, Gap), Gap =< 0.0.
violates(r157_entry) :-
    entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), Offset > 0.0,
    spec_speed(ego, V1), spec_speed(Car, V2), spec_collides_too_soon(Gap, V1, V2).
violates(r157_entry) :-
    entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), Offset < 0.0,
    spec_speed(Car, V1), spec_speed(ego, V2), spec_collides_too_soon(Gap, V1, V2).
violates(r157_entry) :- entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), spec_comes_too_near(Car, Offset, Gap).

property(r157_gives_way,
    'with a vehicle ahead at less than that time, or an oncoming one too near, the target speed is below the ego''s, or 0').
violates(r157_gives_way) :-
    longitudinal_velocity(V), V > 0.0, spec_speed(ego, V1), V >= V1,
    spec_in_path(Car), spec_gap(Car, Offset, Gap), Offset > 0.0, Gap > 0.0,
    spec_speed(Car, V2), spec_collides_too_soon(Gap, V1, V2).
violates(r157_gives_way) :-
    longitudinal_velocity(V), V > 0.0, spec_speed(ego, V1), V >= V1,
    spec_in_path(Car), spec_gap(Car, Offset, Gap), Gap > 0.0, spec_comes_too_near(Car, Offset, Gap).

property(r157_is_enough, 'from a gap above the critical distance there is no contact while the vehicle in front keeps its speed').
violates(r157_is_enough) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), critical_distance(V1, V2, Critical), Gap > Critical,
    moment(T), spec_evading_way(0.35, 6.0, V1, V2, T, Rear), Gap + V2 * T - Rear =< 0.0.

property(r157_is_least, 'from any smaller gap there is a contact if it keeps its speed').
violates(r157_is_least) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), critical_distance(V1, V2, Critical), Gap < Critical,
    T is 0.35 + (V1 - V2) / 6.0, spec_evading_way(0.35, 6.0, V1, V2, T, Rear), Gap + V2 * T - Rear >= 0.0.

% spec_collides_too_soon(Gap, V1, V2): a vehicle at V1 closes in on one at V2, and the time to collision is not above the criterion.
spec_collides_too_soon(Gap, V1, V2) :- V1 > V2, V is max(0.0, V1 - V2), Gap =< V * (V / (2 * 6.0) + 0.35).
