"""The answers of `drlsl query`: what is safe in a scene, and why. No Typer: see `drlsl.cli.plain_query`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drlsl.cli.failures import failures_as_errors
from drlsl.files import printable, to_json

if TYPE_CHECKING:
    from drlsl.driving.explain import BusySection, Objection
    from drlsl.driving.scene import Scene
    from drlsl.driving.shield import Decision, Shield
    from drlsl.logic.explain import Explanation


def answer_query(
    state: Path,
    actions: Sequence[str] | None = None,
    rules: Sequence[Path] | None = None,
    goal: str | None = None,
    explain: bool = False,
    what_if: bool = False,
    picture: Path | None = None,
    time_limit: float = 10.0,
    out: Path | None = None,
    as_json: bool = False,
) -> None:
    """Print what `drlsl query` is asked for; its options explain the arguments.

    Raises:
        UserError: options contradict each other, a file cannot be read, or the rules give no usable answer.
        PrologError: the rules are not a valid program.
    """
    from drlsl.driving.scene import load_scene
    from drlsl.driving.shield import Shield

    _check_options(goal, explain, what_if, actions, out)
    scene = load_scene(state)
    shield = Shield.from_files(rules or ())
    if picture is not None:
        _draw(shield, scene, picture)
    if goal is not None:
        shield.state_facts(scene)
        _print_solutions(shield, goal, as_json=as_json)
    elif what_if:
        from drlsl.cli.what_if import print_what_if

        print_what_if(shield, scene, actions or (), time_limit=time_limit, out=out, as_json=as_json)
    elif explain:
        shield.state_facts(scene)
        _print_explanations(shield, scene, as_json=as_json)
    else:
        _print_decision(shield, scene, as_json=as_json)


def _check_options(
    goal: str | None, explain: bool, what_if: bool, actions: Sequence[str] | None, out: Path | None
) -> None:
    from drlsl.errors import UserError

    asked = {"--goal": goal is not None, "--explain": explain, "--what-if": what_if}
    given = [option for option, is_given in asked.items() if is_given]
    if len(given) > 1:
        raise UserError(f"{' and '.join(given)} print different things; give one of them")
    if not what_if and (actions or out is not None):
        what = f"the action {actions[0]}" if actions else "--out"
        raise UserError(f"{what} goes with --what-if, which is not given")


def _draw(shield: Shield, scene: Scene, path: Path) -> None:
    """Write the picture of a decision."""
    from drlsl.driving.explain import (
        check_picture_path,
        draw_decision,
        objections,
        save_picture,
        speed_reason,
    )

    check_picture_path(path)
    with failures_as_errors():
        decision = shield.decide(scene)
        unsafe = objections(shield, scene, decision)
        reason = speed_reason(shield, scene, decision.target_speed)
    save_picture(draw_decision(scene, decision, unsafe, reason), path)


def _print_solutions(shield: Shield, goal: str, *, as_json: bool) -> None:
    from drlsl.driving.shield import LIMITS

    with failures_as_errors(what=f" on {goal}"):
        solutions = list(shield.engine.query(goal, limits=LIMITS))
    if as_json:
        rows = [dict(solution) for solution in solutions]
        print(to_json({"goal": goal, "solutions": rows}))
    elif not solutions:
        print("false.")
    for solution in solutions if not as_json else ():
        print(
            ", ".join(f"{name} = {shield.engine.format(value)}" for name, value in solution.items())
            or "true."
        )


def _print_explanations(shield: Shield, scene: Scene, *, as_json: bool) -> None:
    """Print proofs and why-not of the actions and the speed, each below its outcome."""
    from drlsl.driving.explain import objections_to, speed_reason
    from drlsl.driving.scene import Action
    from drlsl.driving.shield import COMFORT, LIMITS

    with failures_as_errors():
        proofs = {
            action: shield.engine.explain(f"safe_actions({action.atom})", limits=LIMITS) for action in Action
        }
        against = objections_to(shield, (action for action, proof in proofs.items() if not proof.holds))
        speed = shield.engine.explain("longitudinal_velocity(Speed)", limits=LIMITS)
        target = speed.bindings.get("Speed")
        number = target if isinstance(target, int | float) else None
        reason = None if number is None else speed_reason(shield, scene, number)
        comfort = _comfort(shield)
    if as_json:
        data: dict[str, Any] = {
            action.atom: {
                "offered": proof.holds,
                "objections": [objection.as_json() for objection in against.get(action, ())],
                **proof.to_dict(),
            }
            for action, proof in proofs.items()
        }
        data["target_speed"] = {
            "value": number,
            "decided_by": None if reason is None else asdict(reason),
            **speed.to_dict(),
        }
        if comfort is not None:
            data["comfortable_acceleration"] = {
                "value": comfort.bindings.get(COMFORT.variable),
                **comfort.to_dict(),
            }
        print(to_json(data))
        return
    for action, proof in proofs.items():
        print(f"{action.atom} is {_offered(proof.holds, against.get(action, ()))}\n{proof.text()}\n")
    if number is not None:
        decided = "no single vehicle decides it" if reason is None else reason.words()
        print(f"target speed {number:.2f} m/s: {decided}")
    print(speed.text())
    if comfort is not None:
        print(f"\n{comfort.text()}")


def _comfort(shield: Shield) -> Explanation | None:
    """Return the proof of the comfortable acceleration; None if the rules do not say."""
    from drlsl.driving.shield import COMFORT, LIMITS

    if not shield.engine.defines(COMFORT.name, COMFORT.arity):
        return None
    return shield.engine.explain(COMFORT.goal, limits=LIMITS)


def _offered(holds: bool, against: Sequence[Objection]) -> str:
    if holds:
        return "offered"
    return "not offered: " + ("; ".join(one.words() for one in against) or "not derived by the rules")


def _print_decision(shield: Shield, scene: Scene, *, as_json: bool) -> None:
    from drlsl.driving.explain import busy_sections, objections

    with failures_as_errors():
        decision = shield.decide(scene)
        unsafe, sections = objections(shield, scene, decision), busy_sections(shield, scene)
    if as_json:
        print(
            to_json(
                {
                    "safe_actions": [action.atom for action in decision.safe_actions],
                    "unsafe_actions": {
                        action.atom: [objection.as_json() for objection in found]
                        for action, found in unsafe.items()
                    },
                    "target_speed": decision.target_speed,
                    "comfortable_acceleration": _wanted(decision),
                    "observation": list(decision.observation),
                    "observation_names": list(shield.observation.names),
                    "sections": {
                        name: {"vehicle": busy.vehicle, "gap": busy.gap} if busy else None
                        for name, busy in sections.items()
                    },
                }
            )
        )
    else:
        observed = zip(shield.observation.names, decision.observation, strict=True)
        print("\n".join([*_report(scene, decision, unsafe, sections), *_observation_lines(observed)]))


def _report(
    scene: Scene,
    decision: Decision,
    unsafe: dict[Any, list[Objection]],
    sections: dict[str, BusySection | None],
) -> Iterator[str]:
    """Yield the lines of text output."""
    ego = scene.ego
    seen = len(scene.in_range())
    yield f"ego in lane {ego.lane} at {abs(ego.vx):.1f} m/s, {seen} vehicle{'s' * (seen != 1)} in range"
    yield ""
    yield "safe"
    yield from (f"  {action.atom}" for action in decision.safe_actions)
    if unsafe:
        yield "unsafe"
    for action, found in unsafe.items():
        reasons = [objection.words() for objection in found] or ["not derived by the rules"]
        yield f"  {action.atom:<18} {reasons[0]}"
        yield from (f"  {'':<18} {reason}" for reason in reasons[1:])
    yield f"target speed  {decision.target_speed:.2f} m/s"
    wanted = _wanted(decision)
    if wanted is not None:
        yield f"comfortable   {wanted:.2f} m/s²"
    yield "sections"
    for name, busy in sections.items():
        yield f"  {name:<12} {f'{printable(busy.vehicle)}, {_metres(busy.gap)}' if busy else 'free'}"


def _observation_lines(observed: Iterable[tuple[str, float]]) -> Iterator[str]:
    """Yield the lines of the observation in the text output: names and numbers, two pairs in a line."""
    cells = [f"{printable(name):<18} {number:6.3f}" for name, number in observed]
    yield "observation"
    yield from (f"  {'   '.join(cells[start : start + 2])}" for start in range(0, len(cells), 2))


def _wanted(decision: Decision) -> float | None:
    """Return the comfortable acceleration [m/s²]; None if the rules do not say."""
    wanted = decision.comfortable_acceleration
    return wanted if math.isfinite(wanted) else None


def _metres(gap: float) -> str:
    return "alongside" if gap <= 0 else f"{gap:.1f} m"
