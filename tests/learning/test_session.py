import csv
import gc
import os
import shutil
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from drlsl.errors import UserError
from drlsl.learning import RunFolder, Session, load_policy, load_state
from drlsl.learning.config import TrainConfig, make_config, merged

from .conftest import small_config
from .fake import fakes

pytestmark = pytest.mark.usefixtures("fake_driving")


def rows(root: Path) -> list[dict[str, str]]:
    """The metrics as text, without the wall time."""
    with (root / "metrics.csv").open(newline="") as file:
        return [{name: row[name] for name in row if name != "wall_s"} for row in csv.DictReader(file)]


def flat(state: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Leaves of nested dictionaries, lists and tuples by path."""
    if isinstance(state, dict):
        for key, value in state.items():
            yield from flat(value, f"{path}/{key}")
    elif isinstance(state, list | tuple):
        for index, value in enumerate(state):
            yield from flat(value, f"{path}/{index}")
    else:
        yield path, state


def assert_same_outcome(one: Path, other: Path) -> None:
    """Bit-identical checkpoints, weights and metrics."""
    assert rows(one) == rows(other)
    for kind in ("checkpoint", "policy"):
        mine, theirs = (dict(flat(load_state(root / f"{kind}.pt", kind))) for root in (one, other))
        assert mine.keys() == theirs.keys()
        for path, value in mine.items():
            # The checksum of the metrics is of wall times too.
            if path.endswith(("/elapsed_s", "/metrics")):
                continue
            same = (
                torch.equal(value, theirs[path]) if isinstance(value, torch.Tensor) else value == theirs[path]
            )
            assert same, path


def train_whole(root: Path, config: TrainConfig) -> None:
    with Session.start(root, config) as session:
        for _ in session.run():
            pass


def test_a_run_leaves_its_files(tmp_path: Path, tiny_config: TrainConfig) -> None:
    session = Session.start(tmp_path / "run", tiny_config)
    events = [episode for event in session.run() for episode in event.ended]
    session.draw_figures()
    assert {path.name for path in session.folder.root.iterdir()} == {
        "config.yaml",
        "metrics.csv",
        "checkpoint.pt",
        "policy.pt",
        "figures",
        ".lock",
    }
    found = rows(session.folder.root)
    assert [int(row["episode"]) for row in found] == [1, 2, 3, 4, 5, 6]
    assert [float(row["return"]) for row in found] == [event.summary.total_return for event in events]
    assert load_state(session.folder.policy, "policy")["episodes"] == 6


def in_envs(config: TrainConfig, count: int) -> TrainConfig:
    return make_config(merged(config.model_dump(), {"num_envs": count}), "test")


@pytest.mark.parametrize("num_envs", [1, 3])
@pytest.mark.parametrize("stop_after", [1, 25, 36, 70])
@pytest.mark.parametrize(
    "learning", [{}, {"precision": "bfloat16"}, {"overlap": True}], ids=["", "bfloat16", "overlap"]
)
def test_a_stopped_and_resumed_run_is_bit_identical(
    tmp_path: Path, tiny_config: TrainConfig, stop_after: int, num_envs: int, learning: dict[str, Any]
) -> None:
    settings = {"num_envs": num_envs, "learning": learning, "network": {"hidden": [16, 16]}}
    config = make_config(merged(tiny_config.model_dump(), settings), "test")
    train_whole(tmp_path / "whole", config)
    session = Session.start(tmp_path / "run", config)
    for _ in session.run(lambda: session.trainer.total_steps >= stop_after):
        pass
    assert stop_after <= session.trainer.total_steps == session.saved_steps < stop_after + num_envs
    session.close()
    resumed = Session.resume(tmp_path / "run")
    assert resumed.saved_steps == session.saved_steps
    for _ in resumed.run():
        pass
    assert_same_outcome(tmp_path / "whole", tmp_path / "run")


@pytest.mark.parametrize("num_envs", [1, 3])
def test_a_killed_run_goes_back_to_its_checkpoint(
    tmp_path: Path, tiny_config: TrainConfig, num_envs: int
) -> None:
    config = in_envs(tiny_config, num_envs)
    train_whole(tmp_path / "whole", config)
    session = Session.start(tmp_path / "run", config)
    since_fifth = 0
    for _ in session.run():
        # What a kill at this moment leaves is what is on disk.
        since_fifth += session.trainer.finished == 5
        if since_fifth == 3:
            shutil.copytree(tmp_path / "run", tmp_path / "killed")
            break
    assert len(rows(tmp_path / "killed")) == 5
    resumed = Session.resume(tmp_path / "killed")
    assert resumed.trainer.finished == 4
    assert len(rows(tmp_path / "killed")) == 4
    for _ in resumed.run():
        pass
    assert_same_outcome(tmp_path / "whole", tmp_path / "killed")


@pytest.mark.skipif(sys.platform != "linux", reason="reads the process's memory as Linux shows it")
def test_memory_stays_as_it_is_once_the_replay_is_full(tmp_path: Path) -> None:
    config = make_config(
        merged(
            small_config().model_dump(),
            {"episodes": 1_500, "num_envs": 4, "checkpoint_every": 100, "env": {"track_length": 75.0}},
        ),
        "test",
    )
    session = Session.start(tmp_path / "run", config)
    held: dict[int, tuple[int, int]] = {}
    tracemalloc.start()
    try:
        for event in session.run():
            for episode in event.ended:
                if episode.finished % 500 == 0:
                    gc.collect()
                    held[episode.finished] = (tracemalloc.get_traced_memory()[0], resident_bytes())
    finally:
        tracemalloc.stop()
    (python_before, all_before), _, (python_after, all_after) = held.values()
    assert session.trainer.total_steps > 10 * config.learning.replay_capacity
    # A thousand episodes later: anything kept of each of them, or of their steps, would be more.
    assert python_after - python_before < 60_000
    assert all_after - all_before < 8_000_000


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_run_killed_before_its_first_episode_resumes(tmp_path: Path, tiny_config: TrainConfig) -> None:
    train_whole(tmp_path / "whole", tiny_config)
    Session.start(tmp_path / "run", tiny_config)
    for _ in Session.resume(tmp_path / "run").run():
        pass
    assert_same_outcome(tmp_path / "whole", tmp_path / "run")


def test_a_complete_run_resumes_to_nothing(tmp_path: Path, tiny_config: TrainConfig) -> None:
    train_whole(tmp_path / "run", tiny_config)
    assert list(Session.resume(tmp_path / "run").run()) == []
    assert len(rows(tmp_path / "run")) == 6


def test_an_edited_configuration_is_not_resumed(tmp_path: Path, tiny_config: TrainConfig) -> None:
    train_whole(tmp_path / "run", tiny_config)
    path = tmp_path / "run" / "config.yaml"
    path.write_text(path.read_text().replace("episodes: 6", "episodes: 7"))
    with pytest.raises(UserError, match=r"damaged, or changed by hand .* put it back"):
        Session.resume(tmp_path / "run")


def test_a_run_without_a_checkpoint_is_not_resumed(tmp_path: Path, tiny_config: TrainConfig) -> None:
    RunFolder.create(tmp_path / "run", tiny_config)
    with pytest.raises(UserError, match="cannot read the checkpoint"):
        Session.resume(tmp_path / "run")


def test_an_environment_that_cannot_be_made_leaves_no_folder(
    tmp_path: Path, tiny_config: TrainConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drlsl import driving

    def fail(*arguments: object, **_: object) -> None:
        raise UserError("no such recording")

    monkeypatch.setitem(vars(driving), "make_vec", fail)
    with pytest.raises(UserError, match="no such recording"):
        Session.start(tmp_path / "runs" / "run", tiny_config)
    assert list(tmp_path.iterdir()) == []


def test_a_policy_drives_as_its_training_left_it(tmp_path: Path, tiny_config: TrainConfig) -> None:
    session = Session.start(tmp_path / "run", tiny_config)
    for _ in session.run():
        pass
    env = fakes(2)
    policy = load_policy(RunFolder.open(tmp_path / "run"), env)
    for seed in range(5):
        observation, _ = env.reset(seed=[seed, seed + 10])
        expected = session.trainer.agent.policy.values(observation)
        assert policy.values(observation).tolist() == expected.tolist()


def test_weights_of_another_network_are_refused(tmp_path: Path, tiny_config: TrainConfig) -> None:
    train_whole(tmp_path / "run", tiny_config)
    wider = make_config(merged(tiny_config.model_dump(), {"network": {"hidden": [32]}}), "test")
    with pytest.raises(UserError, match="do not fit"):
        load_policy(RunFolder(tmp_path / "run", wider), fakes(1))
