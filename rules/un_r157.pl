% un_r157.pl - highway.pl with another critical distance: the cut-in criterion of UN Regulation 157 in place of RSS.
%
% UN R157, 5.2.5.2 has the system avoid a collision with a vehicle that cuts in while the time to collision is more than
% v_rel / (2 * 6 m/s2) + 0.35 s. The distance of that time is what a rear vehicle needs that responds after 0.35 s and then
% brakes by 6 m/s2 until it is as fast as the one in front, if that one keeps its speed. RSS lets it brake by 8 m/s2.
% Towards a vehicle that comes the other way, of which UN R157 says nothing, the distance of RSS stays.

:- ensure_loaded('highway.pl').
:- abolish(critical_distance/3).    % said anew here

% critical_distance(VRear, VFront, C): the way by which the rear vehicle comes nearer until it is no faster; 0 where it is not.
% Source: UN R157, 5.2.5.2.
critical_distance(VRear, VFront, C) :-
    response_time(T), rear_braking(B), V is max(0.0, VRear - VFront), C is V * (V / (2 * B) + T).
