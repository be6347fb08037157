"""An episode as it was driven: every frame, what the rules said about it and what the driver chose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Self

import numpy as np

from drlsl.driving.config import EnvConfig
from drlsl.driving.explain import Objection, Reason, RuleClause
from drlsl.driving.rendering import Moment
from drlsl.driving.scene import Action, Road, Scene, Vehicle
from drlsl.driving.shield import ObservationSpace, Shield
from drlsl.files import digests
from drlsl.traffic import Floats, Integers, Mask

NO_DECISION: Final = -1
"""`Episode.action` in a frame in which the driver was not asked."""


@dataclass(frozen=True, slots=True)
class Ending:
    """The way in which an episode ended.

    `kind`: completed, contact, off_road, or scene for a single moment; of a contact the `verdict`, the other
    `vehicle`, and the `closing_speed` [m/s].
    """

    kind: str
    verdict: str = ""
    vehicle: str = ""
    closing_speed: float = 0.0

    def words(self) -> str:
        """Return the ending in words."""
        if self.kind == "contact":
            blame = "at fault" if self.verdict == "at_fault" else self.verdict.replace("_", " ")
            return f"contact with {self.vehicle}, {blame}"
        return self.kind.replace("_", " ")


@dataclass(frozen=True, slots=True)
class Origin:
    """The circumstances of an episode: who drove, where, by which rules.

    `enforced`: the driver had to take an offered action. `number` counts the episodes of a seed from 1.
    `rules` are the files as they were named, none for highway.pl; `digests` has the SHA-256 of every file.
    `wants` says what the driver's preferences are: Q-values, or another measure.
    """

    driver: str
    recording: str
    enforced: bool
    offers: str
    seed: int
    number: int
    rules: tuple[str, ...]
    digests: dict[str, str]
    wants: str

    @classmethod
    def of(
        cls, config: EnvConfig, shield: Shield, driver: str, wants: str, *, enforced: bool, seed: int
    ) -> Self:
        """Return that of the episodes of a driver in an environment; their numbers are yet to come."""
        return cls(
            driver=driver,
            recording=", ".join(config.recordings),
            enforced=enforced,
            offers=config.offers,
            seed=seed,
            number=0,
            rules=config.rules,
            digests=digests(shield.files()),
            wants=wants,
        )

    @property
    def name(self) -> str:
        """The name of the episode among others."""
        return f"{self.driver}, shield {'on' if self.enforced else 'off'}, episode {self.number}"


@dataclass(frozen=True, slots=True, eq=False)
class VehicleRows:
    """The vehicles of T frames: those of frame t are the rows `begin[t]` to `begin[t + 1]`, the ego first.

    `begin` (T + 1,); `name` (V,) indexes `Episode.names`; `lane` (V,) ids; `numbers` (V, 6): x, y, vx, vy,
    length, width in m and m/s.
    """

    begin: Integers
    name: Integers
    lane: Integers
    numbers: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The rules' decisions in T frames, and the mask that was offered.

    `offered` (T, A) bool; `target_speed` (T,) [m/s]; `observation` (T, S); `front_is_free` (T,);
    `lane_to_keep` (T,) ids; `comfortable_acceleration` (T,) [m/s²], infinite if the rules do not say.
    """

    offered: Mask
    target_speed: Floats
    observation: Floats
    front_is_free: Mask
    lane_to_keep: Integers
    comfortable_acceleration: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """An episode of T frames.

    `traffic` is all traffic as it was, `seen` what the rules saw of it if sensing had faults; `target_lane`
    (T,) ids; `distance` (T,) driven [m]. `action` (T,): what the driver chose in the frame, `NO_DECISION`
    where it was not asked; `preferences` (T, A): how much it wanted each action, NaN where it was not asked.
    `changed` (T,): a lane change began; `entered` (T,): the ego was placed anew at the beginning of the
    stretch. `reasons`: by frame, what speaks against actions that were not offered, or against any where
    all are offered, whatever the rules say; `failures`: by frame, why the rules failed, so that the fail-safe
    drove.
    """

    origin: Origin
    ending: Ending
    road: Road
    observation: ObservationSpace
    clauses: tuple[RuleClause, ...]
    names: tuple[str, ...]
    traffic: VehicleRows
    seen: VehicleRows | None
    target_lane: Integers
    distance: Floats
    answers: Answers
    action: Integers
    preferences: Floats
    changed: Mask
    entered: Mask
    reasons: tuple[tuple[Reason, ...], ...] = ()
    failures: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.target_lane)

    def scene(self, frame: int) -> Scene:
        """Return the scene of a frame, with all traffic, in radar range or not."""
        return self._scene(self.traffic, frame)

    def seen_scene(self, frame: int) -> Scene:
        """Return the scene of a frame as the rules saw it."""
        return self._scene(self.seen or self.traffic, frame)

    def offered(self, frame: int) -> tuple[Action, ...]:
        """Return the actions that were offered in a frame."""
        return tuple(action for action in Action if self.answers.offered[frame, action])

    def moment(self, frame: int) -> Moment:
        """Return a frame as it is drawn."""
        unsafe: dict[Action, list[Objection]] = {}
        for reason in self.reasons[frame]:
            if self.answers.offered[frame, reason.action]:
                continue
            unsafe.setdefault(reason.action, []).append(reason.objection)
        failure = self.failures.get(frame, "")
        last = frame == len(self) - 1 and self.ending.kind in ("contact", "off_road")
        return Moment(
            scene=self.scene(frame),
            offered=self.offered(frame),
            unsafe=unsafe,
            target_speed=float(self.answers.target_speed[frame]),
            distance=float(self.distance[frame]),
            alarm=self.ending.words() if last else failure and f"fail-safe: {failure}",
        )

    def _scene(self, traffic: VehicleRows, frame: int) -> Scene:
        rows = slice(int(traffic.begin[frame]), int(traffic.begin[frame + 1]))
        names = [self.names[name] for name in traffic.name[rows]]
        lanes, numbers = traffic.lane[rows].tolist(), traffic.numbers[rows].tolist()
        ego, *others = (
            Vehicle(name, lane, *row) for name, lane, row in zip(names, lanes, numbers, strict=True)
        )
        return Scene(self.road, ego, tuple(others), int(self.target_lane[frame]))


def vehicle_rows(frames: Sequence[tuple[Vehicle, ...]], names: dict[str, int]) -> VehicleRows:
    """Return the vehicles of some frames as arrays; new names are added to `names`."""
    begin = np.cumsum([0, *map(len, frames)], dtype=np.int64)
    cars = [car for frame in frames for car in frame]
    numbers = np.array([car[2:] for car in cars], dtype=np.float64).reshape(-1, 6)
    found = np.array([names.setdefault(car.id, len(names)) for car in cars], dtype=np.int64)
    return VehicleRows(begin, found, np.array([car.lane for car in cars], dtype=np.int64), numbers)
