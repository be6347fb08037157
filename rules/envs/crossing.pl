% crossing.pl - which of highway-env's meta-actions are offered where traffic crosses: intersection-v0, roundabout-v0.
%
% An action is offered if it can be followed by a plan, to stop or to go on, on which the ego is in no zone of conflict while another vehicle
% may be in it. Others may take any branch, and keep their speed, speed up or slow down. The ego enters the crossing only if it can leave it
% again, stops before the line otherwise, and gives way to those who have it.
%
% Lengths are in m, speeds in m/s, accelerations in m/s2, times in s. Facts:
%
%   ego(V, Priority, Place)                            Place is approach, inside, exit, or ring_exit on a roundabout
%   speeds(Low, Step, High)                            the speeds that the ego can steer for: from Low to High, Step apart
%   aim(Action, Way, W)                                the actions that do anything, with the way that each follows and the speed it steers for
%   line(Way, Enter, Leave)                            how far the ego is from where its front is past the line of a crossing on that way, and
%                                                      from where the crossing ends; none on a roundabout
%   zone(Car, Way, From1, To1, From2, To2, Alike, V, Top, Priority, Place)
%                                                      while the ego's centre is From1 to To1 further on its way, and that of Car From2 to To2
%                                                      on one that it may take, they are too near; Alike is the cosine between their
%                                                      directions there; Car drives at V, at most at Top, on a road of that priority; Place is
%                                                      behind if it is behind the ego in its lane

:- dynamic ego/3, speeds/3, aim/3, line/3, zone/11.

% Parameters

% lag(L): the ego's speed approaches the one that it steers for with this time constant. Source: ControlledVehicle.TAU_ACC.
% left(Quarter, F): what is left of the difference after so many quarters of a decision's second, exp(-Quarter / 4 / L).
lag(0.6).
left(0, 1.0).
left(1, 0.659240630).
left(2, 0.434598209).
left(3, 0.286504797).
left(4, 0.188875603).

% step_time(H), last_step(N): the rules look at every quarter of three decisions.
step_time(0.25).
last_step(12).

% speeds_up(A), slows_down(B): what may change the speed of others. alike(C): who drives the ego's way may slow down, by the cosine of their
% directions; who crosses it keeps its speed or speeds up.
speeds_up(0.5).
slows_down(3.0).
alike(0.7).

% gap_time(T): nobody who has the right of way may have to brake: the ego has left a zone for so long when such a vehicle comes into it.
gap_time(0.5).

% near_line(D): how far before the line the ego takes up a gap in the traffic.
near_line(35.0).

% The ego's motion

% plan(Plan): what the ego does after an action. change(Plan, Decision, Change): its speed then, in steps from that of the action.
plan(stop).
plan(go).
change(_, 1, 0.0).
change(stop, 2, -1.0).
change(stop, 3, -2.0).
change(go, 2, 1.0).
change(go, 3, 2.0).

% steers_for(Plan, Aim, Decision, W): the speed that the ego steers for then, if the action steers for Aim.
steers_for(Plan, Aim, Decision, W) :- change(Plan, Decision, Change), speeds(Low, By, High), W is min(High, max(Low, Aim + Change * By)).

% moves(V0, W, Quarter, S, V): how far the ego comes in so many quarters of a second from the speed V0 if it steers for W, and its speed then.
moves(V0, W, Quarter, S, V) :-
    left(Quarter, F), lag(L), step_time(H), S is W * (Quarter * H) + (V0 - W) * L * (1.0 - F), V is W + (V0 - W) * F.

% starts(Plan, Aim, Decision, S, V): how far the ego has come when it takes a decision, and its speed then.
starts(_, _, 1, 0.0, V) :- ego(V, _, _).
starts(Plan, Aim, Decision, S, V) :-
    Decision > 1, Before is Decision - 1, starts(Plan, Aim, Before, S0, V0), steers_for(Plan, Aim, Before, W),
    moves(V0, W, 4, S1, V), S is S0 + S1.

% way(Plan, Aim, Step, S): how far the ego comes in so many steps.
way(Plan, Aim, Step, S) :-
    Decision is max(1, (Step + 3) // 4), Quarter is Step - 4 * (Decision - 1),
    starts(Plan, Aim, Decision, S0, V0), steers_for(Plan, Aim, Decision, W), moves(V0, W, Quarter, S1, _), S is S0 + S1.

% Others' motion

% fastest(V, Top, T, S), slowest(V, Alike, T, S): the farthest and the least that a vehicle at V may come within T.
fastest(V, Top, T, S) :- speeds_up(A), S is min(V * T + A * T * T / 2, Top * T).
slowest(V, Alike, T, S) :- alike(C), slows_down(B), ( Alike > C -> T1 is min(T, V / B), S is V * T1 - B * T1 * T1 / 2 ; S is V * T ).

% Right of way

% has_way(Priority, Place): who is there has the right of way over the ego: it is in the crossing already, or comes on a road of higher
% priority.
has_way(_, inside) :- ego(_, _, approach).
has_way(Priority, approach) :- ego(_, Priority0, approach), Priority > Priority0.

% lead(Priority, Place, T): how much earlier than who is there the ego must have left a zone.
lead(Priority, Place, T) :- ( has_way(Priority, Place) -> gap_time(T) ; T = 0.0 ).

% Conflicts

% meets(Way, Aim, Plan, Car, Step): in that step the ego, steering for Aim on Way, and Car may be in a zone of theirs at once. Nobody drives
% backwards: who is in a zone at some time of the step is in it or before its end at the beginning, and in it or past its beginning at the end.
% Who is behind the ego in its lane keeps its distance.
meets(Way, Aim, Plan, Car, Step) :-
    zone(Car, Way, From1, To1, From2, To2, Alike, V, Top, Priority, Place), Place \== behind,
    lead(Priority, Place, Lead), last_step(N), between(1, N, Step), step_time(H), Before is Step - 1,
    way(Plan, Aim, Before, S0), S0 =< To1, way(Plan, Aim, Step, S1), S1 >= From1,
    T0 is Before * H, slowest(V, Alike, T0, Least), Least =< To2,
    T1 is Step * H + Lead, fastest(V, Top, T1, Most), Most >= From2.

% conflict(Action, Plan, Car, Step): so it does after Action, and Plan after that. clear(Action, Plan): in no step, with nobody.
conflict(Action, Plan, Car, Step) :- aim(Action, Way, Aim), plan(Plan), meets(Way, Aim, Plan, Car, Step).
clear(Action, Plan) :- aim(Action, Way, Aim), plan(Plan), \+ meets(Way, Aim, Plan, _, _).

% ends_inside(Action, Plan): at the last step the ego is in the crossing, its front past the line.
ends_inside(Action, Plan) :-
    aim(Action, Way, Aim), plan(Plan), last_step(N), way(Plan, Aim, N, S), line(Way, Enter, Leave), S > Enter, S =< Leave.

% safe(Action): the ego can go on through the crossing after Action, or come to stand before the line, or behind the crossing.
safe(Action) :- clear(Action, go).
safe(Action) :- clear(Action, stop), \+ ends_inside(Action, stop).

% Actions

% can_go: the ego can go faster, or on at its highest speed.
can_go :- clear(faster, go).
can_go :- \+ aim(faster, _, _), clear(idle, go).

% gap_is_free: the ego is at the line of an intersection, past it or on its way out, and can go. Then it does not stand or dawdle there.
gap_is_free :- ego(_, _, exit), can_go.
gap_is_free :- aim(slower, Way, _), line(Way, Enter, Leave), near_line(D), Enter < D, Leave > 0.0, can_go.

% ring_is_free: the ego is at a roundabout or in it, where there is no line, and can go. Then it does not slow down.
ring_is_free :- ego(_, _, Place), Place \== exit, \+ line(_, _, _), can_go.

% offered(Action): what is safe; without it what comes to stand near nobody, wherever; without it what is in no conflict before the next
% decision; without it slower.
offered(Action) :- safe(Action), \+ dawdles(Action).
offered(Action) :- \+ safe(_), clear(Action, stop), \+ ( Action \== slower, clear(slower, stop) ).
offered(Action) :- \+ safe(_), \+ clear(_, stop), later(Action).
offered(slower) :- \+ safe(_), \+ clear(_, stop), \+ later(_).

% dawdles(Action): Action leaves a free gap unused.
dawdles(slower) :- gap_is_free.
dawdles(idle) :- gap_is_free, aim(faster, _, _).
dawdles(slower) :- ring_is_free.

% later(Action): Action brings the ego into no conflict before the next decision, which is that of the fifth step.
later(Action) :- aim(Action, _, _), \+ ( conflict(Action, go, _, Step), Step =< 4 ).

% objection(Action, Reason): why Action is not offered.
objection(Action, conflict(Plan, Car, Step)) :- unsafe(Action), conflict(Action, Plan, Car, Step).
objection(Action, stops_in_the_crossing) :- unsafe(Action), clear(Action, stop).
objection(Action, gap_is_free) :- dawdles(Action).

% unsafe(Action): an action of those that do anything that is not safe.
unsafe(Action) :- aim(Action, _, _), \+ safe(Action).
