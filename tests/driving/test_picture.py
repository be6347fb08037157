"""Pictures of scenes: what is in them, and that the scale is stated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.colors import to_rgba
from matplotlib.patches import Rectangle

from drlsl.driving.explain import draw_scene, save_picture
from drlsl.driving.explain.drawing import EGO_COLOUR, FOCUS_COLOUR
from drlsl.driving.scene import Scene, load_scene

EXAMPLE = Path(__file__).parents[2] / "examples" / "scene.json"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(EXAMPLE)


def test_every_vehicle_in_range_is_a_box_of_its_size(scene: Scene) -> None:
    focus = scene.in_range()[0].id
    (axes,) = draw_scene(scene, focus=focus, notes={focus: "5 m, 7 m needed"}).axes
    boxes = [patch for patch in axes.patches if type(patch) is Rectangle and patch.get_zorder() == 3]
    cars = [*scene.in_range(), scene.ego]
    assert [(box.get_width(), box.get_height()) for box in boxes] == [(car.length, car.width) for car in cars]
    assert [box.get_x() + car.length / 2 for box, car in zip(boxes, cars, strict=True)] == pytest.approx(
        [car.x for car in cars]
    )
    assert boxes[-1].get_facecolor() == to_rgba(EGO_COLOUR)
    assert boxes[0].get_facecolor() == to_rgba(FOCUS_COLOUR)
    assert any("5 m, 7 m needed" in text.get_text() for text in axes.texts)


def test_a_short_road_is_to_scale_and_a_long_one_says_how_it_is_stretched(scene: Scene) -> None:
    (short,) = draw_scene(replace(scene, vehicles=())).axes
    assert short.get_aspect() == 1
    assert "to scale" in short.get_xlabel()
    one = tuple(lane for lane in scene.road.lanes if lane.id == scene.ego.lane)
    ends = tuple(
        car._replace(x=scene.ego.x + along, y=scene.ego.y)
        for car, along in zip(scene.vehicles[:2], (95.0, -95.0), strict=True)
    )
    far = Scene(replace(scene.road, lanes=one), scene.ego, ends, scene.target_lane)
    (long,) = draw_scene(far).axes
    stretch = long.get_aspect()
    assert isinstance(stretch, int | float)
    assert stretch > 1
    assert f"stretched {stretch:.0f} times" in long.get_xlabel()


def test_y_points_downward(scene: Scene) -> None:
    (axes,) = draw_scene(scene).axes
    bottom, top = axes.get_ylim()
    assert bottom > top


@pytest.mark.parametrize(("ending", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_files(scene: Scene, tmp_path: Path, ending: str, start: bytes) -> None:
    path = tmp_path / f"scene.{ending}"
    save_picture(draw_scene(scene, title="a scene", caption="two\nlines"), path)
    assert path.read_bytes().startswith(start)
