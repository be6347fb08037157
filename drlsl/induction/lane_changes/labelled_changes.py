"""Lane changes driven in the world, each labelled safe or unsafe by what became of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from drlsl.driving import EnvConfig
from drlsl.driving.scene import SCHEMA, Action, Road, SceneBatch, taken_rows
from drlsl.driving.shield import LIMITS, SceneProgram, Shield
from drlsl.driving.simulation import StepResult, World, playbacks_of
from drlsl.errors import UserError
from drlsl.induction.lane_changes.scene_bias import OBJECTIONS, SIDES
from drlsl.logic import Engine
from drlsl.lowering.backends import compile_numpy
from drlsl.lowering.frontend import Query, lower
from drlsl.shield import consult_rules
from drlsl.traffic import Integers, Mask, Recording
from drlsl.workers import followed

Label: TypeAlias = Literal["fault", "contact", "rss"]

WATCHED: Final = 6.0
"""How long a lane change is watched [s]: it takes some 3 s, and then a vehicle behind has closed up."""

SHARE: Final = 0.02
"""Probability with which an ego that may change lanes begins to, in a step of `STEP_TIME`."""

STEP_TIME: Final = 0.04
"""The time that `SHARE` is meant for [s]: a frame of highD."""

EGOS: Final = 256
"""Egos that drive side by side."""

_TO_SIDE: Final = {
    SIDES.index("left"): Action.LEFT_LANE_CHANGE,
    SIDES.index("right"): Action.RIGHT_LANE_CHANGE,
}

LEFT_OUT: Final = {
    "cut short": "the ego reached the end of the stretch or of its episode first",
    "excused": "a contact that was not the ego's fault",
    "failed": "the rules gave no decision while it was watched",
}
"""The lane changes that have no label, by reason."""


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """N lane changes: the scene in which each began, its side, its label and what it comes from.

    `side` (N,) indexes `SIDES`; `unsafe` (N,); `origin` (N,): the name of a recording, or of a property.
    `left_out` counts those without a label, by the reasons of `LEFT_OUT`.
    """

    scenes: SceneBatch
    side: Integers
    unsafe: Mask
    origin: tuple[str, ...]
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.side)


def labelling_shield(bias: str, *, tier: str = "auto") -> Shield:
    """Return the shield of the program `bias` that offers every lane change that the road has.

    A lane change is never given up, since a dangerous one would then often look safe.

    Raises:
        UserError, PrologError: the program cannot be used.
    """
    engine = Engine()
    consult_rules(engine, bias)
    giving_up = ":- abolish(lane_to_keep/1).\n" if engine.defines("lane_to_keep", 1) else ""
    engine.consult_text(f"{OBJECTIONS}\n{giving_up}opening(_).\n", "the rules while labelling", limits=LIMITS)
    return Shield(engine, tier=tier)


@dataclass(frozen=True, slots=True)
class Labelling:
    """Settings of labelling: the label, the number of lane changes of each recording, and the seed."""

    label: Label = "fault"
    changes: int = 5000
    seed: int = 0
    egos: int = EGOS


def label_changes(how: Labelling, bias: str, recording: Recording) -> Changes:
    """Return what `labelled` returns at its end."""
    return followed(labelled(how, bias, recording))


def labelled(how: Labelling, bias: str, recording: Recording) -> Generator[int, None, Changes]:
    """Drive lane changes in a recording at random moments, and return those that got a label.

    Now and then their number is yielded. All is a function of the arguments.

    Raises:
        UserError, PrologError: the program cannot be used, or the recording has no gap to enter.
    """
    shield = labelling_shield(bias)
    config = EnvConfig(recording=recording.name)
    playbacks = playbacks_of([recording], config.radar_range)
    world = World(config, [playbacks] * how.egos, shield)
    critical = _critical_program(shield.engine) if how.label == "rss" else None
    drive = _LabelDrive(world, how, recording, critical)
    yield from drive.run()
    return drive.changes()


def _critical_program(engine: Engine) -> SceneProgram:
    """Return the program that says of scenes whether a change is critical, and whether it has ended.

    Raises:
        UserError: the program does not define `critical_change/0`.
    """
    if not engine.defines("critical_change", 0):
        raise UserError("--label rss: the program does not define critical_change/0; learning.pl does")
    queries = [Query("critical_change", 0, "holds"), Query("settled", 0, "holds")]
    return SceneProgram(compile_numpy(lower(engine, SCHEMA, queries)))


class _LabelDrive:
    """Egos side by side, which begin a lane change now and then and are watched until it has a label."""

    def __init__(
        self, world: World, how: Labelling, recording: Recording, critical: SceneProgram | None
    ) -> None:
        self._world, self._how, self._name, self._critical = world, how, recording.name, critical
        self._rng, *own = (
            np.random.default_rng(seed) for seed in np.random.SeedSequence(how.seed).spawn(how.egos + 1)
        )
        self._own = own
        self._share = min(1.0, SHARE * recording.dt / STEP_TIME)
        self._frames = round(WATCHED / recording.dt)
        self._age = np.full(how.egos, -1)  # frames since the lane change began; -1: none is watched
        self._row = np.zeros(how.egos, dtype=np.int64)
        self._begun: list[SceneBatch] = []
        self._sides: list[int] = []
        self._unsafe: dict[int, bool] = {}
        self._left_out: Counter[str] = Counter()

    def run(self) -> Iterator[int]:
        """Drive until there are enough labels; yield their number now and then."""
        self._world.reset(range(self._world.count), self._own)
        restarts: dict[int, np.random.Generator] = {}
        while len(self._unsafe) < self._how.changes:
            actions = self._actions()
            result = self._world.step(actions, restarts)
            self._watch(result, list(restarts))
            over = (result.terminated | result.truncated).nonzero()[0].tolist()
            restarts = {ego: self._own[ego] for ego in over}
            if over:
                yield min(len(self._unsafe), self._how.changes)

    def _actions(self) -> Integers:
        """Return the actions, and remember the scenes in which lane changes begin."""
        world = self._world
        offered = world.decisions.action_mask[:, [_TO_SIDE[0], _TO_SIDE[1]]]
        drawn = self._rng.random((world.count, 3))
        begins = (self._age < 0) & (drawn[:, 2] < self._share) & offered.any(axis=1)
        side = np.argmax((drawn[:, :2] + 1.0) * offered, axis=1)
        egos = begins.nonzero()[0]
        actions = np.full(world.count, int(Action.LANE_KEEPING))
        actions[egos] = np.array([_TO_SIDE[0], _TO_SIDE[1]])[side[egos]]
        if egos.size:
            self._begun.append(taken_rows(world.seen, egos))
            self._row[egos] = len(self._sides) + np.arange(len(egos))
            self._sides.extend(side[egos].tolist())
            self._age[egos] = 0
        return actions

    def _watch(self, result: StepResult, restarted: list[int]) -> None:
        """Give labels to the lane changes that the step decides."""
        self._age[restarted] = -1
        watched = self._age >= 0
        self._age[watched] += 1
        for ego, contact in result.contacts.items():
            if not watched[ego]:
                continue
            if contact.at_fault or self._how.label == "contact":
                self._settle(ego, unsafe=True)
            else:
                self._leave_out(ego, "excused")
        for ego in (result.off_road & (self._age >= 0)).nonzero()[0].tolist():
            self._settle(ego, unsafe=True)
        for ego in result.failures:
            if self._age[ego] >= 0:
                self._leave_out(ego, "failed")
        if self._critical is not None:
            self._watch_distances(self._critical, result)
        for ego in ((result.truncated | result.entered) & (self._age >= 0)).nonzero()[0].tolist():
            self._leave_out(ego, "cut short")
        for ego in (self._age >= self._frames).nonzero()[0].tolist():
            self._settle(ego, unsafe=False)

    def _watch_distances(self, critical: SceneProgram, result: StepResult) -> None:
        """Give labels by the distances that hold until the change has ended."""
        egos = (self._age >= 0).nonzero()[0]
        if not egos.size:
            return
        (broken, settled), undecided = critical(taken_rows(result.scenes, egos))
        for place, ego in enumerate(egos.tolist()):
            if undecided[place]:
                self._leave_out(ego, "failed")
            elif broken.value[place]:
                self._settle(ego, unsafe=True)
            elif settled.value[place]:
                self._settle(ego, unsafe=False)

    def _settle(self, ego: int, *, unsafe: bool) -> None:
        self._unsafe[int(self._row[ego])] = unsafe
        self._age[ego] = -1

    def _leave_out(self, ego: int, why: str) -> None:
        self._left_out[why] += 1
        self._age[ego] = -1

    def changes(self) -> Changes:
        """Return the labelled lane changes, in the order in which they began."""
        rows = sorted(self._unsafe)[: self._how.changes]
        scenes = joined_scenes(self._begun)
        return Changes(
            taken_rows(scenes, np.array(rows, dtype=np.int64)),
            np.array([self._sides[row] for row in rows], dtype=np.int64),
            np.array([self._unsafe[row] for row in rows], dtype=np.bool_),
            (self._name,) * len(rows),
            dict(self._left_out),
        )


def joined_scenes(batches: list[SceneBatch]) -> SceneBatch:
    """Return the scenes of several batches, one after another; vehicles keep their names."""
    roads: dict[Road, int] = {}
    for batch in batches:
        for road in batch.roads:
            roads.setdefault(road, len(roads))
    slots = max(batch.valid.shape[1] for batch in batches)

    def column(name: str) -> Any:
        arrays = [getattr(batch, name) for batch in batches]
        if arrays[0].ndim == 1:
            return np.concatenate(arrays)
        widened = [np.pad(array, ((0, 0), (0, slots - array.shape[1]))) for array in arrays]
        return np.concatenate(widened)

    columns = {one.name: column(one.name) for one in fields(SceneBatch) if one.name not in ("roads", "road")}
    places = [np.array([roads[one] for one in batch.roads], dtype=np.int64)[batch.road] for batch in batches]
    return SceneBatch(roads=tuple(roads), road=np.concatenate(places), **columns)
