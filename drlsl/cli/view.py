"""`drlsl view`: episodes and scenes in one HTML page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from drlsl.cli.failures import failures_as_errors
from drlsl.cli.options import Rules
from drlsl.errors import UserError

if TYPE_CHECKING:
    from drlsl.driving.episodes import Episode

EPISODES: Final = "episodes"
"""The folder of a run that its episodes are looked for in."""

What = Annotated[
    list[str],
    typer.Argument(
        metavar="RUN|EPISODE|SCENE...",
        help="Run folder with a folder episodes in it; a folder or a file (.npz, .parquet) of episodes, as "
        "drlsl eval --episodes-out and drlsl stress --out write them; or a scene file (.json). "
        "Several share a page.",
    ),
]


def view(
    what: What,
    out: Annotated[Path, typer.Option(metavar="FILE.html", help="Write the page to this file.")],
    rules: Rules = None,
    every: Annotated[int, typer.Option(min=1, help="Show only every so many frames: for long drives.")] = 1,
    title: Annotated[str | None, typer.Option(help="Title of the page.")] = None,
) -> None:
    """Write a page in which episodes play, with the reason for every action that is not offered.

    It is one HTML file, which needs neither a server nor a network.
    """
    from drlsl.driving.page import write_page
    from drlsl.driving.shield import Shield
    from drlsl.traffic import counted

    if out.suffix.lower() not in (".html", ".htm"):
        raise UserError(f"{out}: expected a file that ends in .html")
    if not out.parent.is_dir():
        raise UserError(f"{out}: there is no folder {out.parent}")
    if rules:
        Shield.from_files(rules)  # who names rules wants those, not a page that plays without
    episodes = [episode for name in what for episode in _episodes(Path(name), rules)]
    write_page(out, episodes, title=title or _title(episodes), rules=rules or (), every=every)
    shown = f"{counted(len(episodes), 'episode')}, {counted(sum(map(len, episodes)), 'frame')}"
    typer.echo(f"wrote {out}: {shown}, {out.stat().st_size / 1000:.0f} kB")


def _title(episodes: list[Episode]) -> str:
    names = list(dict.fromkeys(one.origin.recording for one in episodes))
    return f"Why it drove so: {', '.join(names)}"


def _episodes(path: Path, rules: list[Path] | None) -> Iterator[Episode]:
    """Yield what an argument names.

    Raises:
        UserError: it is nothing that can be shown.
    """
    from drlsl.driving.episodes import SUFFIXES, load_episode

    if path.suffix == ".json":
        yield _of_scene(path, rules)
    elif path.is_dir():
        yield from map(load_episode, _files(path))
    elif path.suffix in SUFFIXES:
        yield load_episode(path)
    elif path.exists():
        raise UserError(
            f"{path}: expected a run, a folder or a file ({', '.join(SUFFIXES)}) of episodes, or a scene "
            "(.json)"
        )
    else:
        raise UserError(f"{path}: there is no such run folder, episode or scene")


def _files(folder: Path) -> list[Path]:
    """Return the files of the episodes in a folder.

    Raises:
        UserError: there are none; the message tells how to get some.
    """
    from drlsl.driving.episodes import SUFFIXES, episode_files

    is_run = (folder / "config.yaml").is_file()
    place = folder / EPISODES if is_run else folder
    found = episode_files(place)
    if not found and is_run:
        raise UserError(
            f"{folder} has no episodes; to record some: drlsl eval {folder} --episodes 3 "
            f"--episodes-out {place}"
        )
    if not found:
        raise UserError(
            f"{folder} has no episodes ({', '.join(SUFFIXES)}); drlsl eval RUN --episodes-out DIR records "
            "some"
        )
    return found


def _of_scene(path: Path, rules: list[Path] | None) -> Episode:
    """Return a scene file as an episode of one frame.

    Raises:
        UserError: it cannot be read, or has no vehicles.
    """
    from drlsl.driving.episodes import Origin, episode_of_scene
    from drlsl.driving.scene import load_scene
    from drlsl.driving.shield import Shield
    from drlsl.files import digests

    scene = load_scene(path)
    if not scene.vehicles:
        raise UserError(f"{path}: it has no vehicles besides the ego, so there is nothing to see; add some")
    shield = Shield.from_files(rules or ())
    named, read = tuple(map(str, rules or ())), digests(shield.files())
    origin = Origin("", path.name, True, "rules", 0, 1, named, read, "preferences")
    with failures_as_errors():
        return episode_of_scene(shield, scene, origin)
