%= 5:8: syntax error: unexpected end of clause: expected a term ('(' is open since line 5, column 1)
%= 6:10: syntax error: unexpected ')': expected an operator, ',', '|' or ']' ('[' is open since line 6, column 5)
%= 7:11: syntax error: unexpected ')': expected a term
good(1).
bad(a, .
bad([a, b).
bad(a) :- ).
end_of_case.
