"""Episodes that a command records, as files of a folder."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

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

PAGE: Final = "view.html"
"""The page with the episodes of a folder."""

_OTHER: Final = re.compile(r"[^A-Za-z0-9._-]+")


@dataclass(frozen=True)
class EpisodeFolder:
    """A folder for the episodes that a driver called `who` drives in environments of a configuration.

    `wants` says what the driver's preferences are.
    """

    folder: Path
    config: EnvConfig
    who: str
    wants: str

    def recorder(self, env: HighwayVectorEnv, driver: str, *, enforced: bool, seed: int) -> EpisodeRecorder:
        """Return a recorder that watches `env` and writes each episode that ends.

        Raises:
            UserError: the folder cannot be made.
        """
        from drlsl.driving.episodes import EpisodeRecorder, Origin

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
        save(self.folder, episode)

    def write_page(self) -> str:
        """Write a page with all episodes of the folder beside them; return in words what was written.

        Raises:
            UserError: it cannot be written.
        """
        from drlsl.driving.episodes import SUFFIX, load_episode
        from drlsl.driving.page import least_thinning, write_page

        episodes = [load_episode(path) for path in sorted(self.folder.glob(f"*{SUFFIX}"))]
        page, every = self.folder / PAGE, least_thinning(episodes)
        write_page(page, episodes, title=f"{self.who} in {', '.join(self.config.recordings)}", every=every)
        thinned = "" if every == 1 else f", every {every}th frame"
        return f"wrote {len(episodes)} episodes to {self.folder}, and {page} to look at them{thinned}"


def make_folder(folder: Path) -> None:
    """Make a folder for episodes, unless there is one.

    Raises:
        UserError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make {folder}: {error.strerror}") from error


def save(folder: Path, episode: Episode, prefix: str = "") -> Path:
    """Write an episode to a folder, under a name that tells it from others there; return the file.

    Raises:
        UserError: it cannot be written.
    """
    from drlsl.driving.episodes import SUFFIX, save_episode

    origin = episode.origin
    shield = "on" if origin.enforced else "off"
    driver = _OTHER.sub("-", origin.driver).strip("-.") or "driver"
    path = folder / f"{prefix}{driver}-shield-{shield}-{origin.number:04}{SUFFIX}"
    save_episode(path, episode)
    return path
