"""200 wild variations of highD and NGSIM files: each loads rightly, says what is odd, or ends in one line."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path

import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.traffic import Lane, Recording, load_recording
from tests.traffic.wild import MUTATIONS, mutate, write_base

KINDS = {"highd": 100, "ngsim": 100}
SAMPLE = 5
"""Of so many variations one is in the tests of every change."""

NEAR = {"x": 0.01, "y": 0.05, "vx": 0.05, "vy": 0.3, "length": 0.01, "width": 0.01}


def seeds(kind: str) -> list[object]:
    return [
        pytest.param(kind, seed, marks=() if seed % SAMPLE == 0 else pytest.mark.slow)
        for seed in range(KINDS[kind])
    ]


def told(recording: Recording) -> set[str]:
    """Everything that a recording says was odd in its files."""
    return {*recording.notes, *(f"{item.rows}: {item.reason}" for item in recording.dropped)}


def is_true(read: Recording, truth: Recording) -> bool:
    """Whether all rows of a recording are rows of the true one, at their times, on the same lanes."""
    if any(min(_apart(lane, true) for true in truth.lanes) > 0.1 for lane in read.lanes):
        return False
    if len(read.lanes) < len(truth.lanes) and "straightened" not in str(read.notes):
        return False  # lanes that are fitted are those with vehicles
    if any(truth.vehicle_class.get(vehicle) is not kind for vehicle, kind in read.vehicle_class.items()):
        return False
    mine, true = read.frames, truth.frames
    time, slot = np.nonzero(mine.valid)
    vehicle = mine.vehicle[time, slot]
    begin = _time_of(truth, int(vehicle[0]), float(mine.x[time[0], slot[0]]))
    frame = np.rint((time / read.frame_rate + begin - time[0] / read.frame_rate) * truth.frame_rate).astype(
        int
    )
    if frame.min() < 0 or frame.max() >= truth.frame_count:
        return False
    found = true.vehicle[frame] == vehicle[:, None]
    if not found.any(axis=1).all():
        return False
    place = frame, found.argmax(axis=1)
    return all(
        bool((np.abs(getattr(mine, name)[time, slot] - getattr(true, name)[place]) <= near).all())
        for name, near in NEAR.items()
    )


def _apart(one: Lane, other: Lane) -> float:
    """How far apart two lanes are, in centre, width and limit."""
    numbers = zip(_numbers(one), _numbers(other), strict=True)
    return max(abs(mine - true) for mine, true in numbers) if one.direction is other.direction else np.inf


def _numbers(lane: Lane) -> tuple[float, ...]:
    return lane.centre, lane.width, lane.speed_limit


def _time_of(truth: Recording, vehicle: int, x: float) -> float:
    """The time at which a vehicle truly was nearest to x."""
    time, slot = np.nonzero(truth.frames.vehicle == vehicle)
    if not len(time):
        return 0.0
    return float(time[np.abs(truth.frames.x[time, slot] - x).argmin()]) / truth.frame_rate


def outcome(kind: str, seed: int, folder: Path) -> tuple[str, str]:
    """How a variation ends, and what was done to the files."""
    path = write_base(kind, folder)
    truth = load_recording(path, cache=False)
    done = "; ".join(mutate(kind, path, seed))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            read = load_recording(path, cache=False)
    except UserError as error:
        plain = "\n" not in str(error) and str(folder) in str(error)
        return "refused" if plain else "in no line that names the file", f"{done}: {error}"
    if is_true(read, truth):
        return "right", done
    new = told(read) - told(truth)
    return ("noted" if new else "wrong in silence"), f"{done}: {sorted(new)}"


@pytest.mark.parametrize(("kind", "seed"), [*seeds("highd"), *seeds("ngsim")])
def test_nothing_is_read_wrongly_in_silence(kind: str, seed: int, tmp_path: Path) -> None:
    end, done = outcome(kind, seed, tmp_path)
    logging.getLogger(__name__).info("%s: %s", end, done)  # pytest -rA shows how each ends
    assert end in ("right", "noted", "refused"), done


def test_every_mutation_is_met() -> None:
    assert all(len(MUTATIONS[kind]) <= count for kind, count in KINDS.items())


RIGHT = {
    "byte order mark",
    "carriage returns and newlines",
    "blank lines",
    "no last newline",
    "spaces after commas",
    "all quoted",
    "shuffled columns",
    "shuffled rows",
    "repeated rows",
    "column of text",
    "upper case",
    "whole numbers with points",
    "thinned",
    "lost rows",
    "missing frames",
}
"""What is harmless: a loader that refused it would refuse good files."""


@pytest.mark.parametrize("what", sorted(RIGHT))
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_harmless_is_loaded_rightly(kind: str, what: str, tmp_path: Path) -> None:
    seed = next(seed for seed, (_, name, *_) in enumerate(MUTATIONS[kind]) if name == what)
    assert outcome(kind, seed, tmp_path)[0] == "right"
