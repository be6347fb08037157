"""A rule program as a module of JavaScript."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from drlsl.driving.export.rule_program import RuleProgram
from drlsl.driving.export.stored import StoredDecision
from drlsl.driving.export.templates_text import filled
from drlsl.driving.scene import EGO_LIMITS, Action, scene_defaults, scene_json
from drlsl.driving.shield import COMFORT, LANE
from drlsl.lowering.backends import js_source, js_support
from drlsl.lowering.frontend import Lowered

ULPS: Final = 8
"""How far numbers may be off where exp, sin and the like are called on the way."""


def js_files(program: RuleProgram, stored: Sequence[StoredDecision]) -> dict[str, str]:
    """Return the module `rules.mjs`, its check and the stored decisions, by name.

    Raises:
        NotLowerable: the program cannot be lowered, or calls a function that JavaScript lacks.
    """
    lowered = _lowered(program)
    check = filled(
        "check.mjs",
        HEAD=program.head("//"),
        COUNT=str(len(stored)),
        ULPS="0" if all(map(program.is_exact, lowered.values())) else str(ULPS),
    )
    decisions = [{"scene": json.loads(scene_json(one.scene)), "decision": one.as_json()} for one in stored]
    lines = ",\n".join(json.dumps(one, separators=(",", ":"), allow_nan=False) for one in decisions)
    return {
        "rules.mjs": _module(program, lowered),
        "check.mjs": check,
        "decisions.json": f"[\n{lines}\n]\n",
    }


def js_page_module(program: RuleProgram) -> str:
    """Return `rules.mjs` with a function more: `decide_with_clauses(scene)`, for a page that explains.

    Raises:
        NotLowerable: see `js_files`.
    """
    lowered = _lowered(program)
    if not program.has_reasons:
        return _module(program, lowered, filled("clauses.mjs") + "function answer_clauses() { return []; }\n")
    return _module(program, lowered | {"answer_clauses": program.clause_reasons()}, filled("clauses.mjs"))


def _lowered(program: RuleProgram) -> dict[str, Lowered]:
    """Return what is asked of a program, by the name of the function that answers it."""
    reasons = {"answer_reasons": program.reasons()} if program.has_reasons else {}
    return {"answer_decision": program.decision(ordered=True), **reasons}


def _module(program: RuleProgram, lowered: Mapping[str, Lowered], more: str = "") -> str:
    texts = [js_source(one, name) for name, one in lowered.items()]
    space, defaults = program.shield.observation, scene_defaults()
    module = filled(
        "rules.mjs",
        HEAD=program.head("//"),
        FILES=_json(program.files),
        ACTIONS=_json([action.atom for action in Action]),
        NAMES=_json(space.names),
        BOUNDS=_json([list(bounds) for bounds in zip(space.low, space.high, strict=True)]),
        LIMITS=_json(EGO_LIMITS),
        TIME_STEP=_json(defaults["time_step_s"]),
        RADAR_RANGE=_json(defaults["radar_range_m"]),
        BOX=_json({name: defaults[name] for name in ("vy_mps", "length_m", "width_m")}),
        HAS_LANE=_json(program.defines(LANE)),
        HAS_COMFORT=_json(program.defines(COMFORT)),
        HAS_REASONS=_json(program.has_reasons),
        SUPPORT=js_support(texts),
        PROGRAM="\n".join(texts),
    )
    return module + more


def _json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)
