% The moves over a frozen lake that are offered: Gymnasium's FrozenLake, slippery or not, on any map.
%
% Sure ground is the cells from which the goal can be reached without ever risking a hole. On it a move is
% offered if every cell where it may end is sure ground, too. Elsewhere a move is offered if no other is less
% likely to end in a hole within the next steps/1 moves, the later ones being made as safely as possible.
%
% One move ahead is not enough on slippery ice, where a cell may have no safe move. Not to fall is not enough
% either: on the slippery map 4x4 no move is ever risked where one never leaves the first row.
%
% Facts: size(Rows, Columns); at(Row, Column), where one is; hole(Row, Column); goal(Row, Column);
% straight(Chance), the chance that a move goes where it should; else it goes to either side alike.

:- dynamic size/2, at/2, hole/2, goal/2, straight/1.
:- table sure_ground/1, ends/3, survival/3.

% steps(Steps): on the slippery map 4x4 fewer fall more often, and from six on no goal is reached.
steps(4).

% tolerance(Chance): chances that are equal may differ in their last bits.
tolerance(1.0e-9).

offered(Move) :- move(Move, _, _), \+ objection(Move, _).

% objection(Move, Reason): the chance in falls_within/2 is that of a fall.
objection(Move, leaves_sure_ground(Row, Column)) :-
    here(Here), sure_ground(Ground), memberchk(Here, Ground),
    ends(Move, Here, Ends), member(Row-Column, Ends), \+ memberchk(Row-Column, Ground).
objection(Move, falls_within(Steps, Chance)) :-
    here(Here), sure_ground(Ground), \+ memberchk(Here, Ground),
    steps(Steps), tolerance(Tolerance), survival(Here, Steps, Best),
    survival_after(Move, Here, Steps, Survival), Survival < Best - Tolerance,
    Chance is 1.0 - Survival.

% here(Cell).
here(Row-Column) :- at(Row, Column).

% Where a move may end

% move(Move, Rows, Columns).
move(left, 0, -1).
move(down, 1, 0).
move(right, 0, 1).
move(up, -1, 0).

% ends(Move, Cell, Cells): every cell where a move may end.
ends(Move, Cell, Cells) :- move(Move, _, _), findall(End, end(Move, Cell, End, _), Cells).

% end(Move, Cell, End, Chance): the edge of the lake stops a move.
end(Move, Row-Column, R-C, Chance) :-
    goes(Move, Way, Chance), move(Way, Rows, Columns), size(Height, Width),
    R is max(0, min(Height - 1, Row + Rows)), C is max(0, min(Width - 1, Column + Columns)).

% goes(Move, Way, Chance): the way that is taken, straight or to a side/2.
goes(Move, Move, Chance) :- straight(Chance), Chance > 0.0.
goes(Move, Way, Chance) :- straight(Straight), Straight < 1.0, side(Move, Way), Chance is (1.0 - Straight) / 2.0.

side(left, up).
side(left, down).
side(right, up).
side(right, down).
side(up, left).
side(up, right).
side(down, left).
side(down, right).

% Sure ground

% sure_ground(Cells): the greatest set that holds the goals and else cells with a sure way to one.
sure_ground(Cells) :-
    findall(R-C, goal(R, C), Goals),
    size(Height, Width), LastRow is Height - 1, LastColumn is Width - 1,
    findall(R-C, ( between(0, LastRow, R), between(0, LastColumn, C), \+ hole(R, C), \+ goal(R, C) ), Ice),
    reverse(Ice, Others), % the last rows first, since the goal is usually there
    narrowed(Others, Goals, Cells).

% narrowed(Others, Goals, Cells): cells without a sure way are taken away until every one has one.
narrowed(Others, Goals, Cells) :-
    holding(Others, Goals, Firm),
    append(Goals, Firm, Ground),
    spread(Firm, Goals, Ground, Strays),
    (   Strays == []
    ->  Cells = Ground
    ;   findall(Cell, ( member(Cell, Firm), \+ memberchk(Cell, Strays) ), Left),
        narrowed(Left, Goals, Cells)
    ).

% holding(Others, Goals, Firm): cells that every move may leave are taken away until there is none.
holding(Others, Goals, Firm) :-
    append(Goals, Others, Ground),
    findall(Cell, ( member(Cell, Others), once(keeps(_, Cell, _, Ground)) ), Left),
    ( same_length(Left, Others) -> Firm = Others ; holding(Left, Goals, Firm) ).

% keeps(Move, Cell, Ends, Ground): the move ends in one of some cells, all of which are of the ground.
keeps(Move, Cell, Ends, Ground) :-
    ends(Move, Cell, Ends), \+ ( member(End, Ends), \+ memberchk(End, Ground) ).

% spread(Cells, Known, Ground, Strays): the cells without a sure way to a known one are strays.
spread(Cells, Known, Ground, Strays) :-
    swept(Cells, Known, Ground, More, Left),
    ( same_length(Left, Cells) -> Strays = Left ; spread(Left, More, Ground, Strays) ).

% swept(Cells, Known, Ground, More, Left): each cell from which a move may end in a known one becomes known.
swept([], Known, _, Known, []).
swept([Cell | Cells], Known, Ground, More, Left) :-
    (   keeps(_, Cell, Ends, Ground), member(End, Ends), memberchk(End, Known)
    ->  swept(Cells, [Cell | Known], Ground, More, Left)
    ;   Left = [Cell | Others], swept(Cells, Known, Ground, More, Others)
    ).

% Elsewhere

% survival(Cell, Steps, Chance): the best chance of being in no hole after so many moves.
survival(R-C, _, 0.0) :- hole(R, C).
survival(R-C, 0, 1.0) :- \+ hole(R, C).
survival(R-C, Steps, 1.0) :- Steps > 0, goal(R, C).
survival(R-C, Steps, Best) :-
    Steps > 0, \+ hole(R, C), \+ goal(R, C),
    aggregate_all(max(Chance), survival_after(_, R-C, Steps, Chance), Best).

% survival_after(Move, Cell, Steps, Chance): the same if this move is the first.
survival_after(Move, Cell, Steps, Survival) :-
    move(Move, _, _), Left is Steps - 1,
    aggregate_all(sum(Chance * Later), ( end(Move, Cell, End, Chance), survival(End, Left, Later) ), Survival).
