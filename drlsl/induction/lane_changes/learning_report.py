"""The report of learnt rules: examples, rounds, proofs, and how they drive beside other rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drlsl.assurance import Score
from drlsl.driving import EnvConfig
from drlsl.driving.drivers import DRIVERS, KEEP, Driver, make_driver
from drlsl.errors import UserError
from drlsl.files import write_atomic
from drlsl.induction.lane_changes.change_examples import ChangeExamples
from drlsl.induction.lane_changes.examination import Stressed, stressed
from drlsl.induction.lane_changes.labelled_changes import LEFT_OUT
from drlsl.induction.lane_changes.lane_change_domain import LearnRequest
from drlsl.induction.learning_rounds import Learnt
from drlsl.learning import EpisodeSummary, as_record, drive, load_driver, make_evaluation_env, times_of
from drlsl.verify import Request, Result, verify, write_counterexample
from drlsl.workers import ALONE, Crew

BESIDE: Final = ("highway.pl", "paper.pl")
"""Programs beside which learnt rules are judged."""

REPORT: Final = ".report"
"""The folder of the report is called like the rule file, with this in place of its suffix."""

_MOBIL: Final = "mobil"

SEED: Final = 77_000
"""Seed of the report's stress: no round of learning drives these episodes."""


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """A request to measure: stress on the recordings learnt from and on those `held_out`, and time saved.

    `episodes` of stress on each recording, `drives` of MOBIL and of each of the `agents`, which are run
    folders or what else `drlsl eval` takes; `attack`: scenes against each proof.
    """

    held_out: tuple[str, ...] = ("highway-test", "overtake-test")
    episodes: int = 2000
    drives: int = 100
    agents: tuple[str, ...] = ()
    attack: int = 20_000
    crew: Crew = ALONE


class LearningReport:
    """Measures learnt rules, and writes what it finds to a folder beside the rule file."""

    def __init__(
        self,
        rules: Path,
        request: LearnRequest,
        learnt: Learnt[ChangeExamples],
        mutants: Score,
        tell: Callable[[str], None],
    ) -> None:
        self._rules, self._request, self._learnt, self._mutants = rules, request, learnt, mutants
        self._tell = tell
        self.folder = rules.with_suffix(REPORT)

    def write(self, what: ReportRequest) -> Path:
        """Measure, and write the report; return its file.

        Raises:
            UserError: a recording cannot be driven in, or a file cannot be written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        sections = [
            f"# {self._rules.name}\n\nWritten by `drlsl rules learn`.",
            "## Examples and rounds\n\n" + "\n".join(self._examples()),
            "## Proofs\n\n" + "\n".join(self._proofs(what)),
            "## Stress\n\n" + "\n".join(self._stress(what)),
            "## Time saved\n\n" + "\n".join(self._time_saved(what)),
        ]
        path = self.folder / "report.md"
        write_atomic(path, ("\n\n".join(sections) + "\n").encode())
        return path

    def _examples(self) -> Iterator[str]:
        for name, left_out in self._learnt.left_out.items():
            for why, count in left_out.items():
                yield f"- {name}: {count:,} lane changes have no label: {LEFT_OUT[why]}"
        yield from (f"- {line}" for line in self._learnt.lines())
        yield (
            f"- the table notices {self._mutants.killed:,} of {len(self._mutants.verdicts):,} mutants; "
            f"{len(self._mutants.survivors):,} have a reason"
        )
        yield ""
        yield from _head(
            "round", "clauses", "safe examples offered", "at fault", "proofs", "new unsafe examples"
        )
        for one in self._learnt.rounds:
            fault = ", ".join(
                f"{name} {counts['contacts_at_fault']} in {counts['episodes']:,}"
                for name, counts in one.stress.items()
            )
            proofs = ", ".join(f"{name} {status}" for name, status in one.proofs.items())
            yield (
                f"| {one.number} | {len(one.clauses)} | {one.safe:,} | {fault or 'not driven'} | {proofs} | "
                f"{len(one.bad)} |"
            )

    def _proofs(self, what: ReportRequest) -> Iterator[str]:
        request = Request(
            rules=(self._rules,), properties=self._request.properties, crew=what.crew, attack=what.attack
        )
        self._tell("report: proofs")
        yield from _head("property", "result", "means")
        pictures = []
        for result in verify(request).results:
            yield f"| {result.name} | {_status(result)} | {result.text} |"
            if result.counterexample is not None:
                written = write_counterexample(request, result, self.folder)
                pictures += [(result, path.name) for path in written if path.suffix == ".png"]
        for result, name in pictures:
            yield f"\n![A scene that breaks {result.name}: {result.text}]({name})"

    def _stress(self, what: ReportRequest) -> Iterator[str]:
        held_out = [one for one in what.held_out if one not in self._request.recordings]
        yield (
            f"{what.episodes:,} episodes on each recording, a third by each policy of `drlsl stress`. "
            "Recordings marked * were not learnt from.\n"
        )
        yield from _head(
            "rules",
            "recording",
            "km",
            "lane changes",
            "off the road",
            "at fault",
            "excused",
            "by lane change",
        )
        for rules in (self._rules, *map(Path, BESIDE)):
            self._tell(f"report: stress with {rules.name}")
            driven = stressed(
                rules,
                [*self._request.recordings, *held_out],
                what.episodes,
                SEED,
                crew=what.crew,
                whole=True,
            )
            yield from (_stress_row(rules, one, one.recording in held_out) for one in driven)

    def _time_saved(self, what: ReportRequest) -> Iterator[str]:
        yield (
            f"{what.drives} episodes of each driver behind each of the rules, against keeping the lane in "
            "the same episodes.\n"
        )
        yield from _head(
            "driver", "rules", "recording", "time saved", "lane changes per km", "at fault", "excused"
        )
        for rules in (self._rules, *map(Path, BESIDE)):
            self._tell(f"report: time saved behind {rules.name}")
            for recording in dict.fromkeys([*self._request.recordings, *what.held_out]):
                yield from _driven(rules, recording, what)


def _head(*names: str) -> Iterator[str]:
    """Yield the head of a table with columns of these names."""
    yield f"| {' | '.join(names)} |"
    yield "|" + "---|" * len(names)


def _status(result: Result) -> str:
    if result.status == "proved" and result.for_any_number:
        return "proved for any number of vehicles"
    return result.status


def _stress_row(rules: Path, one: Stressed, held_out: bool) -> str:
    counts = one.counts.as_json()
    changes, excused = counts["lane_changes"], counts["contacts_not_at_fault"]
    share = f"{excused / changes:.3f}" if changes else "-"
    return (
        f"| {rules.name} | {one.recording}{'*' * held_out} | {counts['distance'] / 1000:,.0f} "
        f"| {changes:,} | {counts['off_road']} | {counts['contacts_at_fault']} | {excused:,} | {share} |"
    )


def _driven(rules: Path, recording: str, what: ReportRequest) -> Iterator[str]:
    """Yield a row for each driver that drives in a recording behind rules."""
    config = EnvConfig(recording=recording, rules=(str(rules),))
    env = make_evaluation_env(config)

    def driven(driver: Driver) -> list[EpisodeSummary]:
        return list(drive(env, driver, shield="on", episodes=what.drives, seed=SEED))

    kept = times_of(driven(make_driver(KEEP)))
    for name in (_MOBIL, *what.agents):
        try:
            driver = make_driver(name) if name in DRIVERS else load_driver(name, env, {})
        except UserError as error:  # an agent need not observe what these rules give
            yield f"| {name} | {rules.name} | {recording} | not driven: {error} | - | - | - |"
            continue
        record = as_record(driven(driver), env={}, shield="on", seed=SEED, kept=kept)["totals"]
        saved, per_km = record["time_saved"], record["lane_changes_per_km"]
        yield (
            f"| {name} | {rules.name} | {recording} | {'-' if saved is None else f'{saved:.1%}'} | "
            f"{'-' if per_km is None else f'{per_km:.2f}'} | {record['contacts_at_fault']} | "
            f"{record['contacts_not_at_fault']} |"
        )
