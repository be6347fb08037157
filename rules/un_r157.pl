% un_r157.pl - highway.pl with another critical distance: the cut-in criterion of UN Regulation 157 instead of RSS.
%
% UN R157, 5.2.5.2 requires the system to avoid a collision with a vehicle that cuts in if the time to collision is more than
% v_rel / (2 * 6 m/s2) + 0.35 s. The distance covered in that time is what a rear vehicle needs if it responds after 0.35 s and
% then brakes by 6 m/s2 down to the speed of the front vehicle, which keeps its speed; RSS assumes that the front one brakes by 8 m/s2.
% UN R157 does not cover oncoming vehicles; for them the distance of RSS is kept.

:- ensure_loaded('highway.pl').
:- abolish(critical_distance/3).    % redefined here

% critical_distance(VRear, VFront, C): how much nearer the rear vehicle comes until it is no faster; 0 if it is not faster now.
% Source: UN R157, 5.2.5.2.
critical_distance(VRear, VFront, C) :-
    response_time(T), rear_braking(B), V is max(0.0, VRear - VFront), C is V * (V / (2 * B) + T).

% following_acceleration(Car, A): adds that the ego gives way to an oncoming vehicle within the distance of RSS. In highway.pl that
% follows from the distance to where it will stop, which is shorter here.
following_acceleration(Car, A) :-
    target_vehicle(Car), place(ahead, Car, Gap), in_way(Car, now), velocity(Car, V2), V2 < 0.0,
    speed(ego, V1), required_gap(V1, V2, Required), Gap =< Required, giving_way(B), A is -B.
