% append: join two lists, over and over. bench(N) joins lists of 100 and of 1 element N times.

append_([], L, L).
append_([H|T], L, [H|R]) :- append_(T, L, R).

range(N, N, [N]) :- !.
range(I, N, [I|L]) :- I < N, J is I + 1, range(J, N, L).

bench(N, Length) :- range(1, 100, L), repeat_append(N, L), append_(L, [end], R), length(R, Length).

repeat_append(0, _) :- !.
repeat_append(N, L) :- append_(L, [end], _), M is N - 1, repeat_append(M, L).
