"""Compare exported rules with the code for one scene in Python.

`python scripts/compare_exports.py [SCENES] [FILE...]` needs node and a C compiler. It prints for each rule
file how many decisions differ, reasons included.
"""

from __future__ import annotations

import ctypes
import json
import math
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from drlsl.driving.export import StoredDecision, draw_scenes, export_rules
from drlsl.driving.scene import SCHEMA, Action, Scene, facts_of, scene_json
from drlsl.driving.shield import Decision, RuleFailure, Shield
from drlsl.driving.shield.compiled import ScalarTier
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Undecided

FILES: Final = ("highway.pl", "paper.pl", "un_r157.pl", "overtake_left.pl", "merge.pl")
AT_ONCE: Final = 2000
STATUS: Final = ("decided", "undecided", "failed")


class Lane(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_int32),
        ("direction", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("centre", "width", "speed_limit")),
        ("ends", ctypes.c_bool),
        ("end", ctypes.c_double),
    )


class Car(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_int32),
        ("lane", ctypes.c_int32),
        *((name, ctypes.c_double) for name in ("x", "y", "vx", "vy", "length", "width")),
    )


class CRules:
    """Rules that were exported to C, compiled as a library; `flags` for the compiler."""

    def __init__(self, folder: Path, *flags: str) -> None:
        compiler = shutil.which("gcc") or shutil.which("cc")
        assert compiler is not None, "there is no C compiler"
        library = folder / "rules.so"
        strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
        subprocess.run(
            [
                compiler,
                *strict,
                *(flags or ("-O2",)),
                "-shared",
                "-fPIC",
                "-o",
                library,
                folder / "rules.c",
                "-lm",
            ],
            check=True,
        )
        defined = [line.split() for line in (folder / "rules.h").read_text().splitlines()]
        sizes = {words[1]: words[2] for words in defined if words[:1] == ["#define"] and len(words) == 3}
        lanes, vehicles, reasons, details, observation = (
            int(sizes[f"DRLSL_{name}"])
            for name in ("MAX_LANES", "MAX_VEHICLES", "MAX_REASONS", "MAX_DETAILS", "OBSERVATION")
        )
        numbers = ("time_step", "radar_range", "acceleration_limit", "braking_limit", "centre_tolerance")

        class Road(ctypes.Structure):
            _fields_ = (
                ("lane_count", ctypes.c_int32),
                ("lanes", Lane * lanes),
                *((name, ctypes.c_double) for name in numbers),
            )

        class CScene(ctypes.Structure):
            _fields_ = (
                ("road", Road),
                ("ego", Car),
                ("target_lane", ctypes.c_int32),
                ("vehicle_count", ctypes.c_int32),
                ("vehicles", Car * vehicles),
            )

        class CDecision(ctypes.Structure):
            _fields_ = (
                ("status", ctypes.c_int),
                ("problem", ctypes.c_int),
                ("offered", ctypes.c_bool * 3),
                ("target_speed", ctypes.c_double),
                ("comfortable_acceleration", ctypes.c_double),
                ("observation", ctypes.c_double * observation),
                ("front_is_free", ctypes.c_bool),
                ("lane_to_keep", ctypes.c_int32),
            )

        class Reason(ctypes.Structure):
            _fields_ = (
                ("action", ctypes.c_int),
                ("reason", ctypes.c_int32),
                ("details", ctypes.c_double * details),
            )

        class Reasons(ctypes.Structure):
            _fields_ = (
                ("status", ctypes.c_int),
                ("count", ctypes.c_int32),
                ("left_out", ctypes.c_int32),
                ("reasons", Reason * reasons),
            )

        self._library = ctypes.CDLL(str(library))
        self.scene = CScene()
        self._decision = CDecision()
        self._reasons = Reasons()

    def put(self, scene: Scene) -> None:
        """State a scene."""
        road = self.scene.road
        road.lane_count = len(scene.road.lanes)
        for place, lane in enumerate(scene.road.lanes):
            direction = 0 if lane.direction.sign > 0 else 1
            numbers = (lane.centre, lane.width, lane.speed_limit)
            road.lanes[place] = Lane(lane.id, direction, *numbers, lane.end is not None, lane.end or 0.0)
        for name in ("time_step", "radar_range", "acceleration_limit", "braking_limit", "centre_tolerance"):
            setattr(road, name, getattr(scene.road, name))
        self.scene.ego = Car(-1, *scene.ego[1:])
        self.scene.target_lane = scene.target_lane
        self.scene.vehicle_count = len(scene.vehicles)
        for place, car in enumerate(scene.vehicles):
            self.scene.vehicles[place] = Car(place, *car[1:])

    def decide(self, scene: Scene) -> dict[str, Any]:
        """Return the decision in the form of the module in JavaScript, without reasons."""
        self.put(scene)
        return self.decide_again()

    def decide_again(self) -> dict[str, Any]:
        """Return the decision about the scene that is stated."""
        self._library.drlsl_decide(ctypes.byref(self.scene), ctypes.byref(self._decision))
        found = self._decision
        wanted = found.comfortable_acceleration
        return {
            "status": STATUS[found.status],
            "problem": found.problem,
            "safe_actions": [action.atom for action in Action if found.offered[action]],
            "target_speed": found.target_speed,
            "comfortable_acceleration": wanted if wanted < math.inf else None,
            "observation": list(found.observation),
            "front_is_free": found.front_is_free,
            "lane_to_keep": found.lane_to_keep,
        }

    def reasons(self, scene: Scene) -> set[tuple[Any, ...]]:
        """Return the action, the name of the reason and the details of each; vehicles by name."""
        self.put(scene)
        self._library.drlsl_find_reasons(ctypes.byref(self.scene), ctypes.byref(self._reasons))
        found = self._reasons
        assert STATUS[found.status] == "decided"
        assert found.left_out == 0
        return {self._reason(found.reasons[place], scene) for place in range(found.count)}

    def _reason(self, one: Any, scene: Scene) -> tuple[Any, ...]:
        letters = self._text("drlsl_reason_details", one.reason)
        details = [
            number
            if letter == "n"
            else scene.vehicles[int(number)].id
            if number >= 0
            else self._text("drlsl_atom_names", int(-1 - number))
            for letter, number in zip(letters, one.details, strict=False)
        ]
        return (Action(one.action).atom, self._text("drlsl_reason_names", one.reason), *details)

    def _text(self, table: str, place: int) -> str:
        texts = (ctypes.c_char_p * (place + 1)).in_dll(self._library, table)
        return str((texts[place] or b"").decode())

    def microseconds(self, runs: int) -> float:
        """Return how long a decision about the stated scene takes: the best of `runs` [µs]."""
        best = math.inf
        decide = self._library.drlsl_decide
        scene, decision = ctypes.byref(self.scene), ctypes.byref(self._decision)
        for _ in range(runs):
            start = time.perf_counter()
            decide(scene, decision)
            best = min(best, time.perf_counter() - start)
        return best * 1e6


class JsRules:
    """Rules that were exported to JavaScript."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._main = folder / "many.mjs"
        self._main.write_text(
            'import { readFileSync } from "node:fs";\n'
            'import { decide } from "./rules.mjs";\n'
            "console.log(JSON.stringify(JSON.parse(readFileSync(process.argv[2])).map(decide)));\n"
        )

    def decide(self, scenes: Sequence[Scene]) -> list[dict[str, Any]]:
        """Return the decision about each scene."""
        return self.decide_objects([json.loads(scene_json(scene)) for scene in scenes])

    def decide_objects(self, scenes: Sequence[Any]) -> list[dict[str, Any]]:
        """Return the decision about each object of the form of scene.json, or that should be."""
        node = shutil.which("node")
        assert node is not None, "there is no node"
        data = self._folder / "many.json"
        data.write_text(json.dumps(scenes))
        ran = subprocess.run([node, self._main, data], capture_output=True, text=True, check=True)
        answers: list[dict[str, Any]] = json.loads(ran.stdout)
        return answers


class PythonRules:
    """The same rules as generated Python, and their reasons."""

    def __init__(self, path: str) -> None:
        self.shield = Shield.from_files([path])
        self._tier = ScalarTier(self.shield.engine, self.shield.observation)
        lowered = lower(self.shield.engine, SCHEMA, [Query("objection", 2, "all")])
        self._objections = compile_scalar(lowered)

    def decide(self, scene: Scene) -> Decision:
        """Return the decision."""
        return self._tier.decide_scene(scene)

    def reasons(self, scene: Scene) -> set[tuple[Any, ...]]:
        """Return the action, the name of the reason and the details of each."""
        (found,) = self._objections(facts_of(scene))
        return {
            (action, reason) if isinstance(reason, str) else (action, reason.name, *reason.args)
            for action, reason in found
        }


def differences(rules: PythonRules, c: CRules, js: JsRules, scenes: Sequence[Scene]) -> Iterator[str]:
    """Yield each scene and language whose decision or reasons are others than in Python."""
    for scene, in_js in zip(scenes, js.decide(scenes), strict=True):
        try:
            decision = rules.decide(scene)
        except Undecided:
            expected: dict[str, Any] = {"status": "undecided"}
        except RuleFailure:
            expected = {"status": "failed"}
        else:
            expected = {"status": "decided", **StoredDecision(scene, decision, {}).as_json()}
        in_c = c.decide(scene)
        status = "decided" if "safe_actions" in in_js else next(iter(in_js))
        if status != expected["status"] or in_c["status"] != expected["status"]:
            yield f"python {expected['status']}, C {in_c['status']}, JavaScript {status}: {scene}"
            continue
        if status != "decided":
            continue
        reasons = rules.reasons(scene)
        if c.reasons(scene) != reasons or _reasons_in_js(in_js) != {
            one for one in reasons if one[0] not in in_js["safe_actions"]
        }:
            yield f"reasons: {reasons}, C {c.reasons(scene)}, JS {in_js['unsafe_actions']}: {scene}"
        for name in expected.keys() - {"status", "unsafe_actions"}:
            wanted = sorted(expected[name]) if name == "safe_actions" else expected[name]
            for language, answer in (("C", in_c), ("JavaScript", in_js)):
                given = sorted(answer[name]) if name == "safe_actions" else answer[name]
                if given != wanted:
                    yield f"{language}: {name} is {given}, {wanted} in Python: {scene}"


def _reasons_in_js(decision: dict[str, Any]) -> set[tuple[Any, ...]]:
    return {
        (
            action,
            one["reason"],
            *(one[name] for name in ("vehicle", "gap", "needed") if name in one),
            *one.get("details", ()),
        )
        for action, found in decision["unsafe_actions"].items()
        for one in found
    }


def compare(name: str, count: int) -> None:
    """Print what differs for one rule file."""
    with tempfile.TemporaryDirectory() as folder:
        export_rules([Path(name)], "c", Path(folder) / "c", decisions=10)
        export_rules([Path(name)], "js", Path(folder) / "js", decisions=10)
        rules, c, js = PythonRules(name), CRules(Path(folder) / "c"), JsRules(Path(folder) / "js")
        wrong = 0
        scenes = draw_scenes(count, 16, seed=7, ends=Path(name).name == "merge.pl")
        for start in range(0, count, AT_ONCE):
            some = [next(scenes) for _ in range(min(AT_ONCE, count - start))]
            for problem in differences(rules, c, js, some):
                wrong += 1
                if wrong < 4:
                    print(problem)
        print(f"{name}: {wrong} of {count} scenes differ", flush=True)


if __name__ == "__main__":
    for file in sys.argv[2:] or FILES:
        compare(file, int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
