% zebra: who owns the zebra? bench(N) solves Einstein's puzzle N times.

right_of(X, Y, [Y,X|_]).
right_of(X, Y, [_|T]) :- right_of(X, Y, T).

next_to(X, Y, L) :- right_of(X, Y, L).
next_to(X, Y, L) :- right_of(Y, X, L).

in(X, [X|_]).
in(X, [_|T]) :- in(X, T).

zebra(Owner) :-
    Houses = [house(_, norwegian, _, _, _), _, house(_, _, _, milk, _), _, _],
    in(house(red, english, _, _, _), Houses),
    in(house(green, _, _, coffee, _), Houses),
    in(house(_, spanish, dog, _, _), Houses),
    in(house(_, ukrainian, _, tea, _), Houses),
    right_of(house(green, _, _, _, _), house(ivory, _, _, _, _), Houses),
    in(house(_, _, snails, _, winston), Houses),
    in(house(yellow, _, _, _, kools), Houses),
    next_to(house(_, _, _, _, chesterfield), house(_, _, fox, _, _), Houses),
    next_to(house(_, _, _, _, kools), house(_, _, horse, _, _), Houses),
    in(house(_, _, _, orange_juice, lucky), Houses),
    in(house(_, japanese, _, _, parliament), Houses),
    next_to(house(_, norwegian, _, _, _), house(blue, _, _, _, _), Houses),
    in(house(_, Owner, zebra, _, _), Houses).

bench(N, Owner) :- repeat_zebra(N), zebra(Owner), !.

repeat_zebra(0) :- !.
repeat_zebra(N) :- zebra(_), !, M is N - 1, repeat_zebra(M).
