"""The domain of lane changes in recorded traffic."""

from __future__ import annotations

import json
from collections.abc import Generator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

from drlsl.driving.scene import parse_scene, scene_json
from drlsl.errors import UserError
from drlsl.induction.clause_search import SECONDS
from drlsl.induction.domain import Effort, Examined, Progress, Tell, Trial, unseen
from drlsl.induction.lane_changes.change_examples import ChangeExamples
from drlsl.induction.lane_changes.examination import (
    BadChange,
    Stressed,
    bad_changes,
    broken_by,
    examined,
    stressed,
)
from drlsl.induction.lane_changes.label_cache import cached_changes
from drlsl.induction.lane_changes.labelled_changes import Changes, Labelling
from drlsl.induction.lane_changes.scene_bias import FORM, OPENINGS, SceneBias
from drlsl.traffic import load_recording
from drlsl.verify import Prover, Result
from drlsl.workers import ALONE, Crew, Function, in_order


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


class LaneChanges:
    """Lane changes in recorded traffic: a `Domain` in which properties are proved, too."""

    def __init__(self, request: LearnRequest, progress: Progress = unseen) -> None:
        """Load the program; `progress` shows how far what takes long is.

        Raises:
            UserError: a recording or a property is not there, or the program cannot be used.
            PrologError: it is not a valid program.
        """
        self._request, self._progress = request, progress
        self.bias: Final = SceneBias(request.bias)
        self.form: Final = FORM
        self.effort: Final = Effort(request.clauses, request.literals, request.seconds, request.rounds)
        if not request.recordings:
            raise UserError("no recording to learn from; name one, such as highway-train")
        for recording in request.recordings:  # before a folder is begun with a name that is mistyped
            load_recording(recording)
        if request.must:
            Prover.of([request.bias], request.properties, request.must)

    def settings(self) -> dict[str, Any]:
        """Return all that the rounds depend on."""
        return self._request.as_json()

    def label(self, folder: Path, tell: Tell) -> list[Changes]:
        """Return the labelled lane changes of each recording; the cache folder keeps them, not `folder`."""
        request = self._request
        make = partial(_labelling, request.how, request.bias)
        tell(f"labelling {request.how.changes:,} lane changes in each of {', '.join(request.recordings)}")

        def heard(recording: str, count: int) -> None:
            self._progress(f"labelling {recording}", count, request.how.changes)

        found = in_order(request.crew.perform(make, request.recordings, heard=heard))
        parts = []
        for name, part in zip(request.recordings, found, strict=True):
            left = ", ".join(f"{count:,} {why}" for why, count in sorted(part.left_out.items()))
            tell(
                f"{name}: {len(part):,} lane changes, {int(part.unsafe.sum()):,} unsafe; left out: "
                f"{left or 'none'}"
            )
            parts.append(part)
        return parts

    def left_out(self, parts: Sequence[Changes]) -> dict[str, dict[str, int]]:
        """Return how many lane changes have no label, by recording and reason."""
        return {name: dict(part.left_out) for name, part in zip(self._request.recordings, parts, strict=True)}

    def examples(self, parts: Sequence[Changes], bad: Sequence[BadChange]) -> ChangeExamples:
        """Return the lane changes of some parts, and bad ones as unsafe."""
        return ChangeExamples(self.bias, [*parts, *([bad_changes(bad)] if bad else [])])

    def examine(self, trial: Trial, tell: Tell) -> Examined:
        """Drive with what was found, and try to prove what must hold of it.

        Raises:
            UserError: a property cannot be met by any clause.
        """
        request, rules, number, known = self._request, trial.rules, trial.number, trial.known
        doubtful = [name for name in request.must if not known.get(name, "").startswith("proved")]
        if doubtful:
            tell(f"round {number}: proving {', '.join(doubtful)}")
        results = self._examined(rules, doubtful)
        driven: list[Stressed] = []
        if all(result.status != "refuted" for result in results):
            tell(f"round {number}: driving up to {request.episodes:,} episodes on each recording")
            driven = stressed(
                rules,
                request.recordings,
                request.episodes,
                1000 * number,
                crew=request.crew,
                progress=self._progress,
            )
            if all(one.clean for one in driven):
                rest = [name for name in request.must if name not in doubtful]
                results += self._examined(rules, rest)
        bad = [one for result in results for one in self._broken(rules, result)]
        bad += [one for part in driven for one in part.bad]
        statuses = {result.name: result.status for result in results}
        return Examined(
            stress={one.recording: one.counts.as_json() for one in driven},
            proofs={name: statuses.get(name, known.get(name, "not tried")) for name in request.must},
            bad=bad,
            unexplained=sum(one.unexplained for one in driven),
        )

    def _examined(self, rules: Path, names: Sequence[str]) -> list[Result]:
        request = self._request
        return examined(
            rules,
            request.properties,
            names,
            crew=request.crew,
            progress=partial(self._progress, f"proving {', '.join(names)}"),
        )

    def _broken(self, rules: Path, result: Result) -> list[BadChange]:
        if result.status != "refuted":
            return []
        found = list(broken_by(rules, self._request.properties, result))
        if not found:
            raise UserError(
                f"--must {result.name}: it is refuted, but not by the offer of a lane change, so that no "
                f"clause can meet it; drlsl rules verify {rules} --only {result.name} shows the scene"
            )
        return found

    def is_clean(self, stress: Mapping[str, Any]) -> bool:
        """Return whether nobody was at fault or off the road."""
        return not stress["contacts_at_fault"] and not stress["off_road"]

    def words(self, name: str, stress: Mapping[str, Any]) -> str:
        """Return the contacts at fault on a recording."""
        return f"{name} {stress['contacts_at_fault']} at fault in {stress['episodes']:,} episodes"

    def sentence(self, name: str, stress: Mapping[str, Any]) -> str:
        """Return what happened on a recording."""
        return (
            f"stress on {name}: {stress['episodes']:,} episodes, {stress['lane_changes']:,} lane changes, "
            f"{stress['contacts_at_fault']} at fault, {stress['off_road']} off the road, "
            f"{stress['contacts_not_at_fault']:,} excused"
        )

    def bad_as_json(self, bad: BadChange) -> dict[str, Any]:
        """Return a bad lane change as a file of a round has it."""
        return {"scene": json.loads(scene_json(bad.scene)), "side": bad.side, "origin": bad.origin}

    def bad_of_json(self, values: dict[str, Any], place: str) -> BadChange:
        """Return the bad lane change that a file has."""
        return BadChange(parse_scene(json.dumps(values["scene"]), place), values["side"], values["origin"])


def _labelling(how: Labelling, bias: str) -> Function[str, Generator[int, None, Changes]]:
    """Return the function that labels the lane changes of a recording, and says how many have a label."""
    return lambda recording, _stop: cached_changes(how, bias, load_recording(recording))
