%= 3:1: syntax error: end of file in a block comment: expected */
end_of_case.
/* never closed
a.
