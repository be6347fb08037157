:- module(ordsets, [list_to_ord_set/2, ord_union/3, ord_union/2, ord_subtract/3, ord_intersection/3,
    ord_memberchk/2, ord_insert/3, ord_add_element/3, ord_del_element/3, ord_subset/2, ord_empty/1, ord_disjoint/2]).

list_to_ord_set(L, S) :- sort(L, S).

ord_empty([]).

ord_union([], L, L).
ord_union([X|Xs], Ys, Zs) :- ord_union_(Ys, X, Xs, Zs).

ord_union_([], X, Xs, [X|Xs]).
ord_union_([Y|Ys], X, Xs, Zs) :- compare(O, X, Y), ord_union_(O, X, Xs, Y, Ys, Zs).

ord_union_(<, X, Xs, Y, Ys, [X|Zs]) :- ord_union(Xs, [Y|Ys], Zs).
ord_union_(=, X, Xs, _, Ys, [X|Zs]) :- ord_union(Xs, Ys, Zs).
ord_union_(>, X, Xs, Y, Ys, [Y|Zs]) :- ord_union([X|Xs], Ys, Zs).

ord_union(Sets, S) :- append(Sets, L), sort(L, S).

ord_subtract([], _, []).
ord_subtract([X|Xs], Ys, Zs) :- ord_subtract_(Ys, X, Xs, Zs).

ord_subtract_([], X, Xs, [X|Xs]).
ord_subtract_([Y|Ys], X, Xs, Zs) :- compare(O, X, Y), ord_subtract_(O, X, Xs, Y, Ys, Zs).

ord_subtract_(<, X, Xs, Y, Ys, [X|Zs]) :- ord_subtract(Xs, [Y|Ys], Zs).
ord_subtract_(=, _, Xs, _, Ys, Zs) :- ord_subtract(Xs, Ys, Zs).
ord_subtract_(>, X, Xs, _, Ys, Zs) :- ord_subtract([X|Xs], Ys, Zs).

ord_intersection([], _, []).
ord_intersection([X|Xs], Ys, Zs) :- ord_intersection_(Ys, X, Xs, Zs).

ord_intersection_([], _, _, []).
ord_intersection_([Y|Ys], X, Xs, Zs) :- compare(O, X, Y), ord_intersection_(O, X, Xs, Y, Ys, Zs).

ord_intersection_(<, _, Xs, Y, Ys, Zs) :- ord_intersection(Xs, [Y|Ys], Zs).
ord_intersection_(=, X, Xs, _, Ys, [X|Zs]) :- ord_intersection(Xs, Ys, Zs).
ord_intersection_(>, X, Xs, _, Ys, Zs) :- ord_intersection([X|Xs], Ys, Zs).

ord_memberchk(X, [Y|Ys]) :- compare(O, X, Y), ord_memberchk_(O, X, Ys).

ord_memberchk_(=, _, _).
ord_memberchk_(>, X, Ys) :- ord_memberchk(X, Ys).

ord_insert(S, E, S2) :- ord_union(S, [E], S2).

ord_add_element(S, E, S2) :- ord_union(S, [E], S2).

ord_del_element(S, E, S2) :- ord_subtract(S, [E], S2).

ord_subset(A, B) :- ord_subtract(A, B, []).

ord_disjoint(A, B) :- ord_intersection(A, B, []).
