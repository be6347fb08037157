"""Clauses as generated Python code: the second way to run a program, with the answers of the machine.

A predicate becomes one function in continuation-passing style, which the machine's trampoline calls, and one
more function for what follows each call in a body. Variables are Python locals, the first argument selects
clauses by a switch, a last call of the predicate itself is a loop, and tests before the first call leave no
choice point.
"""

from drlsl.logic.jit.tiering import cold_entry, settle_rest

__all__ = [
    "cold_entry",
    "settle_rest",
]
