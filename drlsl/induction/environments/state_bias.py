"""The quantities of an environment's actions: their numbers in a state, by generated code where it can be."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.errors import UserError
from drlsl.induction.environments.learning_domain import NamedDomain, find_domain
from drlsl.induction.environments.plain_facts import PlainFacts, as_facts
from drlsl.induction.learnt_file import FileForm
from drlsl.induction.quantities import LIMITS, Bias
from drlsl.lowering import NotLowerable, Query, Schema, Undecided, compile_scalar, lower
from drlsl.shield import FactForms, Interpreter, RuleFailure, own_files
from drlsl.traffic import Floats

ACTION: Final = ("action", 1)
"""The predicate of the actions that there are in a state; all if the program does not define it."""

OTHERWISE: Final = ("otherwise", 1)
"""The predicate of the actions that are offered where none is learnt to be safe; else the fallback."""

_REPLACED: Final = (("offered", 1), ("objection", 2))

_ABOUT: Final = "learnt(Action): Action is safe here, by what was learnt."


class StateBias(Bias):
    """A rule program, and the quantities that it declares for the actions of an environment."""

    noun = "action"

    @staticmethod
    @lru_cache(maxsize=4)
    def of(name: str) -> StateBias:
        """Return that of the domain of this name; it is made once in a process, for the time it takes.

        Raises:
            UserError, PrologError: as for a new one, or there is no such domain.
        """
        return StateBias(find_domain(name))

    def __init__(self, named: NamedDomain) -> None:
        """Load the program.

        Raises:
            UserError: the file cannot be read, or does not declare quantities as it should.
            PrologError: it is not a valid program.
        """
        domain = named.domain
        super().__init__(named.bias, list(domain.actions), "Action", domain.schema or Schema(()))
        self.named = named
        self._forms = FactForms(self.engine, domain.schema)
        queries = [Query(name, 1, "first") for name in self.names]
        self._limits_actions = self.engine.defines(*ACTION)
        if self._limits_actions:
            queries.append(Query(ACTION[0], 1, "set"))
        self._queries = queries
        self._reference = Interpreter(self.engine, queries, LIMITS)
        self._programs: list[Callable[[Any], tuple[Any, ...]]] | None = None
        self._known: dict[PlainFacts, tuple[Floats, tuple[int, ...]]] = {}

    @property
    def own_files(self) -> list[Path]:
        """The files of the program and of the domain that do not ship with the package."""
        place = Path(self.named.name.rpartition(":")[0])
        return [*own_files(self.engine), *([place] if place.is_file() else [])]

    @property
    def form(self) -> FileForm:
        """The words of the file of learnt rules around its clauses."""
        name, fallback = self.named.name, self.named.domain.fallback
        lines = [f":- abolish({one}/{arity})." for one, arity in _REPLACED if self.engine.defines(one, arity)]
        if not self.engine.defines(*ACTION):
            lines += ["", "% action(Action).", *(f"action({one})." for one in self.choices)]
        otherwise = "otherwise(Action)" if self.engine.defines(*OTHERWISE) else f"Action = {fallback}"
        lines += [
            "",
            "% offered(Action): all actions that are learnt to be safe; without one, what is done otherwise.",
            "offered(Action) :- action(Action), learnt(Action).",
            f"offered(Action) :- \\+ some_learnt, {otherwise}.",
            "",
            "% some_learnt: some action is learnt to be safe.",
            "some_learnt :- action(Action), learnt(Action).",
            "",
            "% objection(Action, Reason): Action is not offered.",
            "objection(Action, not_learnt_to_be_safe) :- action(Action), \\+ offered(Action).",
        ]
        title = f"which actions are offered in {name}, learnt from its failures by drlsl rules learn."
        return FileForm(title, "\n".join(lines).lstrip("\n"), "learnt(Action)", _ABOUT)

    def values(self, facts: PlainFacts) -> Floats:
        """Return the hardest value of each quantity for each action, shape (A, Q); NaN without a solution.

        Raises:
            UserError: the facts are not as declared, or the program raises an error.
        """
        return self._found(facts)[0]

    def available(self, facts: PlainFacts) -> tuple[int, ...]:
        """Return the places of the actions that there are in a state.

        Raises:
            UserError: as `values` does.
        """
        return self._found(facts)[1]

    def _found(self, facts: PlainFacts) -> tuple[Floats, tuple[int, ...]]:
        known = self._known.get(facts)
        if known is None:
            known = self._known[facts] = self._asked(facts)
        return known

    def _asked(self, facts: PlainFacts) -> tuple[Floats, tuple[int, ...]]:
        answers = self._answers(as_facts(facts))
        count = len(self.names)
        values = np.array([self.number(one) for one in answers[:count]])
        places = tuple(range(len(self.choices)))
        if self._limits_actions:
            unknown = [one for one in answers[count] if str(one) not in self.choices]
            if unknown:
                raise UserError(f"{self.path}: action({unknown[0]}) is not among {', '.join(self.choices)}")
            found = {str(one) for one in answers[count]}
            places = tuple(place for place in places if self.choices[place] in found)
        return values.reshape(len(self.choices), len(self.quantities)), places

    def _answers(self, facts: Any) -> tuple[Any, ...]:
        """Return the answer to each question, by generated code once the kinds of all facts are known."""
        try:
            if self._forms.schema is None:
                self._forms.learn(facts)
            else:
                self._forms.check_keys(facts)
            if self._programs is None and self._forms.schema is not None:
                self._programs = self._compiled(self._forms.schema)
            with suppress(Undecided):
                if self._programs:
                    return tuple(program(facts)[0] for program in self._programs)
            return self._interpreted(facts)
        except RuleFailure as error:
            raise UserError(f"{self.path}: {error}") from error

    def _compiled(self, schema: Schema) -> list[Callable[[Any], tuple[Any, ...]]]:
        """Return a program for each question, since all together may be too much; none if one has none."""
        try:
            return [compile_scalar(lower(self.engine, schema, [query])) for query in self._queries]
        except NotLowerable:
            return []

    def _interpreted(self, facts: Any) -> tuple[Any, ...]:
        self._reference.state(self._forms.conformed(facts))
        return self._reference.answers()
