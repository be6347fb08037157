"""`drlsl query`: what is safe in a scene, and why."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from drlsl.driving.reasons import BusySection, Objection
    from drlsl.driving.scene import Scene
    from drlsl.driving.shield import Decision, Shield


def query(
    state: Annotated[
        Path, typer.Option("--state", metavar="FILE", help="The scene, as JSON; docs/scene.md describes it.")
    ],
    rules: Annotated[
        list[Path] | None,
        typer.Option(
            "--rules", metavar="FILE", help="A rule file instead of highway.pl; give it again for more."
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option("--goal", metavar="GOAL", help="Run this goal in the scene and print its solutions."),
    ] = None,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Print the proof of every safe action, and why the others have none."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print which actions are safe in a scene, what speaks against the others, and the target speed."""
    from drlsl.driving.scene_file import load_scene
    from drlsl.driving.shield import Shield

    scene = load_scene(state)
    shield = Shield.from_files(rules or ())
    if goal is not None:
        shield.state_facts(scene)
        _print_solutions(shield, goal, as_json=as_json)
    elif explain:
        shield.state_facts(scene)
        _print_explanations(shield, as_json=as_json)
    else:
        _print_decision(shield, scene, as_json=as_json)


def _print_solutions(shield: Shield, goal: str, *, as_json: bool) -> None:
    from drlsl.driving.shield import LIMITS
    from drlsl.errors import UserError
    from drlsl.logic import LimitExceeded

    try:
        solutions = list(shield.engine.query(goal, limits=LIMITS))
    except LimitExceeded as error:
        raise UserError(f"gave up on {goal}: it went beyond {LIMITS.inferences:,} inferences") from error
    if as_json:
        rows = [{name: _plain(value) for name, value in solution.items()} for solution in solutions]
        print(json.dumps({"goal": goal, "solutions": rows}, indent=2))
    elif not solutions:
        print("false.")
    for solution in solutions if not as_json else ():
        print(
            ", ".join(f"{name} = {shield.engine.format(value)}" for name, value in solution.items())
            or "true."
        )


def _print_explanations(shield: Shield, *, as_json: bool) -> None:
    from drlsl.driving.actions import ATOMS
    from drlsl.driving.shield import LIMITS

    found = {atom: shield.engine.explain(f"safe_actions({atom})", limits=LIMITS) for atom in ATOMS}
    if as_json:
        print(json.dumps({atom: explanation.to_dict() for atom, explanation in found.items()}, indent=2))
    else:
        print("\n\n".join(explanation.text() for explanation in found.values()))


def _plain(value: object) -> Any:
    """A value of a solution as JSON has it; terms that JSON lacks become text."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value if isinstance(value, str | int | float) else str(value)


def _print_decision(shield: Shield, scene: Scene, *, as_json: bool) -> None:
    from drlsl.driving.reasons import busy_sections, objections
    from drlsl.driving.shield import RuleFailure
    from drlsl.errors import UserError

    try:
        decision = shield.decide(scene)
    except RuleFailure as failure:
        raise UserError(f"{failure}; on the road the ego would keep its lane and brake") from failure
    unsafe, sections = objections(shield, decision), busy_sections(shield)
    if as_json:
        print(
            json.dumps(
                {
                    "safe_actions": [action.atom for action in decision.safe_actions],
                    "unsafe_actions": {
                        action.atom: [objection.as_json() for objection in found]
                        for action, found in unsafe.items()
                    },
                    "target_speed": decision.target_speed,
                    "observation": list(decision.observation),
                    "sections": {
                        name: {"vehicle": busy.vehicle, "gap": busy.gap} if busy else None
                        for name, busy in sections.items()
                    },
                },
                indent=2,
            )
        )
    else:
        print("\n".join(_report(scene, decision, unsafe, sections)))


def _report(
    scene: Scene,
    decision: Decision,
    unsafe: dict[Any, list[Objection]],
    sections: dict[str, BusySection | None],
) -> Iterator[str]:
    """The lines that a person reads."""
    ego = scene.ego
    seen = len(scene.in_range())
    yield f"ego in lane {ego.lane} at {abs(ego.vx):.1f} m/s, {seen} vehicle{'s' * (seen != 1)} in range"
    yield ""
    yield "safe"
    yield from (f"  {action.atom}" for action in decision.safe_actions)
    if unsafe:
        yield "unsafe"
    for action, found in unsafe.items():
        reasons = [_words(objection) for objection in found] or ["not derived by the rules"]
        yield f"  {action.atom:<18} {reasons[0]}"
        yield from (f"  {'':<18} {reason}" for reason in reasons[1:])
    yield f"target speed  {decision.target_speed:.2f} m/s"
    yield "sections"
    for name, busy in sections.items():
        yield f"  {name:<12} {f'{busy.vehicle}, {_metres(busy.gap)}' if busy else 'free'}"
    yield "observation   " + " ".join(f"{number:.3f}" for number in decision.observation)


def _words(objection: Objection) -> str:
    if objection.vehicle is None or objection.gap is None or objection.needed is None:
        words = objection.reason.replace("_", " ")
        details = [detail if isinstance(detail, str) else f"{detail:.4g}" for detail in objection.details]
        return f"{words}: {', '.join(details)}" if details else words
    place = "alongside" if objection.gap <= 0 else f"{objection.gap:.1f} m away"
    return f"{objection.vehicle} is {place}, {objection.needed:.1f} m needed"


def _metres(gap: float) -> str:
    return "alongside" if gap <= 0 else f"{gap:.1f} m"
