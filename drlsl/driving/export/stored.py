"""Decisions of the interpreter about scenes, for an exported program to be checked against."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from drlsl.driving.explain import Objection, objections
from drlsl.driving.export.rule_program import RuleProgram
from drlsl.driving.scene import Action, Scene
from drlsl.driving.shield import NO_WISH, Decision, RuleFailure
from drlsl.logic import LimitExceeded, PrologError


@dataclass(frozen=True, slots=True)
class StoredDecision:
    """A scene, the decision about it, None where the rules fail, and what speaks against other actions."""

    scene: Scene
    decision: Decision | None
    unsafe: dict[Action, list[Objection]]

    def as_json(self) -> dict[str, Any]:
        """Return the decision in the form of the exported module."""
        decision = self.decision
        if decision is None:
            return {"failed": True}
        wanted = decision.comfortable_acceleration
        return {
            "safe_actions": [action.atom for action in decision.safe_actions],
            "unsafe_actions": {
                action.atom: [one.as_json() for one in found] for action, found in self.unsafe.items()
            },
            "target_speed": decision.target_speed,
            "comfortable_acceleration": None if wanted == NO_WISH else wanted,
            "observation": list(decision.observation),
            "front_is_free": decision.front_is_free,
            "lane_to_keep": decision.lane_to_keep,
        }


def decide_all(program: RuleProgram, scenes: Iterable[Scene]) -> list[StoredDecision]:
    """Return the interpreter's decision about each scene."""
    return [_decide(program, scene) for scene in scenes]


def _decide(program: RuleProgram, scene: Scene) -> StoredDecision:
    try:
        decision = program.shield.decide(scene)
        return StoredDecision(scene, decision, objections(program.shield, scene, decision))
    except (RuleFailure, PrologError, LimitExceeded):
        return StoredDecision(scene, None, {})
