%= 9:3: syntax error: unexpected 'b': expected an operator or '.'
%= 10:5: syntax error: operator * as an operand: expected (*)
%= 11:8: syntax error: an operand of operator :- binds too loosely: expected brackets around it
%= 12:7: syntax error: an operand of operator = binds too loosely: expected brackets around it
%= 13:8: syntax error: unexpected 'r': expected an operator or '.'
%= 14:5: syntax error: operator :- in an argument: expected brackets around the term
%= 15:3: syntax error: operator :- in an argument: expected brackets around the term
%= 16:8: syntax error: an operand of operator = binds too loosely: expected brackets around it
a b.
X = * .
a :- b :- c.
a = b = c.
p :- q r.
f(a :- b).
f(:- a).
p :- X = \+ q.
end_of_case.
