% crossing.properties.pl - what holds for every set of facts, with any number of zones and so of vehicles:
% drlsl rules verify envs/crossing.pl --property envs/crossing.properties.pl
%
%   property(Name, Text), violates(Name)   a property, and that a set of facts, with some values of the unknowns, breaks it
%   facts(Fact, Rows)                      the facts that the rules are told: what each column may hold, and how many rows there are
%   unknown(Name, Low, High, Text)         any number from Low to High, given as the fact Name(Number)
%
% The motion is written a second time, with the time as an unknown, so that an error in the rules cannot hide itself.
% docs/shielded-environments.md ("Crossings of highway-env") says what the properties mean together.
%
% Assumptions: The ego's speed approaches the one that it steers for with a time constant of 0.6 s. Others speed up by at most 0.5 m/s2, never
% beyond their highest speed; those whose direction is like the ego's (cosine above 0.7) brake by at most 3 m/s2, those who cross its way do not
% brake. Nobody drives backwards. Wherever two come too near, a zone says so.

facts(ego(number(0, 40), integer(0, 3), one_of([approach, inside, exit, ring_exit])), one).
facts(speeds(number(0, 10), number(0, 10), number(0, 40)), one).
facts(aim(one_of([slower, idle, faster, lane_left, lane_right]), integer(0, 2), number(0, 40)), any).
facts(line(integer(0, 2), number(-300, 300), number(-300, 300)), any).
facts(
    zone(
        integer(0, 3), integer(0, 2), number(0, 300), number(0, 300), number(0, 300), number(0, 300), number(-1, 1), number(0, 40),
        number(0, 40), integer(0, 3), one_of([approach, inside, exit, ring_exit, beside, behind])
    ),
    any
).

:- dynamic(speed_at_decision/1).
:- dynamic(speed_aimed_at/1).
:- dynamic(since_decision/1).
:- dynamic(left_of_difference/1).
:- dynamic(speed_of_car/1).
:- dynamic(highest_speed/1).
:- dynamic(alikeness/1).
:- dynamic(time_before/1).
:- dynamic(moment/1).
:- dynamic(time_after/1).
:- dynamic(way_of_ego/1).
:- dynamic(way_of_car/1).

unknown(speed_at_decision, 0, 40, 'the ego''s speed at a decision, m/s').
unknown(speed_aimed_at, 0, 40, 'the speed that it steers for from then on, m/s').
unknown(since_decision, 0, 1, 'time since that decision, s').
unknown(left_of_difference, 0, 1, 'what is left then of the difference between the two').
unknown(speed_of_car, 0, 40, 'speed of another vehicle, m/s').
unknown(highest_speed, 0, 40, 'its highest speed, m/s').
unknown(alikeness, -1, 1, 'the cosine between its direction and the ego''s').
unknown(time_before, 0, 4, 'a time, s').
unknown(moment, 0, 4, 'a time not before it, s').
unknown(time_after, 0, 4, 'a time not before that, s').
unknown(way_of_ego, 0, 300, 'how far the ego has come, m').
unknown(way_of_car, 0, 300, 'how far another vehicle has come, m').

% Motion

property(ego_between, 'at every time of a quarter of a second the ego is between where moves/5 has it at the beginning and at the end').
violates(ego_between) :-
    spec_quarter(Quarter, T, E), spec_ego(T, E, S), spec_speeds(V0, W), moves(V0, W, Quarter, Least, _), S < Least - 1.0e-6.
violates(ego_between) :-
    spec_quarter(Quarter, T, E), spec_ego(T, E, S), spec_speeds(V0, W), After is Quarter + 1, moves(V0, W, After, Most, _),
    S > Most + 1.0e-6.

property(decisions_follow, 'each decision finds the ego where, and as fast as, it is a second after the one before').
violates(decisions_follow) :-
    aim(_, _, Aim), spec_plan(Plan, Decision, Steps), starts(Plan, Aim, Decision, S0, V0), spec_aimed_at(Aim, Steps, W),
    Next is Decision + 1, starts(Plan, Aim, Next, S1, V1), spec_apart(S0, V0, W, S1, V1).

% spec_apart(S0, V0, W, S1, V1): the ego, a second after S0 and V0 steering for W, is not at S1 with V1.
spec_apart(_, V0, W, _, V1) :- abs(V1 - (W + (V0 - W) * 0.188875603)) > 1.0e-6.
spec_apart(S0, V0, W, S1, _) :- abs(S1 - (S0 + W + (V0 - W) * 0.4866746382)) > 1.0e-6.

property(others_between, 'at every time another vehicle is between slowest/4 of any time before and fastest/4 of any time after').
violates(others_between) :- spec_car(Alike, V, _, T, S), time_before(T0), T0 =< T, slowest(V, Alike, T0, Least), S < Least - 1.0e-6.
violates(others_between) :- spec_car(_, V, Top, T, S), time_after(T1), T1 >= T, fastest(V, Top, T1, Most), S > Most + 1.0e-6.

% Conflicts

property(no_conflict, 'on a clear plan there is in no quarter of three seconds another vehicle in a zone while the ego may be in it').
violates(no_conflict) :-
    aim(_, Way, Aim), spec_plan(Plan, 1, _), \+ meets(Way, Aim, Plan, _, _),
    spec_in_zone(Way, Aim, Plan, Quarter, From2, To2, car(Alike, V, Top, _, _)),
    T0 is (Quarter - 1) * 0.25, slowest(V, Alike, T0, Least), T1 is Quarter * 0.25, fastest(V, Top, T1, Most),
    way_of_car(S), S >= Least, S =< Most, S >= From2, S =< To2.

property(gives_way, 'nor one that has the right of way and comes into it within half a second').
violates(gives_way) :-
    aim(_, Way, Aim), spec_plan(Plan, 1, _), \+ meets(Way, Aim, Plan, _, _),
    spec_in_zone(Way, Aim, Plan, Quarter, From2, To2, car(Alike, V, Top, Priority, Place)),
    spec_first(Priority, Place), T0 is (Quarter - 1) * 0.25, slowest(V, Alike, T0, Least), T1 is Quarter * 0.25 + 0.5,
    fastest(V, Top, T1, Most), Least =< To2, Most >= From2.

% spec_in_zone(Way, Aim, Plan, Quarter, From2, To2, car(Alike, V, Top, Priority, Place)): in that quarter of a second the ego may be in a zone that it
% has with a vehicle that is not behind it in its lane.
spec_in_zone(Way, Aim, Plan, Quarter, From2, To2, car(Alike, V, Top, Priority, Place)) :-
    zone(_, Way, From1, To1, From2, To2, Alike, V, Top, Priority, Place), Place \== behind,
    between(1, 12, Quarter), Before is Quarter - 1, way(Plan, Aim, Before, Least), way(Plan, Aim, Quarter, Most),
    way_of_ego(S), S >= Least, S =< Most, S >= From1, S =< To1.

% spec_quarter(Quarter, T, E): the time T after a decision is in that quarter of a second, and E is what may be left of the difference of speeds:
% it falls from A to B of spec_left(Quarter, A, B), in each quarter by no more than the slope at its beginning, 1 / 0.6 of what is left.
spec_quarter(Quarter, T, E) :-
    spec_left(Quarter, A, B), since_decision(T), left_of_difference(E), T >= Quarter * 0.25, T =< (Quarter + 1) * 0.25, E =< A, E >= B,
    A - E =< (T - Quarter * 0.25) / 0.6, E - B =< ((Quarter + 1) * 0.25 - T) / 0.6.
spec_left(0, 1.0, 0.659240630).
spec_left(1, 0.659240630, 0.434598209).
spec_left(2, 0.434598209, 0.286504797).
spec_left(3, 0.286504797, 0.188875603).

% spec_ego(T, E, S): the ego has come S far at the time T after a decision. spec_speeds(V0, W): from V0, steering for W.
spec_ego(T, E, S) :- spec_speeds(V0, W), S is W * T + (V0 - W) * 0.6 * (1.0 - E).
spec_speeds(V0, W) :- speed_at_decision(V0), speed_aimed_at(W).

% spec_plan(Plan, Decision, Steps): after a decision a plan steers for so many steps more than the action. spec_aimed_at(Aim, Steps, W): that is W.
spec_plan(stop, 1, 0.0).
spec_plan(stop, 2, -1.0).
spec_plan(go, 1, 0.0).
spec_plan(go, 2, 1.0).
spec_aimed_at(Aim, Steps, W) :- speeds(Low, By, High), W is min(High, max(Low, Aim + Steps * By)).

% spec_car(Alike, V, Top, T, S): another vehicle, at V now, may have come S far at the time T. spec_at_least(Alike, V, T, S): no less far than so.
spec_car(Alike, V, Top, T, S) :-
    speed_of_car(V), highest_speed(Top), Top >= V, alikeness(Alike), moment(T), way_of_car(S),
    S =< V * T + 0.25 * T * T, S =< Top * T, spec_at_least(Alike, V, T, S).
spec_at_least(Alike, V, T, S) :- Alike =< 0.7, S >= V * T.
spec_at_least(Alike, V, T, S) :- Alike > 0.7, 3.0 * T =< V, S >= V * T - 1.5 * T * T.
spec_at_least(Alike, V, T, S) :- Alike > 0.7, 3.0 * T > V, S >= V * V / 6.0.

% spec_first(Priority, Place): who is there has the right of way over an ego that approaches.
spec_first(_, inside) :- ego(_, _, approach).
spec_first(Priority, approach) :- ego(_, Rank, approach), Priority > Rank.
