"""The page of drlsl view in a real Chromium, by clicks and keys: web/test/page.test.mjs says how."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drlsl.cli import run
from drlsl.driving.drivers import Situations, make_driver
from drlsl.driving.explain import objections
from drlsl.driving.page import write_page
from drlsl.driving.scene import Action, load_scene, write_scenes
from drlsl.driving.shield import Shield
from drlsl.files import digest
from tests.driving.driven import drive

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"

INTERPRETED = """
:- ensure_loaded('highway.pl').
objection(left_lane_change, odd) :- findall(X, vehicle(X, _, _, _, _, _, _, _), Xs), msort(Xs, []).
"""


class Stubborn:
    """A driver that wants nothing but to the left."""

    window = 1

    def preferences(self, situations: Situations) -> np.ndarray:
        return np.tile([0.5, 1.0, 0.0], (len(situations.offered), 1))


@pytest.fixture(scope="module")
def chromium() -> str:
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    if shutil.which("node") is None or not (WEB / "node_modules" / "playwright-core").is_dir():
        pytest.skip("needs node and npm ci in web/")
    return found


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    scene = ROOT / "examples" / "scene.json"
    assert run(["view", str(scene), "--out", str(folder / "scene.html")]) == 0
    ending = load_scene(scene)
    lanes = [replace(lane, end=ending.ego.x + 40.0) if lane.id == 5 else lane for lane in ending.road.lanes]
    write_scenes(folder, {"ramp": replace(ending, road=replace(ending.road, lanes=tuple(lanes)))})
    assert run(["view", str(folder / "ramp.json"), "--out", str(folder / "ramp.html")]) == 0
    rules = Shield.default().files()
    digests = {path.name: digest([path]) for path in rules}
    (one,) = drive(seeds=(3,), track_length=900.0)
    origin = replace(one.origin, digests=digests)
    on, off = (replace(one, origin=replace(origin, enforced=enforced)) for enforced in (True, False))
    (busy,) = drive(make_driver("always-change"), seeds=(4,), track_length=400.0)
    busy = replace(busy, origin=replace(busy.origin, driver="always-change", digests=digests))
    write_page(folder / "drives.html", [off, on, busy], title="Three")
    (stubborn,) = drive(Stubborn(), seeds=(3,))
    write_page(folder / "stubborn.html", [stubborn], title="Stubborn")
    write_page(folder / "busy.html", [busy], title="Busy")
    write_page(folder / "changed.html", [one], title="Changed")
    text = folder / "interpreted.pl"
    text.write_text(INTERPRETED)
    (odd,) = drive(seeds=(3,), rules=(str(text),))
    digests |= {text.name: digest([text])}
    odd = replace(odd, origin=replace(odd.origin, rules=(str(text),), digests=digests))
    write_page(folder / "interpreted.html", [odd], title="Interpreted")
    return folder


def test_by_clicks_and_keys(chromium: str, pages: Path) -> None:
    done = subprocess.run(
        ["node", "--test", "--test-reporter=tap", "test/page.test.mjs"],
        cwd=WEB,
        env={**os.environ, "PAGES": str(pages), "CHROMIUM": chromium},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6000:]
    assert int(re.findall(r"# pass (\d+)", done.stdout)[0]) >= 15
    # What the page says about the scene that was copied there, and what the interpreter says.
    scene, shield = load_scene(pages / "copied.json"), Shield.default()
    (objection,) = objections(shield, scene, shield.decide(scene))[Action.LEFT_LANE_CHANGE]
    assert objection.words() in (pages / "copied.txt").read_text()
