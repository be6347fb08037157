"""Pure tasks on a Ray cluster of two nodes on this machine."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from drlsl.cli import run
from drlsl.driving import stress_test
from drlsl.errors import UserError
from drlsl.workers import Crew, in_order
from tests.assurance import test_told_tables
from tests.cli import test_rules_test

from .chores import performed, squaring, tell

ray = pytest.importorskip("ray", reason="the extra ray is not installed")

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:a task was lost")]


@pytest.fixture
def cluster() -> Iterator[Any]:
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    made.add_node(num_cpus=1)
    yield made
    made.shutdown()


def squares(root: Path, cluster: Any, count: int, **options: Any) -> list[int]:
    crew = Crew(ray=cluster.address)
    return list(in_order(crew.perform(partial(squaring, root), range(count), **options)))


def test_the_tasks_of_lost_processes_and_nodes_are_done_again(
    cluster: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tell(tmp_path, "killed", 1)
    tell(tmp_path, "killed", 4, times=2)
    assert squares(tmp_path, cluster, 6) == [0, 1, 4, 9, 16, 25]
    assert [number for number, _ in performed(tmp_path)].count(4) == 3
    extra = cluster.add_node(num_cpus=1)
    found = []
    for answer in in_order(Crew(ray=cluster.address).perform(partial(squaring, tmp_path), range(40))):
        found.append(answer)
        if len(found) == 3:
            cluster.remove_node(extra, allow_graceful=False)
    assert found == [number * number for number in range(40)]
    assert capsys.readouterr().out == ""


def test_what_a_task_raises_ends_the_work(cluster: Any, tmp_path: Path) -> None:
    tell(tmp_path, "key", 1)
    with pytest.raises(KeyError):
        squares(tmp_path, cluster, 4)
    tell(tmp_path, "killed", 2, times=9)
    with pytest.raises(UserError, match="lost 3 times: the process or its node ended"):
        squares(tmp_path, cluster, 4)


def test_a_node_with_another_version_or_other_files_refuses(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drlsl.workers import cluster as module

    rules = tmp_path / "mine.pl"
    rules.write_text("a.\n")
    assert squares(tmp_path, cluster, 2, files=[rules]) == [0, 1]
    with monkeypatch.context() as context:
        context.setattr(module, "digest", lambda _: "that of another text")
        with pytest.raises(UserError, match=r"mine\.pl on .* differs"):
            squares(tmp_path, cluster, 2, files=[rules])
    with monkeypatch.context() as context:
        context.setattr(module, "__version__", "0.0.7")
        with pytest.raises(UserError, match=r"machine of the command 0\.0\.7"):
            squares(tmp_path, cluster, 2)


def test_commands_print_the_same_on_a_cluster(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stress_test, "BLOCK", 10)
    monkeypatch.chdir(tmp_path)
    Path("mine.pl").write_text(":- ensure_loaded('highway.pl').\n")
    arguments = ["stress", "freeway", "--episodes", "30", "--offers", "all", "--rules", "mine.pl", "--json"]
    proofs = ["rules", "verify", "mine.pl", "--only", "nobody_alongside", "--attack", "2000", "--json"]
    for command in (arguments, proofs):
        told = []
        for workers in (["--jobs", "1"], ["--ray", cluster.address]):
            assert run([*command, *workers]) == 0
            told.append(_without_seconds(json.loads(capsys.readouterr().out)))
        assert told[0] == told[1]


@pytest.mark.parametrize(
    ("rules", "table"),
    [
        (
            test_rules_test.RULES.replace(":- include('limits.pl').", "far(D) :- D > 30."),
            test_rules_test.TABLE,
        ),
        (test_told_tables.RULES, test_told_tables.TABLE),
    ],
    ids=["scenes", "facts"],
)
def test_mutants_are_told_alike_on_a_cluster(
    rules: str,
    table: str,
    cluster: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.pl").write_text(rules)
    Path("mine.test.yaml").write_text(table.replace("far(X), X = 1", "X = 1, far(X)"))
    told = []
    for workers in (["--jobs", "1"], ["--jobs", "2"], ["--ray", cluster.address]):
        assert run(["rules", "test", "mine.pl", "--mutate", *workers]) == 1
        told.append(capsys.readouterr().out)
    assert "this row would notice it" in told[0]
    assert told[0] == told[1] == told[2]


def _without_seconds(told: Any) -> Any:
    if isinstance(told, dict):
        return {key: _without_seconds(value) for key, value in told.items() if key != "seconds"}
    return [_without_seconds(one) for one in told] if isinstance(told, list) else told
