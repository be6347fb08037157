"""The reasons against actions, and the nearest vehicle of each section, from the rules."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

from drlsl.driving.scene import Action, Scene, action_of_atom
from drlsl.driving.shield import LIMITS, Decision, Shield
from drlsl.errors import UserError
from drlsl.files import printable
from drlsl.logic import Compound

_LOG: Final = logging.getLogger(__name__)

SECTIONS: Final = ("front", "front_right", "right", "back_right", "back", "back_left", "left", "front_left")
"""The sections around the ego, clockwise. Source: paper, SLP for AD."""


@dataclass(frozen=True, slots=True)
class Objection:
    """One reason against an action, with `vehicle`, `gap` and `needed` [m] where a vehicle is too close.

    `details` are the arguments of any other reason that a program gives.
    """

    reason: str
    vehicle: str | None = None
    gap: float | None = None
    needed: float | None = None
    details: tuple[str | float, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The vehicle that is too close, or the details that are names: of vehicles among others."""
        named = tuple(detail for detail in self.details if isinstance(detail, str))
        return named if self.vehicle is None else (self.vehicle, *named)

    @property
    def missing(self) -> float | None:
        """The missing length of the gap [m]."""
        return None if self.gap is None or self.needed is None else self.needed - self.gap

    def as_json(self) -> dict[str, Any]:
        """Return the fields that are set."""
        fields = {
            "reason": self.reason,
            "vehicle": self.vehicle,
            "gap": self.gap,
            "needed": self.needed,
            "missing": self.missing,
            "details": list(self.details) or None,
        }
        return {name: value for name, value in fields.items() if value is not None}

    def words(self) -> str:
        """Return the reason in words."""
        if self.gap is None or self.needed is None or self.missing is None:
            details = [
                printable(detail) if isinstance(detail, str) else f"{detail:.4g}" for detail in self.details
            ]
            reason = printable(self.reason).replace("_", " ")
            return f"{reason}: {', '.join(details)}" if details else reason
        place = "alongside" if self.gap <= 0 else f"{self.gap:.1f} m away"
        missing = f"{self.needed:.1f} m needed: {self.missing:.1f} m missing"
        return printable(f"{self.vehicle} is {place}, {missing}")


@dataclass(frozen=True, slots=True)
class BusySection:
    """The nearest vehicle of a section and the gap to it [m], as the rules measure gaps."""

    vehicle: str
    gap: float


@dataclass(frozen=True, slots=True)
class SpeedReason:
    """The vehicle that determines the target speed, and the target speed `without` it [m/s]."""

    vehicle: str
    without: float

    def words(self) -> str:
        """Return the reason in words."""
        return f"{printable(self.vehicle)} decides it; without it {self.without:.2f} m/s"


def objections(shield: Shield, scene: Scene, decision: Decision) -> dict[Action, list[Objection]]:
    """Return the objections to every action that `decision` does not offer in `scene`: see `objections_to`.

    An objection to an action that is offered all the same is logged as a warning.

    Raises:
        RuleFailure, PrologError, UserError: see `Shield.state_facts` and `objections_to`.
    """
    shield.state_facts(scene)
    found = objections_to(shield, Action)
    for action in decision.safe_actions:
        for objection in found.pop(action):
            _LOG.warning("the rules offer %s in spite of an objection: %s", action.atom, objection.words())
    return found


def objections_to(shield: Shield, actions: Iterable[Action]) -> dict[Action, list[Objection]]:
    """Return the objections to each of some actions, nearest vehicle first.

    Queries `objection(Action, Reason)` in the scene of the engine's current facts; a program that does not
    define it gives no reasons.

    Raises:
        PrologError: the rules raised an error.
        UserError: an objection is to an action that the agent does not know, or its reason has no name.
    """
    unsafe: dict[Action, list[Objection]] = {action: [] for action in actions}
    if shield.engine.defines("objection", 2):
        for solution in shield.engine.query("objection(Action, Reason)", limits=LIMITS):
            action = action_of_atom(solution["Action"])
            if action in unsafe:
                unsafe[action].append(objection_of(action, solution["Reason"]))
    return {action: sorted(set(found), key=_urgency) for action, found in unsafe.items()}


def busy_sections(shield: Shield, scene: Scene) -> dict[str, BusySection | None]:
    """Return the nearest vehicle of each section in `scene`, None for a free section.

    Queries `busy_section(Section, Car, Gap)`; a program that does not define it has no busy section.

    Raises:
        RuleFailure: see `Shield.state_facts`.
        PrologError: the rules raised an error.
    """
    shield.state_facts(scene)
    nearest: dict[str, BusySection | None] = dict.fromkeys(SECTIONS)
    if shield.engine.defines("busy_section", 3):
        for solution in shield.engine.query("busy_section(Section, Car, Gap)", limits=LIMITS):
            section, found = (
                str(solution["Section"]),
                BusySection(str(solution["Car"]), _number(solution["Gap"])),
            )
            known = nearest.get(section)
            if known is None or found.gap < known.gap:
                nearest[section] = found
    return nearest


def speed_reason(shield: Shield, scene: Scene, target_speed: float) -> SpeedReason | None:
    """Return the vehicle with the greatest effect on `target_speed` [m/s]; None if no single one has any.

    The rules are queried again without each vehicle in turn; then the facts of `scene` are restored.

    Raises:
        RuleFailure, PrologError: the rules raised an error.
    """
    reasons = []
    for car in scene.in_range():
        others = tuple(other for other in scene.vehicles if other is not car)
        shield.state_facts(replace(scene, vehicles=others))
        found = shield.engine.once("longitudinal_velocity(Speed)", limits=LIMITS)
        speed = math.nan if found is None else _number(found["Speed"])
        if math.isfinite(speed) and speed != target_speed:
            reasons.append(SpeedReason(car.id, speed))
    shield.state_facts(scene)
    return max(reasons, key=lambda reason: abs(reason.without - target_speed), default=None)


def objection_of(action: Action, term: object) -> Objection:
    """Return the objection that a reason of the rules stands for.

    Raises:
        UserError: the reason has no name.
    """
    match term:
        case Compound(name="too_close", args=(str(car), int() | float() as gap, int() | float() as needed)):
            return Objection("too_close", car, float(gap), float(needed))
        case Compound(name=name, args=args):
            details = (value if isinstance(value, int | float) else str(value) for value in args)
            return Objection(name, details=tuple(details))
        case str(name):
            return Objection(name)
        case _:
            raise UserError(
                f"the rules give {term} as a reason against {action.atom}; expected a name, such as no_lane, "
                "or a name with details, such as too_close(Car, Gap, Needed)"
            )


def _urgency(objection: Objection) -> tuple[float, str, str, float, tuple[tuple[float, str], ...]]:
    details = tuple((math.inf, one) if isinstance(one, str) else (one, "") for one in objection.details)
    gap = -math.inf if objection.gap is None else objection.gap
    return gap, objection.reason, objection.vehicle or "", objection.needed or 0.0, details


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
