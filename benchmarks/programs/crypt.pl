% crypt: a multiplication puzzle. Odd digits are O, even ones E, and no number begins with 0:
%
%        O E E
%      *   E E
%      -------
%      E O E E
%      E O E
%      -------
%      O O E E
%
% bench(N) finds the solution N times.

odd(1). odd(3). odd(5). odd(7). odd(9).
even(0). even(2). even(4). even(6). even(8).
lefteven(2). lefteven(4). lefteven(6). lefteven(8).

crypt([A, B, C, D, E]) :-
    odd(A), even(B), even(C), even(E),
    N1 is A * 100 + B * 10 + C,
    P1 is N1 * E,
    P1 >= 2000, P1 < 9000,
    shape([even, odd, even, even], P1),
    lefteven(D),
    P2 is N1 * D,
    P2 >= 200, P2 < 900,
    shape([even, odd, even], P2),
    P3 is P1 + P2 * 10,
    P3 >= 1000, P3 =< 9999,
    shape([odd, odd, even, even], P3).

% shape(Parities, N): the digits of N are as the list says, from the left.
shape(Parities, N) :- reversed(Parities, [], Ps), digits(Ps, N).

reversed([], R, R).
reversed([X|Xs], R0, R) :- reversed(Xs, [X|R0], R).

digits([], 0).
digits([P|Ps], N) :- D is N mod 10, parity(P, D), M is N // 10, digits(Ps, M).

parity(odd, D) :- 1 is D mod 2.
parity(even, D) :- 0 is D mod 2.

bench(N, Solution) :- repeat_crypt(N), crypt(Solution), !.

repeat_crypt(0) :- !.
repeat_crypt(N) :- crypt(_), !, M is N - 1, repeat_crypt(M).
