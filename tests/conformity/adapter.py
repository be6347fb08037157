"""Drives an engine the way the judge of the shared conformity cases asks for (see its head)."""

from __future__ import annotations

import io
from typing import Any

from drlsl.logic import Engine, LimitExceeded, Limits, PrologError, PrologSyntaxError
from drlsl.logic.core import FOUND, Machine
from drlsl.logic.syntax import read_term
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

_SECONDS = 10.0


def term_json(term: Term) -> dict[str, Any]:
    """A term as the judge's JSON; built without recursion, since answers may be long lists."""
    done: list[dict[str, Any]] = []
    todo: list[tuple[Term, bool]] = [(term, False)]
    while todo:
        part, ready = todo.pop()
        part = deref(part)
        if isinstance(part, Struct):
            if ready:
                arity = len(part.args)
                arguments = done[-arity:]
                del done[-arity:]
                done.append({"c": [part.name, arguments]})
            else:
                todo.append((part, True))
                todo.extend((argument, False) for argument in reversed(part.args))
        else:
            done.append(_leaf(part))
    return done[0]


def _leaf(term: Atom | Var | int | float | str) -> dict[str, Any]:
    if isinstance(term, Var):
        return {"v": id(term)}
    if isinstance(term, Atom):
        return {"a": term.name}
    if isinstance(term, int):
        return {"i": str(term)}
    return {"f": repr(term)} if isinstance(term, float) else {"s": term}


class Adapter:
    """One fresh engine for each group of cases."""

    def __init__(self, **flags: str) -> None:
        self._flags = flags

    def start(self, consult_text: str) -> None:
        self._output = io.StringIO()
        self._engine = Engine(flags=self._flags, output=self._output)
        if consult_text:
            self._engine.consult_text(consult_text, "fixture")

    def run(self, goal_text: str, limit: int) -> dict[str, Any]:
        """Up to `limit` solutions of a goal, or the error that it ends with."""
        result: dict[str, Any] = {"solutions": [], "output": "", "timeout": False}
        self._output.seek(0)
        self._output.truncate()
        try:
            read = read_term(goal_text, self._engine.operators, self._engine.flags, "case")
        except PrologSyntaxError as error:
            return {**result, "syntax": term_json(error.term)}
        machine = Machine(self._engine, Limits(seconds=_SECONDS))
        try:
            found = machine.solve(machine.call(read.term, FOUND))
            while found:
                answer = {name: term_json(variable) for name, variable in read.variables.items()}
                result["solutions"].append(answer)
                found = len(result["solutions"]) < limit and machine.retry()
        except LimitExceeded:
            result["timeout"] = True
        except PrologError as error:
            result["error"] = term_json(error.term)
        finally:
            machine.close()
        result["output"] = self._output.getvalue()
        return result

    def stop(self) -> None:
        """Nothing outlives an engine."""
