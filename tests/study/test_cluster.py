"""Tasks on a Ray cluster of two nodes on this machine."""

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.study import StudyFolder, work, workers_of
from drlsl.study.plan import Run, Task
from drlsl.workers import Crew

from .fake import INPUTS, PAUSE, perform, study, tell_to_fail

ray = pytest.importorskip("ray", reason="the extra ray is not installed")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    made.add_node(num_cpus=1)
    yield made
    made.shutdown()


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    return StudyFolder.prepare(tmp_path / "study", study(), INPUTS)


def test_a_study_on_two_nodes_with_failures(cluster: Any, folder: StudyFolder) -> None:
    tell_to_fail(folder.root, "m0-seed0", "raise", 1)
    tell_to_fail(folder.root, "m1-seed0.freeway", "killed", 1)
    tell_to_fail(folder.root, "m1-seed1", "raise", 3)
    busy = []
    on_terminate = signal.getsignal(signal.SIGTERM)
    workers = workers_of(folder, Crew(ray=cluster.address), perform)
    assert signal.getsignal(signal.SIGTERM) is on_terminate
    for progress in work(folder, workers):
        busy.append(len(progress.busy))
    assert (progress.done, progress.given_up) == (12, 4)
    assert max(busy) == 2
    (told,) = folder.failures(Task(Run("m0", 0)))
    assert told.summary == "told to fail at m0-seed0"
    assert "in _fail_if_told" in told.log
    assert "\x1b" not in told.log
    (killed,) = folder.failures(Task(Run("m1", 0), "freeway"))
    assert killed.summary == "the process or its node ended (WorkerCrashedError)"
    assert len(folder.failures(Task(Run("m1", 1)))) == 2


def test_a_stopped_study_goes_on_in_processes_of_this_machine(
    cluster: Any, folder: StudyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(PAUSE, "0.05")

    def begun() -> bool:
        return any(folder.episodes_done(run) for run in folder.study.runs)

    for progress in work(folder, workers_of(folder, Crew(ray=cluster.address), perform), begun):
        assert progress.failure is None
    assert not all(map(folder.is_done, folder.study.tasks))
    assert list(work(folder, workers_of(folder, Crew(2), perform)))[-1].done == 16


def test_the_nodes_of_a_cluster_do_real_work(cluster: Any, tmp_path: Path) -> None:
    config = tmp_path / "two.yaml"
    config.write_text(
        "seeds: 2\npreset: tiny\nmethods: {dqn: {label: DQN, train: {method: dqn}}}\n"
        "tests: {freeway: {label: freeway, recording: freeway}}\nevaluation_episodes: 1\n"
    )
    out = tmp_path / "study"
    arguments = ["study", "--config", str(config), "--out", str(out), "--ray", cluster.address]
    assert run(arguments) == 0
    assert "None." in (out / "report" / "report.md").read_text().partition("Runs that failed")[2][:20]


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("127.0.0.1:1", "no Ray cluster there"),
        ("127.0.0.1:99999", "no Ray cluster there"),
        ("ray://127.0.0.1:1", "no Ray cluster there"),
        ("auot", "expected HOST:PORT"),
    ],
)
def test_a_cluster_that_is_not_there(folder: StudyFolder, address: str, told: str) -> None:
    with pytest.raises(UserError, match=told):
        workers_of(folder, Crew(ray=address), perform)
