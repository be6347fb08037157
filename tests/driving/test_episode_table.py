"""Episodes as Parquet hold all that the archives hold, to the bit, and others read their columns."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.cli import run
from drlsl.driving.episodes import Ending, Episode, Origin, is_episode, load_episode, save_episode
from drlsl.driving.episodes.driven_episode import Answers, VehicleRows
from drlsl.driving.explain import Objection, Reason, RuleClause
from drlsl.driving.scene import Action, Road
from drlsl.driving.shield import ObservationSpace
from drlsl.driving.simulation.world import World
from drlsl.errors import UserError
from drlsl.traffic import Direction, Lane
from tests.driving.driven import drive
from tests.driving.test_episodes import same

arrow = pytest.importorskip("pyarrow", reason="needs the extra parquet")
parquet = pytest.importorskip("pyarrow.parquet")

FLOATS = st.floats(allow_nan=False)
TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=8)
INTEGERS = st.integers(-(2**63), 2**63 - 1)
LANE = Lane(1, Direction.LEFT_TO_RIGHT, 2.0, 3.75, 36.1)


@st.composite
def vehicle_rows(draw: Any, frames: int, names: int) -> VehicleRows:
    counts = draw(st.lists(st.integers(1, 3), min_size=frames, max_size=frames))
    total = sum(counts)
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    numbers = rng.normal(size=(total, 6))
    numbers[draw(st.integers(0, total - 1))] = draw(st.tuples(*[st.floats(width=64)] * 6))
    begin = np.cumsum([0, *counts], dtype=np.int64)
    return VehicleRows(begin, rng.integers(0, names, total), rng.integers(-9, 9, total), numbers)


@st.composite
def reasons(draw: Any, clauses: int) -> Reason:
    details = draw(st.lists(TEXTS | FLOATS, max_size=4))
    objection = Objection(draw(st.sampled_from(["settled", "no_lane", "ü"])), details=tuple(details))
    if draw(st.booleans()):
        objection = Objection("too_close", draw(TEXTS), draw(FLOATS), draw(FLOATS))
    clause = draw(st.none() | st.integers(0, clauses - 1)) if clauses else None
    return Reason(draw(st.sampled_from(list(Action))), objection, clause)


@st.composite
def drawn_episodes(draw: Any) -> Episode:
    frames, observed = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    names = draw(st.lists(TEXTS, min_size=1, max_size=4, unique=True))
    clauses = tuple(RuleClause("a.pl", line, f"a :- {line}.") for line in range(draw(st.integers(0, 2))))
    rng = np.random.default_rng(draw(st.integers(0, 99)))

    def floats(*shape: int) -> Any:
        values = rng.normal(size=(frames, *shape))
        values.flat[rng.integers(values.size)] = draw(st.sampled_from([math.nan, math.inf, -0.0, 5e-324]))
        return values

    def masks(*shape: int) -> Any:
        return rng.random((frames, *shape)) < 0.5

    whole = [draw(st.lists(INTEGERS, min_size=frames, max_size=frames)) for _ in range(3)]
    target, keep, action = (np.array(values, dtype=np.int64) for values in whole)
    return Episode(
        origin=Origin(draw(TEXTS), "r", True, "rules", 3, 1, ("a.pl",), {"a.pl": "0"}, "Q-values"),
        ending=Ending("contact", "at_fault", draw(TEXTS), draw(st.floats(0.0, 90.0))),
        road=Road((LANE, replace(LANE, id=2, centre=5.75, end=draw(st.none() | st.just(100.0)))), 0.1, 100.0),
        observation=ObservationSpace.of(
            [f"o{one}" for one in range(observed)], [(-math.inf, 1.0)] * observed
        ),
        clauses=clauses,
        names=tuple(names),
        traffic=draw(vehicle_rows(frames, len(names))),
        seen=draw(st.none() | vehicle_rows(frames, len(names))),
        target_lane=target,
        distance=floats(),
        answers=Answers(masks(3), floats(), floats(observed), masks(), keep, floats()),
        action=action,
        preferences=floats(3),
        changed=masks(),
        entered=masks(),
        reasons=tuple(tuple(draw(st.lists(reasons(len(clauses)), max_size=3))) for _ in range(frames)),
        failures={0: draw(TEXTS)} if draw(st.booleans()) else {},
    )


@settings(max_examples=60, deadline=None)
@given(drawn_episodes())
def test_what_is_read_is_what_was_written(tmp_path_factory: pytest.TempPathFactory, episode: Episode) -> None:
    folder = tmp_path_factory.mktemp("episode")
    for suffix in (".npz", ".parquet"):
        path = folder / f"one{suffix}"
        save_episode(path, episode)
        assert same(load_episode(path), episode)
        before = path.read_bytes()
        save_episode(path, load_episode(path))
        assert path.read_bytes() == before


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two driven episodes as archives, the second with what faulty sensing saw."""
    folder = tmp_path_factory.mktemp("drives")
    save_episode(folder / "plain.npz", drive(seeds=(3,))[0])
    save_episode(folder / "faulty.npz", drive(seeds=(5,), sensing={"position_noise": 0.5})[0])
    return folder


def test_a_row_says_in_words_what_a_frame_was(written: Path, tmp_path: Path) -> None:
    episode = load_episode(written / "faulty.npz")
    save_episode(tmp_path / "one.parquet", episode)
    table = parquet.read_table(tmp_path / "one.parquet")
    assert table.num_rows == len(episode)
    header = json.loads(table.schema.metadata[b"drlsl episode"])
    assert header["origin"]["driver"] == "mobil"
    told = 0
    for frame in range(0, len(episode), 11):
        row = table.slice(frame, 1).to_pylist()[0]
        for name, scene in (("vehicles", episode.scene(frame)), ("seen", episode.seen_scene(frame))):
            cars = [tuple(one.values()) for one in row[name]]
            assert cars == [tuple(one) for one in (scene.ego, *scene.vehicles)]
        assert row["target_speed"] == episode.answers.target_speed[frame]
        for found, reason in zip(row["reasons"], episode.reasons[frame], strict=True):
            assert found["action"] == reason.action.atom
            assert found["reason"] == reason.objection.reason
            names = [one["name"] for one in found["arguments"] if one["name"] is not None]
            assert names == ([reason.objection.vehicle] if reason.objection.vehicle else [])
            told += 1
    assert told


def test_episodes_are_converted_there_and_back(written: Path, tmp_path: Path, capsys: Any) -> None:
    there, back = tmp_path / "there", tmp_path / "back"
    assert run(["data", "convert", str(written), "--out", str(there), "--to", "parquet"]) == 0
    assert capsys.readouterr().out == f"{there}: 2 episodes\n"
    names = [str(there / "plain.parquet"), str(there / "faulty.parquet")]
    assert run(["data", "convert", *names, "--out", str(back), "--to", "npz"]) == 0
    for name in ("plain.npz", "faulty.npz"):
        assert (back / name).read_bytes() == (written / name).read_bytes()
    assert run(["data", "convert", names[0], "--out", str(tmp_path / "one.npz")]) == 0
    assert (tmp_path / "one.npz").read_bytes() == (written / "plain.npz").read_bytes()
    capsys.readouterr()
    for path in (names[0], str(there)):
        assert run(["view", path, "--out", str(tmp_path / "page.html")]) == 0
    assert "2 episodes" in capsys.readouterr().out


def test_an_episode_named_as_a_recording_is_told_what_shows_it(
    written: Path, tmp_path: Path, capsys: Any
) -> None:
    save_episode(tmp_path / "one.parquet", load_episode(written / "plain.npz"))
    for path in (written / "plain.npz", tmp_path / "one.parquet"):
        assert run(["data", "info", str(path)]) == 2
        shown = "an episode, which `drlsl view` and `drlsl render` show"
        assert capsys.readouterr().err == f"drlsl: {path}: no recording, but {shown}\n"
    assert run(["data", "info", str(written)]) == 2
    assert "no recordings, but episodes, which `drlsl view` shows" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["{written}/plain.npz", "freeway", "--out", "x"], "freeway: no episodes, as others are"),
        (["{written}", "--out", "x.parquet"], "2 episodes need a folder"),
        (["{written}", "--out", "x"], "episodes become .npz or .parquet"),
        (["{written}/plain.npz", "--out", "x.parquet", "--every", "2"], "are for recordings"),
        (["{written}/plain.npz", "--out", "{written}/plain.npz"], "exists already"),
        (
            ["{written}", "{written}", "--out", "x", "--to", "parquet"],
            "two of the episodes would be called so",
        ),
        (["freeway", "--out", "x.npz"], "no episodes, which alone are written as .npz"),
    ],
)
def test_what_cannot_be_converted_is_said_in_one_line(
    written: Path, tmp_path: Path, monkeypatch: Any, capsys: Any, words: list[str], problem: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["data", "convert", *(word.format(written=written) for word in words)]) == 2
    told = capsys.readouterr().err
    assert problem in told
    assert told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def changed(table: Any, name: str, column: Any) -> Any:
    return table.set_column(table.column_names.index(name), name, column)


DAMAGE: dict[str, Any] = {
    "target_speed is missing in": lambda table: changed(
        table, "target_speed", arrow.array([None, *[1.0] * (table.num_rows - 1)])
    ),
    "lists of offered differ in length": lambda table: changed(
        table, "offered", arrow.array([[True], *[[True] * 3] * (table.num_rows - 1)])
    ),
    "array offered has shape": lambda table: changed(
        table, "offered", arrow.array([[True]] * table.num_rows)
    ),
    "distance is missing, or of another kind": lambda table: changed(
        table, "distance", arrow.array(["far"] * table.num_rows)
    ),
    "a damaged episode": lambda table: table.drop(["vehicles"]),
    "not an episode: a Parquet file without": lambda table: table.replace_schema_metadata({}),
    "format": lambda table: table.replace_schema_metadata({b"drlsl episode": b"{}"}),
    "not JSON": lambda table: table.replace_schema_metadata({b"drlsl episode": b"\xff{"}),
    "is not in the header": lambda table: table.replace_schema_metadata(
        {b"drlsl episode": table.schema.metadata[b"drlsl episode"].replace(b'"ego"', b'"ago"')}
    ),
    "a frame has no ego": lambda table: changed(
        table, "vehicles", arrow.array([[]] * table.num_rows, type=table.schema.field("vehicles").type)
    ),
}


@pytest.mark.parametrize("problem", DAMAGE)
def test_a_damaged_table_is_refused_in_one_line(written: Path, tmp_path: Path, problem: str) -> None:
    path = tmp_path / "one.parquet"
    save_episode(path, load_episode(written / "plain.npz"))
    parquet.write_table(DAMAGE[problem](parquet.read_table(path)), path)
    with pytest.raises(UserError, match=problem) as caught:
        load_episode(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_what_is_no_parquet_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.parquet"
    with pytest.raises(UserError, match="no such file"):
        load_episode(path)
    path.write_bytes(b"PAR1, or so")
    for ask in (load_episode, is_episode):
        with pytest.raises(UserError, match="cannot be read"):
            ask(path)


def test_an_episode_is_a_file_that_ends_so(written: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"ends in \.npz or \.parquet"):
        save_episode(tmp_path / "one.csv", load_episode(written / "plain.npz"))


def test_a_recording_is_no_episode(tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "freeway.parquet"
    assert run(["data", "convert", "freeway", "--out", str(path)]) == 0
    assert not is_episode(path)
    with pytest.raises(UserError, match="without the header"):
        load_episode(path)
    assert run(["data", "convert", str(path), "--out", str(tmp_path / "again.parquet")]) == 0
    assert "vehicles" in capsys.readouterr().out


def test_a_missing_library_is_told_before_the_first_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    out = tmp_path / "episodes"
    asked = ["--episodes", "1", "--shield", "on", "--episodes-out", str(out), "--episodes-as", "parquet"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(World, "step", None)  # Nothing is driven.
        assert run(["eval", "keep", *asked]) == 2
    assert "pyarrow" in capsys.readouterr().err
    assert not out.exists()
