"""Why an action is not offered, and who is in which section, as the rules tell it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from drlsl.driving.actions import Action, action_of_atom
from drlsl.driving.shield import LIMITS, Decision, Shield
from drlsl.logic import Compound

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

    def as_json(self) -> dict[str, Any]:
        """The fields that are given."""
        fields = {
            "reason": self.reason,
            "vehicle": self.vehicle,
            "gap": self.gap,
            "needed": self.needed,
            "details": list(self.details) or None,
        }
        return {name: value for name, value in fields.items() if value is not None}


@dataclass(frozen=True, slots=True)
class BusySection:
    """The nearest vehicle of a section and the gap to it [m], as the rules measure gaps."""

    vehicle: str
    gap: float


def objections(shield: Shield, decision: Decision) -> dict[Action, list[Objection]]:
    """For every action that `decision` does not offer, what speaks against it, nearest vehicle first.

    Asks `objection(Action, Reason)` about the scene that was decided last; a program that does not define it
    gives no reasons.

    Raises:
        PrologError: the rules raised an error.
    """
    unsafe: dict[Action, list[Objection]] = {
        action: [] for action in Action if action not in decision.safe_actions
    }
    if shield.engine.defines("objection", 2):
        for solution in shield.engine.query("objection(Action, Reason)", limits=LIMITS):
            action = action_of_atom(solution["Action"])
            if action in unsafe:
                unsafe[action].append(_objection(solution["Reason"]))
    return {action: sorted(set(found), key=_urgency) for action, found in unsafe.items()}


def busy_sections(shield: Shield) -> dict[str, BusySection | None]:
    """The nearest vehicle of each section in the scene that was decided last, None where the section is free.

    Asks `busy_section(Section, Car, Gap)`; a program that does not define it has no busy section to tell.

    Raises:
        PrologError: the rules raised an error.
    """
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


def _objection(term: object) -> Objection:
    match term:
        case Compound(name="too_close", args=(car, gap, needed)):
            return Objection("too_close", str(car), _number(gap), _number(needed))
        case Compound(name=name, args=args):
            details = (value if isinstance(value, int | float) else str(value) for value in args)
            return Objection(name, details=tuple(details))
        case _:
            return Objection(str(term))


def _urgency(objection: Objection) -> tuple[float, str]:
    return (float("-inf") if objection.gap is None else objection.gap, str(objection))


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
