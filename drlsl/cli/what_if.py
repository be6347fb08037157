"""`drlsl query --what-if`: print the least changes that would alter the decision."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

from drlsl.cli.failures import failures_as_errors
from drlsl.cli.options import check_new
from drlsl.files import printable, to_json

if TYPE_CHECKING:
    from drlsl.counterfactual import Answer, Change, Finding
    from drlsl.driving.explain import Objection
    from drlsl.driving.scene import Action, Scene
    from drlsl.driving.shield import Shield


def print_what_if(
    shield: Shield,
    scene: Scene,
    names: Sequence[str],
    *,
    time_limit: float,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the least changes for the actions of these names, or for all.

    Raises:
        UserError: z3 is not installed, no action has that name, `out` exists or cannot be written, or the
            rules cannot be asked.
    """
    from drlsl.errors import UserError

    if find_spec("z3") is None:
        raise UserError("a what-if needs z3-solver: pip install 'drlsl[verify]'")
    actions = _actions(names)
    check_new(out)
    from drlsl.counterfactual import what_if
    from drlsl.driving.explain import objections_to

    with failures_as_errors():
        answers = what_if(shield, scene, actions, time_limit=time_limit)
        shield.state_facts(scene)
        against = objections_to(shield, (answer.action for answer in answers if not answer.offered))
    written = _write(answers, out) if out is not None else ()
    if as_json:
        print(to_json({answer.action.atom: answer.as_json() for answer in answers}))
    else:
        for answer in answers:
            print("\n".join(_lines(answer, scene, against.get(answer.action, ()))))
        print("\n".join(f"wrote {path}" for path in written), end="\n" if written else "")


def _actions(names: Sequence[str]) -> list[Action]:
    from drlsl.driving.scene import ATOMS, Action
    from drlsl.errors import UserError

    for name in names:
        if name not in ATOMS:
            raise UserError(f"there is no action {name}; there are {', '.join(ATOMS)}")
    return [action for action in Action if not names or action.atom in names]


def _write(answers: Sequence[Answer], out: Path) -> list[Path]:
    """Write the changed scenes; return their files."""
    from drlsl.driving.scene import write_scenes

    scenes = {
        f"{answer.action.atom}.{kind}": finding.scene
        for answer in answers
        for kind, finding in answer.findings().items()
        if finding is not None and finding.scene is not None
    }
    return write_scenes(out, scenes)


def _lines(answer: Answer, scene: Scene, against: Sequence[Objection]) -> Iterator[str]:
    """Yield the lines of text output for one action."""
    name = f"{answer.action.atom:<18}"
    state = "is offered" if answer.offered else "is not offered"
    others = [one.words() for one in against if one.vehicle is None]
    if others:
        state += f" ({', '.join(others)})"
    findings = [one for one in answer.findings().values() if one is not None]
    found = [one for one in findings if one.status == "found"]
    single = [one for one in found if one is not answer.gaps]
    unknown = [(kind, one) for kind, one in answer.findings().items() if one and one.status == "unknown"]
    would = "it would not be if" if answer.offered else "it would be if"
    if single:
        state += f"; {would}"
    elif not unknown:
        several = "" if answer.offered or answer.gaps else ", or of several gaps,"
        state += f"; no change of one gap or speed{several} would alter that"
    yield f"{name} {state}"
    for number, finding in enumerate(single):
        words = _words(finding.changes[0], finding, scene) + _reservation(finding)
        yield f"{'':<21}{'or ' if number else ''}{words}"
    if answer.gaps is not None:
        yield from _joint(answer.gaps, scene, would)
    for kind, finding in unknown:
        yield f"{'':<19}unknown for {_KINDS[kind]}: {finding.reason}"


_KINDS: Final = {
    "gap": "one vehicle elsewhere",
    "gap_without_passing": "one vehicle elsewhere that does not pass the ego",
    "speed": "one vehicle's speed",
    "ego_speed": "the ego's speed",
    "gaps": "several vehicles elsewhere",
}


def _joint(finding: Finding, scene: Scene, would: str) -> Iterator[str]:
    if finding.status == "none":
        yield f"{'':<19}no change of several gaps would either"
    elif finding.status == "found":
        yield f"{'':<19}{would}"
        for number, change in enumerate(finding.changes):
            yield f"{'':<21}{'and ' if number else ''}{_words(change, finding, scene)}"
        total = _decimal(sum(abs(change.change) for change in finding.changes), 9)
        yield f"{'':<21}{total} m in all{_reservation(finding)}"


def _reservation(finding: Finding) -> str:
    """Return the words for what remains unknown about lesser changes."""
    return f" (at least {finding.least:.4g}; {finding.reason})" if finding.reason else ""


def _words(change: Change, finding: Finding, scene: Scene) -> str:
    """Return one change in words: its amount, its direction and its effect."""
    from drlsl.driving.scene import bumper_gap

    assert finding.scene is not None
    amount = _decimal(abs(change.change), 9)
    if change.quantity == "vx":
        who = "the ego" if change.vehicle == scene.ego.id else printable(change.vehicle)
        way = "faster" if change.change > 0 else "slower"
        return f"{who} drove {amount} m/s {way}, at {_decimal(abs(change.after))} m/s"
    way = "further ahead" if change.change > 0 else "further back"
    if change.out_of_sight:
        return f"{printable(change.vehicle)} were {amount} m {way}, out of sight"
    car = next(one for one in finding.scene.vehicles if one.id == change.vehicle)
    gap = bumper_gap(car, scene.ego)
    place = "alongside" if gap <= 0 else f"with a gap of {_decimal(gap)} m"
    passing = ", past the ego" if (change.before - scene.ego.x) * (change.after - scene.ego.x) < 0 else ""
    return f"{printable(change.vehicle)} were {amount} m {way}{passing}, {place}"


def _decimal(number: float, digits: int = 2) -> str:
    """Return a number with at most `digits` decimals, and at least one."""
    text = f"{number:.{digits}f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text
