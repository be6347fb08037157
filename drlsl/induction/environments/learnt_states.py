"""The table of rules learnt in an environment: real states on both sides of each limit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from drlsl.assurance import Score, ToldFacts, facts_row, flow
from drlsl.errors import UserError
from drlsl.induction.environments.action_examples import ActionExamples
from drlsl.induction.environments.plain_facts import PlainFacts, as_facts
from drlsl.induction.environments.rule_stress import learnt_rules
from drlsl.induction.learnt_file import FixedLimit, fixed_limits
from drlsl.induction.noticing_table import TableDraft, write_noticing_table
from drlsl.induction.search_problem import LearntClause
from drlsl.shield import ActionRules, Facts, RuleFailure
from drlsl.workers import ALONE, Crew

_DIGITS: Final = 6
"""The most decimals of numbers that are rounded; where more are needed a state is left as it was."""

NOT_FOUND: Final = (
    "No state near those of the table was found in which it differs: no example tells the two apart, or "
    "another clause decides there."
)


class LearntStates:
    """Makes the rows of a table for the clauses in a rule file."""

    def __init__(self, rules: Path, clauses: Sequence[LearntClause], examples: ActionExamples) -> None:
        """Load the rules.

        Raises:
            UserError: they cannot be used.
        """
        self._rules, self._clauses, self._examples = rules, clauses, examples
        self._bias = examples.state_bias
        self._asked: ActionRules = learnt_rules(self._bias.named, rules)
        self._several = {
            (name, arity) for facts in examples.facts for name, arity, rows in facts if len(rows) != 1
        }

    def text(self) -> str:
        """Return the table."""
        domain = self._bias.named.domain
        shield = flow({"shield": {"actions": list(domain.actions), "fallback": domain.fallback}})[1:-1]
        head = f"# States that fix the limits of {self._rules.name}; written by drlsl rules learn."
        return f"{head}\n\n{shield}\n\nstates:\n" + "".join((*self._limits(), *self._nowhere()))

    def row(self, words: str, facts: PlainFacts, action: str | None = None) -> str:
        """Return a row with the actions that the rules offer; with `action`, also why not that one."""
        told = as_facts(facts)
        row: dict[str, Any] = {"row": words} if words else {}
        row |= {"facts": facts_row(told), **self._answer(told)}
        if action is not None:
            row["objections"] = {action: list(self._asked.objections(told, action))}
        return flow(row)

    def expecting(self, row: str) -> str:
        """Return a row that a witness gave, with the actions that the rules offer."""
        told = yaml.safe_load(row)
        return flow({**told, **self._answer(ToldFacts(self._asked.engine).facts(told["facts"]))})

    def _answer(self, told: Facts) -> dict[str, Any]:
        """Return the actions that the rules offer, or why they fail, as a row has it."""
        try:
            return {"actions": list(self._asked.decide(told))}
        except RuleFailure as failure:
            return {"fails": str(failure)}

    def _limits(self) -> Iterator[str]:
        for limit in fixed_limits(self._clauses, self._examples):
            rows = list(self._rows(limit))
            if not rows:
                continue
            one = self._bias.quantities[limit.quantity]
            yield f"\n  # clause {limit.clause + 1}\n  - state: '{one.bound(limit.ease)}'\n    rows:\n"
            for words, facts, action in rows:
                yield f"      - {self.row(words, facts, action)}\n"

    def _rows(self, limit: FixedLimit) -> Iterator[tuple[str, PlainFacts, str]]:
        """Yield the unsafe example that fixes a limit, and the safe one that comes nearest to it."""
        clause = self._clauses[limit.clause]
        places = []
        if limit.example is not None:
            places.append(("just not", limit.example))
        eases = self._examples.eases
        inside = (clause.covers(eases) & ~self._examples.unsafe).nonzero()[0]
        if inside.size:
            places.append(("just", int(inside[np.argmin(eases[inside, limit.quantity])])))
        for words, place in places:
            action = self._bias.choices[int(self._examples.choice[place])]
            yield words, self._simplified(place), action

    def _simplified(self, place: int) -> PlainFacts:
        """Return the state of an example without what makes no difference to its verdict."""
        facts = self._examples.facts[place]
        verdict = self._verdict(place, facts)
        return simplified(facts, self._several, lambda other: self._verdict(place, other) == verdict)

    def _verdict(self, place: int, facts: PlainFacts) -> object:
        """Return what the rules offer in a state, and the limits that an example's action meets there.

        None if they cannot be asked about it.
        """
        try:
            values = self._bias.values(facts)
            eases = self._bias.eases(values)[int(self._examples.choice[place])]
            offered = tuple(sorted(self._asked.offer(as_facts(facts)).actions))
        except UserError:
            return None
        met = tuple(
            tuple(
                limit is None or bool(ease >= limit) for ease, limit in zip(eases, clause.limits, strict=True)
            )
            for clause in self._clauses
        )
        return offered, met

    def _nowhere(self) -> Iterator[str]:
        """Yield a state in which no action is learnt to be safe, if there is one among the examples."""
        bias = self._bias
        for facts in dict.fromkeys(self._examples.facts):
            eases = bias.eases(bias.values(facts))
            if not any(clause.covers(eases).any() for clause in self._clauses):
                yield "\n  - state: nothing is learnt to be safe\n    rows:\n"
                yield f"      - {self.row('', facts)}\n"
                return


def simplified(
    facts: PlainFacts, several: Collection[tuple[str, int]], is_same: Callable[[PlainFacts], bool]
) -> PlainFacts:
    """Return facts with fewer digits, and fewer rows of the relations `several`, that `is_same` accepts.

    It accepts the facts themselves.
    """
    for relation, (name, arity, rows) in enumerate(facts):
        for row in rows if (name, arity) in several else ():
            left = tuple(other for other in facts[relation][2] if other is not row)
            fewer = (*facts[:relation], (name, arity, left), *facts[relation + 1 :])
            facts = fewer if is_same(fewer) else facts
    for digits in range(1, _DIGITS + 1):
        rounded = tuple(
            (name, arity, tuple(tuple(_rounded(value, digits) for value in row) for row in rows))
            for name, arity, rows in facts
        )
        if is_same(rounded):
            return rounded
    return facts


def _rounded(value: Any, digits: int) -> Any:
    return round(value, digits) if isinstance(value, float) else value


def write_states_table(
    rules: Path, clauses: Sequence[LearntClause], examples: ActionExamples, *, crew: Crew = ALONE
) -> Score:
    """Write the table of rules learnt in an environment, as `write_noticing_table` does.

    Raises:
        UserError: a file cannot be written.
    """
    states = LearntStates(rules, clauses, examples)
    draft = TableDraft(
        text=states.text(),
        subject="state",
        asked="offered",
        expecting=states.expecting,
        learnt="learnt/1",
        not_found=NOT_FOUND,
    )
    return write_noticing_table(rules, draft, crew=crew)
