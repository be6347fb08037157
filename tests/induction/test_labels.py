"""Labels by simulation: what they mean, that they are counted, and that they are kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drlsl.driving.scene import SceneBatch, taken_rows
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.induction.lane_changes import Changes, Labelling, SceneBias, cached_changes, label_changes
from drlsl.induction.lane_changes.labelled_changes import WATCHED, labelling_shield
from drlsl.traffic import load_recording
from drlsl.workers import followed
from tests.driving.recordings import Drive, recording

QUICK = Labelling(changes=40, egos=16)


def alike(one: Changes, other: Changes) -> bool:
    same = all(
        np.array_equal(getattr(one.scenes, name), getattr(other.scenes, name))
        for name in ("x", "y", "id", "road")
    )
    return (
        same
        and one.scenes.roads == other.scenes.roads
        and np.array_equal(one.side, other.side)
        and np.array_equal(one.unsafe, other.unsafe)
        and (one.origin, one.left_out) == (other.origin, other.left_out)
    )


def test_labels_are_a_function_of_what_is_asked() -> None:
    made = load_recording("highway-test")
    one, again = (label_changes(QUICK, "learning.pl", made) for _ in range(2))
    assert len(one) == 40
    assert 0 < one.unsafe.sum() < 40
    assert alike(one, again)
    assert not alike(one, label_changes(Labelling(changes=40, egos=16, seed=1), "learning.pl", made))


def test_a_lane_change_begins_settled_and_towards_a_lane() -> None:
    changes = label_changes(QUICK, "learning.pl", load_recording("freeway"))
    offered = labelling_shield("learning.pl", tier="numpy").decide_batch(changes.scenes).action_mask
    assert offered[np.arange(len(changes)), 1 + changes.side].all()


def test_while_labelling_no_lane_change_is_given_up() -> None:
    assert Shield.default().engine.defines("lane_to_keep", 1)
    assert not labelling_shield("learning.pl").engine.defines("lane_to_keep", 1)


def test_a_vehicle_alongside_makes_a_change_unsafe_and_an_empty_road_safe() -> None:
    """The lanes on both sides are full of vehicles as fast as the traffic, or there is nobody else."""
    full = recording(
        [Drive(lane, x, 20.0) for lane in (1, 3) for x in np.arange(-300.0, 420.0, 6.0).tolist()], frames=400
    )
    changes = label_changes(Labelling(changes=12, egos=4), "learning.pl", full)
    from_middle = np.array([int(scene) == 2 for scene in changes.scenes.target_lane])
    assert from_middle.any()
    assert changes.unsafe[from_middle].all()
    empty = recording([Drive(1, 200.0, 0.0, length=1.0)], frames=400)
    nobody = label_changes(Labelling(changes=12, egos=4), "learning.pl", empty)
    values = SceneBias("learning.pl").values(nobody.scenes)[np.arange(12), nobody.side]
    alone = np.isnan(values).all(axis=1)
    assert alone.any()
    assert not nobody.unsafe[alone].any()


@pytest.mark.parametrize("label", ["fault", "contact", "rss"])
def test_labels_differ_in_what_they_call_unsafe(label: str) -> None:
    made = load_recording("freeway")
    changes = label_changes(Labelling(label=label, changes=60, egos=16), "learning.pl", made)  # type: ignore[arg-type]
    assert set(changes.left_out) <= {"excused", "cut short", "failed"}
    if label == "contact":
        assert "excused" not in changes.left_out
    if label == "rss":
        offered = Shield.default(tier="numpy").decide_batch(changes.scenes).action_mask
        mine = offered[np.arange(len(changes)), 1 + changes.side]
        assert 0 < mine.sum() < len(changes)
        assert changes.unsafe[~mine].mean() > changes.unsafe[mine].mean()


def test_the_label_of_distances_needs_the_predicate(tmp_path: Path) -> None:
    path = tmp_path / "mine.pl"
    path.write_text(":- ensure_loaded('highway.pl').\n")
    with pytest.raises(UserError, match="does not define critical_change/0"):
        label_changes(Labelling(label="rss", changes=1), str(path), load_recording("freeway"))


def test_labels_are_kept_until_anything_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRLSL_CACHE", str(tmp_path))
    made = load_recording("highway-test")
    asked: list[int] = []
    first = followed(cached_changes(QUICK, "learning.pl", made), asked.append)
    assert asked
    asked.clear()
    again = followed(cached_changes(QUICK, "learning.pl", made), asked.append)
    assert not asked
    assert alike(first, again)
    followed(cached_changes(Labelling(changes=39, egos=16), "learning.pl", made), asked.append)
    assert asked
    for file in (tmp_path / "labels").iterdir():
        file.write_bytes(file.read_bytes()[:100])
    with pytest.warns(UserWarning, match="damaged cache file"):
        assert alike(followed(cached_changes(QUICK, "learning.pl", made)), first)


def test_scenes_of_several_batches_are_joined() -> None:
    from drlsl.induction.lane_changes.labelled_changes import joined_scenes

    changes = label_changes(QUICK, "learning.pl", load_recording("highway-test"))
    parts = [taken_rows(changes.scenes, np.arange(low, low + 10)) for low in (0, 10, 20, 30)]
    other = label_changes(QUICK, "learning.pl", load_recording("freeway")).scenes
    joined = joined_scenes([*parts, other])
    expected = [batch.scene(n) for batch in (changes.scenes, other) for n in range(len(batch))]
    assert [joined.scene(n) for n in range(len(joined))] == expected
    assert isinstance(joined, SceneBatch)
    assert WATCHED == 6.0
