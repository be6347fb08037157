"""`drlsl bench`: measure the speed of each part beside its competitors, all in one run."""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from drlsl.cli.options import AsJson, given_settings, several

app = typer.Typer(help="Measure speeds, medians of several runs.", no_args_is_help=True)

Runs = Annotated[int, typer.Option(min=1, help="Runs of each measurement; the median counts.")]


@app.command()
def engine(
    runs: Runs = 5,
    programs: Annotated[
        Path | None,
        typer.Option(help="Measure the programs of this folder instead, each with a goal top or main."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the logic engine in inferences per second and on ten programs, beside swipl if installed."""
    from drlsl.errors import UserError

    if programs is not None:
        _compare_programs(programs, runs, as_json=as_json)
        return
    from drlsl.benchmarks import inferences_per_second, program_times

    try:
        speeds, times = inferences_per_second(runs), program_times(runs)
    except FileNotFoundError as error:
        raise UserError(
            f"{error.filename} is missing: the benchmark programs are in a checkout only"
        ) from error
    if as_json:
        by_program = {
            timing.program: {"compiled_s": timing.compiled, "plain_s": timing.plain, "swipl_s": timing.swipl}
            for timing in times
        }
        print(json.dumps({**speeds, "programs": by_program}, indent=2))
        return
    for name, speed in speeds.items():
        print(f"{name:<22} {speed / 1e6:8.3f} million a second")
    print(f"\n{'program':<10} {'compiled':>12} {'plain':>12} {'swipl':>12}")
    for timing in times:
        cells = (timing.compiled, timing.plain, timing.swipl)
        print(f"{timing.program:<10} " + " ".join(f"{_milliseconds(cell):>12}" for cell in cells))


def _compare_programs(folder: Path, runs: int, *, as_json: bool) -> None:
    """Print how much longer each program of a folder takes than in SWI-Prolog."""
    from drlsl.benchmarks import Times, compare_folder, geometric_mean
    from drlsl.errors import UserError

    ratios: dict[str, list[float]] = {"first": [], "repeated": []}
    report: dict[str, Any] = {}
    if not as_json:
        heads = ("first call", "swipl", "ratio", "repeated", "swipl", "ratio")
        print(f"{'program':<16}" + "".join(f"{head:>12}" for head in heads))
    try:
        for each in compare_folder(folder, runs):
            here, swipl = each.here, each.swipl
            if here is None or swipl is None:
                report[each.program] = {"problem": each.problem}
                if not as_json:
                    print(f"{each.program:<16}  not rated: {each.problem}")
                continue
            pairs = {"first": (here.first, swipl.first), "repeated": (here.repeated, swipl.repeated)}
            line = f"{each.program:<16}"
            for kind, (ours, theirs) in pairs.items():
                ratio = ours / max(theirs, Times.SHORTEST)
                ratios[kind].append(ratio)
                report.setdefault(each.program, {})[kind] = {"s": ours, "swipl_s": theirs, "ratio": ratio}
                line += f"{ours * 1e3:>9.3f} ms{theirs * 1e3:>9.4f} ms{ratio:>12.1f}"
            if not as_json:
                print(line)
    except FileNotFoundError as error:
        raise UserError(f"{error} is missing: programs are compared with SWI-Prolog's") from error
    if not ratios["first"]:
        raise UserError(f"no program of {folder} could be rated")
    means = {kind: geometric_mean(values) for kind, values in ratios.items()}
    if as_json:
        print(json.dumps({"programs": report, "geometric_mean": means}, indent=2))
    else:
        print(f"geometric mean of {len(ratios['first'])}: first call {means['first']:.1f} times", end="")
        print(f" as long as swipl, repeated {means['repeated']:.1f}")


@app.command()
def env(runs: Runs = 5, as_json: AsJson = False) -> None:
    """Measure environment steps a second, alone and side by side, beside highway-env if installed."""
    from drlsl.benchmarks import VEHICLES, env_speeds

    def lines(speeds: Any) -> Iterator[str]:
        yield f"environment steps a second, {VEHICLES} vehicles, rules on the {speeds['tier']} tier"
        for size, speed in speeds["steps_per_s"].items():
            yield f"  {size:>4} side by side {speed:>12,.0f}"
        if "highway_env" in speeds:
            yield f"  highway-env, 1    {speeds['highway_env']:>12,.0f}"

    _print_speeds(env_speeds(runs), lines, as_json=as_json)


def _print_speeds(speeds: Any, lines: Callable[[Any], Iterator[str]], *, as_json: bool) -> None:
    """Print speeds as JSON, or as the lines that say them."""
    print(json.dumps(speeds, indent=2) if as_json else "\n".join(lines(speeds)))


@app.command()
def rules(runs: Runs = 5, as_json: AsJson = False) -> None:
    """Measure the rules in every tier, for one scene and for a batch, beside swipl if installed."""
    from drlsl.benchmarks import rule_speeds

    def lines(speeds: Any) -> Iterator[str]:
        yield "one scene: its facts replaced and four queries asked [ms]"
        for tier, by_vehicles in speeds["one_scene_ms"].items():
            cells = "   ".join(f"{number} vehicles {value:7.3f}" for number, value in by_vehicles.items())
            yield f"  {tier:<14} {cells}"
        yield "256 scenes with 40 vehicles: each scene [us]"
        for tier, value in speeds["batch_us_per_scene"].items():
            yield f"  {tier:<14} {value:8.2f}"

    _print_speeds(rule_speeds(runs), lines, as_json=as_json)


@app.command()
def train(
    runs: Runs = 5,
    num_envs: Annotated[int, typer.Option(min=1, help="Environments driven in step.")] = 16,
    settings: Annotated[
        list[str] | None,
        several("--set", "KEY=VALUE", "A setting of the training; may be repeated."),
    ] = None,
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Train so many seeds together, too, as train --seeds does.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure training in updates a second, beside its bare updates and Stable-Baselines3 if installed.

    There is one update per step. Training is measured as a whole: environments, rules, acting and replay
    memory, once that is full and at first. The bare update has its minibatch ready; it is also measured
    with the same network as a plain PyTorch module. Settings are those of preset paper.
    """
    from drlsl.benchmarks import training_speeds

    given = given_settings(settings or [], {}, "learning.precision=bfloat16")
    speeds = training_speeds(runs, num_envs, given, seeds)
    if as_json:
        print(json.dumps(speeds, indent=2))
        return
    print(f"updates a second, batch {speeds['batch_size']}, one CPU thread, {num_envs} environments in step")
    print(f"  bare updates           {speeds['bare_updates_per_s']:8.1f}")
    print(f"  as a plain module      {speeds['module_updates_per_s']:8.1f}", end="")
    print(f"   takes {speeds['module_ratio']:.2f} times as long")
    print(f"  training, dqnsl        {speeds['updates_per_s']:8.1f}   {speeds['ratio']:.3f} of bare")
    print(f"  training, at first     {speeds['updates_per_s_at_first']:8.1f}")
    if "stacked_updates_per_s" in speeds:
        together, ratio = speeds["stacked_updates_per_s"], speeds["stacked_ratio"]
        print(f"  {f'{seeds} seeds together':<21}  {together:8.1f}   {ratio:.3f} of one after another")
    if "stable_baselines3_updates_per_s" in speeds:
        other, ratio = speeds["stable_baselines3_updates_per_s"], speeds["stable_baselines3_ratio"]
        print(f"  Stable-Baselines3 DQN  {other:8.1f}   training is {ratio:.2f} times as fast")


@app.command()
def compare(
    old: Annotated[
        Path, typer.Argument(metavar="OLD", help="A wheel, or a checkout in which `make check` was run.")
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="The one that is compared with it.")],
    pairs: Annotated[int, typer.Option(min=1, help="Runs of each measurement of each version.")] = 9,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PART",
            help="rules, env, train, query, start, compile or proofs; give it again for more. Default: all.",
        ),
    ] = None,
    new_settings: Annotated[
        list[str] | None,
        several("--new-set", "KEY=VALUE", "A setting of NEW's training alone; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure two versions in turn: the speed of NEW relative to OLD, with the interval of the median.

    Both times are medians; the swing is the longest time of a version over its shortest, so a ratio within it
    may be chance. Wheels are installed in environments of their own, which share the other packages. What
    only one version reports is left out. All parts with nine pairs take about 40 minutes.
    """
    from drlsl.benchmarks import MEASUREMENTS
    from drlsl.benchmarks import compare as compared
    from drlsl.errors import UserError

    parts = only or list(MEASUREMENTS)
    for part in parts:
        if part not in MEASUREMENTS:
            raise UserError(f"--only {part}: expected one of {', '.join(MEASUREMENTS)}")
    report = {}
    for found in compared(old, new, parts, pairs, new_settings or ()):
        low, high = found.interval
        before, after = statistics.median(found.old), statistics.median(found.new)
        report[found.name] = {
            "median": found.median,
            "interval": [low, high],
            "ratios": list(found.ratios),
            "old_s": before,
            "new_s": after,
            "swing": found.swing,
        }
        if as_json:
            continue
        if len(report) == 1:
            print(f"{'':<36} {'old':>10} {'new':>10} {'faster':>8}   {'interval':<16} swing")
        print(
            f"{found.name:<36} {_seconds(before):>10} {_seconds(after):>10} {found.median:>8.3f}   "
            f"{f'{low:.3f} to {high:.3f}':<16} {found.swing:.2f}",
            flush=True,
        )
    if as_json:
        print(json.dumps(report, indent=2))


def _seconds(time: float) -> str:
    """Return a time with a fitting unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e3)):
        if time * factor >= 1.0:
            return f"{time * factor:.3g} {unit}"
    return f"{time * 1e6:.3g} us"


def _milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f} ms"
