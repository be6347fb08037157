"""Interrupt a training and a study repeatedly, and check that both end as if never interrupted.

python scripts/interruptions.py runs/interruptions --interruptions 30

Progress is kept in the folder: the same command resumes. The exit status is 1 if any bit differs.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import torch

from drlsl.learning import Kind, load_state

SETTINGS: dict[str, Any] = {
    "checkpoint_every": 3,
    "device": "cpu",
    "num_envs": 2,
    "env": {"track_length": 60.0, "tier": "numpy"},
    "evaluation": {"episodes": 2, "episodes_after_training": 0},
}
"""Short episodes and, with the preset tiny, a small network, so that files are written often."""

STUDY: dict[str, Any] = {
    "seeds": 2,
    "preset": "tiny",
    "methods": {
        "dqn": {"label": "DQN", "train": {"method": "dqn"}},
        "dqnsl": {"label": "DQNSL", "train": {"method": "dqnsl"}},
    },
    "tests": {"freeway": {"label": "freeway", "recording": "freeway"}},
    "evaluation_episodes": 2,
}

PATIENCE_S = 300.0
"""Longest wait for a process."""

LONGEST_S = 1.5
"""Longest time that a process runs before it is interrupted."""

Process = subprocess.Popen[bytes]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run both parts and print the differences."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--interruptions", type=int, default=30, help="of the training, and of the study")
    parser.add_argument("--episodes", type=int, default=600, help="of each training")
    given = parser.parse_args(arguments)
    # A background process of a shell ignores Ctrl-C, and so would the processes started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    given.folder.mkdir(parents=True, exist_ok=True)
    differences = [
        *training(given.folder, given.interruptions, given.episodes),
        *study(given.folder, given.interruptions, given.episodes),
    ]
    for line in differences:
        print(f"differs: {line}")
    print(f"{len(differences)} differences")
    return 1 if differences else 0


class Log:
    """Interruptions so far, kept in a file; their number seeds the next one."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.done: list[str] = json.loads(path.read_text("utf-8")) if path.exists() else []

    def draw(self) -> random.Random:
        """Return a random generator for the next interruption."""
        return random.Random(len(self.done))

    def add(self, how: str) -> None:
        """Record an interruption."""
        self.done.append(how)
        self._path.write_text(json.dumps(self.done), "utf-8")
        print(f"{self._path.stem}: {len(self.done)} {how}", flush=True)

    def __str__(self) -> str:
        counts = sorted(Counter(how.partition(",")[0] for how in self.done).items())
        return f"{len(self.done)} interruptions ({', '.join(f'{count} {how}' for how, count in counts)})"


def training(folder: Path, interruptions: int, episodes: int) -> Iterator[str]:
    """Interrupt a training; yield its differences from an uninterrupted one."""
    config = folder / "train.json"
    config.write_text(json.dumps({**SETTINGS, "episodes": episodes}), "utf-8")
    whole, broken, log = folder / "whole", folder / "broken", Log(folder / "training.json")

    def begin(out: Path) -> Process:
        if (out / "checkpoint.pt").exists():
            return begun("train", "--out", out, "--resume")
        more = ["--force"] if out.exists() else []
        return begun("train", "--preset", "tiny", "--config", config, "--out", out, *more)

    finish(begin(whole))
    while len(log.done) < interruptions:
        draw, process = log.draw(), begin(broken)
        if draw.random() < 0.8:
            before = rows(broken)
            until(lambda: process.poll() is not None or rows(broken) != before)  # noqa: B023
        time.sleep(draw.uniform(0.0, LONGEST_S))
        number = draw.choice([signal.SIGKILL] * 4 + [signal.SIGINT, signal.SIGTERM])
        process.send_signal(number)
        status = process.wait(PATIENCE_S)
        check(status)
        log.add(f"{number.name}, status {status}, {rows(broken)} rows")
    finish(begin(broken))
    print(f"training: {log}, {rows(broken)} episodes")
    yield from differences_of_runs(whole, broken)


def study(folder: Path, interruptions: int, episodes: int) -> Iterator[str]:
    """Interrupt a study and its workers; yield its differences from an uninterrupted one."""
    config = folder / "study.json"
    config.write_text(json.dumps({**STUDY, "train": {**SETTINGS, "episodes": episodes // 2}}), "utf-8")
    whole, broken, log = folder / "study-whole", folder / "study-broken", Log(folder / "study.log.json")

    def begin(out: Path) -> Process:
        return begun("study", "--config", config, "--out", out, "--jobs", "2")

    finish(begin(whole))
    process = begin(broken)
    while len(log.done) < interruptions:
        draw = log.draw()
        before = progress(broken)
        until(lambda: process.poll() is not None or progress(broken) != before)  # noqa: B023
        time.sleep(draw.uniform(0.0, LONGEST_S))
        if process.poll() is not None:
            check(process.returncode)
        how = draw.choice(["worker", "worker", "all", "alone", "Ctrl-C", "SIGTERM"])
        if how == "worker":
            if kill_worker(process, draw):
                until(lambda: any(broken.glob("failures/*.json")))
                # A study tolerates one failure of each task; here there are more.
                for path in broken.glob("failures/*.json"):
                    path.unlink()
                log.add(f"kill -9 of a worker, {progress(broken)} done")
            continue
        stop: dict[str, Callable[[Process], object]] = {
            "all": lambda one: os.killpg(one.pid, signal.SIGKILL),
            "alone": lambda one: one.kill(),
            "Ctrl-C": lambda one: os.killpg(one.pid, signal.SIGINT),
            "SIGTERM": lambda one: one.terminate(),
        }
        stop[how](process)
        status = process.wait(PATIENCE_S)
        name = {"all": "kill -9 of all", "alone": "kill -9 of the study alone"}.get(how, how)
        check(status)
        log.add(f"{name}, status {status}, {progress(broken)} done")
        process = begin(broken)
    finish(process)
    print(f"study: {log}")
    for path in sorted(whole.glob("runs/*")):
        yield from differences_of_runs(path, broken / "runs" / path.name)
    for path in sorted(whole.glob("evaluations/*.json")):
        mine, theirs = (
            json.loads(one.read_text("utf-8")) for one in (path, broken / "evaluations" / path.name)
        )
        if mine["evaluations"] != theirs["evaluations"]:
            yield str(path)


def begun(*arguments: object) -> Process:
    """Start a command in a process group of its own."""
    command = [sys.executable, "-c", "from drlsl.cli import main; main()", *map(str, arguments)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True, env=environment)


def check(status: int) -> None:
    """Check that a command was ended by the signal sent to it."""
    if status == 0:
        raise SystemExit("done before the last interruption: use more --episodes, and another folder")
    if status not in (130, 143, -signal.SIGINT, -signal.SIGTERM, -signal.SIGKILL):
        raise SystemExit(f"status {status}")


def finish(process: Process) -> None:
    """Wait for a command, which must succeed."""
    if process.wait() != 0:
        raise SystemExit(f"status {process.returncode}: {process.args!r}")


def until(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"the condition did not hold within {PATIENCE_S:.0f} s")
        time.sleep(0.01)


def kill_worker(process: Process, draw: random.Random) -> bool:
    """Kill one of a study's workers, if it has any (Linux: the children that Python has spawned)."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text("utf-8").split()
    workers = [child for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]
    if workers:
        os.kill(int(draw.choice(workers)), signal.SIGKILL)
    return bool(workers)


def rows(run: Path) -> int:
    """Return the number of rows in the metrics of a run."""
    path = run / "metrics.csv"
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


def progress(out: Path) -> int:
    """Return the number of finished episodes and tests of a study according to its files."""
    return sum(map(rows, out.glob("runs/*"))) + len(list(out.glob("evaluations/*.json")))


def differences_of_runs(one: Path, other: Path) -> Iterator[str]:
    """Yield the differences between two run folders, except wall times."""
    if table(one) != table(other):
        yield f"{other}/metrics.csv"
    if (one / "policy.pt").read_bytes() != (other / "policy.pt").read_bytes():
        yield f"{other}/policy.pt"
    kind: Kind = "checkpoint"
    mine, theirs = (dict(leaves(load_state(run / "checkpoint.pt", kind))) for run in (one, other))
    if mine.keys() != theirs.keys():
        yield f"{other}/checkpoint.pt: other keys"
        return
    for path, value in mine.items():
        same = torch.equal(value, theirs[path]) if isinstance(value, torch.Tensor) else value == theirs[path]
        if not same and not path.endswith(("/elapsed_s", "/metrics")):
            yield f"{other}/checkpoint.pt: {path}"


def table(run: Path) -> list[dict[str, str]]:
    """Return the metrics as text, without the wall time."""
    with (run / "metrics.csv").open(newline="", encoding="utf-8") as file:
        return [{name: row[name] for name in row if name != "wall_s"} for row in csv.DictReader(file)]


def leaves(state: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the leaves of nested dictionaries, lists and tuples with their paths."""
    pairs: Any = ()
    if isinstance(state, dict):
        pairs = state.items()
    elif isinstance(state, list | tuple):
        pairs = enumerate(state)
    else:
        yield path, state
    for key, value in pairs:
        yield from leaves(value, f"{path}/{key}")


if __name__ == "__main__":
    sys.exit(main())
