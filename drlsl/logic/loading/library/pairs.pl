:- module(pairs, [pairs_keys_values/3, pairs_keys/2, pairs_values/2, transpose_pairs/2, map_list_to_pairs/3]).

pairs_keys_values([], [], []).
pairs_keys_values([K-V|Ps], [K|Ks], [V|Vs]) :- pairs_keys_values(Ps, Ks, Vs).

pairs_keys([], []).
pairs_keys([K-_|Ps], [K|Ks]) :- pairs_keys(Ps, Ks).

pairs_values([], []).
pairs_values([_-V|Ps], [V|Vs]) :- pairs_values(Ps, Vs).

transpose_pairs(Pairs, Transposed) :- flip_pairs(Pairs, Flipped), keysort(Flipped, Transposed).

flip_pairs([], []).
flip_pairs([K-V|Ps], [V-K|Fs]) :- flip_pairs(Ps, Fs).

map_list_to_pairs(P, L, Pairs) :- pairs_of(L, P, Pairs).

pairs_of([], _, []).
pairs_of([X|Xs], P, [K-X|Ps]) :- call(P, X, K), pairs_of(Xs, P, Ps).
