%= 4:1: syntax error: unexpected end of text: expected a term ('(' is open since line 3, column 6)
end_of_case.
p :- foo(a,
