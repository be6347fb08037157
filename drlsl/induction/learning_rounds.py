"""The loop: search, examine what was found, take what went wrong as examples, and search again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

from drlsl.driving.scene import parse_scene, scene_json
from drlsl.errors import UserError
from drlsl.files import parse_json, read_text, write_atomic
from drlsl.induction.bias import OPENINGS, Bias
from drlsl.induction.clause_search import SECONDS, Found, search
from drlsl.induction.examination import BadChange, Stressed, bad_changes, broken_by, examined, stressed
from drlsl.induction.examples import Examples
from drlsl.induction.label_cache import cached_changes
from drlsl.induction.labelled_changes import Changes, Labelling
from drlsl.induction.learnt_file import contradiction_words, learnt_text
from drlsl.induction.search_problem import LearntClause, SearchProblem, covered
from drlsl.traffic import load_recording
from drlsl.verify import Prover, Result
from drlsl.workers import ALONE, Crew, Function, in_order

Tell = Callable[[str], None]

ROUNDS: Final = ".rounds"
"""The folder of the rounds is called like the rule file, with this in place of its suffix."""


@dataclass(frozen=True, slots=True)
class LearnRequest:
    """A request to learn: the recordings, how, and what must hold of the result.

    `must` names properties of `properties`, or of properties.pl; `episodes` of stress on each recording end
    the learning if nothing goes wrong in them; `seconds` limits each search.
    """

    recordings: tuple[str, ...] = ("highway-train", "freeway")
    bias: str = OPENINGS
    how: Labelling = field(default_factory=Labelling)
    clauses: int = 3
    literals: int = 4
    seconds: float = SECONDS
    must: tuple[str, ...] = ("nobody_alongside", "nothing_hidden")
    properties: tuple[Path, ...] = ()
    episodes: int = 10_000
    rounds: int = 20
    crew: Crew = ALONE

    def as_json(self) -> dict[str, Any]:
        """Return all that the rounds depend on."""
        values = asdict(self)
        del values["crew"], values["rounds"]
        return {**values, "properties": [str(path) for path in self.properties]}


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
    bad: tuple[BadChange, ...]
    unexplained: int

    @property
    def clean(self) -> bool:
        """True if nothing went wrong."""
        fine = all(not one["contacts_at_fault"] and not one["off_road"] for one in self.stress.values())
        return fine and not self.bad and all(status.startswith("proved") for status in self.proofs.values())

    def words(self) -> str:
        """Return the round in one line."""
        parts = [f"{len(self.clauses)} clauses offer {self.safe:,} safe examples"]
        for name, counts in self.stress.items():
            parts.append(f"{name} {counts['contacts_at_fault']} at fault in {counts['episodes']:,} episodes")
        parts += [f"{name} {status}" for name, status in self.proofs.items()]
        parts.append(f"{len(self.bad)} new unsafe examples" if self.bad else "nothing went wrong")
        return f"round {self.number}: " + "; ".join(parts)

    def as_json(self) -> dict[str, Any]:
        """Return the round as its file has it."""
        return {
            "number": self.number,
            "clauses": [list(clause.limits) for clause in self.clauses],
            "safe": self.safe,
            "optimal": self.optimal,
            "hardest": self.hardest,
            "stress": self.stress,
            "proofs": self.proofs,
            "bad": [
                {"scene": json.loads(scene_json(one.scene)), "side": one.side, "origin": one.origin}
                for one in self.bad
            ],
            "unexplained": self.unexplained,
        }

    @classmethod
    def of_json(cls, values: dict[str, Any], place: str) -> Round:
        """Return the round that a file has."""
        bad = [
            BadChange(parse_scene(json.dumps(one["scene"]), place), one["side"], one["origin"])
            for one in values["bad"]
        ]
        clauses = [LearntClause(tuple(limits)) for limits in values["clauses"]]
        return cls(**{**values, "clauses": tuple(clauses), "bad": tuple(bad)})


@dataclass(frozen=True, slots=True)
class Learnt:
    """The result of learning: the last round, all of them, and the examples of its search."""

    rounds: tuple[Round, ...]
    examples: Examples
    problem: SearchProblem
    left_out: dict[str, dict[str, int]]

    @property
    def clauses(self) -> tuple[LearntClause, ...]:
        """The learnt clauses."""
        return self.rounds[-1].clauses

    @property
    def finished(self) -> bool:
        """True if nothing went wrong in the last round."""
        return self.rounds[-1].clean

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
        ended = "nothing went wrong in the last" if last.clean else "the last one still brought examples"
        driven = [
            f"stress on {name}: {counts['episodes']:,} episodes, {counts['lane_changes']:,} lane changes, "
            f"{counts['contacts_at_fault']} at fault, {counts['off_road']} off the road, "
            f"{counts['contacts_not_at_fault']:,} excused"
            for name, counts in last.stress.items()
        ]
        proofs = [f"property {name}: {status}" for name, status in last.proofs.items()]
        return [
            examples,
            f"{len(last.clauses)} clauses offer {last.safe:,} of the safe ones and no unsafe one: {best}",
            f"{len(self.rounds)} rounds; {ended}",
            *driven,
            *proofs,
        ]


class LearningRun:
    """A run of `learn`: a rule file, and beside it the folder of its rounds."""

    def __init__(self, request: LearnRequest, out: Path, tell: Tell) -> None:
        """Begin, or resume what an earlier call with the same settings left.

        Raises:
            UserError: a recording cannot be loaded, or the file exists and is of other settings.
        """
        self._request, self._out, self._tell = request, out, tell
        self._folder = out.with_suffix(ROUNDS)
        self.bias = Bias(request.bias)
        self._check_request()
        self.rounds: list[Round] = self._begun()

    def _check_request(self) -> None:
        for number, flag in ((self._request.clauses, "--clauses"), (self._request.literals, "--literals")):
            if number < 1:
                raise UserError(f"{flag} {number}: expected 1 or more")
        if not self._request.recordings:
            raise UserError("no recording to learn from; name one, such as highway-train")
        for recording in self._request.recordings:  # before a folder is begun with a name that is mistyped
            load_recording(recording)
        if self._request.must:
            Prover.of([self._request.bias], self._request.properties, self._request.must)

    def _begun(self) -> list[Round]:
        """Return the rounds of an earlier call, or begin a new folder."""
        settings = self._folder / "settings.json"
        asked = json.dumps(self._request.as_json(), indent=1)
        if not settings.is_file():
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
        return [Round.of_json(parse_json(read_text(file), file.name), file.name) for file in files]

    def run(self) -> Learnt:
        """Learn until nothing goes wrong, or until the limit of rounds.

        Raises:
            UserError: there is nothing to learn, or no clause meets what is asked.
        """
        request = self._request
        parts = self._labelled()
        left_out = {name: dict(part.left_out) for name, part in zip(request.recordings, parts, strict=True)}
        while True:
            ended = self._ended()
            bad = [one for done in (self.rounds[:-1] if ended else self.rounds) for one in done.bad]
            examples = Examples(self.bias, [*parts, *([bad_changes(bad)] if bad else [])])
            problem = self._problem(examples)
            if ended:
                break
            if problem.safe_count == problem.contradicted:
                raise UserError(
                    "no safe lane change can be offered; see whether the declared directions, more and less, "
                    f"are right: {contradiction_words(problem, examples)}"
                )
            self._tell(f"round {len(self.rounds) + 1}: searching, at most {request.seconds:g} s")
            found = search(
                problem, clauses=request.clauses, literals=request.literals, seconds=request.seconds
            )
            self._write(
                found.clauses, examples, [f"Round {len(self.rounds) + 1}, not yet driven nor proved."]
            )
            one = self._examine(found, problem, examples)
            name = self._folder / f"round-{one.number:02d}.json"
            write_atomic(name, f"{json.dumps(one.as_json(), indent=1)}\n".encode())
            self.rounds.append(one)
            self._tell(one.words())
        result = Learnt(tuple(self.rounds), examples, problem, left_out)
        self._write(result.clauses, examples, result.lines())
        return result

    def _ended(self) -> bool:
        """Return whether the last round brought nothing to learn from, or was the last one allowed."""
        return bool(self.rounds) and (not self.rounds[-1].bad or len(self.rounds) >= self._request.rounds)

    def _labelled(self) -> list[Changes]:
        """Return the labelled lane changes of each recording."""
        request = self._request
        make = partial(_labelling, request.how, request.bias)
        self._tell(
            f"labelling {request.how.changes:,} lane changes in each of {', '.join(request.recordings)}"
        )
        found = in_order(request.crew.perform(make, request.recordings))
        parts = []
        for name, part in zip(request.recordings, found, strict=True):
            left = ", ".join(f"{count:,} {why}" for why, count in sorted(part.left_out.items()))
            self._tell(
                f"{name}: {len(part):,} lane changes, {int(part.unsafe.sum()):,} unsafe; left out: "
                f"{left or 'none'}"
            )
            parts.append(part)
        return parts

    def _problem(self, examples: Examples) -> SearchProblem:
        unsafe = examples.unsafe
        return SearchProblem(self.bias.quantities, examples.eases[~unsafe], examples.eases[unsafe])

    def _examine(self, found: Found, problem: SearchProblem, examples: Examples) -> Round:
        """Drive with what was found, and try to prove what must hold of it."""
        request = self._request
        number = len(self.rounds) + 1
        known = self.rounds[-1].proofs if self.rounds else {}
        doubtful = [name for name in request.must if not known.get(name, "").startswith("proved")]
        if doubtful:
            self._tell(f"round {number}: proving {', '.join(doubtful)}")
        results = examined(self._out, request.properties, doubtful, crew=request.crew)
        driven: list[Stressed] = []
        if all(result.status != "refuted" for result in results):
            self._tell(f"round {number}: driving up to {request.episodes:,} episodes on each recording")
            driven = stressed(
                self._out, request.recordings, request.episodes, 1000 * number, crew=request.crew
            )
            if all(one.clean for one in driven):
                rest = [name for name in request.must if name not in doubtful]
                results += examined(self._out, request.properties, rest, crew=request.crew)
        bad = [one for result in results for one in self._broken(result)]
        bad += [one for part in driven for one in part.bad]
        self._check_offered(found.clauses, bad)
        statuses = {result.name: result.status for result in results}
        return Round(
            number=number,
            clauses=found.clauses,
            safe=found.safe,
            optimal=found.optimal,
            hardest=len(problem.hardest),
            stress={one.recording: one.counts.as_json() for one in driven},
            proofs={name: statuses.get(name, known.get(name, "not tried")) for name in request.must},
            bad=tuple(bad),
            unexplained=sum(one.unexplained for one in driven),
        )

    def _broken(self, result: Result) -> list[BadChange]:
        if result.status != "refuted":
            return []
        found = list(broken_by(self._out, self._request.properties, result))
        if not found:
            raise UserError(
                f"--must {result.name}: it is refuted, but not by the offer of a lane change, so that no "
                f"clause can meet it; drlsl rules verify {self._out} --only {result.name} shows the scene"
            )
        return found

    def _check_offered(self, clauses: Sequence[LearntClause], bad: Sequence[BadChange]) -> None:
        """Check that the clauses cover what went wrong, as the tiers that offered it say."""
        if bad and not covered(clauses, Examples(self.bias, [bad_changes(bad)]).eases).all():
            raise RuntimeError("a lane change was offered that the learnt clauses do not cover")

    def _write(self, clauses: Sequence[LearntClause], examples: Examples, head: Sequence[str]) -> None:
        loaded = self._request.bias
        if Path(loaded).is_file():
            loaded = os.path.relpath(loaded, self._out.parent)
        text = learnt_text(clauses, examples, head, self._out.name, loaded)
        write_atomic(self._out, text.encode())


def _labelling(how: Labelling, bias: str) -> Function[str, Changes]:
    """Return the function that labels the lane changes of a recording."""
    return lambda recording, _stop: cached_changes(how, bias, load_recording(recording))
