"""The tasks as they are: a tiny study from end to end, and what its results depend on."""

import importlib.util
import sys
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.driving.episodes import load_episode
from drlsl.errors import UserError
from drlsl.files import digest
from drlsl.learning.config import merged
from drlsl.study import StudyConfig, StudyFolder, inputs_of, perform, preset_study
from drlsl.study.plan import Run, Task, make_study
from drlsl.study.results import collect
from tests.learning import networks

from . import fake

WIDE = f"{networks.__name__}:wide"

TINY = {
    "seeds": 1,
    "preset": "tiny",
    "methods": {
        "dqn": {"label": "DQN", "train": {"method": "dqn"}, "paper": "DQN"},
        "mpsdqn": {"label": "MPSDQN", "train": {"method": "mpsdqn"}, "paper": "MPSDQN"},
        "dqnsl": {
            "label": "DQNSL, noisy",
            "train": {"method": "dqnsl", "network": {"noisy": True}, "env": {"rules": ["paper.pl"]}},
            "paper": "DQNSL",
        },
    },
    "tests": {"freeway": {"label": "freeway", "recording": "freeway"}},
    "sweeps": {
        "blind": {
            "label": "not seen",
            "test": "freeway",
            "setting": "sensing.drop_rate",
            "values": [0.9, 0.99],
        },
    },
    "evaluation_episodes": 2,
}


@pytest.mark.slow
def test_a_tiny_study(tmp_path: Path) -> None:
    (tmp_path / "tiny.yaml").write_text(str(TINY))
    out = tmp_path / "study"
    arguments = ["study", "--config", str(tmp_path / "tiny.yaml"), "--out", str(out)]
    assert run(arguments) == 0
    report = (out / "report" / "report.md").read_text()
    results = collect(StudyFolder.open(out))
    assert len(results.training) == 3 * 4
    assert len(results.tests) == 3 * 2
    assert (results.tests["episodes"] == 2).all()
    assert len(results.sweeps) == 3 * 2 * 2
    assert "| not seen | 0.99 |" in report
    assert run(arguments) == 0
    assert run(["study", "--out", str(out), "--report-only"]) == 0
    assert (out / "report" / "report.md").read_text() == report
    assert str(tmp_path) not in report.replace(f"drlsl {' '.join(arguments)}", "")


def test_a_driver_takes_part_in_a_study_without_being_trained(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def left(s): return [1] * len(s.offered)\n")
    plan = {
        **TINY,
        "sweeps": {},
        "train": {"env": {"track_length": 60.0}},
        "methods": {
            "keep": {"label": "keep", "driver": "keep"},
            "mine": {"label": "mine", "driver": f"{tmp_path / 'mine.py'}:left"},
        },
    }
    (tmp_path / "plan.yaml").write_text(str(plan))
    out = tmp_path / "study"
    assert run(["study", "--config", str(tmp_path / "plan.yaml"), "--out", str(out), "--jobs", "1"]) == 0
    folder = StudyFolder.open(out)
    assert f"driver {tmp_path / 'mine.py'}:left" in folder.inputs["digests"]
    results = collect(folder)
    assert (len(results.training), results.missing) == (0, [])
    assert results.tests["method"].tolist() == ["keep", "keep", "mine", "mine"]
    assert results.tests.loc[results.tests["method"] == "keep", "lane_changes"].sum() == 0
    assert "| keep |" in (out / "report" / "report.md").read_text()


SWERVE = """
def swerve(situations):
    lanes = situations.scenes.lane[:, 0].tolist()
    odd = [int(1000 * one.sum()) % 2 for one in situations.observations]
    return [2 if lane <= 2 else 1 if lane >= 4 else 1 + one for lane, one in zip(lanes, odd)]
"""


def test_contacts_at_fault_can_be_watched(tmp_path: Path) -> None:
    """What is kept is what was counted, and the report leads to the page."""
    (tmp_path / "mine.py").write_text(SWERVE)
    plan = {
        **TINY,
        "sweeps": {},
        "train": {"env": {"track_length": 250.0}},
        "methods": {"mine": {"label": "mine", "driver": f"{tmp_path / 'mine.py'}:swerve"}},
        "evaluation_episodes": 8,
    }
    (tmp_path / "plan.yaml").write_text(str(plan))
    out = tmp_path / "study"
    assert run(["study", "--config", str(tmp_path / "plan.yaml"), "--out", str(out), "--jobs", "1"]) == 0
    folder = StudyFolder.open(out)
    (task,) = folder.study.tasks
    for record in folder.result(task)["evaluations"]:
        at_fault = [n for n, one in enumerate(record["per_episode"], start=1) if one["at_fault"]]
        for number in at_fault[:2]:
            path = out / "contacts" / f"{task.name}-shield-{record['shield']}-{number:04}.npz"
            episode = load_episode(path)
            counted = record["per_episode"][number - 1]
            assert (episode.ending.kind, episode.ending.verdict) == ("contact", "at_fault")
            assert episode.distance[-1] == counted["distance"]
            assert episode.changed.sum() == counted["lane_changes"]
    kept = folder.contacts()
    assert kept
    assert "](contacts.html)" in (out / "report" / "report.md").read_text()
    assert '<a href="contacts.html">' in (out / "report" / "report.html").read_text()
    assert (out / "report" / "contacts.html").stat().st_size > 10_000


PPO = {
    **TINY,
    "sweeps": {},
    "train": {"episodes": 3, "env": {"track_length": 60.0}},
    "methods": {"ppo": {"label": "PPO", "ppo": {"steps": 16, "batch_size": 16, "epochs": 1}}},
}


@pytest.mark.skipif(importlib.util.find_spec("sb3_contrib") is None, reason="the extra sb3")
def test_masked_ppo_takes_part_in_a_study(tmp_path: Path) -> None:
    study, training = make_study(PPO, "test"), Task(Run("ppo", 0))
    folder = StudyFolder.prepare(tmp_path / "study", study, {"command": "drlsl study", **inputs_of(study)})
    perform(folder.root, training, lambda: True)
    assert not folder.is_done(training), "stopped"
    for task in study.tasks:
        perform(folder.root, task, lambda: False)
        assert folder.is_done(task)
    assert "sb3-contrib" in folder.result(training)["packages"]
    results = collect(folder)
    assert (len(results.training), results.missing) == (3, [])
    assert results.tests["shield"].tolist() == ["off", "on"]
    assert results.tests["contacts_at_fault"].tolist()[1] == 0


def test_a_study_with_masked_ppo_needs_a_package_before_anything_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    (tmp_path / "ppo.yaml").write_text(str(PPO))
    out = tmp_path / "study"
    assert run(["study", "--config", str(tmp_path / "ppo.yaml"), "--out", str(out)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "drlsl: masked PPO needs sb3-contrib, which is missing: pip install 'drlsl[sb3]'"
    ]
    assert not out.exists()


def test_what_stands_beside_the_benchmark_can_be_added_to_it() -> None:
    beside, benchmark = preset_study("benchmark-beside"), preset_study("benchmark")
    assert beside.extends(benchmark)
    assert set(beside.methods) - set(benchmark.methods) == {"oracle", "ppo"}
    assert beside.tests == benchmark.tests


@pytest.mark.slow
def test_a_training_that_was_stopped_goes_on_bit_for_bit(tmp_path: Path) -> None:
    study, task = make_study(TINY, "test"), Task(Run("dqnsl", 0))
    whole, broken = (StudyFolder.prepare(tmp_path / name, study, inputs_of(study)) for name in "ab")
    perform(whole.root, task, lambda: False)
    steps = iter(range(10_000))
    perform(broken.root, task, lambda: next(steps) > 120)
    assert not broken.is_done(task)
    assert broken.run_path(task.run).is_dir()
    perform(broken.root, task, lambda: False)
    assert broken.is_done(task)
    policies = [folder.run(task.run).policy.read_bytes() for folder in (whole, broken)]
    assert policies[0] == policies[1]


def test_inputs_name_every_rule_file_and_recording() -> None:
    digests = inputs_of(preset_study("paper"))["digests"]
    assert set(digests) == {
        "rules/highway.pl",
        "rules/longitudinal.pl",
        "rules/observation.pl",
        "rules/paper_observation.pl",
        "rules/paper.pl",
        "recording highway-train",
        "recording highway-test",
        "recording freeway",
    }
    assert len(set(digests.values())) == len(digests)


def test_inputs_name_the_file_of_a_network_of_the_users_own() -> None:
    def with_factory(name: str) -> StudyConfig:
        return make_study(
            merged(fake.study().model_dump(mode="json"), {"train": {"network": {"factory": name}}}), "test"
        )

    plain, own = (inputs_of(study)["digests"] for study in (fake.study(), with_factory(WIDE)))
    assert own.items() - plain.items() == {(f"network {WIDE}", digest([Path(networks.__file__)]))}
    with pytest.raises(UserError, match=r"network\.factory nets\.py:make: no file nets\.py"):
        inputs_of(with_factory("nets.py:make"))
