"""Scene files: what is read, and one clear line for everything that cannot be."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from drlsl.driving.scene import Scene, load_scene, parse_scene, scene_json
from drlsl.driving.scene.scene_keys import SCENE
from drlsl.driving.scene.scene_schema import SceneModel
from drlsl.errors import UserError
from tests.scenes import scenes

ROOT = Path(__file__).parents[2]


@pytest.fixture
def example() -> dict[str, Any]:
    data: dict[str, Any] = json.loads((ROOT / "examples" / "scene.json").read_text())
    return data


@given(scene=scenes())
def test_what_is_written_is_read_back(scene: Scene) -> None:
    assert parse_scene(scene_json(scene), "test") == scene


def test_lanes_are_found_from_places() -> None:
    scene = load_scene(ROOT / "examples" / "scene.json")
    assert scene.ego.lane == scene.target_lane == 4
    assert {car.id: car.lane for car in scene.vehicles} == {
        "truck": 4,
        "sports_car": 3,
        "van": 5,
        "hatchback": 5,
        "estate": 2,
    }


def test_the_schema_in_the_documentation_is_the_models() -> None:
    documented = json.loads((ROOT / "docs" / "scene.schema.json").read_text())
    assert documented == SceneModel.model_json_schema()


def test_the_schema_accepts_the_example(example: dict[str, Any]) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.validate(example, SceneModel.model_json_schema())


def refusal(data: object) -> str:
    with pytest.raises(UserError) as caught:
        parse_scene(data if isinstance(data, str) else json.dumps(data), "scene.json")
    message = str(caught.value)
    assert message.startswith("scene.json")
    assert "\n" not in message
    return message


def test_text_that_is_not_json_is_placed() -> None:
    assert refusal('{"road": {\n  "lanes": [,]\n}}').startswith("scene.json:2:13: not JSON")


@pytest.mark.parametrize("text", ["", "[]", "3", "null", '"scene"', "[" * 100_000])
def test_json_that_is_no_scene(text: str) -> None:
    refusal(text)


def test_a_scene_without_an_ego(example: dict[str, Any]) -> None:
    del example["ego"]
    assert "ego is missing" in refusal(example)


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite(example: dict[str, Any], value: str) -> None:
    text = json.dumps(example).replace('"x_m": 180.0', f'"x_m": {value}')
    assert "ego.x_m" in refusal(text)


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        (("ego", "length_m"), -4.6, "ego.length_m"),
        (("ego", "width_m"), 0, "ego.width_m"),
        (("vehicles", 1, "length_m"), -1, "vehicles[1].length_m"),
        (("ego", "lane"), 9, "a lane that the road lacks; it has 1, 2, 3, 4, 5"),
        (("ego", "target_lane"), 0, "ego.target_lane is 0"),
        (("vehicles", 0, "lane"), 7, "vehicles[0].lane is 7"),
        (("vehicles", 0, "id"), "van", "'van' 2 times"),
        (("vehicles", 0, "id"), "ego", "the ego's own"),
        (("ego", "y_m"), 9.0, "in no lane"),
        (("ego", "speed"), 3.0, "ego.speed is not a field"),
        (("ego", "vx_mps"), "fast", "ego.vx_mps"),
        (("ego", "vx_mps"), True, "ego.vx_mps"),
        (("road", "lanes"), [], "road.lanes"),
        (("road", "lanes", 1, "id"), 1, "lane 1 2 times"),
        (("road", "lanes", 0, "direction"), "up", "direction"),
        (("road", "time_step_s"), 0, "road.time_step_s"),
    ],
)
def test_scenes_that_cannot_be(
    example: dict[str, Any], path: tuple[str | int, ...], value: object, expected: str
) -> None:
    place: Any = example
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    assert expected in refusal(example)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot read the scene"):
        load_scene(tmp_path / "none.json")
    (tmp_path / "latin.json").write_bytes(b'{"ego": "\xe9"}')
    with pytest.raises(UserError, match="not UTF-8"):
        load_scene(tmp_path / "latin.json")


ODD: list[Any] = [
    *(None, True, 0, 1, -1, 3, 1.5, -0.0, 1e308, math.inf, -math.inf, math.nan),
    *(2**63, 2**1024, 10**400, -(10**400), sys.float_info.max),
    *("", "van", "vän", "\ud800", "\x1b", "left_to_right", "up", [], {}, [1], {"x_m": 1.0}),
]


def places(data: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the path of every value inside a scene file's data."""
    inside = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in inside:
        yield (*place, key)
        yield from places(value, (*place, key))


@given(data=st.data())
def test_what_is_read_without_pydantic_is_read_with_it_alike(data: st.DataObject) -> None:
    scene = json.loads((ROOT / "examples" / "scene.json").read_text())
    for path in data.draw(st.lists(st.sampled_from(list(places(scene))), min_size=1, max_size=2)):
        place: Any = scene
        with suppress(KeyError, IndexError, TypeError):  # another change took it away
            for key in path[:-1]:
                place = place[key]
            match data.draw(st.sampled_from(["odd", "odd", "gone", "new"])):
                case "odd":
                    place[path[-1]] = data.draw(st.sampled_from(ODD))
                case "gone":
                    del place[path[-1]]
                case "new":
                    place["z_m"] = 0.0
    try:
        model = SceneModel.model_validate(scene)
    except ValidationError:
        assert not SCENE(scene)
    else:
        assert SCENE(scene)
        assert repr(SCENE.filled(scene)) == repr(model.model_dump())


@given(scene=scenes())
def test_a_written_scene_needs_no_pydantic(scene: Scene) -> None:
    assert SCENE(json.loads(scene_json(scene)))
