"""Rules that leave Python answer as they do in it, with the same reasons, and fail as loudly."""

from __future__ import annotations

import json
import math
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from drlsl.cli import run
from drlsl.driving.export import FORMATS, RuleProgram, decide_all, draw_scenes
from drlsl.driving.export.c_files import c_files
from drlsl.driving.export.js_files import js_files
from drlsl.driving.scene import Scene, load_scene, scene_json
from drlsl.driving.shield.decision import fail_safe
from drlsl.errors import UserError
from scripts.compare_exports import CRules, JsRules, PythonRules, differences
from tests.lowering.exported import FLAGS, GCC, NODE

ROOT = Path(__file__).parents[2]
RULES = ROOT / "rules"
PROGRAMS = ("highway.pl", "paper.pl", "un_r157.pl", "overtake_left.pl", "merge.pl")
SCENES = 400

needs_gcc = pytest.mark.skipif(GCC is None, reason="there is no C compiler")
needs_node = pytest.mark.skipif(NODE is None, reason="there is no node")


def write(folder: Path, files: dict[str, str]) -> Path:
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="module", params=PROGRAMS)
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp("exported")
    program = RuleProgram.of([RULES / request.param])
    stored = decide_all(program, draw_scenes(100, 12, seed=3, ends=program.knows_lane_ends))
    write(folder / "c", c_files(program, stored))
    write(folder / "js", js_files(program, stored))
    return request.param, folder


def checked(folder: Path, to: str) -> tuple[int, str]:
    """The status and output of the check that comes with an export."""
    command = FORMATS[to].check.replace("cc ", f"{GCC} {' '.join(FLAGS)} ")
    ran = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False)
    assert not ran.stderr, ran.stderr
    return ran.returncode, ran.stdout


@pytest.mark.parametrize("to", [pytest.param("c", marks=needs_gcc), pytest.param("js", marks=needs_node)])
def test_an_export_passes_its_own_check(exported: tuple[str, Path], to: str) -> None:
    status, output = checked(exported[1] / to, to)
    assert (status, output) == (0, "100 of 100 decisions are the stored ones, 0 undecided\n")


@needs_gcc
@needs_node
def test_the_languages_agree(exported: tuple[str, Path]) -> None:
    name, folder = exported
    c, js = CRules(folder / "c", "-O1"), JsRules(folder / "js")
    scenes = list(draw_scenes(SCENES, 16, seed=11, ends=name == "merge.pl"))
    assert list(differences(PythonRules(str(RULES / name)), c, js, scenes)) == []


@needs_gcc
@pytest.mark.parametrize("level", ["-O0", "-O2", "-O3"])
def test_c_compiles_without_a_word(exported: tuple[str, Path], level: str) -> None:
    CRules(exported[1] / "c", level)


@needs_gcc
def test_c_needs_no_memory_but_a_fixed_stack(exported: tuple[str, Path]) -> None:
    folder = exported[1] / "c"
    assert GCC is not None
    command = [GCC, *FLAGS, "-O2", "-fstack-usage", "-c", "rules.c", "-o", "rules.o"]
    subprocess.run(command, cwd=folder, check=True)
    usage = [line.split("\t") for line in (folder / "rules.su").read_text().splitlines()]
    assert {kind for _, _, kind in usage} == {"static"}
    assert max(int(size) for _, size, _ in usage) < 64_000
    words = set(re.findall(r"\w+", (folder / "rules.c").read_text()))
    assert not words & {"malloc", "calloc", "realloc", "alloca", "do", "goto", "while"}


def test_c_has_no_recursion(exported: tuple[str, Path]) -> None:
    """A function is defined before it is called, and does not call itself."""
    text = (exported[1] / "c" / "rules.c").read_text()
    found = list(re.finditer(r"^(?:static )?\w+ \*?(\w+)\([^;{]*\)\n\{\n(.*?)^\}", text, re.M | re.S))
    assert len(found) > 15
    for function in found:
        assert not re.search(rf"\b{function[1]}\(", function[2])
        assert not re.search(rf"\b{function[1]}\(", text[: function.start()])


def test_the_head_has_the_files_and_their_digests(exported: tuple[str, Path]) -> None:
    name, folder = exported
    for path in (*(folder / "c").glob("*.[ch]"), *(folder / "js").glob("*s.mjs")):
        for seal in RuleProgram.of([RULES / name]).files.items():
            assert "  ".join(seal) in path.read_text()[:1500]


@pytest.fixture(scope="module")
def highway(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = RuleProgram.of([RULES / "highway.pl"])
    folder = tmp_path_factory.mktemp("highway")
    write(folder / "c", c_files(program, decide_all(program, draw_scenes(20, 12, seed=5))))
    write(folder / "js", js_files(program, decide_all(program, draw_scenes(20, 12, seed=5))))
    return folder


@needs_node
@pytest.mark.parametrize("rules", PROGRAMS)
def test_reasons_are_those_that_query_prints(
    rules: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = RuleProgram.of([RULES / rules])
    js = JsRules(write(tmp_path / "js", js_files(program, ())))
    drawn = draw_scenes(8, 12, seed=2, ends=rules == "merge.pl")
    scenes = [load_scene(ROOT / "examples" / "scene.json"), *drawn]
    for scene, found in zip(scenes, js.decide(scenes), strict=True):
        path = tmp_path / "scene.json"
        path.write_text(scene_json(scene))
        assert run(["query", "--json", "--state", str(path), "--rules", str(RULES / rules)]) == 0
        printed = json.loads(capsys.readouterr().out)
        for name in (
            "safe_actions",
            "unsafe_actions",
            "target_speed",
            "comfortable_acceleration",
            "observation",
        ):
            assert found[name] == printed[name]
        assert list(found["unsafe_actions"]) == list(printed["unsafe_actions"])


@needs_gcc
@needs_node
def test_a_check_fails_if_one_decision_is_another(highway: Path, tmp_path: Path) -> None:
    for to, name in (("js", "decisions.json"), ("c", "check.c")):
        folder = write(
            tmp_path / to,
            {
                path.name: path.read_text()
                for path in (highway / to).iterdir()
                if path.suffix != ".so" and path.name != "check"
            },
        )
        text = (folder / name).read_text()
        speed = '"target_speed":' if to == "js" else "{true, "
        place = text.index(speed) + len(speed)
        changed = text[:place] + ("9" if to == "js" else "!") + text[place:]
        (folder / name).write_text(changed)
        assert checked(folder, to)[0] == 1


def scene_object(**changes: Any) -> dict[str, Any]:
    """The example scene with other values at dotted places."""
    data: dict[str, Any] = json.loads((ROOT / "examples" / "scene.json").read_text())
    for place, value in changes.items():
        *path, last = place.split("__")
        part = data
        for name in path:
            part = part[int(name)] if name.isdigit() else part[name]  # type: ignore[index]  # a list
        part[last] = value
    return data


@needs_node
@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        ({}, "road is no object"),
        ("a road", "the scene is no object"),
        (scene_object(ego__x_m="far"), "ego.x_m is far; expected a number"),
        (scene_object(ego__x_m=None), "ego.x_m is null; expected a number"),
        (scene_object(ego__lane=99), "ego.lane is 99, a lane that the road lacks"),
        (scene_object(ego__width_m=0), "ego.width_m is 0; expected a number greater than 0"),
        (scene_object(ego__y_m=1e3), "ego.y_m is in no lane of the road; give ego.lane or move the ego"),
        (scene_object(vehicles__0__id="ego"), "vehicles has one called 'ego'; that name is the ego's own"),
        (scene_object(vehicles__0__colour="red"), "vehicles[0] has a field colour that is none of a scene"),
        (scene_object(road__lanes=[]), "road.lanes is no list of lanes"),
    ],
)
def test_javascript_refuses_an_impossible_scene(highway: Path, scene: Any, reason: str) -> None:
    (found,) = JsRules(highway / "js").decide_objects([scene])
    assert found == {"failed": reason, "fail_safe": None}


@needs_node
@needs_gcc
def test_a_number_beyond_the_bounds_leaves_the_decision_open(highway: Path) -> None:
    scene = load_scene(ROOT / "examples" / "scene.json")
    strange = replace(scene, ego=scene.ego._replace(vx=1e16))
    wanted = fail_safe(strange, RuleProgram.of([RULES / "highway.pl"]).shield.observation)
    (in_js,) = JsRules(highway / "js").decide([strange])
    assert "only the interpreter can tell" in in_js["undecided"]
    in_c = CRules(highway / "c").decide(strange)
    assert (in_c["status"], in_c["problem"]) == ("undecided", 2)
    for found in (in_js["fail_safe"], in_c):
        assert found["safe_actions"] == [action.atom for action in wanted.safe_actions]
        assert found["target_speed"] == wanted.target_speed
        assert found["lane_to_keep"] == wanted.lane_to_keep
        assert found["observation"] == list(wanted.observation)


@needs_gcc
@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("field", ["x", "y", "vx", "vy", "length", "width"])
def test_c_gives_the_fail_safe_for_numbers_that_are_none(highway: Path, field: str, value: float) -> None:
    rules = CRules(highway / "c")
    scene = load_scene(ROOT / "examples" / "scene.json")
    rules.put(scene)
    setattr(rules.scene.vehicles[0], field, value)
    found = rules.decide_again()
    if (field, value) in (("x", math.inf), ("y", math.inf)):
        assert found["status"] == "decided"  # it is out of range
        return
    assert found["status"] in ("undecided", "failed")
    assert found["safe_actions"] == ["lane_keeping"]
    assert found["target_speed"] < abs(scene.ego.vx)


@needs_gcc
@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("vehicle_count", -1),
        ("vehicle_count", 65),
        ("target_lane", 99),
        ("road.lane_count", 0),
        ("road.lane_count", 17),
        ("ego.lane", 0),
    ],
)
def test_c_refuses_an_impossible_scene(highway: Path, field: str, value: int) -> None:
    rules = CRules(highway / "c")
    rules.put(load_scene(ROOT / "examples" / "scene.json"))
    part: Any = rules.scene
    *path, last = field.split(".")
    for name in path:
        part = getattr(part, name)
    setattr(part, last, value)
    found = rules.decide_again()
    assert (found["status"], found["problem"], found["safe_actions"]) == ("failed", 1, ["lane_keeping"])


BROKEN = """
:- include('highway.pl').
:- abolish({name}).
{clause}
"""


@needs_gcc
@needs_node
@pytest.mark.parametrize(
    ("name", "clause", "problem", "words"),
    [
        ("longitudinal_velocity/1", "longitudinal_velocity(-1.0).", 4, "expected a speed in m/s"),
        ("longitudinal_velocity/1", "longitudinal_velocity(V) :- fail, V = 1.0.", 4, "gave null"),
        ("safe_actions/1", "safe_actions(lane_keeping) :- fail.", 3, "the rules offer no action"),
        ("lane_to_keep/1", "lane_to_keep(L) :- target_lane(L), L > 90.", 6, "expected a lane"),
        ("comfortable_acceleration/1", "comfortable_acceleration(A) :- fail, A = 0.0.", 7, "an acceleration"),
    ],
)
def test_unusable_answers_fail(tmp_path: Path, name: str, clause: str, problem: int, words: str) -> None:
    rules = tmp_path / "broken.pl"
    rules.write_text(BROKEN.format(name=name, clause=clause))
    program = RuleProgram.of([rules])
    scene = load_scene(ROOT / "examples" / "scene.json")
    in_c = CRules(write(tmp_path / "c", c_files(program, ()))).decide(scene)
    assert (in_c["status"], in_c["problem"], in_c["safe_actions"]) == ("failed", problem, ["lane_keeping"])
    (in_js,) = JsRules(write(tmp_path / "js", js_files(program, ()))).decide([scene])
    assert words in in_js["failed"]
    assert in_js["fail_safe"]["safe_actions"] == ["lane_keeping"]
    assert in_js["fail_safe"]["target_speed"] == in_c["target_speed"]


def test_a_program_that_cannot_be_lowered_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = tmp_path / "odd.pl"
    rules.write_text(
        BROKEN.format(
            name="longitudinal_velocity/1", clause="longitudinal_velocity(V) :- atom_length(ego, V)."
        )
    )
    for to in ("c", "js"):
        assert run(["rules", "export", str(rules), "--to", to, "--out", str(tmp_path / to)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "odd.pl:4" in line
        assert "longitudinal_velocity/1 cannot be lowered" in line
        assert not (tmp_path / to).exists()


def test_an_old_folder_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine").write_text("mine")
    assert run(["rules", "export", "--to", "c", "--out", str(tmp_path / "mine")]) == 2
    assert (
        capsys.readouterr().err
        == f"drlsl: {tmp_path / 'mine'} exists; name a new folder for the exported rules\n"
    )
    assert (tmp_path / "mine").read_text() == "mine"


def test_an_unknown_action_is_refused(tmp_path: Path) -> None:
    rules = tmp_path / "odd.pl"
    rules.write_text(
        BROKEN.format(
            name="objection/2", clause="objection(A, no_lane) :- lane_change(A, S), \\+ side_lane(S, _)."
        )
    )
    RuleProgram.of([rules]).reasons()
    rules.write_text(BROKEN.format(name="objection/2", clause="objection(left_lane_change, [no, lane])."))
    with pytest.raises(UserError, match="a reason against left_lane_change has no name"):
        RuleProgram.of([rules]).reasons()


def test_scenes_have_two_decimals() -> None:
    scenes: list[Scene] = list(draw_scenes(50, 12, seed=1))
    numbers = [number for scene in scenes for car in scene.vehicles for number in car[2:]]
    assert numbers == [round(number, 2) for number in numbers]
