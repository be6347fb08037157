% follower_brakes.properties.pl - what must hold in every scene with the room behind of follower_brakes.pl, besides most of
% properties.pl.
%
% Of properties.pl, critical_distance_back and safe_entry do not hold here, and should not: they demand the distance of RSS behind. The
% properties below demand that of follower_brakes.pl instead, and say what it guarantees.
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

property(follower_has_room,
    'no lane change is offered with a vehicle behind in the target lane that could not keep 1 s and 2 m by gentle braking').
violates(follower_has_room) :-
    spec_offered(Side), spec_claims(Car, Side), spec_gap(Car, Offset, Gap), Offset < 0.0, spec_follower_crowded(Car, Gap).

property(follower_entry,
    'the ego never enters the road alongside a vehicle, too near to one ahead or oncoming, or without that room for one behind').
violates(follower_entry) :- entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, _, Gap), Gap =< 0.0.
violates(follower_entry) :-
    entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), Offset > 0.0, spec_too_near(Car, Offset, Gap).
violates(follower_entry) :-
    entry_is_safe, spec_in_own_lane(Car), spec_gap(Car, Offset, Gap), Offset < 0.0, spec_follower_crowded(Car, Gap).

property(follower_keeps_distance,
    'from the gap required behind, a follower that brakes gently keeps 1 s and 2 m at every moment while the ego keeps its speed').
violates(follower_keeps_distance) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), required_gap_behind(V1, V2, Required), Gap >= Required,
    moment(T), spec_evading_way(0.4, 3.0, V1, V2, T, Rear), spec_follower_keeps(V1, V2, Least), Gap + V2 * T - Rear < Least.

property(follower_room_is_least, 'from any smaller gap it does not').
violates(follower_room_is_least) :-
    rear_speed(V1), front_speed(V2), gap_between(Gap), required_gap_behind(V1, V2, Required), Gap < Required,
    T is 0.4 + max(0.0, V1 - V2) / 3.0, spec_evading_way(0.4, 3.0, V1, V2, T, Rear), spec_follower_keeps(V1, V2, Least),
    Gap + V2 * T - Rear >= Least, Gap >= Least.

% spec_follower_keeps(V1, V2, Least): a follower at speed V1 behind a vehicle at V2 ends at the lower of the two speeds, and keeps 1 s
% at that speed, and 2 m.
spec_follower_keeps(V1, V2, Least) :- Least is max(2.0, min(V1, V2) * 1.0).

% spec_follower_crowded(Car, Gap): from Gap behind the ego, Car cannot keep that distance by braking at 3 m/s2 after 0.4 s.
spec_follower_crowded(Car, Gap) :-
    spec_speed(Car, V1), spec_speed(ego, V2), spec_follower_keeps(V1, V2, Least), V is max(0.0, V1 - V2),
    Gap < V * (0.4 + V / (2 * 3.0)) + Least.
