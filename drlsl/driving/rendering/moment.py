"""One moment of a drive, as it is shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drlsl.driving.explain import Objection, objections_to
from drlsl.driving.scene import Action, Scene
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import StepResult, World
from drlsl.logic import PrologError


@dataclass(frozen=True, slots=True)
class Moment:
    """The traffic, what the ego is offered, and what speaks against the rest.

    `scene` holds all traffic, in radar range or not; `target_speed` [m/s]; `distance` driven [m], if known;
    `alarm`: a contact, or the reason why the fail-safe drives.
    """

    scene: Scene
    offered: tuple[Action, ...]
    unsafe: Mapping[Action, Sequence[Objection]] = field(default_factory=dict)
    target_speed: float | None = None
    distance: float | None = None
    alarm: str = ""


def moment_of_scene(shield: Shield, scene: Scene) -> Moment:
    """Return the moment of a scene, as the rules decide it.

    Raises:
        RuleFailure, PrologError: the rules raised an error, or gave no usable answer.
        UserError: the rules know an action that the agent does not.
    """
    with shield.lock:
        decision = shield.decide(scene)
        shield.state_facts(scene)
        unsafe = objections_to(shield, set(Action) - set(decision.safe_actions))
    return Moment(scene, tuple(sorted(decision.safe_actions)), unsafe, decision.target_speed)


def moment_of_world(world: World, ego: int = 0, *, alarm: str = "") -> Moment:
    """Return the moment that an ego of a world is in; the `alarm`, if any, goes before that of the rules."""
    decisions = world.decisions
    offered = tuple(action for action in Action if decisions.action_mask[ego, action])
    failure = decisions.failures.get(ego, "")
    refused = set(Action) - set(offered)
    return Moment(
        scene=world.traffic_around(ego),
        offered=offered,
        unsafe=_reasons(world.shield, world.scene(ego), refused) if refused and not failure else {},
        target_speed=float(decisions.target_speed[ego]),
        distance=float(world.distance[ego]),
        alarm=alarm or (failure and f"fail-safe: {failure}"),
    )


def alarm_of(result: StepResult | None, ego: int) -> str:
    """Return in words how a step ended an ego, by a contact or off the road; empty if it did not."""
    if result is None:
        return ""
    if ego in result.contacts:
        contact = result.contacts[ego]
        return (
            "contact, at fault" if contact.at_fault else f"contact: {contact.verdict.value.replace('_', ' ')}"
        )
    return "off the road" if result.off_road[ego] else ""


def _reasons(shield: Shield, scene: Scene, refused: set[Action]) -> Mapping[Action, Sequence[Objection]]:
    """Return the rules' reasons against actions; what they cannot say within their limits is not shown."""
    with shield.lock:
        shield.state_facts(scene)
        try:
            return objections_to(shield, refused)
        except PrologError as error:
            return {action: [Objection(f"no reason: {error}")] for action in refused}
