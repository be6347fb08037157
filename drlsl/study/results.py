"""The results of a study's tasks: a table of training episodes, and one of tests."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import pandas as pd

from drlsl.driving.simulation import Verdict
from drlsl.learning import METRIC_COLUMNS, Totals, time_saved
from drlsl.study.folder import StudyFolder
from drlsl.study.plan import StudyConfig, Task
from drlsl.workers import Failure

EXCUSES = [verdict.value for verdict in Verdict if verdict is not Verdict.AT_FAULT]
"""Reasons for a contact not to be the ego's fault."""

TRAINING_COLUMNS = ["method", "seed", *METRIC_COLUMNS]
_TOTALS = [field.name for field in dataclasses.fields(Totals) if field.name != "episodes"]
TEST_COLUMNS = ["method", "seed", "test", "shield", "episodes", *_TOTALS, "time_saved", *EXCUSES, "wall_s"]
SWEEP_COLUMNS = [*TEST_COLUMNS, "value"]


@dataclass(frozen=True, slots=True)
class Results:
    """All results that the report is made from."""

    study: StudyConfig
    training: pd.DataFrame
    """The metrics of every finished training, with the columns `method` and `seed`."""
    tests: pd.DataFrame
    """One row for each method, seed, test and state of the shield, with the columns of `Totals`.

    `time_saved` is against lane keeping behind the shield in the same episodes, if that is among the methods.
    """
    sweeps: pd.DataFrame
    """The same for each value of each sweep, which stands in the column `test`."""
    attempts: dict[Task, list[Failure]]
    """The attempts that failed."""
    missing: list[Task]
    """Tasks without a result, which are in no table."""
    inputs: dict[str, Any]
    makers: list[dict[str, Any]]
    """The different machines and versions that made the results."""


def collect(folder: StudyFolder) -> Results:
    """Read the results in a study's folder; the same files give the same results.

    Raises:
        UserError: a file is damaged.
    """
    done = [task for task in folder.study.tasks if folder.is_done(task)]
    made = {task: folder.result(task) for task in done}
    trainings = [_training(folder, task, made[task]) for task in done if task.test is None]
    kept = _times_of_baseline(folder.study, made)
    rows = [row for task in done if task.test is not None for row in _test(task, made[task], kept)]
    tests = [row for row in rows if row["test"] in folder.study.tests]
    sweeps = [row for row in rows if row["test"] in folder.study.sweeps]
    makers: list[dict[str, Any]] = []
    for result in made.values():
        maker = {key: result[key] for key in ("machine", "python", "packages")}
        if maker not in makers:
            makers.append(maker)
    return Results(
        study=folder.study,
        training=pd.concat(trainings, ignore_index=True)
        if trainings
        else pd.DataFrame(columns=TRAINING_COLUMNS),
        tests=pd.DataFrame(tests, columns=TEST_COLUMNS),
        sweeps=pd.DataFrame(sweeps, columns=SWEEP_COLUMNS),
        attempts={task: found for task in folder.study.tasks if (found := folder.failures(task))},
        missing=[task for task in folder.study.tasks if task not in made],
        inputs=folder.inputs,
        makers=makers,
    )


def _training(folder: StudyFolder, task: Task, result: dict[str, Any]) -> pd.DataFrame:
    frame = folder.run(task.run).metrics(result.get("metrics")).sort_values("episode", ignore_index=True)
    # Episodes of several environments pass at the same time.
    frame["wall_s"] /= folder.study.training(task.run).num_envs
    return frame.assign(method=task.run.method, seed=task.run.seed)[TRAINING_COLUMNS]


_Times = dict[tuple[int, str | None, float | None], list[float | None]]
"""Durations of episodes by seed, test and value of a sweep."""


def _times_of_baseline(study: StudyConfig, made: dict[Task, dict[str, Any]]) -> _Times:
    """Return the durations of lane keeping behind the shield."""
    return {
        (task.run.seed, task.test, record.get("value")): _times(record)
        for task, result in made.items()
        if task.run.method == study.baseline
        for record in result["evaluations"]
        if record["shield"] == "on"
    }


def _times(record: dict[str, Any]) -> list[float | None]:
    """Return the durations of an evaluation's episodes; None where one was not completed, or not measured."""
    return [
        None if episode["contact"] or episode["off_road"] else (episode.get("measures") or {}).get("time")
        for episode in record["per_episode"]
    ]


def _test(task: Task, result: dict[str, Any], kept: _Times) -> list[dict[str, Any]]:
    rows = []
    for record in result["evaluations"]:
        others = kept.get((task.run.seed, task.test, record.get("value")))
        reasons = [episode["contact_reason"] for episode in record["per_episode"] if episode["contact"]]
        rows.append(
            {
                "method": task.run.method,
                "seed": task.run.seed,
                "test": task.test,
                "shield": record["shield"],
                "episodes": record["episodes"],
                **record["totals"],
                "time_saved": None if others is None else time_saved(_times(record), others),
                **{reason: reasons.count(reason) for reason in EXCUSES},
                "wall_s": result["wall_s"] / len(result["evaluations"]),
                "value": record.get("value"),
            }
        )
    return rows
