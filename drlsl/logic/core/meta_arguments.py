"""Which arguments of control constructs and builtins are goals: for reading programs without running them."""

from __future__ import annotations

from typing import Final

CONTROL_ARGUMENTS: Final[dict[tuple[str, int], tuple[int, ...]]] = {
    (",", 2): (0, 1),
    (";", 2): (0, 1),
    ("|", 2): (0, 1),
    ("->", 2): (0, 1),
    ("*->", 2): (0, 1),
}
"""Of control constructs, by name and arity: the places of goals, from 0."""

BUILTIN_ARGUMENTS: Final[dict[tuple[str, int], tuple[int, ...]]] = {
    ("\\+", 1): (0,),
    ("not", 1): (0,),
    ("once", 1): (0,),
    ("ignore", 1): (0,),
    ("call", 1): (0,),
    (":", 2): (1,),
    ("forall", 2): (0, 1),
    ("findall", 3): (1,),
    ("findall", 4): (1,),
    ("bagof", 3): (1,),
    ("setof", 3): (1,),
    ("aggregate_all", 3): (1,),
    ("aggregate_all", 4): (2,),
    ("catch", 3): (0, 2),
    ("call_cleanup", 2): (0, 1),
    ("setup_call_cleanup", 3): (0, 1, 2),
}
"""Of builtins that call what they are given as it stands."""

GOAL_ARGUMENTS: Final = CONTROL_ARGUMENTS | BUILTIN_ARGUMENTS
"""Of both."""
