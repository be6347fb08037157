import csv
import math
import threading
from pathlib import Path

import pytest

from drlsl.errors import UserError
from drlsl.learning import METRIC_COLUMNS, RunFolder, next_free_folder
from drlsl.learning.config import TrainConfig
from drlsl.learning.episode import EpisodeSummary
from drlsl.learning.trainer import EpisodeEvent


def event(episode: int, *, loss: float | None = 0.1) -> EpisodeEvent:
    summary = EpisodeSummary(
        steps=10,
        total_return=-1 / 3,
        reward_lane_change=-5.0,
        reward_velocity=0.1 + 0.2,
        reward_collision=0.0,
        reward_off_road=0.0,
        lane_changes=1,
        contact=True,
        at_fault=False,
        contact_reason="struck from behind",
        off_road=False,
        mean_speed=25.0,
        distance=840.0,
        mask_size=1.5,
        interventions=2,
        fail_safe=0,
    )
    return EpisodeEvent(
        episode=episode,
        finished=episode,
        total_steps=episode * 10,
        summary=summary,
        epsilon=0.1,
        learning_rate=1e-4,
        loss=loss,
        wall_s=0.5,
    )


@pytest.fixture
def folder(tmp_path: Path, tiny_config: TrainConfig) -> RunFolder:
    return RunFolder.create(tmp_path / "deep" / "run", tiny_config)


def names(path: Path) -> set[str]:
    return {item.name for item in path.iterdir()}


def test_rows_read_back_as_they_were_added(folder: RunFolder) -> None:
    added = [folder.append_metrics(event(1, loss=None)), folder.append_metrics(event(2))]
    assert folder.episodes() == added
    assert added[0]["contact"] is True
    assert (added[0]["loss"], added[1]["return"], added[1]["episode"]) == (None, -1 / 3, 2)
    path = folder.root / "metrics.csv"
    path.write_text(path.read_text() + path.read_text().splitlines()[-1][:-1])
    assert folder.episodes() == added
    assert len(folder.metrics()) == 2


def test_rows_that_are_no_metrics_are_refused(folder: RunFolder) -> None:
    folder.append_metrics(event(1))
    path = folder.root / "metrics.csv"
    text = path.read_text()
    for damaged in (text.replace("struck from behind,0", "struck from behind,no"), text + "2,20\n"):
        path.write_text(damaged)
        with pytest.raises(UserError, match=r"metrics\.csv: damaged: "):
            folder.episodes()


def test_a_new_folder_opens_with_its_configuration(folder: RunFolder, tiny_config: TrainConfig) -> None:
    assert RunFolder.open(folder.root).config == tiny_config
    assert names(folder.root.parent) == {"run"}
    assert folder.metrics().empty


def test_an_empty_folder_is_taken(tmp_path: Path, tiny_config: TrainConfig) -> None:
    assert RunFolder.create(tmp_path, tiny_config).metrics().empty


def test_an_existing_run_is_refused_untouched(folder: RunFolder, tiny_config: TrainConfig) -> None:
    folder.append_metrics(event(1))
    with pytest.raises(UserError, match=r"--resume .* --force"):
        RunFolder.create(folder.root, tiny_config)
    assert len(folder.metrics()) == 1
    assert names(folder.root.parent) == {"run"}


def test_force_replaces_a_run(folder: RunFolder, tiny_config: TrainConfig) -> None:
    folder.append_metrics(event(1))
    folder.checkpoint.write_bytes(b"old")
    (folder.root / ".checkpoint.pt.x1y2").write_bytes(b"left by a killed process")
    folder.lock().release()
    RunFolder.create(folder.root, tiny_config, force=True)
    assert names(folder.root) == {"config.yaml", "metrics.csv"}
    assert folder.metrics().empty
    assert names(folder.root.parent) == {"run"}


@pytest.mark.parametrize("extra", ["thesis.tex", ".git", ".configuration"])
def test_force_deletes_nothing_that_no_run_wrote(
    folder: RunFolder, tiny_config: TrainConfig, extra: str
) -> None:
    (folder.root / extra).write_text("mine")
    with pytest.raises(UserError, match=extra):
        RunFolder.create(folder.root, tiny_config, force=True)
    assert (folder.root / extra).read_text() == "mine"


def test_force_does_not_take_a_folder_without_a_run(tmp_path: Path, tiny_config: TrainConfig) -> None:
    (tmp_path / "metrics.csv").write_text("mine")
    with pytest.raises(UserError, match=r"holds no config\.yaml"):
        RunFolder.create(tmp_path, tiny_config, force=True)


def test_a_file_in_the_way_is_refused(tmp_path: Path, tiny_config: TrainConfig) -> None:
    (tmp_path / "run").write_text("mine")
    with pytest.raises(UserError, match="in the way"):
        RunFolder.create(tmp_path / "run", tiny_config, force=True)
    with pytest.raises(UserError, match="cannot make the run folder"):
        RunFolder.create(tmp_path / "run" / "below", tiny_config)


def test_a_folder_without_a_run_does_not_open(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no run here"):
        RunFolder.open(tmp_path)


def test_metrics_come_back_bit_for_bit(folder: RunFolder) -> None:
    folder.append_metrics(event(1, loss=None))
    folder.append_metrics(event(2, loss=1e-17))
    frame = folder.metrics()
    assert list(frame.columns) == METRIC_COLUMNS
    assert {"episode", "steps", "total_steps", "return", "mask_size", "wall_s"} <= set(METRIC_COLUMNS)
    assert math.isnan(frame["loss"][0])
    assert frame["loss"][1] == pytest.approx(1e-17)
    with (folder.root / "metrics.csv").open(newline="") as file:
        row = next(csv.DictReader(file))
    assert float(row["return"]) == -1 / 3
    assert float(row["reward_velocity"]) == 0.1 + 0.2
    assert frame["contact"].tolist() == [1, 1]
    assert frame["at_fault"].tolist() == [0, 0]
    assert frame["contact_reason"][0] == "struck from behind"


def test_rows_after_the_checkpoint_are_dropped(folder: RunFolder) -> None:
    for episode in (1, 2, 3):
        folder.append_metrics(event(episode))
    with (folder.root / "metrics.csv").open("a") as file:
        file.write("4,40,1")
    folder.keep_metrics({1, 2})
    assert folder.metrics()["episode"].tolist() == [1, 2]
    folder.append_metrics(event(3))
    assert folder.metrics()["episode"].tolist() == [1, 2, 3]
    folder.keep_metrics(())
    assert folder.metrics().empty


def test_rows_are_told_by_their_episode_not_counted(folder: RunFolder) -> None:
    path = folder.root / "metrics.csv"
    for episode in (2, 1, 4):
        folder.append_metrics(event(episode))
    whole = folder.sync_metrics()
    expected = path.read_bytes()
    header, *rows = path.read_text().splitlines(keepends=True)
    for episode in (5, 2, 3, 4, 1):
        folder.append_metrics(event(episode, loss=0.7))
    mixed = path.read_text().splitlines(keepends=True)[4:]
    # Two that went on at once, each with rows of its own, one of them half written.
    path.write_text("".join([header, "4,40,1\n", mixed[0], *rows, *mixed[1:], "6,6"]))
    folder.keep_metrics({1, 2, 4}, whole)
    assert path.read_bytes() == expected


@pytest.mark.parametrize(
    "change", [("0.1,", "0.3,"), ("struck", "strucj"), ("\n1,", "\n1 ,"), ("loss", "lost")]
)
def test_damaged_rows_are_an_error(folder: RunFolder, change: tuple[str, str]) -> None:
    folder.append_metrics(event(1))
    whole = folder.sync_metrics()
    path = folder.root / "metrics.csv"
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    before = path.read_bytes()
    with pytest.raises(UserError, match=r"metrics\.csv: (damaged|no row of the finished episode 1)"):
        folder.keep_metrics({1}, whole)
    assert path.read_bytes() == before


def test_missing_rows_are_an_error(folder: RunFolder) -> None:
    folder.append_metrics(event(1))
    with pytest.raises(UserError, match="no row of the finished episode 2"):
        folder.keep_metrics({1, 2})
    (folder.root / "metrics.csv").unlink()
    with pytest.raises(UserError, match="cannot read the metrics"):
        folder.keep_metrics(())


def test_metrics_of_something_else_are_an_error(folder: RunFolder) -> None:
    (folder.root / "metrics.csv").write_text("a,b\n1,2\n")
    with pytest.raises(UserError, match="expected the columns episode"):
        folder.metrics()


def test_an_evaluation_takes_the_place_of_its_like(folder: RunFolder) -> None:
    on = {"shield": "on", "env": {"recording": "a"}, "totals": 1}
    off = {"shield": "off", "env": {"recording": "a"}, "totals": 2}
    folder.save_evaluations([on, off], ("shield", "env"))
    folder.save_evaluations([on | {"totals": 3}], ("shield", "env"))
    assert folder.evaluations() == [on | {"totals": 3}, off]


def test_evaluations_that_end_at_once_are_all_kept(folder: RunFolder) -> None:
    def save(number: int) -> None:
        for part in range(5):
            folder.save_evaluations([{"seed": 5 * number + part}], ("seed",))

    threads = [threading.Thread(target=save, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(item["seed"] for item in folder.evaluations()) == list(range(40))


@pytest.mark.parametrize("text", ["", "[]", "{}", "nonsense"])
def test_a_foreign_evaluation_file_is_an_error(folder: RunFolder, text: str) -> None:
    (folder.root / "evaluation.json").write_text(text)
    with pytest.raises(UserError, match="not a run's evaluations"):
        folder.save_evaluations([], ())
    assert (folder.root / "evaluation.json").read_text() == text


def test_the_next_free_folder(tmp_path: Path) -> None:
    assert next_free_folder(tmp_path, "run") == tmp_path / "run"
    (tmp_path / "run").mkdir()
    (tmp_path / "run-2").mkdir()
    assert next_free_folder(tmp_path, "run") == tmp_path / "run-3"
