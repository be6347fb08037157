"""`drlsl rules learn`: learn when lane changes are open, from driving, and prove what must hold of it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from drlsl.cli.options import Jobs, Ray, crew_of, recordings

if TYPE_CHECKING:
    from drlsl.induction import LearningRun, Learnt

Recordings = Annotated[
    list[str] | None,
    typer.Argument(
        help="Recordings to learn from; default: highway-train and freeway.", autocompletion=recordings
    ),
]
Must = Annotated[
    list[str] | None,
    typer.Option(
        "--must",
        metavar="NAME",
        help="A property that must be proved; may be repeated. Default: nobody_alongside, nothing_hidden.",
    ),
]
HeldOut = Annotated[
    list[str] | None,
    typer.Option(
        "--held-out",
        metavar="NAME",
        help="A recording to judge by, never learnt from; may be repeated. Default: highway-test, "
        "overtake-test.",
        autocompletion=recordings,
    ),
]


def learn(
    recording: Recordings = None,
    out: Annotated[Path, typer.Option(metavar="FILE", help="The rule file to write.")] = Path("learnt.pl"),
    bias: Annotated[
        str, typer.Option(metavar="FILE", help="The program whose learn/2 declares what to learn from.")
    ] = "learning.pl",
    label: Annotated[
        Literal["fault", "contact", "rss"],
        typer.Option(
            help="What makes a lane change unsafe: a contact at fault, any contact, or a gap below the "
            "distance of highway.pl before it has ended."
        ),
    ] = "fault",
    changes: Annotated[int, typer.Option(min=1, help="Lane changes to label in each recording.")] = 20_000,
    clauses: Annotated[int, typer.Option(help="The most clauses.")] = 3,
    literals: Annotated[int, typer.Option(help="The most literals of a clause.")] = 4,
    search_time: Annotated[float, typer.Option(min=0.1, help="Seconds of each search.")] = 10.0,
    must: Must = None,
    properties: Annotated[
        list[Path] | None,
        typer.Option("--property", metavar="FILE", help="A file of properties instead of properties.pl."),
    ] = None,
    episodes: Annotated[
        int, typer.Option(min=1, help="Episodes of stress on each recording, in which nothing may go wrong.")
    ] = 10_000,
    rounds: Annotated[int, typer.Option(min=1, help="The most rounds.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Everything random follows from it.")] = 0,
    jobs: Jobs = None,
    ray: Ray = None,
    held_out: HeldOut = None,
    agent: Annotated[
        list[str] | None,
        typer.Option(metavar="RUN", help="A trained run to drive behind the rules in the report, too."),
    ] = None,
    report_episodes: Annotated[
        int, typer.Option(min=0, help="Episodes of stress on each recording in the report; 0: no report.")
    ] = 2000,
) -> None:
    """Learn when a lane change is open from lane changes in the world, and prove properties of the result.

    Every round drives with what was found, and tries to prove what must hold; what goes wrong becomes an
    example, until nothing does. The same command continues after Ctrl-C. Beside the rule file it writes a
    table of the scenes that fix its limits, and a folder with a report, FILE.report. The exit status is 1
    if the rounds ended before nothing went wrong.
    """
    from drlsl.errors import UserError

    for module, extra in (("clingo", "learn"), ("z3", "verify")):
        if find_spec(module) is None:
            raise UserError(f"learning rules needs {module}: pip install 'drlsl[{extra}]'")
    from drlsl.induction import (
        Labelling,
        LearningReport,
        LearningRun,
        LearnRequest,
        ReportRequest,
        write_table,
    )

    crew = crew_of(jobs, ray)
    usual = LearnRequest()
    request = LearnRequest(
        recordings=tuple(recording or usual.recordings),
        bias=bias,
        how=Labelling(label=label, changes=changes, seed=seed),
        clauses=clauses,
        literals=literals,
        seconds=search_time,
        must=usual.must if must is None else tuple(must),
        properties=tuple(properties or ()),
        episodes=episodes,
        rounds=rounds,
        crew=crew,
    )
    result = _run(LearningRun(request, out, _tell), out)
    print("\n".join(result.lines()))
    mutants = write_table(out, result.clauses, result.examples, jobs=crew.jobs)
    print(f"wrote {out} and its table, which notices {mutants.killed} of {len(mutants.verdicts)} mutants")
    if report_episodes:
        what = ReportRequest(
            held_out=("highway-test", "overtake-test") if held_out is None else tuple(held_out),
            episodes=report_episodes,
            agents=tuple(agent or ()),
            crew=crew,
        )
        print(f"wrote {LearningReport(out, request, result, mutants, _tell).write(what)}")
    if not result.finished:
        raise typer.Exit(1)


def _tell(line: str) -> None:
    typer.echo(line, err=True)


def _run(run: LearningRun, out: Path) -> Learnt:
    """Learn; after Ctrl-C say what is left, and how to go on."""
    try:
        return run.run()
    except KeyboardInterrupt:
        kept = f"{out} has the best clauses so far" if out.exists() else "no clauses were found yet"
        typer.echo(f"drlsl: stopped; {kept}, and the same command continues", err=True)
        raise
