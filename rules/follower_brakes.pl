% follower_brakes.pl - highway.pl with less room behind: enough for a follower that brakes gently.
%
% Assumed: the ego, once in the lane, keeps its speed. A faster vehicle behind keeps its own speed for 0.4 s and then brakes by 3 m/s2
% down to that of the ego. In the end it keeps a time headway of 1 s, and never less than the room at standstill. One that is not
% faster keeps its speed and needs the time headway at once. highway.pl assumes, with RSS, that the ego may brake by 8 m/s2 and the
% follower accelerates for 0.35 s and then brakes by 6 m/s2, which takes about twice the room from a faster follower. The numbers are
% assumptions of this file, taken from no regulation. Ahead, and towards oncoming vehicles, highway.pl's distances remain.

:- ensure_loaded('highway.pl').
:- abolish(required_gap_behind/3).    % redefined here

% follower_response(T): the time before the follower brakes.
follower_response(0.4).

% follower_braking(B): how hard the follower brakes.
follower_braking(3.0).

% follower_headway(T): the time headway that it keeps, at its own speed.
follower_headway(1.0).

% required_gap_behind(VRear, VEgo, Gap): what the follower gains on the ego until it is no faster, and what it keeps from then on.
required_gap_behind(VRear, VEgo, Gap) :-
    follower_response(T), follower_braking(B), follower_headway(Headway), standstill_gap(D),
    ( VRear > VEgo -> V is VRear - VEgo, Kept = VEgo ; V = 0.0, Kept = VRear ),
    Gap is V * T + V * V / (2 * B) + max(D, Kept * Headway).
