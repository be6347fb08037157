% frozen_lake_learning.pl - what drlsl rules learn --domain frozen_lake builds rules from: what is near the cells where a move may end.
%
% On slippery ice a move goes straight on, or to either side of that, each as likely as the other; it never goes back.
%
% Facts, as in frozen_lake.pl: size(Rows, Columns); at(Row, Column), where one is; hole(Row, Column); goal(Row, Column); straight(Chance).

:- dynamic size/2, at/2, hole/2, goal/2, straight/1.

learn(may_fall(_), fails).
learn(holes_beside(_), less).
learn(holes_near(_), less).
learn(sure_moves(_), more).
learn(lasting_moves(_), more).

% action(Move).
action(left).
action(down).
action(right).
action(up).

% ends(Move, Row, Column, R, C): Move from the cell Row, Column may end in the cell R, C; the edge of the lake stops it.
ends(Move, Row, Column, R, C) :-
    goes(Move, Rows, Columns), size(Height, Width),
    R is max(0, min(Height - 1, Row + Rows)), C is max(0, min(Width - 1, Column + Columns)).

% goes(Move, Rows, Columns).
goes(left, 0, -1).
goes(left, 1, 0).
goes(left, -1, 0).
goes(right, 0, 1).
goes(right, 1, 0).
goes(right, -1, 0).
goes(down, 1, 0).
goes(down, 0, 1).
goes(down, 0, -1).
goes(up, -1, 0).
goes(up, 0, 1).
goes(up, 0, -1).

% may_fall(Move): a cell where Move may end is a hole.
may_fall(Move) :- at(Row, Column), ends(Move, Row, Column, R, C), hole(R, C).

% lands(Move, R, C): Move may end in a cell from where one goes on.
lands(Move, R, C) :- at(Row, Column), ends(Move, Row, Column, R, C), \+ goal(R, C).

% holes_beside(Move, Number), holes_near(Move, Number): so many holes are next to that cell, or at most two steps from it.
holes_beside(Move, Number) :- lands(Move, R, C), holes_within(1, R, C, Number).
holes_near(Move, Number) :- lands(Move, R, C), holes_within(2, R, C, Number).

% holes_within(Steps, Row, Column, Number): so many holes are at most so many steps from that cell.
holes_within(Steps, R, C, Number) :- aggregate_all(count, ( hole(R1, C1), abs(R1 - R) + abs(C1 - C) =< Steps ), Number).

% sure_moves(Move, Number): from that cell so many moves can end in no hole.
sure_moves(Move, Number) :- lands(Move, R, C), aggregate_all(count, sure(_, R, C), Number).

% lasting_moves(Move, Number): from that cell so many of them can only end where there is such a move again.
lasting_moves(Move, Number) :- lands(Move, R, C), aggregate_all(count, lasting(_, R, C), Number).

% sure(Move, Row, Column): Move from that cell can end in no hole.
sure(Move, Row, Column) :- action(Move), \+ ( ends(Move, Row, Column, R, C), hole(R, C) ).

% lasting(Move, Row, Column): Move from that cell can only end in a goal, or where some move is sure.
lasting(Move, Row, Column) :-
    sure(Move, Row, Column), \+ ( ends(Move, Row, Column, R, C), \+ goal(R, C), \+ sure(_, R, C) ).

% otherwise(Move): where no move is learnt to be safe, those that may end in the fewest holes.
otherwise(Move) :- risk(Move, Risk), \+ ( risk(_, Less), Less < Risk ).

% risk(Move, Number): so many of the three ways that Move may go end in a hole.
risk(Move, Number) :-
    at(Row, Column), action(Move), aggregate_all(count, ( ends(Move, Row, Column, R, C), hole(R, C) ), Number).
