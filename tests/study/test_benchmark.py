"""Drivers without learning beside the methods, and what the benchmark says of them."""

from pathlib import Path
from typing import Any

import pytest

from drlsl.learning import as_record, time_saved
from drlsl.study import StudyConfig, StudyFolder, benchmark, collect, write_report
from drlsl.study.plan import Run, Task, make_study
from drlsl.study.tasks import SHIELDS, perform
from tests.learning.test_evaluation import measured

from .fake import INPUTS

TIMES: dict[str, list[float | None]] = {
    "keep": [20.0, 20.0, None, 10.0],
    "mobil": [16.0, None, 15.0, 8.0],
    "always-change": [22.0, 22.0, 9.0, 11.0],
}
"""Durations of four episodes, by method; None: a contact."""


def study(**methods: object) -> StudyConfig:
    values = {
        "seeds": 2,
        "preset": "tiny",
        "train": {"env": {"track_length": 400.0, "decision_period": 0.5}},
        "methods": methods or {name: {"label": name.title(), "driver": name} for name in TIMES},
        "tests": {"short": {"label": "short road", "recording": "overtake-test"}},
        "evaluation_episodes": 8,
    }
    return make_study(values, "test")


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    """A study whose episodes last as long as `TIMES` says, a tenth longer without the shield."""
    made = StudyFolder.prepare(tmp_path / "study", study(), INPUTS)
    for task in made.study.tasks:
        records = []
        for shield in SHIELDS:
            slower = 1.0 if shield == "on" else 1.1
            times = TIMES[task.run.method]
            summaries = [measured((time or 1.0) * slower, contact=time is None) for time in times]
            records.append(as_record(summaries, env={}, shield=shield, seed=task.run.seed))
        maker: dict[str, Any] = {"machine": "2 cores", "python": "3", "packages": {"drlsl": "1"}}
        made.finish(task, {**maker, "wall_s": 1.0, "evaluations": records})
    return made


def test_without_a_driver_that_keeps_its_lane_there_is_no_time_saved() -> None:
    assert study().baseline == "keep"
    assert study(dqn={"label": "DQN"}).baseline is None


def test_time_saved_is_against_keeping_the_lane_behind_the_shield(folder: StudyFolder) -> None:
    outcome = benchmark(collect(folder))["short"]
    assert outcome["keep"]["time_saved"] == 0.0
    assert outcome["mobil"]["time_saved"] == pytest.approx(1.0 - 24.0 / 30.0)
    assert outcome["mobil"]["time_saved_interval"] == pytest.approx([0.2, 0.2])
    assert outcome["always-change"]["time_saved"] == pytest.approx(-0.1)
    assert (outcome["mobil"]["excused"], outcome["mobil"]["at_fault"]) == (2, 0)
    assert (outcome["mobil"]["episodes"], outcome["mobil"]["completed"]) == (8, 6)
    assert outcome["mobil"]["jerk_rms"] == pytest.approx(2.0)
    off = benchmark(collect(folder), "off")["short"]
    assert off["keep"]["time_saved"] == pytest.approx(-0.1)


def test_the_report_opens_with_time_saved_against_contacts_at_fault(folder: StudyFolder) -> None:
    out = write_report(folder)
    text = (out / "report.md").read_text(encoding="utf-8")
    assert text.index("figures/outcome.png") < text.index("Expected and found")
    assert (out / "figures" / "outcome.png").read_bytes().startswith(b"\x89PNG")


def test_a_real_driver_is_driven(tmp_path: Path) -> None:
    folder = StudyFolder.prepare(tmp_path / "study", study(), INPUTS)
    for name in ("keep", "always-change"):
        perform(folder.root, Task(Run(name, 0), "short"), lambda: False)
    found = benchmark(collect(folder))["short"]
    assert found["keep"]["time_saved"] == 0.0
    assert found["always-change"]["lane_changes_per_km"] > 0
    assert found["keep"]["at_fault"] == 0


def test_time_saved_needs_equally_many_episodes() -> None:
    with pytest.raises(ValueError, match="shorter"):
        time_saved([1.0], [])
