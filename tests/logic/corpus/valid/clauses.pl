% Facts, rules, directives and grammar rules.
lane(ego, 3).
%= lane(ego,3)
left_is_safe :-
    left_is_valid,
    \+ ( back_left(V), distance(V, D), D < 9.8 ).
%= :-(left_is_safe,','(left_is_valid,\+(','(back_left(V),','(distance(V,D),<(D,9.8))))))
:- dynamic vehicle/8, lane/2.
%= :-(dynamic(','(/(vehicle,8),/(lane,2))))
greeting --> [hello], name | "hi".
%= -->(greeting,'|'(','('.'(hello,[]),name),'.'(104,'.'(105,[]))))
p(X) :- ( X > 0 -> Y = 1 ; X =:= 0 -> Y = 0 ; Y = -1 ), q(Y).
%= :-(p(X),','(;(->(>(X,0),=(Y,1)),;(->(=:=(X,0),=(Y,0)),=(Y,-1))),q(Y)))
soft :- ( a *-> b ; c ).
%= :-(soft,;(*->(a,b),c))
