"""Stress and proofs of a candidate program; what goes wrong in them is an unsafe example."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Final

import numpy as np

from drlsl.driving import POLICIES, Counts, EnvConfig, stress
from drlsl.driving.scene import Action, Scene, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.induction.domain import Progress, unseen
from drlsl.induction.lane_changes.labelled_changes import Changes
from drlsl.induction.lane_changes.scene_bias import SIDES, Side
from drlsl.shield import own_files
from drlsl.traffic import load_recording
from drlsl.verify import Prover, Request, Result, verify
from drlsl.verify.smt import NOBODY
from drlsl.workers import ALONE, Crew, Function, Stop, in_order

BLOCK: Final = 2000
"""Episodes of stress after which one looks whether anything went wrong."""

_KEPT: Final = 100
"""Contacts at fault of a block that become examples."""

_SIDE_OF: Final[dict[Action, Side]] = {Action.LEFT_LANE_CHANGE: "left", Action.RIGHT_LANE_CHANGE: "right"}


@dataclass(frozen=True, slots=True)
class BadChange:
    """A lane change that must not be offered: its scene and side, and where it was found."""

    scene: Scene
    side: Side
    origin: str


@dataclass(frozen=True, slots=True)
class Stressed:
    """The counts of stress on one recording, and its lane changes that ended at fault.

    `unexplained`: contacts at fault of egos that had not begun a lane change.
    """

    recording: str
    counts: Counts
    bad: tuple[BadChange, ...]
    unexplained: int

    @property
    def clean(self) -> bool:
        """True if nobody was at fault or off the road."""
        return not self.counts.contacts_at_fault and not self.counts.off_road

    def with_block(self, other: Stressed) -> Stressed:
        """Return what these and further episodes on the recording found."""
        counts = Counts()
        counts.add(self.counts)
        counts.add(other.counts)
        return replace(
            self, counts=counts, bad=self.bad + other.bad, unexplained=self.unexplained + other.unexplained
        )


def bad_changes(bad: Sequence[BadChange]) -> Changes:
    """Return lane changes that must not be offered as labelled ones."""
    return Changes(
        SceneBatch.of([one.scene for one in bad]),
        np.array([SIDES.index(one.side) for one in bad], dtype=np.int64),
        np.ones(len(bad), dtype=np.bool_),
        tuple(one.origin for one in bad),
    )


def stressed(
    rules: Path,
    recordings: Sequence[str],
    episodes: int,
    seed: int,
    *,
    crew: Crew = ALONE,
    whole: bool = False,
    tier: str = "auto",
    progress: Progress = unseen,
) -> list[Stressed]:
    """Return what stress with `rules` finds on each recording, in blocks until something goes wrong.

    `whole`: all episodes in any case.
    """
    found = {name: Stressed(name, Counts(), (), 0) for name in recordings}

    def tasks() -> Iterator[_Block]:
        for number, first in enumerate(range(0, episodes, BLOCK)):
            for name in recordings:
                if whole or found[name].clean:
                    yield _Block(name, min(BLOCK, episodes - first), seed + number)

    make = partial(_stressing, rules, tier)
    for part in in_order(crew.perform(make, tasks(), files=own_files(Shield.from_files([rules]).engine))):
        # A block that was begun before something went wrong in the one before does not count.
        if whole or found[part.recording].clean:
            found[part.recording] = found[part.recording].with_block(part)
            progress(f"driving on {part.recording}", found[part.recording].counts.episodes, episodes)
    return list(found.values())


@dataclass(frozen=True, slots=True)
class _Block:
    """Some episodes of stress on a recording."""

    recording: str
    episodes: int
    seed: int


def _stressing(rules: Path, tier: str) -> Function[_Block, Stressed]:
    """Return the function that drives a block with `rules`."""
    shield = Shield.from_files([rules], tier=tier)
    recording = lru_cache(load_recording)

    def drive(block: _Block, _stop: Stop) -> Stressed:
        config = EnvConfig(recording=block.recording, rules=(str(rules),))
        *_, report = stress(
            config,
            [recording(block.recording)],
            shield,
            [*POLICIES],
            episodes=block.episodes,
            seed=block.seed,
            kept=_KEPT,
        )
        at_fault = [contact for contact in report.worst if contact.verdict == "at_fault"]
        bad = tuple(
            BadChange(one.change.scene, _SIDE_OF[one.change.action], f"stress of {block.recording}")
            for one in at_fault
            if one.change is not None
        )
        return Stressed(block.recording, report.total, bad, len(at_fault) - len(bad))

    return drive


def examined(
    rules: Path,
    properties: Sequence[Path],
    names: Sequence[str],
    *,
    crew: Crew = ALONE,
    attack: int = 0,
    progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> list[Result]:
    """Return the results of trying to prove the named properties of `rules`; `progress` as for `verify`.

    Raises:
        UserError: there is no such property, or no solver.
    """
    if not names:
        return []
    request = Request(
        rules=(rules,), properties=tuple(properties), only=tuple(names), crew=crew, attack=attack
    )
    return verify(request, progress).results


def broken_by(rules: Path, properties: Sequence[Path], result: Result) -> Iterator[BadChange]:
    """Yield the lane changes whose offer breaks a refuted property in its counterexample.

    There is none if the property is broken with neither change offered.
    """
    found = result.counterexample
    assert found is not None
    if _breaks(rules, properties, result, []):
        return
    for action, side in _SIDE_OF.items():
        if _breaks(rules, properties, result, [action]):
            yield BadChange(found.scene, side, f"property {result.name}")


def _breaks(rules: Path, properties: Sequence[Path], result: Result, offered: Sequence[Action]) -> bool:
    """Return whether the counterexample breaks the property if only some lane changes may be offered."""
    found = result.counterexample
    assert found is not None
    against = [f"objection({action.atom}, not_asked)." for action in _SIDE_OF if action not in offered]
    with tempfile.TemporaryDirectory() as folder:
        changed = Path(folder) / "some_offered.pl"
        lines = [f":- ensure_loaded('{rules.resolve()}').", ":- multifile(objection/2).", *against]
        changed.write_text("\n".join(lines) + "\n", encoding="utf-8")
        replay = Prover.of([changed], properties, [result.name]).replay(result.name)
        return replay.breaks(found.scene, found.focus or NOBODY, found.unknowns) is not None
