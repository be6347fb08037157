"""`drlsl render`: a scene as a picture, a drive as a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import typer

from drlsl.cli.drivers import loaded_driver
from drlsl.cli.failures import failures_as_errors
from drlsl.cli.options import DriveSettings, EpisodeSeed, Rules, config_and_arguments
from drlsl.errors import UserError

if TYPE_CHECKING:
    from drlsl.driving import EnvConfig
    from drlsl.driving.episodes import Episode
    from drlsl.driving.rendering import Film, Moment, RoadView

GIF_RATE: Final = 12.5
"""Pictures a second of a .gif, at most: it is large."""

LAST: Final = 1.0
"""Time for which the last moment of an episode stands still [s]."""

What = Annotated[
    str,
    typer.Argument(
        metavar="RUN|RECORDING|EPISODE|SCENE",
        help="Run folder that `drlsl train` made; or a bundled recording's name, a highD folder or an "
        "NGSIM file; or an episode (.npz, .parquet) that drlsl eval or stress wrote; or a scene file "
        "(.json), as for drlsl query.",
    ),
]
Out = Annotated[Path, typer.Option(metavar="FILE", help="Write to this file: .png, .gif or .mp4.")]
Who = Annotated[str, typer.Option(help="Who drives in a recording: any driver of drlsl eval.")]
ShieldState = Annotated[Literal["on", "off"], typer.Option(help="Offer only safe actions, or all of them.")]
Which = Annotated[
    int, typer.Option(min=1, help="Which of the episodes that drlsl eval drives with this seed.")
]


def render(
    what: What,
    out: Out,
    driver: Who = "mobil",
    shield: ShieldState = "on",
    episode: Which = 1,
    seed: EpisodeSeed = None,
    begin: Annotated[float, typer.Option(min=0, help="Seconds of the episode to leave out.")] = 0.0,
    seconds: Annotated[float, typer.Option(min=0.1, help="Seconds to show, at most.")] = 30.0,
    rules: Rules = None,
    settings: DriveSettings = None,
    width: Annotated[int, typer.Option(min=320, max=3840, help="Width of the picture.")] = 1200,
    height: Annotated[int, typer.Option(min=240, max=2160, help="Height of the picture.")] = 400,
) -> None:
    """Draw a scene, or film a drive: the road, what the ego is offered, and what speaks against the rest.

    A .png of a run or a recording shows the moment at --begin. Needs pip install 'drlsl[render]'.
    """
    from drlsl.driving.episodes import is_episode, load_episode
    from drlsl.driving.rendering import Film, RoadView, check_film_path

    check_film_path(out)
    view = RoadView((width, height))
    if what.endswith(".json"):
        with Film(out, 1.0) as film:
            film.add(view.draw(_of_scene(Path(what), rules)))
        typer.echo(f"wrote {out}")
        return
    drive: _Drive | _Replay
    if is_episode(Path(what)):
        drive = _Replay(load_episode(Path(what)))
    else:
        config, who, arguments, own_seed = _drive(what, driver, settings, rules, shield)
        drive = _Drive(config, who, arguments, own_seed if seed is None else seed, episode - 1)
    shown = _write_film(out, view, drive, begin, seconds)
    typer.echo(f"wrote {out}{shown}")


def _of_scene(path: Path, rules: list[Path] | None) -> Moment:
    """Return the moment of a scene file."""
    from drlsl.driving.rendering import moment_of_scene
    from drlsl.driving.scene import load_scene
    from drlsl.driving.shield import Shield

    scene = load_scene(path)
    with failures_as_errors():
        return moment_of_scene(Shield.from_files(rules or ()), scene)


def _drive(
    what: str, driver: str, settings: list[str] | None, rules: list[Path] | None, shield: str
) -> tuple[EnvConfig, str, dict[str, Any], int]:
    """Return the environment to drive in, who drives, with which parameters, and the seed.

    Raises:
        UserError: a setting is of neither, or wrong.
    """
    from drlsl.learning import RunFolder

    is_run = (Path(what) / "config.yaml").is_file()
    flags = {
        "env.recording": None if is_run else what,
        "env.rules": [str(path) for path in rules] if rules else None,
        "env.offers": "all" if shield == "off" else None,
    }
    run = RunFolder.open(Path(what)) if is_run else None
    config, arguments = config_and_arguments(run, settings, flags)
    return config.env, what if is_run else driver, arguments, config.seed


class _Drive:
    """One episode of a driver, frame by frame."""

    def __init__(
        self, config: EnvConfig, who: str, arguments: dict[str, Any], seed: int, episode: int
    ) -> None:
        from gymnasium.utils import seeding

        from drlsl.driving.drivers import DrivenBy
        from drlsl.driving.shield import Shield
        from drlsl.driving.simulation import World, frames_per_decision, load_playbacks
        from drlsl.learning import evaluation_seed

        shield = Shield.from_files(config.rules, tier=config.tier, seconds=config.rule_seconds)
        self.world = World(config, load_playbacks([config]), shield)
        self._frames = frames_per_decision(config.decision_period, self.world.playbacks)
        self._driven = DrivenBy(loaded_driver(who, arguments, shield))
        self.world.reset([0], [seeding.np_random(evaluation_seed(seed, episode))[0]])
        self.time = 0.0
        """Time of the episode [s]."""

    @property
    def time_step(self) -> float:
        """The duration of a frame [s]."""
        return self.world.playback_of(0).road.time_step

    def frames(self) -> Iterator[Callable[[], Moment]]:
        """Drive to the end of the episode; yield a function that returns the moment of each frame."""
        from drlsl.driving.rendering import alarm_of, moment_of_world
        from drlsl.driving.simulation import drive_decision

        yield partial(moment_of_world, self.world)
        ended = False
        while not ended:
            actions = self._driven.actions(self.world)
            for frame in range(self._frames):
                result = drive_decision(self.world, actions if frame == 0 else [0], frames=1)
                self.time += self.time_step
                yield partial(moment_of_world, self.world, alarm=alarm_of(result, 0))
                ended = bool(result.terminated[0] or result.truncated[0])
                if ended:
                    break


class _Replay:
    """A recorded episode, frame by frame."""

    def __init__(self, episode: Episode) -> None:
        self._episode = episode
        self.time = 0.0
        """Time of the episode [s]."""

    @property
    def time_step(self) -> float:
        """The duration of a frame [s]."""
        return self._episode.road.time_step

    def frames(self) -> Iterator[Callable[[], Moment]]:
        """Yield a function that returns the moment of each frame."""
        for frame in range(len(self._episode)):
            self.time = frame * self.time_step
            yield partial(self._episode.moment, frame)


def _write_film(out: Path, view: RoadView, drive: _Drive | _Replay, begin: float, seconds: float) -> str:
    """Write the part of a drive from `begin` on [s]; return in words how much it is, if it is a film.

    Raises:
        UserError: the drive is over by then, or the film cannot be written.
    """
    from drlsl.driving.rendering import Film

    time_step = drive.time_step
    frames = max(1, round(1 / GIF_RATE / time_step)) if out.suffix.lower() == ".gif" else 1
    with Film(out, 1 / (time_step * frames)) as film:
        _film(film, view, drive, frames, begin, begin + seconds)
    if not film.pictures:
        raise UserError(
            f"--begin {begin:g}: the episode is over after {drive.time:.1f} s; nothing was written"
        )
    return "" if film.full else f": {film.pictures} pictures, {film.pictures * time_step * frames:.1f} s"


def _film(film: Film, view: RoadView, drive: _Drive | _Replay, frames: int, begin: float, end: float) -> None:
    """Add every `frames`-th frame of a drive from `begin` to `end` [s], and the last one for a while."""
    picture = moment = None
    for number, moment in enumerate(drive.frames()):
        if film.full or drive.time > end:
            return
        if drive.time >= begin and number % frames == 0:
            picture = view.draw(moment())
            film.add(picture)
            moment = None
    if picture is not None and moment is not None:
        picture = view.draw(moment())
        film.add(picture)
    if picture is not None:
        for _ in range(round(LAST / (drive.time_step * frames))):
            film.add(picture)
