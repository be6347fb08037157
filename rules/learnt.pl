% learnt.pl - when a lane change is open, learnt from driving by drlsl rules learn.
%
% 24,759 safe and 15,266 unsafe examples, of which the 570 that are hardest to leave out matter; 8,766 safe ones cannot be
% offered, since an unsafe one is as easy on every quantity; for instance this one was safe (highway-train, to the right: gap
% behind -6.92, gap ahead 38.66, gap beyond -, gap follower 53.56, closing behind -3.20, closing ahead 8.86, headway behind -0.30,
% headway ahead 1.21, time_to_collision behind -, time_to_collision ahead 4.36) and this one was not (highway-train, to the right:
% gap behind -6.48, gap ahead 45.33, gap beyond -, gap follower -, closing behind -4.37, closing ahead 5.01, headway behind -0.28,
% headway ahead 1.60, time_to_collision behind -, time_to_collision ahead 9.05)
% 3 clauses offer 11,762 of the safe ones and no unsafe one: the best choice that was found in time
% 8 rounds; nothing went wrong in the last
% stress on highway-train: 10,000 episodes, 70,032 lane changes, 0 at fault, 0 off the road, 4,094 excused
% stress on freeway: 10,000 episodes, 7,055 lane changes, 0 at fault, 0 off the road, 10,000 excused
% property nobody_alongside: proved
% property nothing_hidden: proved

:- ensure_loaded('learning.pl').

:- abolish(objection/2).

% objection(Action, Reason): Reason speaks against a lane change: one is under way, or no lane is open.
objection(Action, changing_lanes) :- lane_change(Action, _), \+ settled.
objection(Action, no_lane) :- lane_change(Action, Side), \+ side_lane(Side, _).
objection(Action, no_opening) :- lane_change(Action, Side), \+ opening(Side).

% opening(Side): the lane on that side is open: no vehicle there is too near, or too fast.

% Clause 1 offers 9,159 of the 24,759 safe examples, 9,159 of them as the first; none of the 15,266 unsafe ones.
%   gap(Side, behind, _) at least 4.50: stress of freeway, to the right: gap behind 4.00, gap ahead 47.77, gap beyond -, gap
%     follower 38.35, closing behind 0.19, closing ahead -0.16, headway behind 0.24, headway ahead 2.89, time_to_collision behind
%     -, time_to_collision ahead -
%   gap(Side, beyond, _) at least 6.00: freeway, to the left: gap behind 5.23, gap ahead 10.54, gap beyond 5.23, gap follower
%     26.67, closing behind 0.78, closing ahead 1.96, headway behind 0.31, headway ahead 0.66, time_to_collision behind -,
%     time_to_collision ahead 39.08
%   headway(Side, ahead, _) at least 0.30: highway-train, to the right: gap behind 24.24, gap ahead 10.59, gap beyond -, gap
%     follower -, closing behind -12.36, closing ahead 12.98, headway behind 1.02, headway ahead 0.29, time_to_collision behind -,
%     time_to_collision ahead 0.82
%   time_to_collision(Side, behind, _) at least 4.00: stress of freeway, to the right: gap behind 10.74, gap ahead 47.57, gap
%     beyond -, gap follower 65.84, closing behind 3.06, closing ahead 3.48, headway behind 0.64, headway ahead 3.42,
%     time_to_collision behind 3.85, time_to_collision ahead 20.71
opening(Side) :-
    forall(gap(Side, behind, V1), V1 >= 4.5),
    forall(gap(Side, beyond, V2), V2 >= 6.0),
    forall(headway(Side, ahead, V3), V3 >= 0.3),
    forall(time_to_collision(Side, behind, V4), V4 >= 4.0).

% Clause 2 offers 4,411 of the 24,759 safe examples, 1,579 of them as the first; none of the 15,266 unsafe ones.
%   gap(Side, behind, _) at least 15.00: freeway, to the left: gap behind 14.19, gap ahead 29.21, gap beyond -3.84, gap follower
%     34.76, closing behind -2.70, closing ahead 5.93, headway behind 0.85, headway ahead 1.50, time_to_collision behind -,
%     time_to_collision ahead 9.71
%   gap(Side, ahead, _) at least 0.50: property nobody_alongside, to the right: gap behind -, gap ahead 0.00, gap beyond -, gap
%     follower -, closing behind -, closing ahead 0.00, headway behind -, headway ahead 0.00, time_to_collision behind -,
%     time_to_collision ahead -
%   closing(Side, behind, _) at most -2.00: freeway, to the left: gap behind 15.24, gap ahead 28.19, gap beyond -4.68, gap
%     follower 35.88, closing behind -1.97, closing ahead 5.14, headway behind 0.91, headway ahead 1.51, time_to_collision behind
%     -, time_to_collision ahead 12.58
%   time_to_collision(Side, ahead, _) at least 1.00: highway-train, to the right: gap behind 24.24, gap ahead 10.59, gap beyond -,
%     gap follower -, closing behind -12.36, closing ahead 12.98, headway behind 1.02, headway ahead 0.29, time_to_collision
%     behind -, time_to_collision ahead 0.82
opening(Side) :-
    forall(gap(Side, behind, V1), V1 >= 15.0),
    forall(gap(Side, ahead, V2), V2 >= 0.5),
    forall(closing(Side, behind, V3), V3 =< -2.0),
    forall(time_to_collision(Side, ahead, V4), V4 >= 1.0).

% Clause 3 offers 6,780 of the 24,759 safe examples, 1,024 of them as the first; none of the 15,266 unsafe ones.
%   gap(Side, behind, _) at least 30.00: highway-train, to the right: gap behind 26.09, gap ahead 9.18, gap beyond -, gap follower
%     -, closing behind -12.35, closing ahead 12.97, headway behind 1.09, headway ahead 0.25, time_to_collision behind -,
%     time_to_collision ahead 0.71
%   gap(Side, ahead, _) at least 0.50: property nobody_alongside, to the right: gap behind -, gap ahead 0.00, gap beyond -, gap
%     follower -, closing behind -, closing ahead 0.00, headway behind -, headway ahead 0.00, time_to_collision behind -,
%     time_to_collision ahead -
%   gap(Side, beyond, _) at least 6.00: highway-train, to the right: gap behind 51.52, gap ahead 11.88, gap beyond 5.03, gap
%     follower -, closing behind 0.66, closing ahead 0.42, headway behind 1.55, headway ahead 0.36, time_to_collision behind -,
%     time_to_collision ahead -
%   time_to_collision(Side, ahead, _) at least 0.60: highway-train, to the right: gap behind 44.97, gap ahead 5.25, gap beyond -,
%     gap follower 50.06, closing behind -9.66, closing ahead 9.58, headway behind 1.80, headway ahead 0.15, time_to_collision
%     behind -, time_to_collision ahead 0.54
opening(Side) :-
    forall(gap(Side, behind, V1), V1 >= 30.0),
    forall(gap(Side, ahead, V2), V2 >= 0.5),
    forall(gap(Side, beyond, V3), V3 >= 6.0),
    forall(time_to_collision(Side, ahead, V4), V4 >= 0.6).
