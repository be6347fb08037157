/* a block
   comment */ a. % a line comment
%= a
b:-c,/* inside */d.%right behind
%= :-(b,','(c,d))
% a comment with ' and " and /* in it
[ a , b | C ].
%= '.'(a,'.'(b,C))
{ a , b }.
%= {}(','(a,b))
[/* */].
%= []
f( - , + , :- ).
%= f(-,+,:-)
X = Y.
%= =(X,Y)
- ( a ).
%= -(a)
