"""`drlsl bench`: how fast the parts are, each beside what it competes with, measured in one run."""

from __future__ import annotations

import json
from typing import Annotated

import typer

app = typer.Typer(help="Measure speeds, medians of several runs.", no_args_is_help=True)

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Runs = Annotated[int, typer.Option(min=1, help="Runs of each measurement; the median counts.")]


@app.command()
def engine(runs: Runs = 5, as_json: AsJson = False) -> None:
    """Measure the logic engine in inferences per second and ten programs, beside swipl where it is there."""
    from drlsl.errors import UserError
    from drlsl.logic.bench import inferences_per_second, program_times

    try:
        speeds, times = inferences_per_second(runs), program_times(runs)
    except FileNotFoundError as error:
        raise UserError(
            f"{error.filename} is missing: the benchmark programs are in a checkout only"
        ) from error
    if as_json:
        programs = {
            timing.program: {"compiled_s": timing.compiled, "plain_s": timing.plain, "swipl_s": timing.swipl}
            for timing in times
        }
        print(json.dumps({**speeds, "programs": programs}, indent=2))
        return
    for name, speed in speeds.items():
        print(f"{name:<22} {speed / 1e6:8.3f} million a second")
    print(f"\n{'program':<10} {'compiled':>12} {'plain':>12} {'swipl':>12}")
    for timing in times:
        cells = (timing.compiled, timing.plain, timing.swipl)
        print(f"{timing.program:<10} " + " ".join(f"{_milliseconds(cell):>12}" for cell in cells))


def _milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f} ms"
