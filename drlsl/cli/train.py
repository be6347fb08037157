"""`drlsl train`: train an agent, show its progress, and leave a run folder behind."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from drlsl.cli.options import Direction, Rules, env_flags, given_settings, presets, recordings, several
from drlsl.cli.stopping import Stop, stop_on_signal
from drlsl.cli.training_display import display
from drlsl.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from drlsl.learning import Session, StackedSession, TrainConfig

RUNS = Path("runs")
"""Where a run without --out is put."""


Config = Annotated[
    Path | None, typer.Option(help="YAML file with settings; settings not in it keep their defaults.")
]
Preset = Annotated[
    str | None,
    typer.Option(
        help="Settings that ship with DRLSL: quick (default), paper or tiny.", autocompletion=presets
    ),
]
Recordings = Annotated[
    list[str] | None,
    typer.Option(
        help="Recording to drive in: a bundled one's name, a file, a folder or a data set with several. May "
        "be repeated; every episode draws one.",
        autocompletion=recordings,
    ),
]
Carriageway = Annotated[Direction | None, typer.Option(help="Carriageway to drive on.")]
Method = Annotated[
    Literal["dqn", "mpsdqn", "dqnsl"] | None,
    typer.Option(help="dqn: all actions; dqnsl: those the rules find safe; mpsdqn: a linear prediction."),
]
Network = Annotated[
    str | None,
    typer.Option(help="mlp, dueling, or a function of yours: FILE.py:FUNCTION or PACKAGE.MODULE:FUNCTION."),
]
Bootstrap = Annotated[
    Literal["all", "safe"] | None, typer.Option(help="Actions that the target's maximum runs over.")
]
Seeds = Annotated[
    int | None,
    typer.Option(
        min=1, help="Train so many seeds side by side, from --seed on, each in a folder seedN of --out."
    ),
]
NumEnvs = Annotated[int | None, typer.Option(help="Environments driven in step; several are faster.")]
Device = Annotated[Literal["auto", "cpu", "cuda"] | None, typer.Option(help="Where the network lives.")]
CheckpointEvery = Annotated[int | None, typer.Option(help="Episodes from one checkpoint to the next.")]
Settings = Annotated[
    list[str] | None,
    several("--set", "KEY=VALUE", "Any other setting of --print-config; may be repeated."),
]
TensorBoard = Annotated[
    bool, typer.Option("--tensorboard", help="Write event files for TensorBoard into the run folder, too.")
]
PrintConfig = Annotated[
    bool, typer.Option("--print-config", help="Print the settings that would be used, and stop.")
]


def train(
    config: Config = None,
    preset: Preset = None,
    recording: Recordings = None,
    direction: Carriageway = None,
    rules: Rules = None,
    track_length: Annotated[float | None, typer.Option(help="Metres of an episode.")] = None,
    method: Method = None,
    network: Network = None,
    bootstrap: Bootstrap = None,
    episodes: Annotated[int | None, typer.Option(help="Episodes of training.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of all that is random.")] = None,
    seeds: Seeds = None,
    num_envs: NumEnvs = None,
    device: Device = None,
    threads: Annotated[int | None, typer.Option(help="PyTorch's CPU threads.")] = None,
    checkpoint_every: CheckpointEvery = None,
    settings: Settings = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default: a new one in runs/.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume the run in --out.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the run in --out.")] = False,
    tensorboard: TensorBoard = False,
    print_config: PrintConfig = False,
) -> None:
    """Train an agent in recorded traffic.

    Settings come from the preset, then --config, then --set, then the other flags; later ones take
    precedence. Ctrl-C ends the run with a checkpoint; --resume continues it with the same result as an
    unbroken run.
    """
    flags = {
        **env_flags(recording, direction, rules, track_length),
        "method": method,
        "network.factory": network,
        "learning.bootstrap": bootstrap,
        "episodes": episodes,
        "seed": seed,
        "num_envs": num_envs,
        "device": device,
        "threads": threads,
        "checkpoint_every": checkpoint_every,
    }
    given = given_settings(settings or [], flags, "learning.discount=0.9")
    session: Session | StackedSession
    if resume:
        others = bool(force or config or preset or print_config)
        session = _resume(out, given, seeds, others=others, tensorboard=tensorboard)
    else:
        chosen = _effective_config(preset, config, given)
        if print_config:
            from drlsl.learning import dump_yaml

            typer.echo(dump_yaml(chosen), nl=False)
            return
        session = _start(out, chosen, seeds, force=force, tensorboard=tensorboard)
    with session:
        _train(session)


def _effective_config(preset: str | None, file: Path | None, given: Mapping[str, Any]) -> TrainConfig:
    from drlsl.files import read_yaml
    from drlsl.learning import EXAMPLE, make_config, merged, preset_values

    name = preset or (None if file else "quick")
    values = preset_values(name) if name else {}
    if file:
        read = read_yaml(file, "the configuration", EXAMPLE)
        values = merged(values, read.values)
        make_config(values, read.name, read)
    return make_config(merged(values, given), "command line")


def _start(
    out: Path | None, config: TrainConfig, seeds: int | None, *, force: bool, tensorboard: bool
) -> Session | StackedSession:
    from drlsl.learning import Session, StackedSession, next_free_folder

    if seeds is not None:
        root = out or next_free_folder(RUNS, f"{config.method}-seeds")
        return StackedSession.start(root, config, seeds, force=force, tensorboard=tensorboard)
    root = out or next_free_folder(RUNS, f"{config.method}-seed{config.seed}")
    return Session.start(root, config, force=force, tensorboard=tensorboard)


def _resume(
    out: Path | None, given: Mapping[str, Any], seeds: int | None, *, others: bool, tensorboard: bool
) -> Session | StackedSession:
    from drlsl.learning import RunFolder, Session, StackedSession, make_config, merged

    if out is None:
        raise UserError("--resume: name the run to resume with --out")
    if others:
        raise UserError("--resume takes its settings from the run: leave out --force, --config and the like")
    folders = StackedSession.folders(out)
    if seeds is not None and seeds != len(folders):
        raise UserError(f"--resume: {out} was begun with {len(folders) or 'no'} --seeds; leave it out")
    first = folders[0] if folders else out
    stored = RunFolder.open(first).config
    if make_config(merged(stored.model_dump(), given), "command line") != stored:
        raise UserError(f"--resume: a setting given here differs from {first}/config.yaml; leave it out")
    if folders:
        return StackedSession.resume(out, tensorboard=tensorboard)
    return Session.resume(out, tensorboard=tensorboard)


def _train(session: Session | StackedSession) -> None:
    from rich.console import Console

    console = Console()
    root, config = session.root, session.config
    verb = "resume" if session.total_steps else "start"
    precision = session.runs[0].trainer.agent.precision
    how = "" if config.learning.precision == "float32" else f", learns in {precision}"
    seeds = ", ".join(str(run.config.seed) for run in session.runs)
    which = f"seed{'s'[: len(session.runs) > 1]} {seeds}"
    typer.echo(f"{verb} {root}: {config.method}, {', '.join(config.env.recordings)}, {which}{how}")
    with stop_on_signal(console.print) as stop:
        finished = _run(session, console, stop)
    if not finished:
        shown = shlex.quote(str(root))
        typer.echo(f"saved at step {session.saved_steps}; resume with: drlsl train --out {shown} --resume")
        raise typer.Exit(stop.status)
    for run in session.runs:
        _finish(run, console)
    typer.echo("next:")
    for run in session.runs:
        typer.echo(f"  drlsl eval {shlex.quote(str(run.root))}")
    rules = "".join(f" --rules {shlex.quote(file)}" for file in config.env.rules)
    typer.echo(f"  drlsl query --state examples/scene.json{rules}")


def _run(session: Session | StackedSession, console: Console, stop: Stop) -> bool:
    """Train with a display of the progress; return whether the last episode was reached."""
    with display(session, console) as shown:
        try:
            for event in session.run(stop.requested):
                shown.step(event)
        except KeyboardInterrupt:
            return False
    return session.finished == session.episodes


def _finish(run: Session, console: Console) -> None:
    """Draw the figures of a run that is done, and evaluate it."""
    figures = run.draw_figures()
    typer.echo(f"{len(figures)} figures in {run.folder.figures}")
    if run.folder.tensorboard.is_dir():
        typer.echo(f"scalars: tensorboard --logdir {shlex.quote(str(run.folder.tensorboard))}")
    _evaluate_briefly(run, console)


def _evaluate_briefly(session: Session, console: Console) -> None:
    from drlsl.cli.evaluate import POLICY, Trial, evaluation_table, judge
    from drlsl.learning import EVALUATION_KEY, load_driver, load_policy, make_evaluation_env

    config, folder = session.folder.config, session.folder
    count = config.evaluation.episodes_after_training
    if not count:
        return
    where = config.env.model_copy(update={"recording": config.evaluation.recording or config.env.recording})
    env = make_evaluation_env(where)
    policy = load_policy(folder, env)
    beside = [Trial(name, load_driver(name, env), "on") for name in config.evaluation.beside]
    records = judge(
        [*beside, Trial(POLICY, policy, "on"), Trial(POLICY, policy, "off")],
        env,
        episodes=count,
        seed=config.seed,
        env_config=where.model_dump(mode="json"),
        console=console,
    )
    folder.save_evaluations([one for one in records if one["driver"] == POLICY], EVALUATION_KEY)
    console.print(evaluation_table(records))
    typer.echo(_in_a_sentence(records[-2], records[-1]))


def _in_a_sentence(shielded: Mapping[str, Any], free: Mapping[str, Any]) -> str:
    """Return what the evaluation of a policy, with the shield and without, comes down to."""
    on, off, count = shielded["totals"], free["totals"], shielded["episodes"]
    saved, quick = on["time_saved"], ""
    if saved is not None:
        quick = f" takes {abs(saved):.1%} {'less' if saved >= 0 else 'more'} time than keeping the lane and"
    return (
        f"behind the shield the learnt driver{quick} is at fault in {on['contacts_at_fault']} and off the "
        f"road in {on['off_road']} of {count} episodes; without it in {off['contacts_at_fault']} and "
        f"{off['off_road']}"
    )
