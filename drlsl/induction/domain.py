"""The domain of a loop of learning: lane changes in traffic, or an environment of a user's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias, TypeVar

from drlsl.induction.clause_search import SECONDS
from drlsl.induction.examples import Examples
from drlsl.induction.learnt_file import FileForm
from drlsl.induction.quantities import Bias
from drlsl.induction.search_problem import LearntClause

Tell: TypeAlias = Callable[[str], None]

Progress: TypeAlias = Callable[[str, int, int], None]
"""Shows of something that takes long how much is done, of how much."""


def unseen(what: str, done: int, total: int) -> None:
    """Show no progress."""


E_co = TypeVar("E_co", bound=Examples, covariant=True)


@dataclass(frozen=True, slots=True)
class Effort:
    """The limits of a search, of at most `clauses` of at most `literals` in `seconds`, and of the rounds."""

    clauses: int = 3
    literals: int = 4
    seconds: float = SECONDS
    rounds: int = 20


@dataclass(frozen=True, slots=True)
class Trial:
    """Learnt rules to try: their file and clauses, the number of the round, and the proofs of the last."""

    rules: Path
    clauses: Sequence[LearntClause]
    number: int
    known: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Examined:
    """The result of trying a program of learnt rules.

    `stress` counts what happened, by where it was driven; `proofs` has the status of each property; `bad`
    are the choices that must not be offered; `unexplained` counts what went wrong without such a choice.
    """

    stress: Mapping[str, Mapping[str, Any]]
    proofs: Mapping[str, str]
    bad: Sequence[Any]
    unexplained: int


class Domain(Protocol[E_co]):
    """A place where rules are learnt: it labels examples, and tries what was learnt.

    A bad choice is whatever the domain makes of it; the loop keeps it, and hands it back.
    """

    @property
    def bias(self) -> Bias:
        """The program that declares quantities."""

    @property
    def form(self) -> FileForm:
        """The words of the file of learnt rules around its clauses."""

    @property
    def effort(self) -> Effort:
        """The limits of searches and rounds."""

    def settings(self) -> dict[str, Any]:
        """Return all that the rounds depend on, as JSON has it."""

    def label(self, folder: Path, tell: Tell) -> Sequence[Any]:
        """Return labelled examples in parts, each with `left_out`; `folder` is that of the rounds."""

    def examples(self, parts: Sequence[Any], bad: Sequence[Any]) -> E_co:
        """Return the examples of some parts, and bad choices as unsafe ones."""

    def left_out(self, parts: Sequence[Any]) -> dict[str, dict[str, int]]:
        """Return how many have no label, by origin and reason."""

    def examine(self, trial: Trial, tell: Tell) -> Examined:
        """Return what comes of learnt rules."""

    def is_clean(self, stress: Mapping[str, Any]) -> bool:
        """Return whether nothing went wrong by the counts of one place."""

    def words(self, name: str, stress: Mapping[str, Any]) -> str:
        """Return the counts of one place in a few words."""

    def sentence(self, name: str, stress: Mapping[str, Any]) -> str:
        """Return all that matters of the counts of one place."""

    def bad_as_json(self, bad: Any) -> dict[str, Any]:
        """Return a bad choice as a file of a round has it."""

    def bad_of_json(self, values: dict[str, Any], place: str) -> Any:
        """Return the bad choice that a file has; `place` names it in errors."""
