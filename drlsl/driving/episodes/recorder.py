"""Record episodes while they are driven."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from drlsl.driving.episodes.driven_episode import NO_DECISION, Answers, Ending, Episode, Origin, vehicle_rows
from drlsl.driving.explain import Objection, Reason, ReasonClauses
from drlsl.driving.scene import Action, Scene
from drlsl.driving.shield import Decision, RuleFailure, Shield
from drlsl.driving.simulation import StepResult, World
from drlsl.logic import PrologError
from drlsl.traffic import Integers


class ReasonFinder:
    """Finds what the rules say against the actions that are not offered, or why they cannot say it."""

    def __init__(self, shield: Shield) -> None:
        self.clauses = ReasonClauses(shield)

    def reasons(self, scene: Scene, offered: Sequence[Action]) -> tuple[Reason, ...]:
        """Return the reasons against all actions but those `offered`."""
        refused = [action for action in Action if action not in offered]
        if not refused:
            return ()
        try:
            return tuple(self.clauses.reasons(scene, refused))
        except (PrologError, RuleFailure) as error:
            problem = Objection(f"no reason: {error}")
            return tuple(Reason(action, problem, None) for action in refused)


@dataclass(slots=True)
class _Frame:
    """One frame of an episode that is being driven."""

    scene: Scene
    seen: Scene | None
    decision: Decision
    reasons: tuple[Reason, ...]
    failure: str
    distance: float
    entered: bool
    action: int = NO_DECISION
    preferences: tuple[float, ...] = (float("nan"),) * len(Action)
    changed: bool = False


@dataclass(slots=True)
class _Record:
    origin: Origin
    frames: list[_Frame] = field(default_factory=list)


class EpisodeRecorder:
    """Records the episodes of some egos of a world; each is handed on when it ends."""

    def __init__(self, world: World, origin: Origin, save: Callable[[Episode], None]) -> None:
        """Record in `world`; `origin` is that of every episode, but for its number.

        `save` is called with each episode that has ended.
        """
        self._world = world
        self._origin = origin
        self._save = save
        self._finder = ReasonFinder(world.shield)
        self._records: dict[int, _Record] = {}

    def begin(self, numbers: Mapping[int, int]) -> None:
        """Begin the episodes of these numbers, by ego; the world has just reset these egos."""
        for ego, number in numbers.items():
            record = self._records[ego] = _Record(replace(self._origin, number=number))
            record.frames.append(self._frame(ego, entered=False))

    def choose(self, actions: Integers, preferences: npt.NDArray[np.floating[Any]]) -> None:
        """Take the actions (N,) that are driven next, and how much each was wanted (N, A)."""
        for ego, record in self._records.items():
            record.frames[-1].action = int(actions[ego])
            record.frames[-1].preferences = tuple(map(float, preferences[ego]))

    def watch(self, result: StepResult) -> None:
        """Take the result of a frame."""
        for ego, record in [*self._records.items()]:
            record.frames[-1].changed = bool(result.changed[ego])
            record.frames.append(self._frame(ego, entered=bool(result.entered[ego])))
            if result.terminated[ego] or result.truncated[ego]:
                del self._records[ego]
                self._save(
                    episode_of(
                        record.origin, _ending(result, ego), self._world.shield, self._finder, record.frames
                    )
                )

    def _frame(self, ego: int, *, entered: bool) -> _Frame:
        world = self._world
        decision, seen = world.decisions.one(ego), world.scene(ego)
        failure = world.decisions.failures.get(ego, "")
        # Where everything is offered one wants to know what the rules would have refused.
        offered = () if world.config.offers == "all" else decision.safe_actions
        return _Frame(
            scene=world.traffic_around(ego),
            seen=seen if world.config.sensing.faulty else None,
            decision=decision,
            reasons=() if failure else self._finder.reasons(seen, offered),
            failure=failure,
            distance=float(world.distance[ego]),
            entered=entered,
        )


def _ending(result: StepResult, ego: int) -> Ending:
    contact = result.contacts.get(ego)
    if contact is not None:
        return Ending("contact", contact.verdict.value, f"v{contact.vehicle}", contact.closing_speed)
    return Ending("off_road" if result.off_road[ego] else "completed")


def episode_of(
    origin: Origin, ending: Ending, shield: Shield, finder: ReasonFinder, frames: Sequence[_Frame]
) -> Episode:
    """Return the frames of one road as an episode."""
    names: dict[str, int] = {}
    decisions = [frame.decision for frame in frames]

    def column(values: Any, kind: type) -> Any:
        return np.array(list(values), dtype=kind)

    traffic = vehicle_rows([(one.scene.ego, *one.scene.vehicles) for one in frames], names)
    seen = [(one.seen.ego, *one.seen.vehicles) for one in frames if one.seen is not None]
    seen_rows = vehicle_rows(seen, names) if seen else None
    return Episode(
        origin=origin,
        ending=ending,
        road=frames[0].scene.road,
        observation=shield.observation,
        clauses=finder.clauses.texts,
        names=tuple(names),
        traffic=traffic,
        seen=seen_rows,
        target_lane=column((one.scene.target_lane for one in frames), np.int64),
        distance=column((one.distance for one in frames), np.float64),
        answers=Answers(
            offered=column((one.action_mask for one in decisions), np.bool_),
            target_speed=column((one.target_speed for one in decisions), np.float64),
            observation=column((one.observation for one in decisions), np.float64),
            front_is_free=column((one.front_is_free for one in decisions), np.bool_),
            lane_to_keep=column((one.lane_to_keep for one in decisions), np.int64),
            comfortable_acceleration=column((one.comfortable_acceleration for one in decisions), np.float64),
        ),
        action=column((one.action for one in frames), np.int64),
        preferences=column((one.preferences for one in frames), np.float64),
        changed=column((one.changed for one in frames), np.bool_),
        entered=column((one.entered for one in frames), np.bool_),
        reasons=tuple(one.reasons for one in frames),
        failures={number: one.failure for number, one in enumerate(frames) if one.failure},
    )


def episode_of_scene(shield: Shield, scene: Scene, origin: Origin) -> Episode:
    """Return a scene as an episode of one frame, as the rules decide it.

    Raises:
        RuleFailure, PrologError: the rules raised an error, or gave no usable answer.
        UserError: the rules know an action that the agent does not.
    """
    finder = ReasonFinder(shield)
    decision = shield.decide(scene)
    reasons = finder.reasons(scene, decision.safe_actions)
    frame = _Frame(scene, None, decision, reasons, "", 0.0, entered=False)
    return episode_of(origin, Ending("scene"), shield, finder, [frame])
