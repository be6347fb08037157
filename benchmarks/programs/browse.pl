% browse: match patterns against a data base of units with property lists, after Gabriel.

bench(N, Count) :-
    make_units(N, Units),
    Patterns = [
        [*(_), a, *(_), b],
        [a, *(X), b, *(X), *(_)],
        [?(_), *(Y), *(Y), ?(_)]
    ],
    count_matches(Units, Patterns, 0, Count).

count_matches([], _, N, N).
count_matches([U|Us], Ps, N0, N) :- count_unit(Ps, U, N0, N1), count_matches(Us, Ps, N1, N).

count_unit([], _, N, N).
count_unit([P|Ps], U, N0, N) :-
    copy_term(P, Q),
    ( match(Q, U) -> N1 is N0 + 1 ; N1 = N0 ),
    count_unit(Ps, U, N1, N).

% match(Pattern, List): ?(X) stands for one element, *(L) for any number of them.
match([], []).
match([X|Ps], [Y|Ys]) :- atom(X), !, X == Y, match(Ps, Ys).
match([?(X)|Ps], [X|Ys]) :- match(Ps, Ys).
match([*(L)|Ps], Ys) :- prefix(L, Ys, Rest), match(Ps, Rest).

prefix([], Ys, Ys).
prefix([Y|L], [Y|Ys], Rest) :- prefix(L, Ys, Rest).

% make_units(N, Units): N lists of 8 to 12 letters from a generator of pseudo-random numbers.
make_units(N, Units) :- units(N, 21, Units).

units(0, _, []) :- !.
units(N, S0, [U|Us]) :-
    Length is 8 + S0 mod 5,
    letters(Length, S0, S1, U),
    M is N - 1,
    units(M, S1, Us).

letters(0, S, S, []) :- !.
letters(N, S0, S, [L|Ls]) :-
    S1 is (S0 * 17 + 11) mod 251,
    K is S1 mod 3,
    letter(K, L),
    M is N - 1,
    letters(M, S1, S, Ls).

letter(0, a).
letter(1, b).
letter(2, c).
