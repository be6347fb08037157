"""Trainings and tests that take no time, and fail where they are told to."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from drlsl.errors import UserError
from drlsl.learning import RunFolder, as_record
from drlsl.learning.episode import EpisodeSummary
from drlsl.learning.trainer import EpisodeEvent
from drlsl.study import StudyConfig, StudyFolder
from drlsl.study.plan import Task, make_study
from drlsl.study.tasks import SHIELDS
from drlsl.workers import Stop

PAUSE = "PAUSE_S"
"""Environment variable: how long an episode takes."""

INPUTS: dict[str, Any] = {"command": "drlsl study", "digests": {"rules/highway.pl": "abc"}}


def study(seeds: int = 2, methods: int = 2, episodes: int = 12) -> StudyConfig:
    """A study with as many methods as wanted, two of them the paper's."""
    papers = ["DQN", "DQNSL", None]
    return make_study(
        {
            "seeds": seeds,
            "preset": "tiny",
            "train": {"episodes": episodes},
            "methods": {
                f"m{index}": {
                    "label": f"Method {index}",
                    "train": {"method": "dqn" if index == 0 else "dqnsl"},
                    "paper": papers[min(index, 2)],
                }
                for index in range(methods)
            },
            "tests": {
                "left-to-right": {
                    "label": "left to right",
                    "recording": "highway-test",
                    "direction": "left_to_right",
                    "paper": "left_to_right",
                },
                "freeway": {"label": "freeway", "recording": "freeway"},
            },
            "sweeps": {
                "latency": {
                    "label": "latency [s]",
                    "test": "freeway",
                    "setting": "sensing.latency",
                    "values": [0.5, 1],
                },
            },
            "evaluation_episodes": 3,
        },
        "test",
    )


def perform(root: Path, task: Task, stop: Stop) -> None:
    """Do a task with numbers made up from its name, slowly if PAUSE_S says so."""
    folder = StudyFolder.open(root)
    with folder.locked(task.name, wait_s=5.0):
        if folder.is_done(task):
            return
        with (root / "performed.txt").open("a") as file:
            file.write(f"{task.name}\n")
        _fail_if_told(root, task)
        if task.test is None:
            _train(folder, task, stop)
        else:
            _evaluate(folder, task)


def tell_to_fail(root: Path, name: str, how: str, times: int) -> None:
    """Let the next attempts at a task "raise", be "killed" or end "silently"."""
    for number in range(times):
        (root / f"fail.{name}.{number}").write_text(how)


def _fail_if_told(root: Path, task: Task) -> None:
    told = sorted(root.glob(f"fail.{task.name}.[0-9]"))
    if not told:
        return
    how = told[0].read_text()
    told[0].unlink()
    if how == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "silently":
        os._exit(3)
    if how == "raise":
        raise UserError(f"told to fail at {task.name}")


def _train(folder: StudyFolder, task: Task, stop: Stop) -> None:
    path, config = folder.run_path(task.run), folder.study.training(task.run)
    run = RunFolder.open(path) if path.exists() else RunFolder.create(path, config)
    for number in range(folder.episodes_done(task.run) + 1, config.episodes + 1):
        if stop():
            return
        time.sleep(float(os.environ.get(PAUSE, "0")))
        summary = _summary(task, number)
        run.append_metrics(EpisodeEvent(number, number, 10 * number, summary, 0.1, 0.01, 0.5, 0.25))
    made = {"machine": "2 cores", "python": "3", "packages": {"drlsl": "1"}}
    folder.finish(task, {**made, "metrics": run.sync_metrics()})


def _evaluate(folder: StudyFolder, task: Task) -> None:
    assert task.test is not None
    time.sleep(float(os.environ.get(PAUSE, "0")))
    study = folder.study
    values: list[dict[str, float]] = [{}]
    if task.test in study.sweeps:
        values = [{"value": value} for value in study.sweeps[task.test].values]
    records = []
    for value in values:
        for shield in SHIELDS:
            told = f"{shield}{value or ''}"
            summaries = [_summary(task, number, told) for number in range(study.evaluation_episodes)]
            records.append({**value, **as_record(summaries, env={}, shield=shield, seed=task.run.seed)})
    made = {"machine": "2 cores", "python": "3", "packages": {"drlsl": "1"}}
    folder.finish(task, {**made, "wall_s": 1.5, "evaluations": records})


def _summary(task: Task, number: int, shield: str = "") -> EpisodeSummary:
    rng = np.random.default_rng([number, *f"{task.name}{shield}".encode()])
    contact = bool(rng.random() < 0.2)
    lane_changes = int(rng.integers(5))
    collision = -60.0 * contact
    return EpisodeSummary(
        steps=int(rng.integers(600, 700)),
        total_return=200.0 - 5.0 * lane_changes + collision,
        reward_lane_change=-5.0 * lane_changes,
        reward_velocity=200.0,
        reward_collision=collision,
        reward_off_road=0.0,
        lane_changes=lane_changes,
        contact=contact,
        at_fault=contact and task.run.method == "m0",
        contact_reason=("at_fault" if task.run.method == "m0" else "cut_off") if contact else "",
        off_road=False,
        mean_speed=28.0,
        distance=840.0,
        mask_size=2.0,
        interventions=int(rng.integers(100)),
        fail_safe=0,
    )
