% paper_observation.pl - the paper's ten numbers instead of those of observation.pl; all else as in highway.pl. Policies trained before
% observation.pl gave more see these.

:- ensure_loaded('highway.pl').
:- abolish(state/1).           % redefined here
:- abolish(state_names/1).     % without names and bounds, the ten are the paper's
:- abolish(state_bounds/1).

% state([Front, FrontRight, Right, BackRight, Back, BackLeft, Left, FrontLeft, Lane, Speed]): the gap to the nearest vehicle
% of each section divided by the radar range, the lane and the speed. Source: paper, State Space.
state([Front, FrontRight, Right, BackRight, Back, BackLeft, Left, FrontLeft, Lane, Speed]) :-
    section_room(front, Front), section_room(front_right, FrontRight), section_room(right, Right),
    section_room(back_right, BackRight), section_room(back, Back), section_room(back_left, BackLeft),
    section_room(left, Left), section_room(front_left, FrontLeft),
    lane_place(Lane), speed_share(Speed).
