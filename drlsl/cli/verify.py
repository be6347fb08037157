"""`drlsl rules verify`: prove properties of a rule program, or show scenes that break them."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from drlsl.cli.options import AsJson, Jobs, Properties, Ray, RuleFiles, check_new, crew_of, several
from drlsl.files import printable, to_json

if TYPE_CHECKING:
    from drlsl.verify import Report, Request, Result
    from drlsl.verify.told import FactsResult


class Solver(StrEnum):
    """The solver that decides the formulas."""

    Z3 = "z3"
    CVC5 = "cvc5"
    BOTH = "both"


Only = Annotated[list[str] | None, several("--only", "NAME", "Only this property; give it again for more.")]
AttackScenes = Annotated[
    int | None,
    typer.Option(
        min=0, metavar="N", help="Scenes with which to attack what is proved, 0: none; default: 200000."
    ),
]
SceneFolder = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Write the scenes that break a property here, with pictures."),
]


def verify(
    files: RuleFiles = None,
    properties: Properties = None,
    only: Only = None,
    vehicles: Annotated[int, typer.Option(min=0, help="Up to so many vehicles besides the ego.")] = 6,
    time_limit: Annotated[
        float, typer.Option(min=0.1, help="Seconds for one property on one kind of road.")
    ] = 60.0,
    attack: AttackScenes = None,
    solver: Annotated[
        Solver, typer.Option(help="Who proves; both: cvc5 is asked again what z3 has proved.")
    ] = Solver.Z3,
    jobs: Jobs = None,
    ray: Ray = None,
    out: SceneFolder = None,
    cache: Annotated[
        bool,
        typer.Option(
            "--cache/--no-cache",
            help="Keep the answers of the solver, and ask no question twice.",
        ),
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Prove properties over all scenes, or find one that breaks them; status 1 unless all are proved."""
    from drlsl.errors import UserError

    if find_spec("z3") is None:
        raise UserError("proofs need z3-solver: pip install 'drlsl[verify]'")
    if solver is not Solver.Z3 and find_spec("cvc5") is None:
        raise UserError(f"--solver {solver.value} needs cvc5: pip install 'drlsl[cvc5]'")
    from drlsl.verify import Request
    from drlsl.verify.attack import SCENES
    from drlsl.verify.smt import answers_file

    check_new(out)
    request = Request(
        rules=tuple(files or ()),
        properties=tuple(properties or ()),
        vehicles=vehicles,
        only=tuple(only or ()),
        time_limit=time_limit,
        crew=crew_of(jobs, ray),
        attack=SCENES if attack is None else attack,
        solver=solver.value,
        kept=answers_file(solver.value) if cache else None,
    )
    if properties and _told(request, out, as_json=as_json):
        return
    report = _run(request)
    if out is not None:
        _write_scenes(request, report, out)
    if as_json:
        print(to_json(_as_json(report, request)))
    else:
        print("\n".join(_lines(report, request, out)))
    if any(result.status != "proved" for result in report.results):
        raise typer.Exit(1)


def _told(request: Request, out: Path | None, *, as_json: bool) -> bool:
    """Prove properties of rules for another environment; return False if they are about driving scenes."""
    from drlsl.errors import UserError
    from drlsl.verify.told import load_told, verify_facts

    book = load_told(request)
    if book is None:
        return False
    if request.crew.ray is not None:
        raise UserError("--ray: proofs about facts of other environments take one process; leave it out")
    if out is not None:
        raise UserError(
            "--out writes scenes of driving; facts of other environments are in the report and in --json"
        )
    results = []
    for result in verify_facts(request, book):
        results.append(result)
        if not as_json:
            print("\n".join(_facts_lines(result)), flush=True)
    if as_json:
        print(to_json({"results": [result.as_json() for result in results]}))
    if any(result.status != "proved" for result in results):
        raise typer.Exit(1)
    return True


def _facts_lines(result: FactsResult) -> Iterator[str]:
    """Yield the lines about a property of rules for another environment."""
    counts = ", ".join(f"{count} of {name}" for name, count in result.rows.items())
    extent = "any number of rows" if result.enough else f"up to {counts}" if counts else ""
    yield f"{result.status:<8} {result.name:<24} {extent:<24} {result.seconds:8.1f} s"
    yield f"         {result.text}"
    if result.reason:
        yield f"         because {result.reason}"
    if result.floats is not None and result.floats.margin is not None:
        margin = f"{result.floats.margin:g}, in its unit, of its limit"
        yield f"         holds in floats unless a comparison is within {margin}"
    if result.scenes:
        tried = f"attacked with {result.scenes:,} sets of facts"
        yield f"         {tried}: {result.close:,} came within 0.001 of breaking it"
    if result.error is not None:
        yield f"         the rules raise an error: {result.error}"
    for (name, _), rows in (result.facts or {}).items():
        yield from (f"         {name}({', '.join(map(str, row))})" for row in rows)


def _run(request: Request) -> Report:
    """Verify, with a bar on a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from drlsl.verify import verify as run

    console = Console(stderr=True)
    columns = (TextColumn("roads"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("roads", total=None)
        return run(request, lambda done, every: bar.update(task, completed=done, total=every))


def _as_json(report: Report, request: Request) -> dict[str, object]:
    return {
        "vehicles": request.vehicles,
        "roads": report.cases,
        "ranges": {name: [float(low), float(high)] for name, (low, high) in report.ranges.items()},
        "results": [result.as_json() for result in report.results],
    }


def _lines(report: Report, request: Request, out: Path | None) -> Iterator[str]:
    """Yield the lines of text output."""
    from drlsl.verify import NAMES, Status

    for result in report.results:
        yield f"{result.status:<8} {result.name:<24} {_extent(result):<24} {result.seconds:8.1f} s"
        yield f"         {result.text}"
        if result.reason:
            yield f"         because {result.reason}"
        yield from (f"         {line}" for line in _floats_line(result))
        if request.solver == "both":
            yield f"         {_opinion_line(result)}"
        yield f"         {_attack_line(result)}"
        if result.counterexample is not None:
            yield from (f"         {line}" for line in _scene_lines(result, out))
    counts = {
        status: sum(result.status == status for result in report.results) for status in get_args(Status)
    }
    yield ""
    yield ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    yield f"over {report.cases} kinds of road with up to {request.vehicles} vehicles besides the ego, and"
    names = {**NAMES, **report.unknowns}
    for name, (low, high) in report.ranges.items():
        yield f"  {names[name]:<34} {float(low):g} to {float(high):g}"


def _floats_line(result: Result) -> Iterator[str]:
    """Yield the margin from which on the proof holds in floating-point arithmetic."""
    floats = result.floats
    if result.status != "proved" or floats is None:
        return
    if not floats.error:
        yield "holds in floats, too: it depends on no comparison that rounds"
        return
    line = f"holds in floats unless a comparison is within {floats.margin:g}, in its unit, of its limit"
    line += ", or a divisor that close to 0" * floats.divisors
    yield f"{line}; otherwise each is off by at most {floats.error:.2g}"
    if floats.because is not None:
        yield floats.because


def _opinion_line(result: Result) -> str:
    """Return the second solver's result; a repeated question is asked only once."""
    line = f"{result.confirmed} question{'s' * (result.confirmed != 1)} confirmed by cvc5"
    return line + (f", {result.unanswered} answered by one solver only" if result.unanswered else "")


def _attack_line(result: Result) -> str:
    """Yield how thoroughly the attack tried to break a proved property."""
    attacked = result.attack
    if attacked is None:
        return "not attacked"
    if attacked.reason:
        return f"not attacked: {attacked.reason}"
    line = f"attacked with {attacked.scenes:,} scenes: {attacked.near:,} reached the last goal of violates, "
    line += f"{attacked.close:,} came within 0.001 of breaking it"
    if attacked.undecided:
        line += f", {attacked.undecided:,} undecided, of which {attacked.asked:,} put to the interpreter"
    return line + (f", {attacked.broken:,} broke it in floats" if attacked.broken else "")


def _extent(result: Result) -> str:
    if result.for_any_number:
        return "any number of vehicles"
    if result.counterexample is not None:
        count = len(result.counterexample.scene.vehicles)
        return f"{count} vehicle{'s' * (count != 1)}"
    return f"up to {result.vehicles} vehicles"


def _scene_lines(result: Result, out: Path | None) -> Iterator[str]:
    """Yield a counterexample in a few words, and the file it is in."""
    found = result.counterexample
    assert found is not None
    if found.error is not None:
        yield f"the rules raise an error: {found.error}"
    scene = found.scene
    yield f"ego in lane {scene.ego.lane}, steering for {scene.target_lane}, at {scene.ego.vx:.4g} m/s"
    for car in scene.vehicles:
        mark = ", in focus" if car.id == found.focus else ""
        ahead, aside = car.x - scene.ego.x, car.y - scene.ego.y
        place = f"{ahead:+.4g} m along x, {aside:+.4g} m along y"
        yield f"{printable(car.id)} in lane {car.lane} at {place}, {car.vx:.4g} m/s{mark}"
    yield from (f"{name} = {value:.6g}" for name, value in found.unknowns.items())
    yield f"scene: {out / f'{result.name}.json'}" if out is not None else "--out DIR writes the scene"


def _write_scenes(request: Request, report: Report, out: Path) -> None:
    """Write a scene file and a picture for every counterexample."""
    from drlsl.verify import write_counterexample

    refuted = [result for result in report.results if result.counterexample is not None]
    out.mkdir(parents=True)
    for result in refuted:
        write_counterexample(request, result, out)
