"""`drlsl train`: train an agent, show its progress, and leave a run folder behind."""

from __future__ import annotations

import contextlib
import shlex
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from drlsl.cli.options import Direction, Rules, given_settings, one_or_several, presets, recordings
from drlsl.cli.stopping import Stop, stop_on_signal
from drlsl.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from drlsl.learning import Session, StepEvent, TrainConfig

RUNS = Path("runs")
"""Where a run without --out is put."""

SMOOTHED = 20
"""Episodes of the moving average of the return that is shown."""

PLAIN_LINES = 20
"""About how many progress lines are printed where there is no terminal."""


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
NumEnvs = Annotated[int | None, typer.Option(help="Environments driven in step; several are faster.")]
Device = Annotated[Literal["auto", "cpu", "cuda"] | None, typer.Option(help="Where the network lives.")]
CheckpointEvery = Annotated[int | None, typer.Option(help="Episodes from one checkpoint to the next.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Any other setting of --print-config; may be repeated."),
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
    num_envs: NumEnvs = None,
    device: Device = None,
    threads: Annotated[int | None, typer.Option(help="PyTorch's CPU threads.")] = None,
    checkpoint_every: CheckpointEvery = None,
    settings: Settings = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default: a new one in runs/.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume the run in --out.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the run in --out.")] = False,
    tensorboard: Annotated[
        bool,
        typer.Option("--tensorboard", help="Write event files for TensorBoard into the run folder, too."),
    ] = False,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the settings that would be used, and stop.")
    ] = False,
) -> None:
    """Train an agent in recorded traffic.

    Settings come from the preset, then --config, then --set, then the other flags; later ones take
    precedence. Ctrl-C ends the run with a checkpoint; --resume continues it with the same result as an
    unbroken run.
    """
    flags = {
        "env.recording": one_or_several(recording),
        "env.direction": direction,
        "env.rules": [str(path) for path in rules] if rules else None,
        "env.track_length": track_length,
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
    if resume:
        others = bool(force or config or preset or print_config)
        session = _resume(out, given, others=others, tensorboard=tensorboard)
    else:
        chosen = _effective_config(preset, config, given)
        if print_config:
            from drlsl.learning import dump_yaml

            typer.echo(dump_yaml(chosen), nl=False)
            return
        session = _start(out, chosen, force=force, tensorboard=tensorboard)
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


def _start(out: Path | None, config: TrainConfig, *, force: bool, tensorboard: bool) -> Session:
    from drlsl.learning import Session, next_free_folder

    root = out or next_free_folder(RUNS, f"{config.method}-seed{config.seed}")
    return Session.start(root, config, force=force, tensorboard=tensorboard)


def _resume(out: Path | None, given: Mapping[str, Any], *, others: bool, tensorboard: bool) -> Session:
    from drlsl.learning import RunFolder, Session, make_config, merged

    if out is None:
        raise UserError("--resume: name the run to resume with --out")
    if others:
        raise UserError("--resume takes its settings from the run: leave out --force, --config and the like")
    stored = RunFolder.open(out).config
    if make_config(merged(stored.model_dump(), given), "command line") != stored:
        raise UserError(f"--resume: a setting given here differs from {out}/config.yaml; leave it out")
    return Session.resume(out, tensorboard=tensorboard)


def _train(session: Session) -> None:
    from rich.console import Console

    console = Console()
    root, config = session.folder.root, session.folder.config
    verb = "resume" if session.trainer.total_steps else "start"
    precision = session.trainer.agent.precision
    how = "" if config.learning.precision == "float32" else f", learns in {precision}"
    typer.echo(f"{verb} {root}: {config.method}, {', '.join(config.env.recordings)}, seed {config.seed}{how}")
    shown = shlex.quote(str(root))
    with stop_on_signal(console.print) as stop:
        finished = _run(session, console, stop)
    if not finished:
        typer.echo(f"saved at step {session.saved_steps}; resume with: drlsl train --out {shown} --resume")
        raise typer.Exit(stop.status)
    figures = session.draw_figures()
    typer.echo(f"{len(figures)} figures in {session.folder.figures}")
    if session.folder.tensorboard.is_dir():
        typer.echo(f"scalars: tensorboard --logdir {shlex.quote(str(session.folder.tensorboard))}")
    _evaluate_briefly(session, console)
    typer.echo("next:")
    typer.echo(f"  drlsl eval {shown}")
    rules = "".join(f" --rules {shlex.quote(file)}" for file in config.env.rules)
    typer.echo(f"  drlsl query --state examples/scene.json{rules}")


def _run(session: Session, console: Console, stop: Stop) -> bool:
    """Train with a display of the progress; return whether the last episode was reached."""
    display = _LiveDisplay(session, console) if console.is_terminal else _PlainDisplay(session)
    with display:
        try:
            for event in session.run(stop.requested):
                display.step(event)
        except KeyboardInterrupt:
            return False
    return session.trainer.finished == session.folder.config.episodes


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


class _Totals:
    """Running figures of the steps and episodes that this process has seen."""

    def __init__(self, session: Session) -> None:
        self._returns: deque[float] = deque(maxlen=SMOOTHED)
        self._at_fault = self._not_at_fault = self._off_road = 0
        self._started = perf_counter()
        self._steps = self._steps_before = session.trainer.total_steps

    def add(self, event: StepEvent) -> None:
        self._steps = event.total_steps
        for episode in event.ended:
            summary = episode.summary
            self._returns.append(summary.total_return)
            self._at_fault += summary.contact and summary.at_fault
            self._not_at_fault += summary.contact and not summary.at_fault
            self._off_road += summary.off_road

    def text(self) -> str:
        rate = (self._steps - self._steps_before) / max(perf_counter() - self._started, 1e-9)
        mean = sum(self._returns) / len(self._returns)
        contacts = f"{self._at_fault} at fault, {self._not_at_fault} not"
        return f"{rate:.0f} steps/s  return {mean:.1f}  contacts {contacts}  off-road {self._off_road}"


class _PlainDisplay(contextlib.AbstractContextManager["_PlainDisplay"]):
    """Progress as a few plain lines."""

    def __init__(self, session: Session) -> None:
        self._last = session.folder.config.episodes
        self._every = max(1, self._last // PLAIN_LINES)
        self._totals = _Totals(session)

    def __exit__(self, *exception: object) -> None:
        return None

    def step(self, event: StepEvent) -> None:
        self._totals.add(event)
        for episode in event.ended:
            if episode.finished % self._every == 0 or episode.finished == self._last:
                typer.echo(f"episode {episode.finished}/{self._last}  {self._totals.text()}")


class _LiveDisplay(contextlib.AbstractContextManager["_LiveDisplay"]):
    """Progress as a bar and a line below it that stay in place."""

    def __init__(self, session: Session, console: Console) -> None:
        from rich.console import Group
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
        from rich.text import Text

        self._progress = Progress(
            TextColumn("episode"),
            MofNCompleteColumn(),
            BarColumn(),
            TimeRemainingColumn(),
            TextColumn("left"),
        )
        self._task = self._progress.add_task(
            "", total=session.folder.config.episodes, completed=session.trainer.finished
        )
        self._totals = _Totals(session)
        self._line = Text()
        self._live = Live(Group(self._progress, self._line), console=console)

    def __enter__(self) -> _LiveDisplay:
        self._live.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._live.stop()

    def step(self, event: StepEvent) -> None:
        self._totals.add(event)
        if event.ended:
            self._line.plain = self._totals.text()
            self._progress.update(self._task, completed=event.ended[-1].finished)
