% queens: how many ways there are to place N queens so that none attacks another.

queens(N, Qs) :- range(1, N, Ns), place(Ns, [], Qs).

place([], Qs, Qs).
place(Unplaced, Safe, Qs) :-
    pick(Q, Unplaced, Rest),
    \+ attacked(Q, 1, Safe),
    place(Rest, [Q|Safe], Qs).

attacked(X, N, [Y|_]) :- X is Y + N.
attacked(X, N, [Y|_]) :- X is Y - N.
attacked(X, N, [_|Ys]) :- M is N + 1, attacked(X, M, Ys).

pick(X, [X|Xs], Xs).
pick(X, [Y|Ys], [Y|Zs]) :- pick(X, Ys, Zs).

range(N, N, [N]) :- !.
range(I, N, [I|L]) :- I < N, J is I + 1, range(J, N, L).

bench(N, Count) :- findall(Qs, queens(N, Qs), All), length(All, Count).
