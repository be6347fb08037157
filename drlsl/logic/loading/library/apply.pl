:- module(apply, [maplist/2, maplist/3, maplist/4, maplist/5, maplist/6, maplist/7, foldl/4, foldl/5, foldl/6,
    include/3, exclude/3, partition/4, partition/5]).

maplist(G, L) :- maplist_(L, G).

maplist_([], _).
maplist_([A|As], G) :- call(G, A), maplist_(As, G).

maplist(G, L1, L2) :- maplist_(L1, L2, G).

maplist_([], [], _).
maplist_([A|As], [B|Bs], G) :- call(G, A, B), maplist_(As, Bs, G).

maplist(G, L1, L2, L3) :- maplist_(L1, L2, L3, G).

maplist_([], [], [], _).
maplist_([A|As], [B|Bs], [C|Cs], G) :- call(G, A, B, C), maplist_(As, Bs, Cs, G).

maplist(G, L1, L2, L3, L4) :- maplist_(L1, L2, L3, L4, G).

maplist_([], [], [], [], _).
maplist_([A|As], [B|Bs], [C|Cs], [D|Ds], G) :- call(G, A, B, C, D), maplist_(As, Bs, Cs, Ds, G).

maplist(G, L1, L2, L3, L4, L5) :- maplist_(L1, L2, L3, L4, L5, G).

maplist_([], [], [], [], [], _).
maplist_([A|As], [B|Bs], [C|Cs], [D|Ds], [E|Es], G) :- call(G, A, B, C, D, E), maplist_(As, Bs, Cs, Ds, Es, G).

maplist(G, L1, L2, L3, L4, L5, L6) :- maplist_(L1, L2, L3, L4, L5, L6, G).

maplist_([], [], [], [], [], [], _).
maplist_([A|As], [B|Bs], [C|Cs], [D|Ds], [E|Es], [F|Fs], G) :-
    call(G, A, B, C, D, E, F),
    maplist_(As, Bs, Cs, Ds, Es, Fs, G).

foldl(G, L, V0, V) :- foldl_(L, G, V0, V).

foldl_([], _, V, V).
foldl_([X|Xs], G, V0, V) :- call(G, X, V0, V1), foldl_(Xs, G, V1, V).

foldl(G, L1, L2, V0, V) :- foldl_(L1, L2, G, V0, V).

foldl_([], [], _, V, V).
foldl_([X|Xs], [Y|Ys], G, V0, V) :- call(G, X, Y, V0, V1), foldl_(Xs, Ys, G, V1, V).

foldl(G, L1, L2, L3, V0, V) :- foldl_(L1, L2, L3, G, V0, V).

foldl_([], [], [], _, V, V).
foldl_([X|Xs], [Y|Ys], [Z|Zs], G, V0, V) :- call(G, X, Y, Z, V0, V1), foldl_(Xs, Ys, Zs, G, V1, V).

include(G, L, I) :- include_(L, G, I).

include_([], _, []).
include_([X|Xs], G, I) :- ( call(G, X) -> I = [X|I1] ; I = I1 ), include_(Xs, G, I1).

exclude(G, L, E) :- exclude_(L, G, E).

exclude_([], _, []).
exclude_([X|Xs], G, E) :- ( call(G, X) -> E = E1 ; E = [X|E1] ), exclude_(Xs, G, E1).

partition(G, L, I, E) :- partition_(L, G, I, E).

partition_([], _, [], []).
partition_([X|Xs], G, I, E) :- ( call(G, X) -> I = [X|I1], E = E1 ; I = I1, E = [X|E1] ), partition_(Xs, G, I1, E1).

partition(G, L, Ls, Es, Gs) :- partition_(L, G, Ls, Es, Gs).

partition_([], _, [], [], []).
partition_([X|Xs], G, Ls, Es, Gs) :- call(G, X, Order), partition_(Order, X, Xs, G, Ls, Es, Gs).

partition_(<, X, Xs, G, [X|Ls], Es, Gs) :- partition_(Xs, G, Ls, Es, Gs).
partition_(=, X, Xs, G, Ls, [X|Es], Gs) :- partition_(Xs, G, Ls, Es, Gs).
partition_(>, X, Xs, G, Ls, Es, [X|Gs]) :- partition_(Xs, G, Ls, Es, Gs).
