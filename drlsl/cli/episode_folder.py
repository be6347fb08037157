"""Episodes that a command records, as files of a folder."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from drlsl.errors import UserError

if TYPE_CHECKING:
    from drlsl.driving import EnvConfig, HighwayVectorEnv
    from drlsl.driving.episodes import Episode, EpisodeRecorder

EpisodesOut = Annotated[
    Path | None,
    typer.Option(
        "--episodes-out", metavar="DIR", help="Write every episode here, as a file for drlsl view and render."
    ),
]

EpisodesAs = Annotated[
    Literal["npz", "parquet"], typer.Option("--episodes-as", help="The format of these (extra `parquet`).")
]

PAGE: Final = "view.html"
"""The page with the episodes of a folder."""

_OTHER: Final = re.compile(r"[^A-Za-z0-9._-]+")


@dataclass(frozen=True)
class EpisodeFolder:
    """A folder for the episodes that a driver called `who` drives in environments of a configuration.

    `wants` says what the driver's preferences are, `suffix` how the files end.
    """

    folder: Path
    config: EnvConfig
    who: str
    wants: str
    suffix: str

    def recorder(self, env: HighwayVectorEnv, driver: str, *, enforced: bool, seed: int) -> EpisodeRecorder:
        """Return a recorder that watches `env` and writes each episode that ends.

        Raises:
            UserError: the folder cannot be made, or the extra of the format is not installed.
        """
        from drlsl.driving.episodes import PARQUET, EpisodeRecorder, Origin
        from drlsl.files import parquet_library

        if self.suffix == PARQUET:
            parquet_library()  # Told now, and not when the first episode ends.
        make_folder(self.folder)
        origin = Origin.of(self.config, env.shield, driver, self.wants, enforced=enforced, seed=seed)
        recorder = EpisodeRecorder(env.world, origin, self.save)
        env.watch = recorder.watch
        return recorder

    def save(self, episode: Episode) -> None:
        """Write an episode.

        Raises:
            UserError: it cannot be written.
        """
        save(self.folder, episode, self.suffix)

    def write_page(self) -> str:
        """Write a page with all episodes of the folder beside them; return in words what was written.

        Raises:
            UserError: it cannot be written.
        """
        from drlsl.driving.episodes import episode_files, load_episode
        from drlsl.driving.page import least_thinning, write_page
        from drlsl.traffic import counted

        episodes = [load_episode(path) for path in episode_files(self.folder)]
        page, every = self.folder / PAGE, least_thinning(episodes)
        write_page(page, episodes, title=f"{self.who} in {', '.join(self.config.recordings)}", every=every)
        thinned = "" if every == 1 else f", every {every}th frame"
        return (
            f"wrote {counted(len(episodes), 'episode')} to {self.folder}, and {page} to look at them{thinned}"
        )


def make_folder(folder: Path) -> None:
    """Make a folder for episodes, unless there is one.

    Raises:
        UserError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make {folder}: {error.strerror}") from error


def save(folder: Path, episode: Episode, suffix: str) -> Path:
    """Write an episode to a folder, under a name that tells it from others there; return the file.

    Raises:
        UserError: it cannot be written.
    """
    from drlsl.driving.episodes import save_episode

    origin = episode.origin
    shield = "on" if origin.enforced else "off"
    driver = _OTHER.sub("-", origin.driver).strip("-.") or "driver"
    path = folder / f"{driver}-shield-{shield}-{origin.number:04}{suffix}"
    save_episode(path, episode)
    return path


def episodes_of(path: Path) -> list[Path]:
    """Return the files of the episodes that a path names, none if it is no file or folder of episodes.

    Raises:
        UserError: a Parquet file cannot be read.
    """
    from drlsl.driving.episodes import episode_files, is_episode

    if path.is_dir():
        return episode_files(path)
    return [path] if is_episode(path) else []


def convert_episodes(paths: Sequence[Path], out: Path, suffix: str, *, force: bool) -> list[Path]:
    """Write episodes in another format; several go to a folder. Return the files.

    Raises:
        UserError: an episode cannot be read or written, two have one name, or a file exists without `force`.
    """
    from drlsl.driving.episodes import SUFFIXES, load_episode, save_episode

    if len(paths) > 1 and out.suffix in SUFFIXES:
        raise UserError(f"{out}: {len(paths)} episodes need a folder; name one, and add --to {suffix[1:]}")
    single = len(paths) == 1 and out.suffix == suffix
    targets = [out] if single else [out / f"{path.stem}{suffix}" for path in paths]
    for number, target in enumerate(targets):
        if target in targets[:number]:
            raise UserError(f"{target}: two of the episodes would be called so; convert them one by one")
        if target.exists() and not force:
            raise UserError(f"{target}: exists already; choose another place or add --force to replace it")
    if not single:
        make_folder(out)
    for path, target in zip(paths, targets, strict=True):
        save_episode(target, load_episode(path))
    return targets
