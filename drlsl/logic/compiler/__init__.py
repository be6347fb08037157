"""Clauses as generated Python code: the second way to run a program, with the answers of the plain solver.

A predicate becomes one function in continuation-passing style, which the solver's trampoline calls, and one
more function for what follows each call in a body. Variables are Python locals, the first argument selects
clauses by a switch, a last call of the predicate itself is a loop, and tests before the first call leave no
choice point.
"""
