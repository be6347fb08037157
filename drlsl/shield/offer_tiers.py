"""The tiers that answer which actions are offered, for one state and for many."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.logic import Engine
from drlsl.lowering.backends import BatchProgram, compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import NotLowerable, Undecided
from drlsl.shield.fact_batch import ManyFacts, as_arrays, facts_of_one
from drlsl.shield.fact_forms import FactForms, Facts
from drlsl.shield.rule_answers import Interpreter
from drlsl.shield.rule_failure import RuleFailure
from drlsl.shield.tiers import Compiler


@dataclass(frozen=True, slots=True)
class States:
    """The form of states and answers: what all tiers of a program share.

    `place` returns the place of an action that the rules offer, of `width` in all; `forms` are those of the
    facts; `names` are those of integers in arrays.
    """

    place: Callable[[object], int]
    width: int
    forms: FactForms
    names: Mapping[int, str]


@dataclass(slots=True)
class Found:
    """The answers for N states.

    `mask` (N, A); `undecided`: the states that are left to the interpreter; `failures`: those in which the
    rules failed, with the reasons.
    """

    mask: npt.NDArray[np.bool_]
    undecided: Sequence[int] = ()
    failures: dict[int, str] = field(default_factory=dict)


class OfferTier(ABC):
    """Answers which actions are offered."""

    name: str

    @abstractmethod
    def one(self, facts: Facts) -> Sequence[object]:
        """Return the actions offered in one state, in the order derived.

        Raises:
            RuleFailure: the rules failed.
            Undecided: only the interpreter can tell.
            UserError: facts are not of the form that was declared.
        """

    @abstractmethod
    def many(self, facts: ManyFacts, count: int) -> Found:
        """Return the actions offered in each of `count` states.

        Raises:
            UserError: facts are not of the form that was declared, or an unknown action is offered.
        """

    @abstractmethod
    def code(self, atom: str) -> int:
        """Return the integer of a name in arrays."""


class StateTier(OfferTier):
    """A tier that answers for one state at a time."""

    def __init__(self, states: States) -> None:
        self._states = states

    def many(self, facts: ManyFacts, count: int) -> Found:
        states = self._states
        found = Found(np.zeros((count, states.width), dtype=np.bool_))
        schema = states.forms.schema or states.forms.guess("int")
        left = []
        for index in range(count):
            try:
                offered = self.one(facts_of_one(facts, index, schema, states.names))
                found.mask[index, [states.place(each) for each in offered]] = True
            except Undecided:
                left.append(index)
            except RuleFailure as failure:
                found.failures[index] = str(failure)
        found.undecided = left
        return found

    def code(self, atom: str) -> int:
        known = {name: code for code, name in self._states.names.items()}
        return known.get(atom, len(known))


class InterpretedTier(StateTier):
    """The reference: the interpreter."""

    name = "interpreter"

    def __init__(self, interpreter: Interpreter, states: States) -> None:
        super().__init__(states)
        self._interpreter = interpreter

    def one(self, facts: Facts) -> Sequence[object]:
        self._interpreter.state(self._states.forms.conformed(facts))
        (offered,) = self._interpreter.answers()
        return offered  # type: ignore[no-any-return]


class ScalarTier(StateTier):
    """Generated code for one state."""

    name = "scalar"

    def __init__(self, engine: Engine, query: Query, states: States) -> None:
        """Lower the program.

        Raises:
            NotLowerable: a rule that only the interpreter can run.
        """
        super().__init__(states)
        assert states.forms.schema is not None
        self._answer = compile_scalar(lower(engine, states.forms.schema, [query]))

    def one(self, facts: Facts) -> Sequence[object]:
        (offered,) = self._answer(facts)
        return offered  # type: ignore[no-any-return]


class ArrayTier(OfferTier):
    """An array program for many states."""

    def __init__(
        self,
        name: str,
        engine: Engine,
        query: Query,
        states: States,
        actions: Sequence[str],
        compile_program: Compiler,
    ) -> None:
        """Lower the program, and compile it.

        Raises:
            NotLowerable: a rule that only the interpreter can run, or the answers are no known constants.
            UserError: the rules can offer an unknown action.
        """
        forms = states.forms
        assert forms.schema is not None
        self.name = name
        self._actions = actions
        self._forms = forms
        lowered = lower(engine, forms.schema, [query])
        if lowered.answers[0].choices is None:
            raise NotLowerable(str(query), None, "its answers are not constants of the program")
        self._program: BatchProgram[Any] = compile_program(lowered)
        self._read = {key: forms.schema.relations[key] for key in self._program.reads}
        self._places = np.array([states.place(each) for each in self._program.choices[query]], dtype=np.intp)

    def one(self, facts: Facts) -> Sequence[object]:
        found = self.many([facts], 1)
        if found.undecided:
            raise Undecided("an array program cannot decide it")
        return [self._actions[place] for place in found.mask[0].nonzero()[0].tolist()]

    def many(self, facts: ManyFacts, count: int) -> Found:
        try:
            result = self._program(as_arrays(facts, self._read, self._program))
        except (TypeError, ValueError) as error:
            raise self._forms.misfit(error) from error
        chosen, undecided = _numpy(result.answers[0].value), _numpy(result.undecided)
        mask = np.zeros((len(undecided), len(self._actions)), dtype=np.bool_)
        mask[:, self._places] = chosen
        if len(undecided) != count:  # facts that all states share
            mask, undecided = np.repeat(mask, count, axis=0), np.repeat(undecided, count)
        return Found(mask, undecided.nonzero()[0].tolist())

    def code(self, atom: str) -> int:
        return self._program.code(atom)


class BySize(OfferTier):
    """One tier for few states, another for many."""

    FEW: Final = 8
    """Batches of fewer states are answered faster one at a time, where there is no machine code."""

    def __init__(self, few: OfferTier, many: OfferTier) -> None:
        self.name = many.name
        self._few = few
        self._many = many

    def one(self, facts: Facts) -> Sequence[object]:
        return self._few.one(facts)

    def many(self, facts: ManyFacts, count: int) -> Found:
        is_few = count < self.FEW and not isinstance(facts, Mapping)
        return (self._few if is_few else self._many).many(facts, count)

    def code(self, atom: str) -> int:
        return self._many.code(atom)


def _numpy(values: Any) -> npt.NDArray[Any]:
    """Return values as a NumPy array, from whatever device they are on."""
    return np.asarray(values if isinstance(values, np.ndarray) else values.cpu())
