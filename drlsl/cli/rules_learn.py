"""`drlsl rules learn`: learn rules from lane changes in traffic, or from the failures of an environment."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypeVar

import typer

from drlsl.cli.learning_display import LearningDisplay
from drlsl.cli.options import Jobs, Properties, Ray, crew_of, recordings, several

if TYPE_CHECKING:
    from drlsl.assurance import Score
    from drlsl.induction import Effort, Examples, LearningRun, Learnt
    from drlsl.workers import Crew

    E = TypeVar("E", bound=Examples)

Recordings = Annotated[
    list[str] | None,
    typer.Argument(
        help="Recordings to learn from, or folders, data sets and patterns of them; default: highway-train "
        "and freeway.",
        autocompletion=recordings,
    ),
]
Domain = Annotated[
    str | None,
    typer.Option(
        "--domain",
        metavar="NAME",
        help="Learn from the failures of an environment instead: frozen_lake, highway_env, or a "
        "LearningDomain of yours as FILE.py:NAME or PACKAGE.MODULE:NAME.",
    ),
]
Out = Annotated[Path, typer.Option(metavar="FILE", help="The rule file to write.")]
BiasFile = Annotated[
    str | None,
    typer.Option(metavar="FILE", help="The program whose learn/2 declares what to learn from: learning.pl."),
]
LabelName = Annotated[
    Literal["fault", "contact", "rss"] | None,
    typer.Option(
        help="What makes a lane change unsafe: a contact at fault (default), any contact, or a gap below the "
        "distance of highway.pl before it has ended."
    ),
]
Changes = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Lane changes to label in each recording (20,000), or actions in an environment (as its domain "
        "says).",
    ),
]
Clauses = Annotated[int, typer.Option(help="The most clauses.")]
Literals = Annotated[int, typer.Option(help="The most literals of a clause.")]
SearchTime = Annotated[float, typer.Option(min=0.1, help="Seconds of each search.")]
Must = Annotated[
    list[str] | None,
    several(
        "--must",
        "NAME",
        "A property that must be proved; may be repeated. Default: nobody_alongside, nothing_hidden.",
    ),
]
Episodes = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Episodes of stress on each recording (10,000), or in the environment (as its domain says), in "
        "which nothing may go wrong.",
    ),
]
Rounds = Annotated[int, typer.Option(min=1, help="The most rounds.")]
Seed = Annotated[int, typer.Option(min=0, help="Everything random follows from it.")]
HeldOut = Annotated[
    list[str] | None,
    several(
        "--held-out",
        "NAME",
        "A recording, or a data set, to judge by, never learnt from; may be repeated. Default: "
        "highway-test, overtake-test.",
        recordings,
    ),
]
Agent = Annotated[
    list[str] | None,
    typer.Option(metavar="RUN", help="A trained run to drive behind the rules in the report, too."),
]
ReportEpisodes = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="Episodes on each recording (2,000), or in each held-out environment (as its domain says), in "
        "the report; 0: no report.",
    ),
]


_TABLE: Final = "writing the table, and trying it on mutants"


def learn(
    recording: Recordings = None,
    domain: Domain = None,
    out: Out = Path("learnt.pl"),
    bias: BiasFile = None,
    label: LabelName = None,
    changes: Changes = None,
    clauses: Clauses = 3,
    literals: Literals = 4,
    search_time: SearchTime = 10.0,
    must: Must = None,
    properties: Properties = None,
    episodes: Episodes = None,
    rounds: Rounds = 20,
    seed: Seed = 0,
    jobs: Jobs = None,
    ray: Ray = None,
    held_out: HeldOut = None,
    agent: Agent = None,
    report_episodes: ReportEpisodes = None,
) -> None:
    """Learn rules from what goes wrong in lane changes, or in an environment of yours.

    Lane changes are driven in recorded traffic; with --domain, actions are tried in an environment. Every
    round drives with what was found, and tries to prove what must hold; what goes wrong becomes an example,
    until nothing does. The same command continues after Ctrl-C. Beside the rule file it writes a folder with
    a report, FILE.report, and a table of the scenes or states that fix the limits, FILE.test.yaml. The exit
    status is 1 if the rounds ended before nothing went wrong.
    """
    from drlsl.induction import Effort

    numbers = _Numbers(changes, episodes, report_episodes, seed, crew_of(jobs, ray))
    effort = Effort(clauses, literals, search_time, rounds)
    traffic = _Traffic(recording, bias, label, must, properties, held_out, agent)
    if domain is None:
        finished = _learn_lane_changes(traffic, numbers, effort, out)
    else:
        traffic.refuse_with(domain)
        finished = _learn_in_environment(domain, numbers, effort, out)
    if not finished:
        raise typer.Exit(1)


@dataclass(frozen=True, slots=True)
class _Numbers:
    """Numbers of examples and episodes, None for what is usual; the seed, and who does the work."""

    examples: int | None
    episodes: int | None
    report: int | None
    seed: int
    crew: Crew


@dataclass(frozen=True, slots=True)
class _Traffic:
    """The options that lane changes alone have, None where not given."""

    recording: list[str] | None
    bias: str | None
    label: Any
    must: list[str] | None
    property: list[Path] | None
    held_out: list[str] | None
    agent: list[str] | None

    def refuse_with(self, domain: str) -> None:
        """Check that none is given beside --domain.

        Raises:
            UserError: one is.
        """
        from drlsl.errors import UserError

        for name in self.__slots__:
            value = getattr(self, name)
            if value:
                told = f"--{name.replace('_', '-')}" if name != "recording" else f"the recording {value[0]}"
                raise UserError(f"{told} is for lane changes, and means nothing with --domain {domain}")


def _learn_lane_changes(given: _Traffic, numbers: _Numbers, effort: Effort, out: Path) -> bool:
    """Learn when a lane change is open; return whether nothing went wrong in the last round."""
    _check_installed({"clingo": "learn", "z3": "verify"})
    from drlsl.induction import LearningRun
    from drlsl.induction.lane_changes import (
        OPENINGS,
        Labelling,
        LaneChanges,
        LearningReport,
        LearnRequest,
        ReportRequest,
        write_table,
    )

    usual = LearnRequest()
    request = LearnRequest(
        recordings=_each(given.recording) or usual.recordings,
        bias=given.bias or OPENINGS,
        how=Labelling(given.label or "fault", numbers.examples or 20_000, numbers.seed),
        clauses=effort.clauses,
        literals=effort.literals,
        seconds=effort.seconds,
        must=usual.must if given.must is None else tuple(given.must),
        properties=tuple(given.property or ()),
        episodes=numbers.episodes or usual.episodes,
        rounds=effort.rounds,
        crew=numbers.crew,
    )
    display = LearningDisplay()
    result = _run(LearningRun(LaneChanges(request, display.progress), out, display.tell), out, display)
    display.tell(_TABLE)
    mutants = write_table(out, result.clauses, result.examples, crew=numbers.crew)
    _print_written(out, mutants)
    what = ReportRequest(agents=tuple(given.agent or ()), crew=numbers.crew)
    if given.held_out is not None:
        what = replace(what, held_out=_each(given.held_out))
    if numbers.report is not None:
        what = replace(what, episodes=numbers.report)
    if what.episodes:
        print(f"wrote {LearningReport(out, request, result, mutants, display.tell).write(what)}")
    return result.finished


def _each(named: list[str] | None) -> tuple[str, ...]:
    """Return the recordings that names mean, each by a name of its own and once.

    Raises:
        UserError: one means none.
    """
    from drlsl.traffic import recording_names

    return tuple(dict.fromkeys(one for name in named or () for one in recording_names(name)))


def _learn_in_environment(name: str, numbers: _Numbers, effort: Effort, out: Path) -> bool:
    """Learn which actions are safe; return whether nothing went wrong in the last round."""
    _check_installed({"clingo": "learn"})
    from drlsl.induction import LearningRun
    from drlsl.induction.environments import (
        EnvironmentDomain,
        EnvRequest,
        write_environment_report,
        write_states_table,
    )

    request = EnvRequest(name, numbers.examples, numbers.episodes, effort, numbers.seed, numbers.crew)
    display = LearningDisplay()
    domain = EnvironmentDomain(request, display.progress)
    result = _run(LearningRun(domain, out, display.tell), out, display)
    display.tell(_TABLE)
    mutants = write_states_table(out, result.clauses, result.examples, crew=numbers.crew)
    _print_written(out, mutants)
    if numbers.report != 0:
        path, table = write_environment_report(
            out, result, mutants, name, numbers.report, crew=numbers.crew, tell=display.tell
        )
        print("\n".join(table))
        print(f"wrote {path}")
    return result.finished


def _print_written(out: Path, mutants: Score) -> None:
    print(f"wrote {out} and its table, which notices {mutants.killed} of {len(mutants.verdicts)} mutants")


def _check_installed(needed: dict[str, str]) -> None:
    """Check that modules are installed, by the extras that they come with."""
    from drlsl.errors import UserError

    for module, extra in needed.items():
        if find_spec(module) is None:
            raise UserError(f"learning rules needs {module}: pip install 'drlsl[{extra}]'")


def _run(run: LearningRun[E], out: Path, display: LearningDisplay) -> Learnt[E]:
    """Learn, and tell what was learnt; after Ctrl-C say what is left, and how to go on."""
    try:
        with display:
            result = run.run()
    except KeyboardInterrupt:
        kept = f"{out} has the best clauses so far" if out.exists() else "no clauses were found yet"
        typer.echo(f"drlsl: stopped; {kept}, and the same command continues", err=True)
        raise
    print("\n".join(result.lines()))
    return result
