% straight_road.properties.pl - what holds in every state for straight_road.pl; tests/shield/environments/test_straight_road_proofs.py proves it.
%
%   property(Name, Text), violates(Name)   a property, and that a state breaks it
%
% The motion is written a second time, so that an error in the rules cannot hide itself: the ego's speed approaches the one that it steers for
% with a time constant of 0.6 s, of three decisions a second long, and a vehicle ahead brakes by 5 m/s2 until it stands.

:- ensure_loaded('straight_road.pl').

property(behind_at_each_decision,
    'at up to 31 m/s, after a safe action and then going slower, the ego is more than 2.5 m behind a vehicle of its lane at three decisions').
violates(behind_at_each_decision) :-
    safe(Action), spec_in_lane(Action, Gap, V2), spec_way(Action, Number, S1), T is 1.0 * Number, spec_braking_way(V2, T, S2),
    Gap + S2 - S1 =< 2.5.

property(room_behind, 'no lane change is safe with a vehicle behind in that lane that would have to brake by more than 3 m/s2 after 0.7 s').
violates(room_behind) :-
    safe(Action), aim(Action, Y, V), ego(X1, Y1, V1, _, L1, _), Y =\= Y1, ( Action = lane_left ; Action = lane_right ),
    vehicle(_, X2, Y2, V2, _, L2, _, _, _), X2 < X1, abs(Y2 - Y) < 1.0, V2 > V1, V2 > V, Gap is X1 - X2 - (L1 + L2) / 2,
    Closing is V2 - min(V1, V), Gap - 0.7 * Closing < Closing * Closing / 6.0.

% spec_in_lane(Action, Gap, V): a vehicle with the speed V is ahead by Gap, its body in the lane that Action steers for.
spec_in_lane(Action, Gap, V) :-
    aim(Action, Y, _), ego(X1, _, _, _, L1, W1), vehicle(_, X2, Y2, V, _, L2, W2, _, _), X2 > X1, abs(Y2 - Y) < (W1 + W2) / 2,
    Gap is X2 - X1 - (L1 + L2) / 2.

% spec_way(Action, Number, S): how far the ego comes within Number decisions.
spec_way(Action, 1, S) :- spec_first(Action, _, _, S).
spec_way(Action, 2, S) :- spec_second(Action, _, _, S).
spec_way(Action, 3, S) :- spec_second(Action, A, V, S1), spec_slower(A, B), spec_move(V, B, S2, _), S is S1 + S2.

% spec_first(Action, A, V, S), spec_second(Action, A, V, S): after one decision, and after two, the speed steered for, the speed and the way.
spec_first(Action, A, V, S) :- aim(Action, _, A), ego(_, _, V0, _, _, _), spec_move(V0, A, S, V).
spec_second(Action, B, V, S) :- spec_first(Action, A, V1, S1), spec_slower(A, B), spec_move(V1, B, S2, V), S is S1 + S2.

% spec_slower(A, B): the speed steered for after going slower.
spec_slower(A, B) :- speeds(Low, Step), B is max(Low, A - Step).

% spec_move(V0, A, S, V): in one decision the ego comes S far, and is then at V.
spec_move(V0, A, S, V) :- period(_, Fade), S is A + (V0 - A) * 0.6 * (1.0 - Fade), V is A + (V0 - A) * Fade.

% spec_braking_way(V, T, S): how far a vehicle comes that brakes.
spec_braking_way(V, T, S) :- V >= 5.0 * T, S is V * T - 2.5 * T * T.
spec_braking_way(V, T, S) :- V < 5.0 * T, S is V * V / 10.0.
