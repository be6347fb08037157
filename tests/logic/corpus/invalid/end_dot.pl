%= 3:6: syntax error: end of file: expected . at the end of the clause
end_of_case.
p :- foo
