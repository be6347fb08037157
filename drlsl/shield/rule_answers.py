"""The reference tier: the program as written, run by the interpreter on facts that are told to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol

from drlsl.logic import Compound, Engine, LimitExceeded, Limits, PrologError, Solution, Variable
from drlsl.shield.rule_failure import RuleFailure

if TYPE_CHECKING:
    from drlsl.lowering.ir import Schema


class Asked(Protocol):
    """A query about `name` of `arity` unbound arguments, and which of its answers count."""

    @property
    def name(self) -> str:
        """The name of the predicate."""

    @property
    def arity(self) -> int:
        """The number of arguments."""

    @property
    def mode(self) -> Literal["holds", "first", "set", "all"]:
        """The answers that count: whether it holds, its first solution, the set of all, or all in order."""


class Interpreter:
    """Asserts facts in an engine and queries it, with the answers of generated code for one scene."""

    def __init__(self, engine: Engine, queries: Sequence[Asked], limits: Limits) -> None:
        """Prepare the queries; `limits` hold for each."""
        self.engine = engine
        self.limits = limits
        self._queries = [(one, _variables(one), engine.prepare(_goal(one))) for one in queries]

    def state(
        self, facts: Mapping[tuple[str, int], Sequence[Sequence[Any]]], schema: Schema | None = None
    ) -> None:
        """Assert facts, in the form of `schema` if given, in place of those of the same predicates.

        Raises:
            RuleFailure: a number is NaN, or a value is of another kind than its fact has.
        """
        for (name, arity), rows in facts.items():
            try:
                ready = rows if schema is None else schema.relations[name, arity].conform(rows)
                self.engine.replace_facts(name, arity, ready)
            except (TypeError, ValueError) as error:
                raise RuleFailure(f"the fact {name}/{arity} cannot be asserted: {error}") from error

    def answers(self) -> tuple[Any, ...]:
        """Return the answer to each query about the facts that were stated last, as `Scalar` does.

        Raises:
            RuleFailure: the rules raised an error or went beyond a limit.
        """
        try:
            return tuple(self._answer(*one) for one in self._queries)
        except LimitExceeded as error:
            raise RuleFailure(
                f"the rules went beyond the limit of {error.bound} for one question; "
                "does a predicate call itself without end?"
            ) from error
        except PrologError as error:
            raise RuleFailure(f"the rules raised an error: {error}") from error

    def _answer(self, query: Asked, variables: Sequence[str], goal: Any) -> Any:
        if query.mode == "holds":
            return goal.holds(self.limits)
        if query.mode == "first":
            solution = goal.once(self.limits)
            return None if solution is None else _values(solution, variables)
        found = [_values(solution, variables) for solution in goal.solutions(self.limits)]
        if query.mode == "all":
            return found
        return [one for place, one in enumerate(found) if one not in found[:place]]


def _variables(query: Asked) -> list[str]:
    return [f"Argument{place + 1}" for place in range(query.arity)]


def _goal(query: Asked) -> Compound | str:
    return Compound(query.name, tuple(map(Variable, _variables(query)))) if query.arity else query.name


def _values(solution: Solution, variables: Sequence[str]) -> Any:
    values = tuple(solution[variable] for variable in variables)
    return values[0] if len(values) == 1 else values
