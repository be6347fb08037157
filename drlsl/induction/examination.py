"""Stress and proofs of a candidate program; what goes wrong in them is an unsafe example."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.driving import POLICIES, Counts, EnvConfig, stress
from drlsl.driving.scene import Action, Scene, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.induction.bias import SIDES, Side
from drlsl.induction.labelled_changes import Changes
from drlsl.traffic import load_recording
from drlsl.verify import Prover, Request, Result, verify
from drlsl.verify.smt import NOBODY

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
    counts: dict[str, Any]
    bad: tuple[BadChange, ...]
    unexplained: int

    @property
    def clean(self) -> bool:
        """True if nobody was at fault or off the road."""
        return not self.counts["contacts_at_fault"] and not self.counts["off_road"]


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
    jobs: int,
    whole: bool = False,
    tier: str = "auto",
) -> list[Stressed]:
    """Return what stress with `rules` finds on each recording, in blocks until something goes wrong.

    `whole`: all episodes in any case.
    """
    work = partial(_stress_one, rules, episodes=episodes, seed=seed, whole=whole, tier=tier)
    with ProcessPoolExecutor(jobs) if jobs > 1 and len(recordings) > 1 else nullcontext() as pool:
        return list(pool.map(work, recordings) if pool is not None else map(work, recordings))


def _stress_one(rules: Path, recording: str, *, episodes: int, seed: int, whole: bool, tier: str) -> Stressed:
    shield = Shield.from_files([rules], tier=tier)
    config = EnvConfig(recording=recording, rules=(str(rules),))
    loaded = [load_recording(recording)]
    total, bad, unexplained = Counts(), list[BadChange](), 0
    for block in range(0, episodes, BLOCK):
        count = min(BLOCK, episodes - block)
        run = stress(
            config, loaded, shield, [*POLICIES], episodes=count, seed=seed + block // BLOCK, kept=_KEPT
        )
        *_, report = run
        total.add(report.total)
        for contact in report.worst:
            if contact.verdict != "at_fault":
                continue
            if contact.change is None:
                unexplained += 1
            else:
                side = _SIDE_OF[contact.change.action]
                bad.append(BadChange(contact.change.scene, side, f"stress of {recording}"))
        if not whole and (total.contacts_at_fault or total.off_road):
            break
    return Stressed(recording, total.as_json(), tuple(bad), unexplained)


def examined(
    rules: Path, properties: Sequence[Path], names: Sequence[str], *, jobs: int, attack: int = 0
) -> list[Result]:
    """Return the results of trying to prove the named properties of `rules`.

    Raises:
        UserError: there is no such property, or no solver.
    """
    if not names:
        return []
    request = Request(
        rules=(rules,), properties=tuple(properties), only=tuple(names), jobs=jobs, attack=attack
    )
    return verify(request).results


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
