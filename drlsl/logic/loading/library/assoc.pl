:- module(assoc, [empty_assoc/1, get_assoc/3, put_assoc/4, list_to_assoc/2, ord_list_to_assoc/2, assoc_to_list/2,
    assoc_to_keys/2, assoc_to_values/2, max_assoc/3, min_assoc/3, map_assoc/2, map_assoc/3, is_assoc/1]).

% Balanced trees after Adelson-Velsky and Landis: t, or t(Key, Value, Balance, Left, Right), where Balance says
% which side is the deeper: <, - or >.

empty_assoc(t).

is_assoc(t).
is_assoc(t(_, _, _, L, R)) :- is_assoc(L), is_assoc(R).

get_assoc(K, t(K1, V1, _, L, R), V) :- compare(O, K, K1), get_assoc_(O, K, V1, L, R, V).

get_assoc_(=, _, V, _, _, V).
get_assoc_(<, K, _, L, _, V) :- get_assoc(K, L, V).
get_assoc_(>, K, _, _, R, V) :- get_assoc(K, R, V).

put_assoc(K, A0, V, A) :- insert_assoc(A0, K, V, A, _).

% insert_assoc(Tree, Key, Value, NewTree, Grown)
insert_assoc(t, K, V, t(K, V, -, t, t), yes).
insert_assoc(t(K1, V1, B, L, R), K, V, T, Grown) :-
    compare(O, K, K1),
    insert_assoc_(O, K, V, K1, V1, B, L, R, T, Grown).

insert_assoc_(=, K, V, _, _, B, L, R, t(K, V, B, L, R), no).
insert_assoc_(<, K, V, K1, V1, B, L, R, T, Grown) :-
    insert_assoc(L, K, V, L1, LeftGrown),
    left_grown(LeftGrown, K1, V1, B, L1, R, T, Grown).
insert_assoc_(>, K, V, K1, V1, B, L, R, T, Grown) :-
    insert_assoc(R, K, V, R1, RightGrown),
    right_grown(RightGrown, K1, V1, B, L, R1, T, Grown).

left_grown(no, K, V, B, L, R, t(K, V, B, L, R), no).
left_grown(yes, K, V, B, L, R, T, Grown) :- left_heavier(B, K, V, L, R, T, Grown).

left_heavier(-, K, V, L, R, t(K, V, <, L, R), yes).
left_heavier(>, K, V, L, R, t(K, V, -, L, R), no).
left_heavier(<, K, V, t(K1, V1, B1, L1, R1), R, T, no) :- rotate_right(B1, K, V, K1, V1, L1, R1, R, T).

rotate_right(<, K, V, K1, V1, L1, R1, R, t(K1, V1, -, L1, t(K, V, -, R1, R))).
rotate_right(>, K, V, K1, V1, L1, t(K2, V2, B2, L2, R2), R, t(K2, V2, -, t(K1, V1, BL, L1, L2), t(K, V, BR, R2, R))) :-
    split_balance(B2, BL, BR).

right_grown(no, K, V, B, L, R, t(K, V, B, L, R), no).
right_grown(yes, K, V, B, L, R, T, Grown) :- right_heavier(B, K, V, L, R, T, Grown).

right_heavier(-, K, V, L, R, t(K, V, >, L, R), yes).
right_heavier(<, K, V, L, R, t(K, V, -, L, R), no).
right_heavier(>, K, V, L, t(K1, V1, B1, L1, R1), T, no) :- rotate_left(B1, K, V, K1, V1, L, L1, R1, T).

rotate_left(>, K, V, K1, V1, L, L1, R1, t(K1, V1, -, t(K, V, -, L, L1), R1)).
rotate_left(<, K, V, K1, V1, L, t(K2, V2, B2, L2, R2), R1, t(K2, V2, -, t(K, V, BL, L, L2), t(K1, V1, BR, R2, R1))) :-
    split_balance(B2, BL, BR).

% split_balance(Middle, Left, Right): the balances of the halves after a double rotation.
split_balance(-, -, -).
split_balance(<, -, >).
split_balance(>, <, -).

list_to_assoc(L, A) :- list_to_assoc_(L, t, A).

list_to_assoc_([], A, A).
list_to_assoc_([K-V|Ps], A0, A) :-
    ( get_assoc(K, A0, _) -> throw(error(domain_error(unique_key_pairs, [K-V|Ps]), _)) ; put_assoc(K, A0, V, A1) ),
    list_to_assoc_(Ps, A1, A).

ord_list_to_assoc(L, A) :- list_to_assoc(L, A).

assoc_to_list(A, L) :- assoc_to_list_(A, L, []).

assoc_to_list_(t, L, L).
assoc_to_list_(t(K, V, _, Left, Right), L0, L) :- assoc_to_list_(Left, L0, [K-V|L1]), assoc_to_list_(Right, L1, L).

assoc_to_keys(A, Ks) :- assoc_to_list(A, L), pairs_keys(L, Ks).

assoc_to_values(A, Vs) :- assoc_to_list(A, L), pairs_values(L, Vs).

max_assoc(t(K, V, _, _, R), MK, MV) :- max_assoc_(R, K, V, MK, MV).

max_assoc_(t, K, V, K, V).
max_assoc_(t(K, V, _, _, R), _, _, MK, MV) :- max_assoc_(R, K, V, MK, MV).

min_assoc(t(K, V, _, L, _), MK, MV) :- min_assoc_(L, K, V, MK, MV).

min_assoc_(t, K, V, K, V).
min_assoc_(t(K, V, _, L, _), _, _, MK, MV) :- min_assoc_(L, K, V, MK, MV).

map_assoc(_, t).
map_assoc(G, t(_, V, _, L, R)) :- map_assoc(G, L), call(G, V), map_assoc(G, R).

map_assoc(_, t, t).
map_assoc(G, t(K, V, B, L0, R0), t(K, W, B, L1, R1)) :-
    map_assoc(G, L0, L1), call(G, V, W), map_assoc(G, R0, R1).
