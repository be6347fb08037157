"""The page of drlsl view: what is in the file, how large it is, and that it was built from its sources."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
import zlib
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drlsl.cli import run
from drlsl.driving.episodes import Episode, Origin, episode_of_scene, save_episode
from drlsl.driving.explain import ReasonClauses
from drlsl.driving.export import RuleProgram, draw_scenes
from drlsl.driving.page import MOST_FRAMES, write_page
from drlsl.driving.page.page_program import page_program
from drlsl.driving.scene import Action, load_scene, scene_json
from drlsl.driving.shield import Shield
from tests.driving.driven import drive

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"
ASSETS = ROOT / "drlsl" / "driving" / "page" / "assets"
SCENE = ROOT / "examples" / "scene.json"


@pytest.fixture(scope="module")
def episode() -> Episode:
    return drive(seeds=(3,), track_length=840.0)[0]


def data_of(page: Path) -> dict[str, Any]:
    """Return the data of a page."""
    text = page.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">\n(.*)\n</script>', text)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


def columns_of(packed: str) -> dict[str, np.ndarray[Any, Any]]:
    """Return the columns of an episode in a page."""
    content = zlib.decompress(base64.b64decode(packed))
    head = int.from_bytes(content[:4], "little")
    begin = 4 + head
    return {
        name: np.frombuffer(content, f"<{kind}", size, begin + place).astype(np.int64)
        for name, (kind, place, size) in json.loads(content[4:begin]).items()
    }


def places_of(
    columns: dict[str, np.ndarray[Any, Any]], names: list[str], time_step: float
) -> dict[tuple[int, str], list[float]]:
    """Return x, y, vx and vy of every vehicle by frame and name."""
    found = {}
    begins, lengths = np.cumsum(columns["v_begin"]), columns["v_frames"]
    tracks: dict[str, list[np.ndarray[Any, Any]]] = {}
    for name in ("vx", "vy", "x", "y"):
        steps = np.split(columns[f"v_{name}_steps"], np.cumsum(lengths - 1)[:-1])
        firsts = columns[f"v_{name}_first"]
        tracks[name] = [np.cumsum([first, *rest]) for first, rest in zip(firsts, steps, strict=True)]
        for track, (begin, length) in enumerate(zip(begins, lengths, strict=True)):
            if name in ("x", "y"):
                speed = tracks[f"v{name}"][track]
                span = np.diff(np.cumsum(columns["frame"])[begin : begin + length] * time_step)
                driven = np.floor((speed[:-1] + speed[1:]) * span * 0.5 + 0.5)
                tracks[name][track] = tracks[name][track] + np.cumsum([0, *driven])
    for track, (begin, length) in enumerate(zip(begins, lengths, strict=True)):
        for n in range(length):
            values = [float(tracks[name][track][n]) * 0.02 for name in ("x", "y", "vx", "vy")]
            found[int(begin) + n, names[columns["v_name"][track]]] = values
    return found


def test_the_page_holds_the_drive_to_a_centimetre(tmp_path: Path, episode: Episode) -> None:
    out = tmp_path / "page.html"
    write_page(out, [episode], title="One")
    (shown,) = data_of(out)["episodes"]
    columns = columns_of(shown["columns"])
    places = places_of(columns, shown["names"], episode.road.time_step)
    seen = 0
    for frame in range(len(episode)):
        scene = episode.scene(frame)
        for car in (scene.ego, *scene.vehicles):
            if abs(car.x - scene.ego.x) > 2 * scene.road.radar_range:
                assert (frame, car.id) not in places
                continue
            assert places[frame, car.id] == pytest.approx([car.x, car.y, car.vx, car.vy], abs=0.0101)
            seen += 1
    assert seen == len(places)
    speeds = np.cumsum(columns["target_speed"]) * 0.02
    assert np.abs(speeds - episode.answers.target_speed).max() < 0.0101
    offered = (columns["offered"][:, None] >> np.arange(3)) & 1
    assert np.array_equal(offered, episode.answers.offered)
    assert np.array_equal(columns["action"], episode.action)
    observed = np.cumsum(columns["observation"].reshape(-1, len(episode)), axis=1).T * 0.001
    assert np.abs(observed - episode.answers.observation).max() < 0.00051
    reasons = sum(columns["r_frames"])
    assert reasons == sum(map(len, episode.reasons))


def test_the_page_needs_nothing_else(tmp_path: Path, episode: Episode) -> None:
    out = tmp_path / "page.html"
    write_page(out, [episode], title="</script><b>& more")
    text = out.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert not re.search(r"(src|href)=|url\(|@import|fetch\(|XMLHttpRequest|WebSocket|https?://", text)
    assert text.count("</script>") == 2
    assert "<title>&lt;/script&gt;&lt;b&gt;&amp; more</title>" in text
    assert data_of(out)["title"] == "</script><b>& more"


def test_the_page_is_small(tmp_path: Path, episode: Episode) -> None:
    """A thousand frames with controls and reasons; an episode that is joined to itself packs no better."""
    out = tmp_path / "page.html"
    write_page(out, [episode], title="One")
    (shown,) = data_of(out)["episodes"]
    fixed = out.stat().st_size - len(shown["columns"])
    assert fixed < 70_000
    per_thousand = len(shown["columns"]) / len(episode) * 1000
    assert fixed + per_thousand < 150_000
    assert fixed + 10 * per_thousand < 600_000


def test_a_thinned_page_keeps_the_last_frame_and_every_event(tmp_path: Path) -> None:
    from drlsl.driving.drivers import make_driver

    (one,) = drive(make_driver("always-change"), seeds=(3,), track_length=840.0)
    out = tmp_path / "page.html"
    write_page(out, [one], title="One", every=8)
    (shown,) = data_of(out)["episodes"]
    columns = columns_of(shown["columns"])
    frames = np.cumsum(columns["frame"])
    assert frames.tolist() == [*range(0, len(one) - 1, 8), len(one) - 1]
    assert columns["changed"].sum() == one.changed.sum() > 0
    assert len(columns["action"]) == len(frames) == shown["frames"]


def test_too_many_frames_are_refused_with_what_to_do(
    tmp_path: Path, episode: Episode, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "one.npz"
    save_episode(path, episode)
    monkeypatch.setattr("drlsl.driving.page.page_file.MOST_FRAMES", 100)
    assert MOST_FRAMES >= 10_000
    assert run(["view", str(path), "--out", str(tmp_path / "page.html")]) == 2
    problem = capsys.readouterr().err
    assert problem.count("\n") == 1
    every = re.search(r"thin them with --every (\d+)", problem)
    assert every is not None
    assert not (tmp_path / "page.html").exists()
    assert run(["view", str(path), "--out", str(tmp_path / "page.html"), "--every", every[1]]) == 0


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nowhere"], "there is no such run folder, episode or scene"),
        (["empty"], "empty has no episodes (.npz, .parquet)"),
        (["run"], "drlsl eval run --episodes 3 --episodes-out run/episodes"),
        (["alone.json"], "it has no vehicles besides the ego"),
        (
            ["notes.txt"],
            "expected a run, a folder or a file (.npz, .parquet) of episodes, or a scene (.json)",
        ),
        ([str(SCENE), "--out", "page.txt"], "ends in .html"),
        ([str(SCENE), "--out", "no/page.html"], "there is no folder no"),
        ([str(SCENE), "--rules", "nowhere.pl"], "nowhere.pl"),
    ],
)
def test_bad_input_is_one_line_that_says_what_to_do(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    problem: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    Path("run").mkdir()
    Path("run", "config.yaml").write_text("")
    Path("notes.txt").write_text("hello")
    alone = json.loads(SCENE.read_text(encoding="utf-8")) | {"vehicles": []}
    Path("alone.json").write_text(json.dumps(alone))
    out = [] if "--out" in arguments else ["--out", "page.html"]
    assert run(["view", *arguments, *out]) == 2
    told = capsys.readouterr().err
    assert problem in told
    assert told.count("\n") == 1
    assert not Path("page.html").exists()


def test_rules_that_were_named_must_be_right_for_recorded_episodes_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = load_scene(SCENE)
    origin = Origin("", "one", True, "rules", 0, 1, (), {}, "preferences")
    save_episode(tmp_path / "one.npz", episode_of_scene(Shield.default(), scene, origin))
    (tmp_path / "odd.pl").write_text("safe_actions(lane_keeping")
    out = tmp_path / "page.html"
    arguments = ["view", str(tmp_path / "one.npz"), "--rules", str(tmp_path / "odd.pl"), "--out", str(out)]
    assert run(arguments) == 2
    assert "odd.pl:1" in capsys.readouterr().err
    assert not out.exists()


def test_a_scene_becomes_a_page_of_one_moment(tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    assert run(["view", str(SCENE), "--out", str(out)]) == 0
    (shown,) = data_of(out)["episodes"]
    written = json.loads(SCENE.read_text(encoding="utf-8"))
    assert shown["scene"]["ego"]["x_m"] == written["ego"]["x_m"]
    assert [one["reason"] for one in shown["reasons"]] == ["too_close"]
    assert shown["clauses"][shown["reasons"][0]["clause"]]["line"] == 262


def test_episodes_of_several_methods_share_a_page(tmp_path: Path, episode: Episode) -> None:
    folder = tmp_path / "episodes"
    folder.mkdir()
    for enforced in (True, False):
        origin = replace(episode.origin, enforced=enforced)
        save_episode(folder / f"{enforced}.npz", replace(episode, origin=origin))
    out = tmp_path / "page.html"
    assert run(["view", str(folder), str(SCENE), "--out", str(out)]) == 0
    data = data_of(out)
    assert [one["name"] for one in data["episodes"]] == [
        "mobil, shield off, episode 1",
        "mobil, shield on, episode 1",
        "scene.json",
    ]
    assert data["show"] == [0, 1]


# What ships is what the sources make.


def test_the_built_files_are_not_stale() -> None:
    sources = [f"src/{path.name}" for path in (WEB / "src").iterdir()] + ["build.mjs", "package-lock.json"]
    total = hashlib.sha256()
    for name in sorted(sources):
        total.update(f"{name}\0".encode() + (WEB / name).read_bytes() + b"\0")
    for name in ("view.js", "view.css"):
        first = (ASSETS / name).read_text(encoding="utf-8").splitlines()[0]
        assert total.hexdigest() in first, f"{name} is stale: npm ci && npm run build, in web/"


def test_the_lock_names_no_host() -> None:
    lock = (WEB / "package-lock.json").read_text(encoding="utf-8")
    assert "resolved" not in lock
    assert "://" not in re.sub(r'"url": "[^"]*"', "", lock)
    assert json.loads(lock)["packages"][""]["devDependencies"]["esbuild"]


@pytest.fixture(scope="module")
def node() -> str:
    found = shutil.which("node")
    if found is None or not (WEB / "node_modules" / "esbuild").is_dir():
        pytest.skip("needs node and npm ci in web/")
    return found


def test_the_built_files_are_what_esbuild_makes(node: str, tmp_path: Path) -> None:
    subprocess.run([node, "build.mjs", str(tmp_path)], cwd=WEB, check=True)
    for name in ("view.js", "view.css"):
        assert (tmp_path / name).read_bytes() == (ASSETS / name).read_bytes()


def test_the_sources_have_the_types_that_they_say(node: str) -> None:
    done = subprocess.run(
        [node, "node_modules/typescript/bin/tsc", "--noEmit"],
        cwd=WEB,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("rules", ["highway.pl", "paper.pl", "overtake_left.pl"])
def test_the_rules_in_the_page_name_the_clauses_that_the_interpreter_does(rules: str, tmp_path: Path) -> None:
    if shutil.which("node") is None:
        pytest.skip("needs node")
    program = page_program([rules], RuleProgram.of([Path(rules)]).files)
    (tmp_path / "rules.mjs").write_bytes(zlib.decompress(base64.b64decode(program["module"])))
    scenes = list(draw_scenes(60, 12, seed=3))
    (tmp_path / "scenes.json").write_text(json.dumps([json.loads(scene_json(one)) for one in scenes]))
    script = (
        "import { decide_with_clauses } from './rules.mjs'; import { readFileSync } from 'node:fs';"
        "const scenes = JSON.parse(readFileSync('scenes.json'));"
        "console.log(JSON.stringify(scenes.map(decide_with_clauses)));"
    )
    done = subprocess.run(
        ["node", "--input-type=module", "-e", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    shield = Shield.from_files([rules])
    clauses, compared = ReasonClauses(shield), 0
    assert program["clauses"] == [asdict(one) for one in clauses.texts]
    for scene, answer in zip(scenes, json.loads(done.stdout), strict=True):
        refused = [action for action in Action if action.atom in answer.get("unsafe_actions", {})]
        found = [
            (action, objection, number)
            for action, against in answer.get("unsafe_actions", {}).items()
            for objection, number in zip(against, answer["clauses"][action], strict=True)
        ]
        reasons = clauses.reasons(scene, refused)
        assert found == [(one.action.atom, one.objection.as_json(), one.clause) for one in reasons]
        compared += len(found)
    assert compared > 60


def test_rules_that_are_not_there_do_not_keep_the_page_from_playing(tmp_path: Path, episode: Episode) -> None:
    out = tmp_path / "page.html"
    write_page(out, [replace(episode, origin=replace(episode.origin, rules=("gone.pl",)))], title="One")
    (program,) = data_of(out)["programs"]
    assert program["module"] is None
    assert "cannot be loaded here, give --rules: " in program["refused"]
    assert "gone.pl" in program["refused"]
