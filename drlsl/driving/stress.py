"""Drive many episodes with a policy that looks for trouble, and count what happens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.actions import Action
from drlsl.driving.batch import Decisions
from drlsl.driving.config import EnvConfig
from drlsl.driving.playback import in_direction, playbacks_of
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from drlsl.driving.world import StepResult, World
from drlsl.traffic.recording import Recording

Actions: TypeAlias = npt.NDArray[np.int64]
Policy: TypeAlias = Callable[[Decisions, np.random.Generator], Actions]

WORST: Final = 10
"""Contacts whose scenes are kept."""

EGOS: Final = 64
"""Episodes that run side by side."""


def random_policy(decisions: Decisions, rng: np.random.Generator) -> Actions:
    """Any of the offered actions, each as likely; shape (N,)."""
    return np.asarray(np.argmax(rng.random(decisions.action_mask.shape) * decisions.action_mask, axis=1))


def always_change(decisions: Decisions, rng: np.random.Generator) -> Actions:
    """A lane change whenever one is offered, to a random side; shape (N,)."""
    weight = rng.random(decisions.action_mask.shape)
    weight[:, Action.LANE_KEEPING] *= 1e-9
    return np.asarray(np.argmax(weight * decisions.action_mask, axis=1))


POLICIES: Final[dict[str, Policy]] = {"random": random_policy, "always-change": always_change}


@dataclass(frozen=True, slots=True)
class ContactRecord:
    """A contact: the episode, the verdict, the other vehicle and the scene in which they touch."""

    episode: int
    verdict: str
    vehicle: int
    scene: Scene


@dataclass(slots=True)
class StressReport:
    """What happened in the episodes that ended."""

    episodes: int = 0
    steps: int = 0
    distance: float = 0.0
    lane_changes: int = 0
    off_road: int = 0
    fail_safe: int = 0
    contacts: Counter[str] = field(default_factory=Counter)
    worst: list[ContactRecord] = field(default_factory=list)

    @property
    def contacts_at_fault(self) -> int:
        """Contacts that are the ego's fault."""
        return self.contacts["at_fault"]

    @property
    def contacts_not_at_fault(self) -> int:
        """Contacts that one of the written rules excuses."""
        return self.contacts.total() - self.contacts_at_fault

    def as_json(self) -> dict[str, Any]:
        """The counts."""
        return {
            "episodes": self.episodes,
            "contacts_at_fault": self.contacts_at_fault,
            "contacts_not_at_fault": self.contacts_not_at_fault,
            "off_road": self.off_road,
            "fail_safe": self.fail_safe,
            "lane_changes": self.lane_changes,
            "steps": self.steps,
            "distance": self.distance,
            "contacts": dict(self.contacts),
        }


def stress(
    config: EnvConfig,
    recordings: Sequence[Recording],
    shield: Shield,
    policy: Policy,
    *,
    episodes: int,
    seed: int,
    egos: int = EGOS,
) -> Iterator[StressReport]:
    """Run `episodes` episodes under the shield; yields the report, ever the same object, each time one ends.

    Episode number i is a function of (`seed`, i) and of the policy's own draws.
    """
    report = StressReport()
    playbacks = in_direction(playbacks_of(recordings, config.radar_range), config)
    world = World(config, [playbacks] * min(egos, episodes), shield)
    seeds = iter(np.random.SeedSequence(seed).spawn(episodes))
    policy_rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))
    running = {ego: ego for ego in range(world.count)}
    started = world.count
    world.reset(list(running), [np.random.default_rng(next(seeds)) for _ in running])
    while running:
        result = world.step(policy(world.decisions, policy_rng))
        active = list(running)
        report.steps += len(active)
        report.lane_changes += int(result.changed[active].sum())
        report.fail_safe += sum(ego in running for ego in result.decisions.failures)
        ended = [ego for ego in active if result.terminated[ego] or result.truncated[ego]]
        for ego in ended:
            _count(report, running.pop(ego), ego, result)
        fresh = ended[: episodes - started]
        for ego in fresh:
            running[ego], started = started, started + 1
        if fresh:
            world.reset(fresh, [np.random.default_rng(next(seeds)) for _ in fresh])
        if ended:
            yield report


def _count(report: StressReport, episode: int, ego: int, result: StepResult) -> None:
    """Add an episode that ended to the report."""
    report.episodes += 1
    report.distance += float(result.distance[ego])
    report.off_road += bool(result.off_road[ego])
    contact = result.contacts.get(ego)
    if contact is not None:
        report.contacts[contact.verdict.value] += 1
        record = ContactRecord(episode, contact.verdict.value, contact.vehicle, result.scenes.scene(ego))
        report.worst.append(record)
        report.worst.sort(key=lambda kept: kept.verdict != "at_fault")
        del report.worst[WORST:]
