%= 5:6: syntax error: unexpected 'X1': expected an operator or '.'
%= 6:5: syntax error: float is too large
%= 7:3: syntax error: unexpected character '\x01'
%= 8:5: syntax error: tab in quoted text: expected \t
X = 0X1.
a(b,1.0e999).
f().
f('a	b').
end_of_case.
