"""Drive many episodes with policies that look for trouble, and count what happens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.config import EnvConfig
from drlsl.driving.drivers import DrivenBy, Driver
from drlsl.driving.episodes import Ending, Episode, EpisodeRecorder, Origin
from drlsl.driving.scene import Action, Scene, SceneBatch, taken_rows
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import (
    StepResult,
    World,
    drive_decision,
    frames_per_decision,
    in_direction,
    playbacks_of,
)
from drlsl.errors import UserError
from drlsl.traffic import Floats, Recording
from drlsl.workers import Crew, Make

Actions: TypeAlias = npt.NDArray[np.int64]
Policy: TypeAlias = Callable[[World, Floats], Actions]
"""Chooses for each ego one of the offered actions, given numbers (N, 3) drawn from [0, 1)."""

BLOCK: Final = 1000
"""Episodes of a task when several workers drive."""

WORST: Final = 10
"""Contacts whose scenes are kept."""

EGOS: Final = 256
"""Episodes that run side by side."""

MARGIN_HORIZON: Final = 3.0
"""How far ahead the adversary's margin looks [s]: about as long as a lane change takes."""

_DRAWN: Final = 512
"""Steps for which an episode's numbers are drawn at once."""


def random_policy(world: World, drawn: Floats) -> Actions:
    """Return any of the offered actions, with equal probability."""
    return np.asarray(np.argmax((drawn + 1.0) * world.decisions.action_mask, axis=1))


def always_change(world: World, drawn: Floats) -> Actions:
    """Return a lane change if one is offered, to a random side."""
    weight = drawn + 1.0
    weight[:, Action.LANE_KEEPING] = 0.5
    return np.asarray(np.argmax(weight * world.decisions.action_mask, axis=1))


def adversarial(world: World, drawn: Floats) -> Actions:
    """Return the offered action with the least margin; of several, the first in the order of `Action`."""
    # Even a margin of infinity must rank above an action that is not offered.
    margin = np.minimum(margins(world.seen, world.targets()), np.finfo(np.float64).max)
    return np.asarray(np.argmin(np.where(world.decisions.action_mask, margin, np.inf), axis=1))


POLICIES: Final[dict[str, Policy]] = {
    "random": random_policy,
    "always-change": always_change,
    "adversarial": adversarial,
}


def margins(scenes: SceneBatch, targets: Floats) -> Floats:
    """Return the margin of each action [s], shape (N, 3): the least predicted time headway.

    It is taken over all vehicles in the way of an ego at `targets` (N, 3), the y [m] that each action leads
    to: the least gap within 3 s at unchanged speeds, below 0 where one passes through the other, divided by
    the speed of the rear one, at least 1 m/s. Infinite without such a vehicle, or if the action changes
    nothing.
    """
    scene, other = scenes.valid[:, 1:].nonzero()
    other += 1
    width = (scenes.width[scene, other] + scenes.width[scene, 0]) / 2
    row, action = (np.abs(scenes.y[scene, other][:, None] - targets[scene]) < width[:, None]).nonzero()
    scene, other = scene[row], other[row]
    sign = np.where(scenes.vx[scene, 0] < 0.0, -1.0, 1.0)
    ahead = sign * (scenes.x[scene, other] - scenes.x[scene, 0])
    own, speed = (np.maximum(sign * scenes.vx[scene, slot], 0.0) for slot in (0, other))
    later = ahead + (speed - own) * MARGIN_HORIZON
    length = (scenes.length[scene, other] + scenes.length[scene, 0]) / 2
    gap = np.minimum(np.abs(ahead), np.abs(later)) - length
    gap = np.where(ahead * later <= 0.0, -length, gap)
    headway = gap / np.maximum(np.where(ahead > 0.0, own, speed), 1.0)
    result = np.full(targets.shape, np.inf)
    np.minimum.at(result, (scene, action), headway)
    return result


@dataclass(frozen=True, slots=True)
class LaneChange:
    """A lane change that an ego began, and the scene in which it chose to."""

    action: Action
    scene: Scene


@dataclass(frozen=True, slots=True)
class ContactRecord:
    """A contact: its episode and policy, the verdict, the other vehicle and the scene of the contact.

    `closing_speed` [m/s]: the difference of the two speeds. `change`: the last lane change before it, if the
    ego began one since it entered the road.
    """

    episode: int
    policy: str
    verdict: str
    vehicle: int
    closing_speed: float
    scene: Scene
    change: LaneChange | None = None

    @property
    def name(self) -> str:
        """The name of the scene's file, without its suffix."""
        return f"episode-{self.episode}-{self.verdict}-v{self.vehicle}"

    def as_json(self) -> dict[str, Any]:
        """Return all fields but those that hold scenes."""
        return {
            one.name: getattr(self, one.name) for one in fields(self) if one.name not in ("scene", "change")
        }


@dataclass(slots=True)
class Counts:
    """Counts over the episodes that ended."""

    episodes: int = 0
    steps: int = 0
    distance: Fraction = Fraction(0)
    """Metres, added exactly: the sum does not depend on the order of the episodes."""
    lane_changes: int = 0
    off_road: int = 0
    fail_safe: int = 0
    contacts: Counter[str] = field(default_factory=Counter)

    @property
    def contacts_at_fault(self) -> int:
        """Contacts that are the ego's fault."""
        return self.contacts["at_fault"]

    @property
    def contacts_not_at_fault(self) -> int:
        """Contacts that one of the written rules excuses."""
        return self.contacts.total() - self.contacts_at_fault

    def add(self, other: Counts) -> None:
        """Add the counts of other episodes."""
        self.episodes += other.episodes
        self.steps += other.steps
        self.distance += other.distance
        self.lane_changes += other.lane_changes
        self.off_road += other.off_road
        self.fail_safe += other.fail_safe
        self.contacts.update(other.contacts)

    def as_json(self) -> dict[str, Any]:
        """Return the counts."""
        return {
            "episodes": self.episodes,
            "contacts_at_fault": self.contacts_at_fault,
            "contacts_not_at_fault": self.contacts_not_at_fault,
            "off_road": self.off_road,
            "fail_safe": self.fail_safe,
            "lane_changes": self.lane_changes,
            "steps": self.steps,
            "distance": float(self.distance),
            "contacts": {name: count for name, count in sorted(self.contacts.items()) if count},
        }


@dataclass(slots=True)
class StressReport:
    """The counts of each policy, and the `kept` worst contacts: at fault first, then by closing speed."""

    policies: dict[str, Counts] = field(default_factory=dict)
    worst: list[ContactRecord] = field(default_factory=list)
    kept: int = WORST

    @property
    def total(self) -> Counts:
        """The counts of all policies together."""
        total = Counts()
        for counts in self.policies.values():
            total.add(counts)
        return total

    def as_json(self) -> dict[str, Any]:
        """Return the counts of all policies, those of each, and the worst contacts."""
        return {
            **self.total.as_json(),
            "policies": {name: counts.as_json() for name, counts in self.policies.items()},
            "worst": [record.as_json() for record in self.worst],
        }

    def add_contact(self, record: ContactRecord) -> None:
        """Count a contact, and keep it if it is one of the worst."""
        self.policies[record.policy].contacts[record.verdict] += 1
        self._keep([record])

    def add(self, other: StressReport) -> None:
        """Add the report of other episodes."""
        for name, counts in other.policies.items():
            self.policies.setdefault(name, Counts()).add(counts)
        self._keep(other.worst)

    def _keep(self, records: Iterable[ContactRecord]) -> None:
        self.worst.extend(records)
        self.worst.sort(key=lambda kept: (kept.verdict != "at_fault", -kept.closing_speed, kept.episode))
        del self.worst[self.kept :]


def _policy_of(driver: Driver) -> Policy:
    """Return a driver as a policy, which draws nothing."""
    driven = DrivenBy(driver)
    return lambda world, _: driven.actions(world)


class _Draws:
    """The random numbers of the policies; each episode has a generator of its own."""

    def __init__(self, egos: int) -> None:
        self._numbers = np.zeros((egos, _DRAWN, len(Action)))
        self._next = np.zeros(egos, dtype=np.int64)
        self._rngs = [np.random.default_rng() for _ in range(egos)]

    def begin(self, ego: int, rng: np.random.Generator) -> None:
        """Begin an episode."""
        self._rngs[ego], self._next[ego] = rng, _DRAWN

    def take(self, unused: Sequence[int]) -> Floats:
        """Return the next numbers of every ego, shape (N, 3); the `unused` egos are given theirs again."""
        for ego in np.flatnonzero(self._next == _DRAWN).tolist():
            self._rngs[ego].random(out=self._numbers[ego])
            self._next[ego] = 0
        numbers = self._numbers[np.arange(len(self._next)), self._next]
        self._next += 1
        self._next[list(unused)] -= 1
        return numbers


class _Stress:
    """Episodes side by side in one world; an ego whose episode is over takes the next one."""

    def __init__(
        self,
        world: World,
        policies: Mapping[str, Policy],
        seeds: Iterable[tuple[int, np.random.SeedSequence]],
        recorder: EpisodeRecorder | None = None,
        *,
        kept: int = WORST,
    ) -> None:
        """Take the episodes of `seeds`, by number; a `recorder` must not see an ego take a second one."""
        self._world = world
        self._choose = [*policies.values()]
        self._policies = [*policies]
        self._frames = frames_per_decision(world.config.decision_period, world.playbacks)
        self._seeds = iter(seeds)
        self._recorder = recorder
        self._draws = _Draws(world.count)
        self._episode = np.full(world.count, -1)
        self._policy = np.zeros(world.count, dtype=np.int64)
        self._begun: dict[int, tuple[SceneBatch, int, int]] = {}  # by ego: scenes, its row, and the action
        self.report = StressReport({name: Counts() for name in policies}, kept=kept)

    def run(self) -> Iterator[StressReport]:
        """Drive all episodes; yield the report each time some end."""
        first = self._begin(range(self._world.count))
        self._world.reset(list(first), list(first.values()))
        if self._recorder is not None:
            self._recorder.begin(dict(enumerate(self._episode.tolist())))
        # An ego whose episode is over begins the next one in the following step.
        restarts: dict[int, np.random.Generator] = {}
        while (self._episode >= 0).any():
            actions, watch, seen = self._actions([*restarts]), None, self._world.seen
            if self._recorder is not None:
                self._recorder.choose(actions, np.full((len(actions), len(Action)), np.nan))
                watch = self._recorder.watch
            result = drive_decision(self._world, actions, restarts, frames=self._frames, watch=watch)
            running = self._episode >= 0
            running[list(restarts)] = False
            ended = np.flatnonzero(running & (result.terminated | result.truncated)).tolist()
            self._remember(seen, actions, result)
            self._count(result, running, ended)
            restarts = self._begin(ended)
            if ended:
                yield self.report

    def _begin(self, egos: Sequence[int]) -> dict[int, np.random.Generator]:
        """Return the generators of the next episodes, one for each of `egos` while there are any."""
        started = {}
        for ego in egos:
            self._episode[ego] = -1
            self._begun.pop(ego, None)
            for episode, seed in self._seeds:
                own, drawn = seed.spawn(2)
                self._episode[ego], self._policy[ego] = episode, episode % len(self._policies)
                self._draws.begin(ego, np.random.default_rng(drawn))
                started[ego] = np.random.default_rng(own)
                break
        return started

    def _actions(self, beginning: Sequence[int]) -> Actions:
        """Return the choices of each episode's policy; the egos `beginning` one do not act in this step."""
        drawn = self._draws.take(beginning)
        actions = np.zeros(self._world.count, dtype=np.int64)
        for number, choose in enumerate(self._choose):
            mine = self._policy == number
            if mine.any():
                actions = np.where(mine, choose(self._world, drawn), actions)
        return actions

    def _remember(self, seen: SceneBatch, actions: Actions, result: StepResult) -> None:
        """Remember the lane changes that a step began in the scenes `seen`."""
        began = result.changed.nonzero()[0]
        if began.size:
            scenes = taken_rows(seen, began)
            for row, ego in enumerate(began.tolist()):
                self._begun[ego] = scenes, row, int(actions[ego])

    def _last_change(self, ego: int) -> LaneChange | None:
        """Return the last lane change of an ego's episode."""
        if ego not in self._begun:
            return None
        scenes, row, action = self._begun[ego]
        return LaneChange(Action(action), scenes.scene(row))

    def _count(self, result: StepResult, running: npt.NDArray[np.bool_], ended: Sequence[int]) -> None:
        """Add a step of the `running` egos, of which some `ended` their episode, to the report."""
        for number, name in enumerate(self._policies):
            mine, counts = running & (self._policy == number), self.report.policies[name]
            counts.steps += int(mine.sum())
            counts.lane_changes += int((result.changed & mine).sum())
            counts.fail_safe += sum(bool(mine[ego]) for ego in result.failures)
        for ego in ended:
            policy = self._policies[self._policy[ego]]
            counts = self.report.policies[policy]
            counts.episodes += 1
            counts.distance += Fraction(float(result.distance[ego]))
            counts.off_road += bool(result.off_road[ego])
            contact = result.contacts.get(ego)
            if contact is not None:
                self.report.add_contact(
                    ContactRecord(
                        int(self._episode[ego]),
                        policy,
                        contact.verdict.value,
                        contact.vehicle,
                        contact.closing_speed,
                        result.scenes.scene(ego),
                        self._last_change(ego),
                    )
                )


def stress(
    config: EnvConfig,
    recordings: Sequence[Recording],
    shield: Shield,
    policies: Sequence[str],
    *,
    episodes: int,
    seed: int,
    first: int = 0,
    egos: int = EGOS,
    drivers: Mapping[str, Driver] | None = None,
    kept: int = WORST,
) -> Iterator[StressReport]:
    """Run `episodes` episodes, from number `first` on; yield the report, the same object, when some end.

    `policies`, names of `POLICIES`, and `drivers`, by names of their own, take turns. Episode i is a function
    of (`seed`, i) and of its policy; `World` says which parts of `config` matter. The report keeps the worst
    `kept` contacts.
    """
    world = _world(config, recordings, shield, min(egos, episodes))
    turns = _taking_turns(policies, drivers)
    yield from _Stress(world, turns, _seeds(seed, range(first, first + episodes)), None, kept=kept).run()


def spread_stress(
    crew: Crew, make: Make, episodes: int, *, kept: int = WORST, files: Sequence[Path] = ()
) -> Iterator[StressReport]:
    """Have a crew run episodes in blocks of `BLOCK`; yield the report, the same object, when a block ends.

    `make` makes the function that runs a range of episodes, for example by `stress`, and returns the report;
    it depends on `files`. The final report depends on neither the crew nor the order in which blocks end.

    Raises:
        UserError: as `Crew.perform`; or what the function raises.
    """
    blocks = [range(first, min(first + BLOCK, episodes)) for first in range(0, episodes, BLOCK)]
    few = replace(crew, jobs=min(crew.jobs, len(blocks)))
    report = StressReport(kept=kept)
    for _, part in few.perform(make, blocks, files=files):
        report.add(part)
        yield report


def record(
    config: EnvConfig,
    recordings: Sequence[Recording],
    shield: Shield,
    policies: Sequence[str],
    contacts: Sequence[ContactRecord],
    *,
    seed: int,
    drivers: Mapping[str, Driver] | None = None,
) -> list[Episode]:
    """Drive the episodes of some contacts of `stress` again, with its arguments, and return what happened.

    Raises:
        UserError: an episode went otherwise, since a driver depends on more than what it sees.
    """
    found: dict[int, Episode] = {}
    turns = _taking_turns(policies, drivers)
    for contact in contacts:
        world = _world(config, recordings, shield, 1)
        origin = Origin.of(
            config, shield, contact.policy, "preferences", enforced=config.offers != "all", seed=seed
        )
        recorder = EpisodeRecorder(world, origin, lambda one: found.update({one.origin.number: one}))
        for _ in _Stress(world, turns, _seeds(seed, [contact.episode]), recorder).run():
            pass
        expected = Ending("contact", contact.verdict, f"v{contact.vehicle}", contact.closing_speed)
        if found[contact.episode].ending != expected:
            raise UserError(
                f"episode {contact.episode} of {contact.policy} went otherwise when it was driven again: "
                f"{found[contact.episode].ending.words()}; its driver depends on more than what it sees"
            )
    return [found[contact.episode] for contact in contacts]


def _world(config: EnvConfig, recordings: Sequence[Recording], shield: Shield, egos: int) -> World:
    playbacks = in_direction(
        playbacks_of(recordings, config.radar_range, config.lane_limits, config.entry), config
    )
    return World(config, [playbacks] * egos, shield)


def _taking_turns(policies: Sequence[str], drivers: Mapping[str, Driver] | None) -> dict[str, Policy]:
    turns: dict[str, Policy] = {name: POLICIES[name] for name in policies}
    return turns | {name: _policy_of(driver) for name, driver in (drivers or {}).items()}


def _seeds(seed: int, episodes: Iterable[int]) -> Iterator[tuple[int, np.random.SeedSequence]]:
    """Yield the numbers of episodes, each with its seed, which `SeedSequence.spawn` would give it."""
    for episode in episodes:
        yield episode, np.random.SeedSequence(seed, spawn_key=(episode,))
