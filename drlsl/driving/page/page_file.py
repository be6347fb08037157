"""The page as one HTML file: episodes, the rules, and what draws them."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.driving.episodes import Episode
from drlsl.driving.page.packed_columns import FINE, NONE, STEP, pack
from drlsl.driving.page.page_program import page_program
from drlsl.driving.rendering import COLOURS
from drlsl.driving.scene import ATOMS, scene_defaults, scene_json
from drlsl.errors import UserError
from drlsl.files import write_atomic
from drlsl.traffic import Integers
from drlsl.version import __version__

MOST_FRAMES: Final = 50_000
"""Frames that a page holds: some 2.5 MB, which every browser opens at once."""

SHOWN: Final = 2
"""Episodes that a page shows side by side at first."""

BEFORE: Final = 6.0
"""Time before a contact at which its episode opens [s]."""

_FRAME_STYLE: Final = "width: 100%; height: 760px; border: 0"

_PLACE: Final = re.compile(r"@([A-Z_]+)@")

_MORE_COLOURS: Final = {
    "failure": "#a06bd0",
    "track": "#8a938e66",
    "cursor": "#2f7df6",
    "selected": "#ffd84a",
    "label": "#14191799",
}
"""Colours of what only the page has."""


def thinned(episode: Episode, every: int) -> Integers:
    """Return every `every`-th frame, the last one always: the frames to show."""
    frames = np.arange(0, len(episode), every)
    return frames if frames[-1] == len(episode) - 1 else np.append(frames, len(episode) - 1)


def least_thinning(episodes: Sequence[Episode]) -> int:
    """Return the least `every` for which a page holds some episodes, as far as that helps."""
    every, longest = 1, max(map(len, episodes), default=1)
    while every < longest and sum(len(thinned(episode, every)) for episode in episodes) > MOST_FRAMES:
        every += 1
    return every


def write_page(
    path: Path,
    episodes: Sequence[Episode],
    *,
    title: str,
    rules: Sequence[Path] = (),
    every: int = 1,
) -> None:
    """Write a page with some episodes, of which the first are shown.

    `rules`: where the rule files are, if not where the episodes say; `every`: show only every so many frames.

    Raises:
        UserError: there are too many frames, or the file cannot be written.
    """
    write_atomic(path, page_text(episodes, title=title, rules=rules, every=every).encode("utf-8"))


def framed_page(episode: Episode) -> str:
    """Return the page of an episode as a frame of another page, for notebooks."""
    page = page_text([episode], title=episode.origin.name, every=least_thinning([episode]))
    return f'<iframe srcdoc="{html.escape(page)}" title="An episode" style="{_FRAME_STYLE}"></iframe>'


def page_text(episodes: Sequence[Episode], *, title: str, rules: Sequence[Path] = (), every: int = 1) -> str:
    """Return the text of the page that `write_page` writes.

    Raises:
        UserError: there are too many frames.
    """
    frames = [thinned(episode, every) for episode in episodes]
    total = sum(map(len, frames))
    if total > MOST_FRAMES:
        least = least_thinning(episodes)
        raise UserError(
            f"{total:,} frames in {len(episodes)} episodes are more than the {MOST_FRAMES:,} that a page "
            f"holds: name fewer episodes, or thin them with --every {least}"
        )
    known: dict[tuple[Any, ...], int] = {}
    keys = [_program_key(one, rules) for one in episodes]
    places = [known.setdefault(key, len(known)) for key in keys]
    data = {
        "made_by": f"drlsl {__version__}",
        "title": title,
        "step": STEP,
        "fine": FINE,
        "none": NONE,
        "actions": list(ATOMS),
        "colours": {**{name: _css(*colour) for name, colour in COLOURS.items()}, **_MORE_COLOURS},
        "defaults": scene_defaults(),
        "episodes": [
            {**_episode(episode, shown), "program": place}
            for episode, shown, place in zip(episodes, frames, places, strict=True)
        ],
        "programs": [page_program(files, dict(digests)) for files, digests in known],
        "show": list(range(min(SHOWN, len(episodes)))),
    }
    # In a script of a page only < could begin something else.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    values = {
        "TITLE": html.escape(title),
        "MADE_BY": html.escape(f"drlsl {__version__}"),
        "STYLE": _asset("view.css"),
        "SCRIPT": _asset("view.js"),
        "DATA": text,
    }
    return _PLACE.sub(lambda place: values[place[1]], _asset("page.html"))


def _program_key(episode: Episode, rules: Sequence[Path]) -> tuple[Any, ...]:
    """Return the rule files of an episode, and their digests."""
    origin = episode.origin
    return tuple(rules) or origin.rules, tuple(sorted(origin.digests.items()))


def _asset(name: str) -> str:
    return (files(__package__) / "assets" / name).read_text(encoding="utf-8")


def _css(red: int, green: int, blue: int) -> str:
    return f"#{red:02x}{green:02x}{blue:02x}"


def _episode(episode: Episode, frames: Integers) -> dict[str, Any]:
    columns, table = pack(episode, frames)
    first = json.loads(scene_json(episode.scene(0)))
    number = {int(frame): place for place, frame in enumerate(frames.tolist())}
    space = episode.observation
    return {
        "name": episode.origin.name if episode.ending.kind != "scene" else episode.origin.recording,
        "recording": episode.origin.recording,
        "enforced": episode.origin.enforced,
        "ending": {
            "kind": episode.ending.kind,
            "words": episode.ending.words(),
            "vehicle": episode.ending.vehicle,
        },
        "wants": episode.origin.wants,
        "road": first["road"],
        "frames": len(number),
        "observation": [list(row) for row in zip(space.names, space.low, space.high, strict=True)],
        "clauses": [asdict(clause) for clause in episode.clauses],
        "names": list(episode.names),
        "begin": _begin(episode),
        "failures": {str(frame): why for frame, why in episode.failures.items() if frame in number},
        "scene": first if episode.ending.kind == "scene" else None,
        "columns": columns,
        **table,
    }


def _begin(episode: Episode) -> float:
    """Return the time at which an episode opens [s]."""
    if episode.ending.kind not in ("contact", "off_road"):
        return 0.0
    return max(0.0, (len(episode) - 1) * episode.road.time_step - BEFORE)
