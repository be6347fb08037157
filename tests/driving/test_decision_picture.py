"""Pictures of decisions: what is measured and where, what arrows say, and that no words cover others."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from drlsl.driving.explain import Objection, dimension, draw_decision, draw_scene, objections, speed_reason
from drlsl.driving.explain.decision_picture import GO_COLOUR, LEADER_COLOUR, MOST_ROWS
from drlsl.driving.explain.drawing import EGO_COLOUR, FOCUS_COLOUR, OTHER_COLOUR
from drlsl.driving.scene import Action, Scene, Vehicle, bumper_gap, load_scene
from drlsl.driving.shield import Shield, default_rules
from drlsl.logic import Engine
from tests.driving.test_shield import USABLE
from tests.scenes import road, turned

EXAMPLE = load_scene(default_rules()[0].parent.parent / "examples" / "scene.json")
ONE_WAY = road(0, 3)


def car(name: str, lane: int, x: float, speed: float, aside: float = 0.0) -> Vehicle:
    own = ONE_WAY.lanes[lane - 1]
    return Vehicle(name, lane, x, own.centre + aside, speed, 0.0, 4.6, 1.9)


def crowd() -> Scene:
    """40 vehicles, bumper to bumper wherever there is room, in three lanes."""
    cars = [
        car(f"car{lane}{number:02d}", lane, -96.0 + 14.3 * number + 3.0 * lane, 25.0 + (number * lane) % 7)
        for lane in (1, 2, 3)
        for number in range(14)
    ]
    kept = [one for one in cars if not (one.lane == 2 and abs(one.x) < 7.0)]
    return Scene(ONE_WAY, car("ego", 2, 0.0, 28.0), tuple(kept), 2)


SCENES = {
    "example": EXAMPLE,
    "crowd": crowd(),
    "two that object": Scene(
        ONE_WAY, car("ego", 3, 0.0, 30.0), (car("front", 2, 20.0, 26.0), car("back", 2, -30.0, 33.0)), 3
    ),
    "alongside": Scene(ONE_WAY, car("ego", 2, 0.0, 30.0), (car("near", 1, -2.0, 30.0),), 2),
    "changing lanes": Scene(
        ONE_WAY, car("ego", 2, 0.0, 30.0, 1.2), (car("a", 3, 30.0, 28.0), car("b", 1, -25.0, 31.0)), 3
    ),
    "nobody": Scene(ONE_WAY, car("ego", 1, 0.0, 30.0), (), 1),
}


def drawn(scene: Scene, program: str = "highway.pl") -> tuple[Figure, dict[Action, list[Objection]]]:
    shield = Shield.from_files([program])
    decision = shield.decide(scene)
    unsafe = objections(shield, scene, decision)
    return draw_decision(scene, decision, unsafe, speed_reason(shield, scene, decision.target_speed)), unsafe


def boxes(figure: Figure) -> list[Any]:
    """Where all words of the axes are on paper, once it is drawn."""
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    return [text.get_window_extent() for text in axes.texts if text.get_text()]


def lines(figure: Figure, colour: str) -> list[tuple[list[float], list[float]]]:
    """Dimension lines of a colour, without their ticks."""
    (axes,) = figure.axes
    return [
        (np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist())
        for line in axes.lines
        if same_color(line.get_color(), colour)
        and line.get_zorder() == 6
        and line.get_linestyle() == "-"
        and np.size(line.get_xdata()) == 2
    ]


@pytest.mark.parametrize("name", SCENES)
def test_no_words_cover_others(name: str) -> None:
    for figure in (drawn(SCENES[name])[0], draw_scene(SCENES[name])):
        for one, other in combinations(boxes(figure), 2):
            assert not one.overlaps(other)


@pytest.mark.parametrize("name", SCENES)
def test_words_stay_in_the_picture(name: str) -> None:
    figure, _ = drawn(SCENES[name])
    for box in boxes(figure):
        assert figure.bbox.x0 <= box.x0
        assert box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0
        assert box.y1 <= figure.bbox.y1


def test_what_is_missing_reaches_from_the_bumper_to_where_it_ought_to_be() -> None:
    figure, unsafe = drawn(EXAMPLE)
    (objection,) = unsafe[Action.LEFT_LANE_CHANGE]
    assert objection.gap is not None
    assert objection.needed is not None
    behind = EXAMPLE.ego.x - EXAMPLE.ego.length / 2
    ((gap, _),) = lines(figure, "black")
    ((missing, _),) = lines(figure, FOCUS_COLOUR)
    assert gap == pytest.approx([behind, behind - objection.gap])
    assert missing == pytest.approx([behind - objection.gap, behind - objection.needed])
    assert gap[1] == pytest.approx(142.0 + 4.6 / 2)
    (axes,) = figure.axes
    left, right = axes.get_xlim()
    assert left < missing[1] < right
    assert any(text.get_text() == objection.words() for text in axes.texts)


def test_a_vehicle_alongside_has_no_gap() -> None:
    figure, unsafe = drawn(SCENES["alongside"])
    (objection,) = unsafe[Action.LEFT_LANE_CHANGE]
    assert objection.gap == pytest.approx(-2.6)
    assert lines(figure, "black") == []
    ((missing, _),) = lines(figure, FOCUS_COLOUR)
    # from its front bumper, which is beside the ego, back to where it ought to be
    assert missing[0] == pytest.approx(-2.0 + 2.3)
    assert missing[0] - missing[1] == pytest.approx(objection.missing)


def test_rules_may_measure_between_centres() -> None:
    near = car("near", 3, -4.2, 33.0, -1.5)
    scene = Scene(ONE_WAY, car("ego", 2, 0.0, 30.0), (near,), 2)
    figure, unsafe = drawn(scene, "paper.pl")
    (objection,) = unsafe[Action.RIGHT_LANE_CHANGE]
    line = dimension(scene.ego, near, objection)
    assert line is not None
    assert line.measure == "centres"
    assert line.other == (near.x, near.y)
    away = [end - own for end, own in zip(line.end, line.ego, strict=True)]
    assert sum(part**2 for part in away) ** 0.5 == pytest.approx(6.15)
    ((x, y),) = lines(figure, "black")
    assert (x, y) == ([0.0, near.x], [scene.ego.y, near.y])


def test_a_gap_of_another_kind_is_only_told() -> None:
    ego, other = car("ego", 2, 0.0, 30.0), car("v", 1, 30.0, 30.0)
    assert bumper_gap(ego, other) == pytest.approx(25.4)
    assert dimension(ego, other, Objection("too_close", "v", 25.4, 30.0)) is not None
    assert dimension(ego, other, Objection("too_close", "v", 1.9, 3.0)) is None
    assert dimension(ego, other, Objection("no_lane")) is None
    shield = Shield.default()
    decision = shield.decide(Scene(ONE_WAY, ego, (other,), 2))
    odd = Objection("too_close", "v", 1.9, 3.0)
    figure = draw_decision(
        Scene(ONE_WAY, ego, (other,), 2),
        replace(decision, safe_actions=(Action.LANE_KEEPING,)),
        {Action.LEFT_LANE_CHANGE: [odd], Action.RIGHT_LANE_CHANGE: []},
    )
    assert lines(figure, FOCUS_COLOUR) == []
    assert odd.words() in [text.get_text() for text in figure.axes[0].texts]


def arrows(figure: Figure) -> list[tuple[str, str, tuple[float, float]]]:
    """Colour, style and end of the arrows of actions."""
    (axes,) = figure.axes
    found = []
    for text in axes.texts:
        patch = getattr(text, "arrow_patch", None)
        if isinstance(text, Annotation) and patch is not None and text.get_zorder() == 5:
            found.append((patch.get_edgecolor(), patch.get_linestyle(), text.xy))
    return found


@pytest.mark.parametrize("sign", [1, -1])
def test_arrows_lead_where_actions_do(sign: int) -> None:
    scene = EXAMPLE if sign > 0 else turned(EXAMPLE)
    figure, _ = drawn(scene)
    keep, left, right = arrows(figure)
    for arrow, colour in ((keep, GO_COLOUR), (left, FOCUS_COLOUR), (right, GO_COLOUR)):
        assert same_color(arrow[0], colour)
    assert keep[1] == right[1] != left[1]
    assert [arrow[2][1] for arrow in (keep, left, right)] == pytest.approx(
        [sign * y for y in (16.2, 12.4, 19.9)]
    )
    assert all(sign * (arrow[2][0] - scene.ego.x) > scene.ego.length / 2 for arrow in (keep, left, right))
    crosses = [line for line in figure.axes[0].lines if line.get_marker() == "X"]
    assert len(crosses) == 1


def test_reasons_without_a_vehicle_stand_beside_the_arrow() -> None:
    figure, _ = drawn(SCENES["changing lanes"])
    assert [text.get_text() for text in figure.axes[0].texts].count("changing lanes") == 2
    figure, _ = drawn(SCENES["nobody"])
    assert "no lane" in [text.get_text() for text in figure.axes[0].texts]


@pytest.mark.parametrize("reason", ["law(back)", "seen(at(3), back, 2.5)"])
def test_vehicles_that_any_reason_names_have_its_colour(reason: str) -> None:
    engine = Engine()
    engine.consult_text("\n".join([*USABLE.values(), f"objection(left_lane_change, {reason})."]))
    shield, scene = Shield(engine), SCENES["two that object"]
    decision = shield.decide(scene)
    figure = draw_decision(scene, decision, objections(shield, scene, decision))
    coloured = [patch for patch in figure.axes[0].patches if same_color(patch.get_facecolor(), FOCUS_COLOUR)]
    assert len(coloured) == 1
    legend = {text.get_text() for text in figure.legends[0].get_texts()}
    assert "named in a reason" in legend
    assert legend.isdisjoint({"too close", "gap", "missing"})


def test_who_matters_has_a_colour() -> None:
    figure, _ = drawn(EXAMPLE)
    colours = [patch.get_facecolor() for patch in figure.axes[0].patches if patch.get_zorder() == 3]
    wanted = [LEADER_COLOUR, FOCUS_COLOUR, OTHER_COLOUR, OTHER_COLOUR, OTHER_COLOUR, EGO_COLOUR]
    assert all(same_color(one, other) for one, other in zip(colours, wanted, strict=True))
    words = [text.get_text() for text in figure.texts]
    assert any("truck decides it" in text for text in words)
    assert any("not offered: left_lane_change" in text for text in words)


def test_many_that_object_are_named_in_one_row() -> None:
    names = [f"v{number}" for number in range(MOST_ROWS + 3)]
    cars = tuple(car(name, 1, -8.0 * (number + 1), 35.0) for number, name in enumerate(names))
    figure, unsafe = drawn(Scene(ONE_WAY, car("ego", 2, 0.0, 30.0), cars, 2))
    assert len(unsafe[Action.LEFT_LANE_CHANGE]) == MOST_ROWS + 3
    assert len(lines(figure, FOCUS_COLOUR)) == MOST_ROWS - 1
    words = [text.get_text() for text in figure.axes[0].texts]
    assert f"and 4 more that are too close: {', '.join(names[-4:])}" in words


def test_the_lane_is_high_enough_at_any_length(tmp_path: Path) -> None:
    far = (car("a", 1, 99.0, 45.0), car("b", 3, -99.0, 45.0))
    scene = Scene(ONE_WAY, car("ego", 2, 0.0, 30.0), far, 2)
    figure, _ = drawn(scene)
    (axes,) = figure.axes
    FigureCanvasAgg(figure).draw()
    lane = abs(axes.transData.transform((0, 3.5))[1] - axes.transData.transform((0, 0))[1]) / figure.dpi
    assert lane >= 0.6
    assert "stretched" in axes.get_xlabel()
