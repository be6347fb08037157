% Predicates that together use every construct; tests ask goals.txt of them in every way there is to run a program.

:- dynamic(cnt/1).
cnt(0).
a(1). a(2). a(3).
p(1,a). p(2,b). p(3,a).
t1(X) :- a(X), X > 1, !.
t2(X) :- ( a(X), X > 1 -> true ; X = none ).
t3(X) :- \+ a(9), X = ok.
t4(X) :- a(X), \+ X = 2.
t5(X) :- ( a(X) *-> true ; X = none ).
inc(N) :- retract(cnt(N0)), N is N0+1, assertz(cnt(N)).
t6(X) :- catch(member(X,[1,2,3]),_,true).
t7 :- catch((member(X,[1,2]),true),_,true), throw(oops(X)).
s --> [].
s --> [a], s.
len([],0). len([_|T],N) :- len(T,M), N is M+1.
cut1(X) :- (X = 1 ; X = 2), !.
cut1(3).
cut2(X) :- call((X = 1 ; X = 2 , !)).
ite(X,Y) :- (X == 1 -> Y = one ; X == 2 -> Y = two ; Y = many).
q(X) :- a(X), ( X =:= 2 -> ! ; true ).
dbl :- forall(a(X), X > 0).
lu :- assertz(cnt(5)), cnt(X), Y is X+100, assertz(cnt(Y)), fail.
lu.
lr(L) :- retractall(cnt(_)), assertz(cnt(1)), assertz(cnt(2)), assertz(cnt(3)), findall(X,(cnt(X),retract(cnt(2)) ; cnt(X)),L).

app([],L,L).
app([H|T],L,[H|R]) :- app(T,L,R).
nrev([],[]).
nrev([H|T],R) :- nrev(T,RT), app(RT,[H],R).
qs([],[]).
qs([X|Xs],S) :- part(Xs,X,L,G), qs(L,LS), qs(G,GS), app(LS,[X|GS],S).
part([],_,[],[]).
part([X|Xs],P,[X|L],G) :- X =< P, !, part(Xs,P,L,G).
part([X|Xs],P,L,[X|G]) :- part(Xs,P,L,G).
inc1([],[]).
inc1([X|Xs],[Y|Ys]) :- Y is X+1, inc1(Xs,Ys).
inc2([X|Xs],[Y|Ys],Z) :- Y is Z, inc2(Xs,Ys,Z).
inc2([],[],_).
queens(N,Qs) :- numlist(1,N,Ns), sel(Ns,[],Qs).
sel([],Qs,Qs).
sel(Un,Safe,Qs) :- rem(Q,Un,Un1), \+ att(Q,Safe), sel(Un1,[Q|Safe],Qs).
att(X,Xs) :- att(X,1,Xs).
att(X,N,[Y|_]) :- X is Y+N.
att(X,N,[Y|_]) :- X is Y-N.
att(X,N,[_|Ys]) :- N1 is N+1, att(X,N1,Ys).
rem(X,[X|Xs],Xs).
rem(X,[Y|Ys],[Y|Zs]) :- rem(X,Ys,Zs).
fib(0,0).
fib(1,1).
fib(N,F) :- N>1, A is N-1, B is N-2, fib(A,FA), fib(B,FB), F is FA+FB.
c1(X,Y) :- ( X > 3 -> Y = big ; X > 1, Z is X*2, Z < 5 -> Y = mid(Z) ; Y = small ).
c2(X,Y) :- ( a(X) -> Y = yes ; Y = no ), true.
c3(X,Y) :- ( a(X), X > 1 -> Y = X ; Y = none ), member(Y,[2,none]).
c4(L) :- findall(X-Y,(a(X),a(Y),X<Y),L).
c5(L) :- findall(X,(a(X),\+ X = 2),L), L \== [].
c6(X) :- forall(a(Y),Y>0), X = ok.
c7(X) :- ( X = 1 ; X = 2 ; a(X) ), X > 0.
c8(X) :- a(X), ( X = 2, ! ; fail ).
c9(X,Y) :- catch(c9b(X,Y),E,(Y=caught(E))).
c9b(X,Y) :- Y is X+foo.
d1(X) :- once(a(X)).
d2(X) :- ignore((a(X),X>1)), true.
d3(X,Y) :- a(X), call((a(Y),!)), X \= Y.
d4(X) :- \+ \+ (X = 1), var(X).
d5(X,Y) :- (a(X) *-> Y = X ; Y = none).
d6(Y) :- (a(9) *-> Y = 1 ; Y = none).
d7(X,f(X,Y,g(Y,Z),Z)) :- Z = X.
d8(L) :- L = [A,B|T], T = [c], A = B, B = z.
d9(X) :- X = f(X1), X1 = 3.
e1(X) :- a(X), !, true.
e1(9).
e2(X,R) :- X == a, !, R = 1.
e2(X,R) :- atom(X), !, R = 2.
e2(_,3).
e3(f(X),g(X)).
e3(f(X),h(X)).
e3(1,one). e3(1.0,onef). e3("s",str). e3(X,any(X)).
e4(X) :- undefd(X).
e5(X) :- atom_length(X,_).
e6([H|T],H,T).
e7(X,X).
e8(X,Y) :- X = Y.
e9(X) :- (X = 1 -> true ; X = 2).
f1(0,z) :- !.
f1(N,s(R)) :- M is N-1, f1(M,R).
f2(X) :- a(X), (X =:= 2 -> fail ; true).
f3(X,Y) :- G = a(Y), call(G), Y > X.
f4(X) :- catch(throw(b(X)),b(Y),(X=Y)).
f5(L) :- bagof(X-Y,(a(X),p(X,Y)),L).
f6(X,Y) :- p(X,Y), !, true.
f7(X) :- (true ; X = 1).
f8(X,L) :- length(L,X), between(1,2,_).
f9(S) :- S = "abc".
g1(N) :- N > 0, N1 is N - 1, g1(N1).
g1(0).
ev(0). ev(N) :- N > 0, M is N-1, od(M).
od(N) :- N > 0, M is N-1, ev(M).
h1([],0). h1([X|T],S) :- h1(T,S0), S is S0+X.
h2(X,Y) :- (X = a, Y = 1 ; X = b, Y = 2 ; \+ X = a, \+ X = b, Y = 3).
h3(X,Z) :- ( X = 1, Y = a ; X = 2, Y = b ), Z = Y-Y.
h4(X) :- not(a(X)).
h5(Y) :- a(X), ( X > 1 -> Z = X ; Z = 0 ), Y is Z + 1.
h6(X,Y) :- ( X = f(A) -> Y = A ; X = g(A,B) -> Y = A+B ; Y = other ).
len2(L,N) :- len2(L,0,N).
len2([],N,N).
len2([_|T],N0,N) :- N1 is N0+1, len2(T,N1,N).
mx(X,Y,Z) :- ( X >= Y -> Z = X ; Z = Y ).
rep(X,Xs) :- Xs = [X,X|_].
hanoi(0,_,_,_) :- !.
hanoi(N,A,B,C) :- M is N-1, hanoi(M,A,C,B), hanoi(M,C,B,A).
zip([],[],[]).
zip([A|As],[B|Bs],[A-B|Ps]) :- zip(As,Bs,Ps).
