%= 4:7: syntax error: quoted atom is not closed on its line: expected '
%= 5:7: syntax error: string is not closed on its line: expected "
%= 6:10: syntax error: undefined escape sequence \q
case1('not closed).
case2("not closed).
case3(a,'\q').
end_of_case.
