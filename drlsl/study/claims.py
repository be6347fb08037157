"""Check what a study is expected to show, and compare its order of the methods with the paper's."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from drlsl.learning import ShieldState
from drlsl.study import paper
from drlsl.study.plan import Run, StudyConfig
from drlsl.study.result_tables import TABLE_1_ROWS, Table, convergence_of, in_words, median_episode, rows_of
from drlsl.study.results import Results
from drlsl.study.statistics import interquartile_mean


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement, whether the study supports it (None: no result decides it), and the numbers."""

    statement: str
    holds: bool | None
    evidence: str


def claims(results: Results) -> list[Claim]:
    """Check each promise of the shield for every method that learns behind rules."""
    study = results.study
    shielded = [name for name in study.methods if _trained_as(study, name) == "dqnsl"]
    found = []
    for name in shielded:
        found += [_safe_training(results, name), _safe_tests(results, name)]
        baseline = _baseline(study, name)
        if baseline is not None:
            found += [
                _less(results, name, baseline, "lane_changes"),
                _less(results, name, baseline, "time_steps"),
                _sooner(results, name, baseline),
            ]
    return found


def agreement(results: Results) -> Table:
    """Return the paper's order of the methods beside ours for each number of Table 1, shield off."""
    rows = []
    for test, scenario in results.study.tests.items():
        if scenario.paper is None:
            continue
        for row in paper.TABLE_1[scenario.paper]:
            ours = {name: _quantity(results, name, test, row, "off") for name in results.study.methods}
            theirs = {
                name: float(paper.table_1(scenario.paper, row, method.paper))
                for name, method in results.study.methods.items()
                if method.paper is not None
            }
            pairs = [
                np.sign(theirs[one] - theirs[other]) == np.sign(ours[one] - ours[other])
                for one, other in combinations(theirs, 2)
                if theirs[one] != theirs[other] and not np.isnan([ours[one], ours[other]]).any()
            ]
            rows.append(
                {
                    "test": scenario.label,
                    "row": TABLE_1_ROWS[row][0],
                    "paper": _order({results.study.methods[name].paper: theirs[name] for name in theirs}),
                    "study": _order({results.study.methods[name].label: ours[name] for name in ours}),
                    "pairs in the paper's order": f"{sum(pairs)} of {len(pairs)}",
                }
            )
    frame = pd.DataFrame(rows)
    note = "Pairs of methods whose numbers differ in the paper, and how many have the same order here."
    return Table("agreement", "The order of the methods", frame, frame, note)


def _safe_training(results: Results, method: str) -> Claim:
    found = rows_of(results.training, method=method)
    at_fault, off_road = int((found["contact"] * found["at_fault"]).sum()), int(found["off_road"].sum())
    return Claim(
        f"{_label(results, method)}: no contact at fault and never off the road in training",
        at_fault == off_road == 0 if len(found) else None,
        f"{len(found)} episodes: {at_fault} at fault, {off_road} off-road",
    )


def _safe_tests(results: Results, method: str) -> Claim:
    parts, bad, complete = [], 0, True
    for test, scenario in results.study.tests.items():
        found = rows_of(results.tests, method=method, test=test, shield="on")
        at_fault, off_road = int(found["contacts_at_fault"].sum()), int(found["off_road"].sum())
        bad += at_fault + off_road
        complete &= len(found) > 0
        parts.append(
            f"{scenario.label} {at_fault} at fault, {off_road} off-road of {found['episodes'].sum()}"
        )
    statement = "no contact at fault and never off the road in any test, shield on"
    return Claim(f"{_label(results, method)}: {statement}", bad == 0 if complete else None, "; ".join(parts))


def _less(results: Results, method: str, baseline: str, row: str) -> Claim:
    """Check for fewer lane changes than the baseline, or no more steps."""
    strict = row == "lane_changes"
    parts, verdicts = [], []
    for test, scenario in results.study.tests.items():
        mine, theirs = (_quantity(results, name, test, row, "off") for name in (method, baseline))
        if not np.isnan([mine, theirs]).any():
            verdicts.append(mine < theirs if strict else mine <= theirs)
        parts.append(f"{scenario.label} {_number(mine)} vs {_number(theirs)}")
    what = "fewer lane changes than" if strict else "no more steps to the end than"
    statement = f"{_label(results, method)}: {what} {_label(results, baseline)} in every test, shield off"
    return Claim(statement, all(verdicts) if verdicts else None, "; ".join(parts))


def _sooner(results: Results, method: str, baseline: str) -> Claim:
    found = [list(convergence_of(results, name).values()) for name in (method, baseline)]
    mine, theirs = map(median_episode, found)
    statement = f"{_label(results, method)}: converges before {_label(results, baseline)}"
    if np.isnan([mine, theirs]).any():
        return Claim(statement, None, "not trained")
    by_seed = " vs ".join(", ".join(map(in_words, episodes)) for episodes in found)
    evidence = f"median episode {in_words(mine)} vs {in_words(theirs)}; by seed {by_seed}"
    return Claim(statement, mine < theirs, evidence)


def _quantity(results: Results, method: str, test: str, row: str, shield: ShieldState) -> float:
    """Return the middle over seeds of a row of Table 1; NaN where there is none."""
    found = rows_of(results.tests, method=method, test=test, shield=shield)
    values = np.asarray(TABLE_1_ROWS[row][1](found).dropna(), np.float64)
    return float(interquartile_mean(values)) if len(values) else np.nan


def _baseline(study: StudyConfig, method: str) -> str | None:
    """Return the unshielded method that differs from this one in the fewest settings."""
    mine = _settings(study, method)
    others = [name for name in study.methods if _trained_as(study, name) == "dqn"]
    return min(others, key=lambda name: len(mine ^ _settings(study, name)), default=None)


def _settings(study: StudyConfig, method: str) -> set[str]:
    return set(_leaves(study.training(Run(method, 0)).model_dump(mode="json")))


def _leaves(values: dict[str, Any], path: str = "") -> Iterator[str]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}={value}"


def _trained_as(study: StudyConfig, method: str) -> str | None:
    """Return how a DQN was trained; None if the method is another."""
    if method not in study.learnt or study.methods[method].ppo is not None:
        return None
    return study.training(Run(method, 0)).method


def _label(results: Results, method: str) -> str:
    return results.study.methods[method].label


def _order(values: dict[Any, float]) -> str:
    """Return names with their numbers, the smallest first, those without one last."""
    known = sorted(values.items(), key=lambda item: (bool(np.isnan(item[1])), item[1]))
    return "; ".join(f"{name} {_number(value)}" for name, value in known)


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.1f}".removesuffix(".0")
