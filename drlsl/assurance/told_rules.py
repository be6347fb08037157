"""Rules of any environment under test: they are told facts, and asked which actions are offered."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from drlsl.assurance.tested_rules import Answered, Question, State, TestedRules
from drlsl.logic import Engine
from drlsl.logic.terms import Atom, Operators, format_term
from drlsl.lowering.frontend import Query
from drlsl.lowering.ir import Schema
from drlsl.shield import LIMITS, ActionRules, Facts, Interpreter, read_asked


class ToldRules(TestedRules):
    """A program that says which actions are offered, as a `LogicShield` asks it."""

    states = "states"

    def __init__(
        self, asked: ActionRules, schema: Schema, ask: str, reasons: str, files: Sequence[Path] = ()
    ) -> None:
        """Take a program on the interpreter; without `files` the whole program is examined."""
        super().__init__(files)
        self._asked = asked
        self._schema = schema
        self._reference = Interpreter(asked.engine, (), LIMITS)
        self._ask = read_asked(asked.engine, ask, "ask", 1)
        self._why = read_asked(asked.engine, reasons, "reasons", 2)
        self.offered: Final = Question(ask, "set")

    @property
    def actions(self) -> Sequence[str]:
        """The names of the actions."""
        return self._asked.actions

    @property
    def engine(self) -> Engine:
        return self._asked.engine

    @property
    def schema(self) -> Schema:
        return self._schema

    @property
    def usual(self) -> Sequence[Question]:
        return (self.offered, *map(self.reasons_against, self.actions))

    @property
    def queries(self) -> Sequence[Query]:
        """The queries of generated code: the actions offered, and the reasons against them, if any."""
        reasons = Query(self._why.name, self._why.arity, "all")
        known = self.engine.defines(reasons.name, reasons.arity)
        return (Query(self._ask.name, self._ask.arity, "set"), *([reasons] if known else ()))

    def reasons_against(self, action: str) -> Question:
        """Return the question for the reasons against an action."""
        parts = ["Reason", "Reason"]
        parts[self._why.action] = format_term(Atom(action), Operators(), quoted=True)
        return Question(f"{self._why.name}({', '.join(parts)})", "all")

    def tell(self, state: State) -> None:
        self._reference.state(state, self._schema)

    def facts(self, state: State) -> Facts:
        return state  # type: ignore[no-any-return]

    def decide(self, state: State) -> None:
        self._asked.decide(state)

    def on_arrays(self, tier: str, states: Sequence[State]) -> Iterator[Answered]:
        offers = self._asked.with_tier(tier).decide_many(list(states))
        for index, mask in enumerate(offers.mask):
            offered = [name for name, on in zip(self.actions, mask, strict=True) if on]
            yield Answered({self.offered: [{"Action": name} for name in offered]}, offers.failures.get(index))
