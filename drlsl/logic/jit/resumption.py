"""Code for the rest of a clause, behind each of its calls that the plain solver has made.

Choice points keep the frames of such calls for as long as the search lasts. The nodes that continue them are
replaced by generated code, which reads its variables from the frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from drlsl.logic.core import (
    CONTINUATION,
    HEIGHT,
    RESUME,
    Call,
    Clause,
    Cut,
    Goal,
    Node,
    Resolver,
    slots_of,
    steps,
)
from drlsl.logic.jit.clause_code import BodyEmitter
from drlsl.logic.jit.code_writer import Module, Namespace
from drlsl.logic.jit.predicate import RUNTIME, body_of, voids
from drlsl.logic.terms import Var, deref


def compile_rest(clause: Clause, linker: Resolver) -> None:
    """Replace the nodes behind the calls of a clause's body by generated code.

    Raises:
        PrologError: The body is not callable.
    """
    body = body_of(clause)
    predicate = clause.predicate
    module = Module(f"{predicate.name}/{predicate.arity}", Namespace(RUNTIME), voids([clause]))
    height = Var("Height")
    rests = BodyEmitter(module, linker, ("", -1)).emit_rests(clause, body, height)
    functions = module.load()
    nodes = _goal_nodes(clause, steps(body))
    slots = slots_of(clause, linker.link) | {height: HEIGHT}
    for left, (name, variables) in rests.items():
        node = nodes.get(left)
        if node is not None:
            node.code = _taking(functions[name], [slots[variable] for variable in variables])
            node.op = RESUME


def _goal_nodes(clause: Clause, goals: Sequence[Goal]) -> dict[int, Node]:
    """Return the nodes of the calls before the first control construct, by the number of goals from there on.

    Every variable of the goals before such a node is in the frame.
    """
    code = clause.code
    at = len(code.guard) + code.commits
    nodes: dict[int, Node] = {}
    if all(type(goal) is Call for goal in goals[: len(code.guard)]):
        node = code.body
        for left in range(len(goals) - at, 0, -1):
            goal = goals[-left]
            if type(goal) is Call and node.name == goal.name and len(node.args) == len(goal.args):
                nodes[left] = node
            elif type(goal) is not Cut:
                break
            node = node.next
    return nodes


def _taking(function: Any, places: Sequence[int]) -> Callable[[Any, list[Any]], Any]:
    """Return a function of a machine and a frame: it calls `function` with these slots of the frame."""

    def resume(machine: Any, frame: list[Any]) -> Any:
        values = [deref(frame[at]) for at in places]
        return function(machine, (function, *values, frame[CONTINUATION]))

    return resume
