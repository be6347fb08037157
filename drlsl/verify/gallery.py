"""Write counterexamples as files: scenes for `drlsl query`, and pictures."""

from __future__ import annotations

from pathlib import Path

from drlsl.driving.explain import draw_scene, objections, save_picture
from drlsl.driving.scene import Scene, write_scenes
from drlsl.driving.shield import RuleFailure, Shield
from drlsl.errors import UserError
from drlsl.logic import LimitExceeded, PrologError
from drlsl.verify.report import Request, Result


def write_counterexample(request: Request, result: Result, folder: Path) -> list[Path]:
    """Write the scene that breaks a property, its images and a picture of it; return the files."""
    found = result.counterexample
    assert found is not None
    images = {f"{result.name}.{image}": scene for image, scene in found.images}
    written = write_scenes(folder, {result.name: found.scene, **images})
    caption, notes = _decision(request, found.scene)
    for image, scene in found.images:
        other, more = _decision(request, scene)
        caption += f"\nin the image {image}: {other}"
        notes = {**more, **notes}
    if found.unknowns:
        caption += "\n" + ", ".join(f"{name} = {value:.6g}" for name, value in found.unknowns.items())
    if found.error is not None:
        caption = f"the rules raise an error: {found.error}"
    figure = draw_scene(
        found.scene,
        title=f"{result.name} is broken: {result.text}",
        caption=caption,
        focus=found.focus,
        notes=notes,
    )
    path = folder / f"{result.name}.png"
    save_picture(figure, path)
    return [*written, path]


def _decision(request: Request, scene: Scene) -> tuple[str, dict[str, str]]:
    """Return the rules' decision about a scene, as a line and as notes beside vehicles."""
    try:
        shield = Shield.from_files(request.rules)
        decision = shield.decide(scene)
        against = objections(shield, scene, decision)
    except (UserError, RuleFailure, PrologError, LimitExceeded) as error:
        return f"the rules give no answer: {error}", {}
    offered = ", ".join(action.atom for action in decision.safe_actions)
    notes = {
        one.vehicle: f"{one.gap:.1f} m, {one.needed:.1f} m needed"
        for found in against.values()
        for one in found
        if one.vehicle is not None and one.gap is not None and one.needed is not None
    }
    return f"offered: {offered}; target speed {decision.target_speed:.2f} m/s", notes
