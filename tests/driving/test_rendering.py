"""Moving pictures of a drive: what is on them, and how environments and the command line make them."""

from __future__ import annotations

import copy
import errno
import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from drlsl.cli import run
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.rendering import COLOURS, Film, Moment, RoadView, Window, moment_of_scene
from drlsl.driving.scene import Scene, load_scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError

pygame = pytest.importorskip("pygame", reason="pip install 'drlsl[render]'")
imageio = pytest.importorskip("imageio.v2", reason="pip install 'drlsl[render]'")

from drlsl.driving.rendering.road_view import EGO, SEEN, UNSEEN  # noqa: E402

EXAMPLE = Path(__file__).parents[2] / "examples" / "scene.json"
CHANGE_REFUSED = (255, 140, 60)


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default()


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(EXAMPLE)


def pixels(picture: np.ndarray[Any, Any], colour: tuple[int, int, int]) -> int:
    """Return the number of pixels of exactly that colour."""
    return int((picture == np.array(colour)).all(axis=2).sum())


def test_the_ego_is_green_and_what_it_sees_red(scene: Scene) -> None:
    view = RoadView()
    alone = view.draw(Moment(replace(scene, vehicles=()), ()))
    assert pixels(alone, EGO) > 100
    assert (pixels(alone, SEEN), pixels(alone, UNSEEN)) == (0, 0)
    near = scene.ego._replace(id="near", x=scene.ego.x + 60.0)
    far = scene.ego._replace(id="far", x=scene.ego.x + 104.0)
    one = view.draw(Moment(replace(scene, vehicles=(near,)), ()))
    both = view.draw(Moment(replace(scene, vehicles=(near, far)), ()))
    assert pixels(one, SEEN) == pixels(both, SEEN) > 100
    assert pixels(one, UNSEEN) < 10 < 100 < pixels(both, UNSEEN)
    assert pixels(both, EGO) == pixels(alone, EGO)


def test_the_ego_stands_at_one_place_and_looks_ahead(scene: Scene) -> None:
    """Ahead is where it drives to: right in one carriageway, left in the other."""
    left, right = (lane for lane in scene.road.lanes if lane.id in (2, 4))
    places = {}
    for lane, sign in ((right, 1), (left, -1)):
        ego = scene.ego._replace(lane=lane.id, y=lane.centre, vx=sign * 20.0)
        picture = RoadView((1000, 400)).draw(Moment(replace(scene, ego=ego, vehicles=()), ()))
        places[sign] = float((picture == np.array(EGO)).all(axis=2).nonzero()[1].mean())
    assert places[1] == pytest.approx(380, abs=3)
    assert places[-1] == pytest.approx(620, abs=3)


def test_beyond_the_end_of_a_lane_there_is_grass(scene: Scene) -> None:
    alone = replace(scene, vehicles=())
    grass, along = np.array(COLOURS["grass"]), 1200 * 0.62 / 115
    for outer, sign in ((alone.road.lanes[-1], 1), (alone.road.lanes[0], -1)):
        assert outer.direction.sign == sign
        ego = scene.ego._replace(lane=outer.id, y=outer.centre, vx=sign * 20.0)
        grown = []
        for room in (20.0, 60.0):
            lanes = [
                replace(lane, end=ego.x + sign * room) if lane == outer else lane for lane in alone.road.lanes
            ]
            road = replace(alone.road, lanes=tuple(lanes))
            picture = RoadView().draw(Moment(replace(alone, ego=ego, road=road), ()))
            places = (picture == grass).all(axis=2)
            whole = RoadView().draw(Moment(replace(alone, ego=ego), ()))
            new = places & ~(whole == grass).all(axis=2)
            columns = new.nonzero()[1]
            first = columns.min() if sign > 0 else columns.max()
            assert first == pytest.approx(600 - sign * (144 - room * along), abs=6)
            grown.append(int(new.sum()))
        assert grown[0] > grown[1] > 0


def test_more_is_orange_the_more_is_missing(shield: Shield, scene: Scene) -> None:
    """The gap to the sports car in the next lane, and what is missing of it, are drawn to scale."""
    fast = next(car for car in scene.vehicles if car.id == "sports_car")
    counts = []
    for speed in (30.0, 31.0, 32.0):
        others = tuple(fast._replace(vx=speed) if car is fast else car for car in scene.vehicles)
        moment = moment_of_scene(shield, replace(scene, vehicles=others))
        (objection,) = (one for found in moment.unsafe.values() for one in found)
        without = RoadView().draw(replace(moment, unsafe={}))
        drawn = pixels(RoadView().draw(moment)[60:300], CHANGE_REFUSED) - pixels(
            without[60:300], CHANGE_REFUSED
        )
        counts.append((objection.missing or 0.0, drawn))
    metres, drawn_pixels = zip(*counts, strict=True)
    along = 1200 * 0.62 / 115
    for first, second in ((0, 1), (1, 2)):
        wider = (metres[second] - metres[first]) * along * 5
        assert drawn_pixels[second] - drawn_pixels[first] == pytest.approx(wider, abs=15)


def test_gymnasium_accepts_its_pictures() -> None:
    env = gymnasium.make("drlsl/Highway-v0", recording="overtake-test", render_mode="rgb_array")
    assert env.metadata["render_fps"] == pytest.approx(10.0)
    check_env(env.unwrapped)
    env.reset(seed=0)
    before = env.render()
    env.step(0)
    after = env.render()
    assert isinstance(before, np.ndarray)
    assert before.shape == (400, 1200, 3)
    assert before.dtype == np.uint8
    assert (before != after).any()


def test_pictures_change_nothing() -> None:
    plain = HighwayEnv(recording="overtake-test", decision_period=1.0)
    drawn = HighwayEnv(recording="overtake-test", decision_period=1.0, render_mode="rgb_array")
    assert drawn.metadata["render_fps"] == pytest.approx(1.0)
    for env in (plain, drawn):
        env.reset(seed=5)
    for action in (0, 1, 0, 2, 0):
        first, second = plain.step(action), drawn.step(action)
        drawn.render()
        assert (first[0] == second[0]).all()
        assert first[1:4] == second[1:4]
        assert str(first[4]) == str(second[4])
    assert plain.render() is None


def test_many_environments_show_what_each_would() -> None:
    many = HighwayVectorEnv(recording="overtake-test", num_envs=2, render_mode="rgb_array")
    many.reset(seed=7)
    many.step(np.array([0, 1]))
    pictures = many.render()
    assert pictures is not None
    for index, action in enumerate((0, 1)):
        one = HighwayEnv(recording="overtake-test", render_mode="rgb_array")
        one.reset(seed=7 + index)
        one.step(action)
        picture = one.render()
        assert picture is not None
        assert np.array_equal(picture, pictures[index])
    with pytest.raises(UserError, match="render_mode 'human': no such mode; expected one of rgb_array"):
        HighwayVectorEnv(recording="overtake-test", num_envs=2, render_mode="human")


def test_an_environment_that_draws_can_be_copied() -> None:
    env = HighwayEnv(recording="overtake-test", render_mode="rgb_array")
    env.reset(seed=1)
    other = copy.deepcopy(env)
    before, same = env.render(), other.render()
    other.step(0)
    later = other.render()
    assert before is not None
    assert same is not None
    assert later is not None
    assert np.array_equal(before, same)
    assert not np.array_equal(before, later)


def test_a_window_shows_every_frame_until_it_is_closed(
    monkeypatch: pytest.MonkeyPatch, shield: Shield, scene: Scene
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    shown = []
    monkeypatch.setattr(pygame.display, "flip", lambda: shown.append(1))
    env = HighwayEnv(recording="overtake-test", decision_period=0.5, render_mode="human", shield=shield)
    env.reset(seed=0)
    env.step(0)
    assert len(shown) == 1 + 5
    assert env.render() is None
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(0)
    assert len(shown) == 6
    env.close()
    window = Window(RoadView(), 1000.0)
    window.show(moment_of_scene(shield, scene))
    window.close()
    window.show(moment_of_scene(shield, scene))
    assert len(shown) == 7
    assert not window.open


def test_without_pygame_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(UserError, match=r"rendering needs pygame: pip install 'drlsl\[render\]'") as caught:
        HighwayEnv(recording="overtake-test", render_mode="rgb_array")
    # Stable-Baselines3 asks for pictures of every environment, and goes on without after this error alone.
    assert isinstance(caught.value, TypeError)


@pytest.mark.parametrize(("height", "width"), [(60, 80), (61, 81)])
@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_a_film_holds_every_picture_in_any_size(tmp_path: Path, ending: str, height: int, width: int) -> None:
    path = tmp_path / f"film{ending}"
    with Film(path, 10.0) as film:
        for level in range(7):
            film.add(np.full((height, width, 3), 30 * level, np.uint8))
    read = [np.asarray(picture) for picture in imageio.get_reader(path)]
    assert len(read) == film.pictures == 7
    assert [int(picture[..., :3].mean()) for picture in read] == pytest.approx(
        [30 * level for level in range(7)], abs=4
    )
    assert read[0].shape[:2] == (height + height % 2, width + width % 2)


@pytest.mark.parametrize("ending", [".png", ".mp4", ".gif"])
@pytest.mark.parametrize("old", [None, b"an older film"])
def test_a_film_that_fails_leaves_what_was_there(
    tmp_path: Path, ending: str, old: bytes | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"film{ending}"
    if old is not None:
        path.write_bytes(old)
    picture = np.zeros((60, 80, 3), np.uint8)

    def interrupted() -> None:
        with Film(path, 10.0) as film:
            film.add(picture)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    film = Film(path, 10.0)
    film.add(picture)
    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(UserError, match=rf"film\{ending}: cannot write: No space left on device"):
        film.close()
    assert (path.read_bytes() if path.exists() else None) == old
    assert [one.name for one in tmp_path.iterdir()] == ([] if old is None else [path.name])


def test_a_film_replaces_no_folder(tmp_path: Path) -> None:
    (tmp_path / "film.gif").mkdir()
    with pytest.raises(UserError, match=r"film\.gif: is a folder, expected a file to write"):
        Film(tmp_path / "film.gif", 10.0)


def test_gymnasium_records_it(tmp_path: Path) -> None:
    pytest.importorskip("moviepy", reason="Gymnasium's RecordVideo needs moviepy")
    env = gymnasium.wrappers.RecordVideo(
        gymnasium.make("drlsl/Highway-v0", recording="overtake-test", render_mode="rgb_array"),
        str(tmp_path / "films"),
    )
    env.reset(seed=0)
    for _ in range(12):
        env.step(0)
    env.close()  # type: ignore[no-untyped-call]  # Gymnasium's
    (film,) = (tmp_path / "films").glob("*.mp4")
    assert sum(1 for _ in imageio.get_reader(film)) == 13


def test_a_film_is_of_the_episode_that_eval_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flags = ["--seed", "4", "--set", "env.track_length=150"]
    evaluated = [
        "eval",
        "keep",
        "--recording",
        "overtake-test",
        "--episodes",
        "2",
        "--shield",
        "on",
        "--json",
    ]
    assert run([*evaluated, *flags]) == 0
    record = json.loads(capsys.readouterr().out)["evaluations"][0]
    for number, episode in enumerate(record["per_episode"], start=1):
        path = tmp_path / f"{number}.gif"
        drawn = ["render", "overtake-test", "--driver", "keep", "--episode", str(number), "--out", str(path)]
        assert run([*drawn, *flags, "--width", "320", "--height", "240"]) == 0
        frames = round(episode["measures"]["time"] * 10)
        assert f"{frames + 1 + 10} pictures" in capsys.readouterr().out


def test_a_scene_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.png"
    assert run(["render", str(EXAMPLE), "--out", str(path), "--width", "640"]) == 0
    assert capsys.readouterr().out == f"wrote {path}\n"
    assert imageio.imread(path).shape == (400, 640, 3)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["overtake-test", "--out", "film.avi"], "film.avi: expected a file that ends in .png, .gif, .mp4"),
        (["overtake-test", "--out", "no/film.mp4"], "no/film.mp4: there is no folder no"),
        (["nowhere", "--out", "film.mp4"], "nowhere: no such file or folder"),
        (["no.json", "--out", "film.png"], "no.json"),
        (["overtake-test", "--out", "film.mp4", "--set", "learning.discount=0"], "--set: expected settings"),
        (["overtake-test", "--out", "film.mp4", "--driver", "nobody"], "nobody"),
        (
            ["overtake-test", "--out", "film.mp4", "--begin", "500", "--set", "env.track_length=50"],
            "--begin 500: the episode is over after",
        ),
    ],
)
def test_what_cannot_be_drawn_leaves_no_file(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    expected: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["render", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("drlsl: ")
    assert expected in captured.err
    assert captured.err.count("\n") == 1
    assert not [*tmp_path.iterdir()]
