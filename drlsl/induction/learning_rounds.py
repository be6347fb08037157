"""The loop: search, examine what was found, take what went wrong as examples, and search again."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

from drlsl.errors import UserError
from drlsl.files import parse_json, read_text, write_atomic
from drlsl.induction.clause_search import Found, search
from drlsl.induction.domain import Domain, Tell, Trial
from drlsl.induction.examples import Examples
from drlsl.induction.learnt_file import contradiction_words, learnt_text
from drlsl.induction.search_problem import LearntClause, SearchProblem, covered

E = TypeVar("E", bound=Examples)

ROUNDS: Final = ".rounds"
"""The folder of the rounds is called like the rule file, with this in place of its suffix."""


@dataclass(frozen=True, slots=True)
class Round:
    """One round: what was found, how it drove, what was proved of it, and the examples that it brought."""

    number: int
    clauses: tuple[LearntClause, ...]
    safe: int
    optimal: bool
    hardest: int
    stress: dict[str, dict[str, Any]]
    proofs: dict[str, str]
    bad: tuple[Any, ...]
    unexplained: int

    def is_clean(self, domain: Domain[Any]) -> bool:
        """Return whether nothing went wrong."""
        fine = all(domain.is_clean(one) for one in self.stress.values())
        return fine and not self.bad and all(status.startswith("proved") for status in self.proofs.values())

    def words(self, domain: Domain[Any]) -> str:
        """Return the round in one line."""
        parts = [f"{len(self.clauses)} clauses offer {self.safe:,} safe examples"]
        parts += [domain.words(name, counts) for name, counts in self.stress.items()]
        parts += [f"{name} {status}" for name, status in self.proofs.items()]
        parts.append(f"{len(self.bad)} new unsafe examples" if self.bad else "nothing went wrong")
        return f"round {self.number}: " + "; ".join(parts)

    def as_json(self, domain: Domain[Any]) -> dict[str, Any]:
        """Return the round as its file has it."""
        return {
            "number": self.number,
            "clauses": [list(clause.limits) for clause in self.clauses],
            "safe": self.safe,
            "optimal": self.optimal,
            "hardest": self.hardest,
            "stress": self.stress,
            "proofs": self.proofs,
            "bad": [domain.bad_as_json(one) for one in self.bad],
            "unexplained": self.unexplained,
        }

    @classmethod
    def of_json(cls, values: dict[str, Any], place: str, domain: Domain[Any]) -> Round:
        """Return the round that a file has."""
        bad = [domain.bad_of_json(one, place) for one in values["bad"]]
        clauses = [LearntClause(tuple(limits)) for limits in values["clauses"]]
        return cls(**{**values, "clauses": tuple(clauses), "bad": tuple(bad)})


@dataclass(frozen=True, slots=True)
class Learnt(Generic[E]):
    """The result of learning: all rounds, the examples of the last search, and those without a label."""

    domain: Domain[E]
    rounds: tuple[Round, ...]
    examples: E
    problem: SearchProblem
    left_out: dict[str, dict[str, int]]

    @property
    def clauses(self) -> tuple[LearntClause, ...]:
        """The learnt clauses."""
        return self.rounds[-1].clauses

    @property
    def finished(self) -> bool:
        """True if nothing went wrong in the last round."""
        return self.rounds[-1].is_clean(self.domain)

    def lines(self) -> list[str]:
        """Return what was learnt, and from how much, in sentences."""
        last, problem = self.rounds[-1], self.problem
        examples = (
            f"{problem.safe_count:,} safe and {problem.unsafe_count:,} unsafe examples, of which the "
            f"{len(problem.hardest):,} that are hardest to leave out matter; {problem.contradicted:,} safe "
            "ones cannot be offered, since an unsafe one is as easy on every quantity"
        )
        if problem.contradiction is not None:
            examples += f"; for instance {contradiction_words(problem, self.examples)}"
        best = "no choice is better" if last.optimal else "the best choice that was found in time"
        ended = "nothing went wrong in the last" if self.finished else "the last one still brought examples"
        return [
            examples,
            f"{len(last.clauses)} clauses offer {last.safe:,} of the safe ones and no unsafe one: {best}",
            f"{len(self.rounds)} rounds; {ended}",
            *(self.domain.sentence(name, counts) for name, counts in last.stress.items()),
            *(f"property {name}: {status}" for name, status in last.proofs.items()),
        ]


class LearningRun(Generic[E]):
    """A run of learning: a rule file, and beside it the folder of its rounds."""

    def __init__(self, domain: Domain[E], out: Path, tell: Tell) -> None:
        """Begin, or resume what an earlier call with the same settings left.

        Raises:
            UserError: a limit is not usable, or the file exists and is of other settings.
        """
        self._domain, self._out, self._tell = domain, out, tell
        self._folder = out.with_suffix(ROUNDS)
        effort = domain.effort
        for number, flag in ((effort.clauses, "--clauses"), (effort.literals, "--literals")):
            if number < 1:
                raise UserError(f"{flag} {number}: expected 1 or more")
        self.rounds: list[Round] = self._begun()

    def _begun(self) -> list[Round]:
        """Return the rounds of an earlier call, or begin a new folder."""
        settings = self._folder / "settings.json"
        asked = json.dumps(self._domain.settings(), indent=1)
        # What was refused before the first example was kept leaves nothing that other settings could spoil.
        empty = not self._out.exists() and list(self._folder.glob("*")) == [settings]
        if empty or not settings.is_file():
            if self._out.exists():
                raise UserError(f"{self._out} exists; name a new file for the learnt rules")
            self._folder.mkdir(parents=True, exist_ok=True)
            write_atomic(settings, f"{asked}\n".encode())
            return []
        if read_text(settings).strip() != asked:
            raise UserError(
                f"{self._folder} holds the rounds of other settings; name a new file, or repeat those of "
                f"{settings}"
            )
        files = sorted(self._folder.glob("round-*.json"))
        return [
            Round.of_json(parse_json(read_text(file), file.name), file.name, self._domain) for file in files
        ]

    def run(self) -> Learnt[E]:
        """Learn until nothing goes wrong, or until the limit of rounds.

        Raises:
            UserError: there is nothing to learn, or no clause meets what is asked.
        """
        domain = self._domain
        parts = domain.label(self._folder, self._tell)
        while True:
            ended = self._ended()
            bad = [one for done in (self.rounds[:-1] if ended else self.rounds) for one in done.bad]
            examples = domain.examples(parts, bad)
            problem = self._problem(examples)
            if ended:
                break
            one = self._round(problem, examples)
            name = self._folder / f"round-{one.number:02d}.json"
            write_atomic(name, f"{json.dumps(one.as_json(domain), indent=1)}\n".encode())
            self.rounds.append(one)
            self._tell(one.words(domain))
        result = Learnt(domain, tuple(self.rounds), examples, problem, domain.left_out(parts))
        self._write(result.clauses, examples, result.lines())
        return result

    def _ended(self) -> bool:
        """Return whether the last round brought nothing to learn from, or was the last one allowed."""
        return bool(self.rounds) and (
            not self.rounds[-1].bad or len(self.rounds) >= self._domain.effort.rounds
        )

    def _problem(self, examples: Examples) -> SearchProblem:
        """Return the problem of the search.

        Raises:
            UserError: no safe example can be offered.
        """
        unsafe, places = examples.unsafe, examples.unsafe_places
        problem = SearchProblem(
            examples.bias.quantities,
            examples.eases[~unsafe],
            examples.eases[unsafe],
            lambda place: examples.words(int(places[place])),
        )
        if problem.safe_count == problem.contradicted:
            raise UserError(
                f"no safe {examples.bias.noun} can be offered; see whether the declared directions, more and "
                f"less, are right: {contradiction_words(problem, examples)}"
            )
        return problem

    def _round(self, problem: SearchProblem, examples: Examples) -> Round:
        """Search for clauses, and examine what was found."""
        effort, number = self._domain.effort, len(self.rounds) + 1
        self._tell(f"round {number}: searching, at most {effort.seconds:g} s")
        found = search(problem, clauses=effort.clauses, literals=effort.literals, seconds=effort.seconds)
        self._write(found.clauses, examples, [f"Round {number}, not yet driven nor proved."])
        known = self.rounds[-1].proofs if self.rounds else {}
        trial = Trial(self._out, found.clauses, number, known)
        tried = self._domain.examine(trial, self._tell)
        self._check_offered(found, tried.bad)
        return Round(
            number=number,
            clauses=found.clauses,
            safe=found.safe,
            optimal=found.optimal,
            hardest=len(problem.hardest),
            stress={name: dict(counts) for name, counts in tried.stress.items()},
            proofs=dict(tried.proofs),
            bad=tuple(tried.bad),
            unexplained=tried.unexplained,
        )

    def _check_offered(self, found: Found, bad: Sequence[Any]) -> None:
        """Check that the clauses cover what went wrong, as the tiers that offered it say."""
        if bad and not covered(found.clauses, self._domain.examples([], bad).eases).all():
            raise RuntimeError(f"a {self._domain.bias.noun} was offered that the learnt clauses do not cover")

    def _write(self, clauses: Sequence[LearntClause], examples: Examples, head: Sequence[str]) -> None:
        bias = self._domain.bias.path
        loaded = os.path.relpath(bias, self._out.parent) if bias.is_file() else bias.as_posix()
        text = learnt_text(clauses, examples, head, self._out.name, loaded, self._domain.form)
        write_atomic(self._out, text.encode())
