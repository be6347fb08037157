% nrev: naive reverse of a list of 30 elements; one reversal is 496 inferences.

app([], L, L).
app([H|T], L, [H|R]) :- app(T, L, R).

nrev([], []).
nrev([H|T], R) :- nrev(T, RT), app(RT, [H], R).

range(N, N, [N]) :- !.
range(I, N, [I|L]) :- I < N, J is I + 1, range(J, N, L).

bench(N, R) :- range(1, 30, L), repeat_nrev(N, L), nrev(L, R).

repeat_nrev(0, _) :- !.
repeat_nrev(N, L) :- nrev(L, _), M is N - 1, repeat_nrev(M, L).
