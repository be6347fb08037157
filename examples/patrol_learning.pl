% patrol_learning.pl - what rules for patrol.py are made of: how far the robot will be from the guard.

:- dynamic robot/2, guard/2.

learn(distance(_), more).

move(wait, 0, 0).
move(right, 1, 0).
move(left, -1, 0).
move(down, 0, 1).
move(up, 0, -1).

% distance(Action, D): so many steps lie between where Action leads and the guard.
distance(Action, D) :-
    move(Action, Dx, Dy), robot(X, Y), guard(X1, Y1),
    D is abs(max(0, min(7, X + Dx)) - X1) + abs(max(0, min(7, Y + Dy)) - Y1).
