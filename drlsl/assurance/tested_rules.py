"""A rule program under test: how it is told a state, asked about it, and asked about many at once."""

from __future__ import annotations

import copy
import random
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Protocol, Self, TypeAlias

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.lowering.frontend import Mode
from drlsl.lowering.ir import Schema
from drlsl.shield import Facts, RuleFailure

State: TypeAlias = Any
"""A scene of driving or the facts of another environment; only `TestedRules` of that kind look into it."""

Solutions: TypeAlias = Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Question:
    """A goal, and the answers that matter: whether it holds, its first solution, all, or the set of all."""

    goal: str
    mode: Mode


@dataclass(frozen=True)
class Answered:
    """The answer of an array tier about one state: `answers` by question, or why the decision failed."""

    answers: Mapping[Question, Solutions]
    failure: str | None = None


class Staged(Protocol):
    """A state in the words of a table."""

    def state(self) -> State:
        """Return the state."""

    def row(self) -> str:
        """Return it as a row of a table, in one line of YAML."""

    def changed(self, chance: random.Random) -> Self:
        """Return a state like it, with some of its numbers changed."""


class TestedRules(ABC):
    """A rule program with what it is asked in use; `files` are those that are examined."""

    __test__: ClassVar[bool] = False  # not a test, whatever pytest takes it for

    states: ClassVar[str]
    """The word for its states in tables and reports."""

    def __init__(self, files: Sequence[Path]) -> None:
        self.files: Final = tuple(files)

    @property
    @abstractmethod
    def engine(self) -> Engine:
        """The engine with the program."""

    @property
    @abstractmethod
    def schema(self) -> Schema:
        """The form of the facts."""

    @property
    @abstractmethod
    def usual(self) -> Sequence[Question]:
        """The questions that are asked of it in use."""

    @abstractmethod
    def tell(self, state: State) -> None:
        """Assert the facts of a state in the engine, in place of those of the previous one."""

    @abstractmethod
    def facts(self, state: State) -> Facts:
        """Return the facts of a state, as generated code reads them."""

    @abstractmethod
    def decide(self, state: State) -> None:
        """Have the interpreter decide in a state.

        Raises:
            RuleFailure: it gives no usable decision.
            UserError: the rules offer an action that is not known.
        """

    def failure(self, state: State) -> str | None:
        """Return why the interpreter gives no usable decision in a state; None if it gives one."""
        try:
            self.decide(state)
        except (RuleFailure, UserError) as failure:
            return str(failure)
        return None

    @abstractmethod
    def on_arrays(self, tier: str, states: Sequence[State]) -> Iterator[Answered]:
        """Yield what a tier for arrays of states says of each state.

        Raises:
            UserError: the tier cannot run the program.
        """

    def fresh(self) -> Self:
        """Return a copy with an engine of its own, whose program may be changed."""
        return copy.deepcopy(self)
