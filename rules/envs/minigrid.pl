% The actions that are offered in MiniGrid where there is lava: all but a step into it.
%
% Facts: agent(X, Y, Direction), Direction 0 right, 1 down, 2 left, 3 up; thing(X, Y, Kind) of every cell that
% is not empty, Kind such as wall, lava, goal.

:- dynamic agent/3, thing/3.

% action(Action).
action(left).
action(right).
action(forward).
action(pickup).
action(drop).
action(toggle).
action(done).

offered(Action) :- action(Action), \+ objection(Action, _).

% objection(Action, Reason).
objection(forward, lava(X, Y)) :- ahead(X, Y), thing(X, Y, lava).

% ahead(X, Y): the cell in front of the agent.
ahead(X, Y) :- agent(Column, Row, Direction), points(Direction, Right, Down), X is Column + Right, Y is Row + Down.

% points(Direction, Right, Down).
points(0, 1, 0).
points(1, 0, 1).
points(2, -1, 0).
points(3, 0, -1).
