"""Runs beside each other: how far each has come, how it drives, and in which settings they differ."""

import functools
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from drlsl.errors import UserError
from drlsl.learning.config import TrainConfig, describe_keys, make_config, preset_names, preset_values
from drlsl.learning.rundir import CONFIG, METRICS, RunFolder

LATEST: Final = 20
"""Episodes at the end of a training whose mean return is told."""

SEED: Final = "seed"
"""The setting in which runs of one preset differ as a matter of course."""


@dataclass(frozen=True, slots=True)
class TestResult:
    """The last evaluation of a run's policy behind the shield."""

    recording: str | tuple[str, ...]
    episodes: int
    contacts_at_fault: int
    off_road: int
    mean_return: float
    time_saved: float | None
    """Share of the time of keeping the lane; None where it was not measured."""


@dataclass(frozen=True, slots=True)
class RunOverview:
    """A run in a few numbers."""

    run: str
    """Its folder."""
    method: str
    preset: str
    """The preset from which its settings differ in the fewest places."""
    changed: Mapping[str, Any]
    """The settings, by dotted key, that differ from those of the preset; the seed apart."""
    seed: int
    episodes: int
    """Episodes that it is to be trained for."""
    done: int
    mean_return: float | None
    """Mean over the last 20 episodes; None before the first has ended."""
    contacts_at_fault: int
    contacts_not_at_fault: int
    off_road: int
    """Counted, as the contacts, over the training."""
    test: TestResult | None
    """None before the first evaluation."""


def find_runs(places: Sequence[Path]) -> list[Path]:
    """Return the run folders among places and below them, in order, each once.

    Raises:
        UserError: a place does not exist, or has no run.
    """
    found: dict[Path, None] = {}
    for place in places:
        below = list(_runs_below(place))
        if not below:
            problem = "no run here" if place.is_dir() else "no such folder"
            raise UserError(f"{place}: {problem}; `drlsl train --out {place / 'NAME'}` makes one")
        found |= dict.fromkeys(below)
    return list(found)


def _runs_below(place: Path) -> Iterator[Path]:
    for root, folders, files in os.walk(place):
        if {CONFIG, METRICS} <= set(files):
            folders.clear()
            yield Path(root)
        folders[:] = sorted(name for name in folders if not name.startswith("."))


def overview_of(folder: RunFolder) -> RunOverview:
    """Return a run in a few numbers.

    Raises:
        UserError: its metrics or evaluations are damaged.
    """
    config = folder.config
    preset, changed = nearest_preset(config)
    rows = folder.episodes()
    returns = [row["return"] for row in rows[-LATEST:]]
    contacts = [row for row in rows if row["contact"]]
    at_fault = sum(row["at_fault"] for row in contacts)
    return RunOverview(
        run=str(folder.root),
        method=config.method,
        preset=preset,
        changed=changed,
        seed=config.seed,
        episodes=config.episodes,
        done=len(rows),
        mean_return=sum(returns) / len(returns) if returns else None,
        contacts_at_fault=at_fault,
        contacts_not_at_fault=len(contacts) - at_fault,
        off_road=sum(row["off_road"] for row in rows),
        test=_last_test(folder),
    )


def _last_test(folder: RunFolder) -> TestResult | None:
    shielded = [record for record in folder.evaluations() if record["shield"] == "on"]
    if not shielded:
        return None
    record = shielded[-1]
    totals, recording = record["totals"], record["env"]["recording"]
    return TestResult(
        recording=recording if isinstance(recording, str) else tuple(recording),
        episodes=record["episodes"],
        contacts_at_fault=totals["contacts_at_fault"],
        off_road=totals["off_road"],
        mean_return=totals["mean_return"],
        time_saved=totals.get("time_saved"),
    )


def nearest_preset(config: TrainConfig) -> tuple[str, dict[str, Any]]:
    """Return the preset from which a configuration differs in the fewest settings, and those settings."""
    mine = settings_of(config)

    def changed(preset: str) -> dict[str, Any]:
        theirs = _preset_settings(preset)
        return {key: value for key, value in mine.items() if key != SEED and value != theirs[key]}

    return min(((name, changed(name)) for name in preset_names()), key=lambda one: len(one[1]))


@functools.cache
def _preset_settings(name: str) -> dict[str, Any]:
    return settings_of(make_config(preset_values(name), f"preset {name}"))


def settings_of(config: TrainConfig) -> dict[str, Any]:
    """Return every setting by its dotted key, as plain values."""
    values = config.model_dump(mode="json")
    return {
        key: functools.reduce(lambda below, part: below[part], key.split("."), values)
        for key, _ in describe_keys()
    }


def differing_settings(configs: Sequence[TrainConfig]) -> dict[str, list[Any]]:
    """Return the settings in which configurations differ, by dotted key, with the value in each."""
    every = [settings_of(config) for config in configs]
    values = {key: [one[key] for one in every] for key, _ in describe_keys()}
    return {key: row for key, row in values.items() if any(value != row[0] for value in row)}
