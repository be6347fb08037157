"""The tables of the report, each with its plain numbers and their display."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd

from drlsl.learning import FIGURES, ShieldState
from drlsl.study import paper
from drlsl.study.plan import MethodConfig
from drlsl.study.results import EXCUSES, Results
from drlsl.study.statistics import Estimate, convergence_episode, estimate

ALL_TESTS = "all tests"
NONE = "-"

TABLE_1_ROWS: Mapping[str, tuple[str, Callable[[pd.DataFrame], "pd.Series[float]"]]] = {
    "lane_changes": ("Lane changes", lambda rows: rows["lane_changes"]),
    "collisions": ("Collisions", lambda rows: rows["contacts_at_fault"] + rows["contacts_not_at_fault"]),
    "at_fault": ("… ego at fault", lambda rows: rows["contacts_at_fault"]),
    "off_road": ("Off-road", lambda rows: rows["off_road"]),
    "time_steps": ("Time steps", lambda rows: rows["mean_steps_completed"]),
}
"""The rows of the paper's Table 1, and one of ours, from the totals of a test."""

MEASURES: Mapping[str, tuple[str, Callable[[pd.DataFrame], "pd.Series[float]"], str]] = {
    "return": ("return", lambda rows: rows["mean_return"], ".1f"),
    "time_steps": ("time steps", lambda rows: rows["mean_steps_completed"], ".0f"),
    "lane_changes": ("lane changes", lambda rows: rows["lane_changes"] / rows["episodes"], ".2f"),
    "contacts_at_fault": (
        "contacts at fault",
        lambda rows: rows["contacts_at_fault"] / rows["episodes"],
        ".3f",
    ),
    "off_road": ("off-road", lambda rows: rows["off_road"] / rows["episodes"], ".3f"),
    "interventions": ("interventions", lambda rows: rows["interventions"], ".2%"),
    "time_saved": ("time saved", lambda rows: rows["time_saved"].astype(float), ".1%"),
    "jerk_rms": ("RMS jerk [m/s³]", lambda rows: rows["jerk_rms"].astype(float), ".2f"),
}
"""Quantities estimated over seeds: per episode, interventions per step."""

COMPARABLE = ("lane_changes", "contacts_at_fault", "off_road", "interventions", "time_saved", "jerk_rms")
"""Measures that mean the same in every test; returns and steps depend on its frame rate."""


COUNTED = ("episodes", "contacts_at_fault", "contacts_not_at_fault", "off_road")
"""Quantities counted for every value of a sweep."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the report: `frame` becomes the CSV, and `shown` is its display for people."""

    kind: ClassVar = "table"
    stem: str
    title: str
    frame: pd.DataFrame
    shown: pd.DataFrame
    note: str = ""


def table_1(results: Results, test: str, shield: ShieldState) -> Table:
    """Return the paper's Table 1 for one test: the mean over seeds, with the paper's number in brackets."""
    scenario, episodes = results.study.tests[test], results.study.evaluation_episodes
    rows = []
    for row, (label, quantity) in TABLE_1_ROWS.items():
        for name, method in results.study.methods.items():
            values = quantity(rows_of(results.tests, method=name, test=test, shield=shield)).dropna()
            theirs = None
            if scenario.paper and method.paper and row in paper.TABLE_1[scenario.paper]:
                theirs = paper.table_1(scenario.paper, row, method.paper)
            ours = float(values.mean()) if len(values) else None
            rows.append({"row": label, "method": method.label, "mean": ours, "paper": theirs})
    frame = pd.DataFrame(rows)
    cells = frame.assign(cell=[_beside(one.mean, one.paper) for one in frame.itertuples()])  # type: ignore[arg-type]  # pandas' tuples are untyped
    shown = cells.pivot(index="row", columns="method", values="cell")
    shown = shown.loc[[label for label, _ in TABLE_1_ROWS.values()], _labels(results.study.methods)]
    beside = (
        f"in brackets the paper's {paper.TEST_LABELS[scenario.paper]}"
        if scenario.paper
        else "not in the paper"
    )
    return Table(
        f"table_1_{test}_shield_{shield}",
        f"{scenario.label}, shield {shield}",
        frame,
        shown.rename_axis(columns=None).rename_axis("").reset_index(),
        f"{episodes} episodes per seed, mean over seeds; {beside}.",
    )


def contacts(results: Results) -> Table:
    """Return contacts by verdict, off-road and fail-safe steps, summed over seeds."""
    counted = ["episodes", "completed", "contacts_at_fault", *EXCUSES, "off_road", "fail_safe"]
    keys = ["test", "shield", "method"]
    frame = results.tests.groupby(keys, sort=False)[counted].sum().reset_index()
    frame = _in_order(results, frame)
    return Table("contacts", "Contacts by verdict", frame, _named(results, frame))


def interventions(results: Results) -> Table:
    """Return the share of steps in which the action of highest value was not a safe one."""
    rows = []
    for name in results.study.methods:
        trained = rows_of(results.training, method=name)
        row: dict[str, object] = {"method": name}
        row["training"] = _ratio(trained, "interventions", "steps")
        row["last tenth of training"] = _ratio(_last_tenth(trained), "interventions", "steps")
        for test in results.study.tests:
            for shield in ("off", "on"):
                found = rows_of(results.tests, method=name, test=test, shield=shield)["interventions"]
                row[f"{results.study.tests[test].label}, {shield}"] = _mean(found)
        rows.append(row)
    frame = pd.DataFrame(rows)
    return Table("interventions", "Interventions of the shield", frame, _named(results, frame, ".2%"))


def training(results: Results) -> Table:
    """Return mean rewards per episode of training, with all its contacts and steps off the road."""
    rows, cells = [], []
    for name in results.study.learnt:
        method = results.study.methods[name]
        found = rows_of(results.training, method=name)
        row: dict[str, object] = {"method": name, "seeds": found["seed"].nunique(), "episodes": len(found)}
        row |= {title: _mean(found[column]) for column, title in FIGURES.values()}
        row |= {
            "contacts at fault": int((found["contact"] * found["at_fault"]).sum()),
            "contacts not at fault": int((found["contact"] * (1 - found["at_fault"])).sum()),
            "off-road": int(found["off_road"].sum()),
            "fail-safe steps": int(found["fail_safe"].sum()),
        }
        rows.append(row)
        cells.append(row | _paper_rewards(row, method))
    notes = "Rewards are means over all episodes of all seeds, the rest sums; in brackets the paper's."
    return Table("training", "Training", pd.DataFrame(rows), _named(results, pd.DataFrame(cells)), notes)


def convergence(results: Results) -> Table:
    """Return the episode at which each training's return converged, and the median over seeds."""
    rows, cells = [], []
    for name in results.study.learnt:
        method = results.study.methods[name]
        found = convergence_of(results, name)
        median = median_episode(found.values())
        reached = sum(episode is not None for episode in found.values())
        theirs = paper.CONVERGENCE_EPISODE[method.paper] if method.paper else None
        row: dict[str, object] = {"method": name, "converged": reached, "seeds": len(found)}
        row |= {"median": median if np.isfinite(median) else None, "paper": theirs}
        rows.append(row | {f"seed {seed}": episode for seed, episode in found.items()})
        cells.append(
            {
                "method": name,
                "converged": f"{reached} of {len(found)}",
                "median": in_words(median),
                "paper": NONE if theirs is None else str(theirs),
                "by seed": ", ".join(map(in_words, found.values())) or NONE,
            }
        )
    return Table("convergence", "Convergence", pd.DataFrame(rows), _named(results, pd.DataFrame(cells)))


def convergence_of(results: Results, method: str) -> dict[int, int | None]:
    """Return, by seed, the episode at which the training converged; None if it never did."""
    return {
        seed: convergence_episode(
            rows_of(results.training, method=method, seed=seed)["return"].to_numpy(np.float64)
        )
        for seed in seeds_of(results, method)
    }


def median_episode(episodes: Iterable[int | None]) -> float:
    """Return the median of episodes of convergence, infinite for never; NaN if there are none.

    Unlike a mean, it is defined when some training has not converged.
    """
    values = [np.inf if episode is None else float(episode) for episode in episodes]
    return float(np.median(values)) if values else np.nan


def in_words(episode: float | None) -> str:
    """Return an episode of convergence as text for people."""
    if episode is None or np.isinf(episode):
        return "never"
    return NONE if np.isnan(episode) else f"{episode:g}"


def estimates(results: Results, shield: ShieldState) -> Table:
    """Return interquartile means over seeds with their intervals, for each test and over all tests."""
    rows, cells = [], []
    for test in (*results.study.tests, ALL_TESTS):
        strata = list(results.study.tests) if test == ALL_TESTS else [test]
        for name in results.study.methods:
            row: dict[str, object] = {"test": test, "method": name}
            cell = row.copy()
            for measure, (label, quantity, form) in MEASURES.items():
                if test == ALL_TESTS and measure not in COMPARABLE:
                    cell[label] = NONE
                    continue
                values = [
                    list(quantity(rows_of(results.tests, method=name, test=one, shield=shield)).dropna())
                    for one in strata
                ]
                found = estimate(values) if any(values) else None
                row |= _estimate_columns(measure, found)
                cell[label] = _interval(found, form)
            rows.append(row)
            cells.append(cell)
    return Table(
        f"estimates_shield_{shield}",
        f"Interquartile means, shield {shield}",
        pd.DataFrame(rows),
        _named(results, pd.DataFrame(cells)),
    )


def sweep_rows(results: Results, sweep: str) -> pd.DataFrame:
    """Return the results of a sweep, including its test's, which has the value of the training."""
    test, value = results.study.sweeps[sweep].test, results.study.trained_value(sweep)
    frames = [rows_of(results.tests, test=test).assign(value=value), rows_of(results.sweeps, test=sweep)]
    return pd.concat([frame for frame in frames if len(frame)] or frames[1:], ignore_index=True)


def sweeps(results: Results, shield: ShieldState) -> Table:
    """Return contacts at fault for each value of each setting, summed over seeds."""
    rows, cells = [], []
    for sweep, config in results.study.sweeps.items():
        found = rows_of(sweep_rows(results, sweep), shield=shield)
        for value in sorted({results.study.trained_value(sweep), *config.values}):
            cell: dict[str, object] = {"setting": config.label, "value": f"{value:g}"}
            for name, method in results.study.methods.items():
                here = rows_of(found, method=name, value=value)
                counts = {key: int(here[key].sum()) for key in COUNTED}
                rows.append({"sweep": sweep, "value": value, "method": name, **counts})
                contacts_of = f"{counts['contacts_at_fault']} of {counts['episodes']}"
                cell[method.label] = contacts_of if counts["episodes"] else NONE
            cells.append(cell)
    return Table(
        f"sweeps_shield_{shield}",
        f"Contacts at fault, shield {shield}",
        pd.DataFrame(rows),
        pd.DataFrame(cells),
    )


def wall_time(results: Results) -> Table:
    """Return the wall time per seed of each method, in minutes."""
    tested = pd.concat([results.tests[["method", "wall_s"]], results.sweeps[["method", "wall_s"]]])
    rows = []
    for name in results.study.methods:
        seeds = max(1, len(seeds_of(results, name)))
        rows.append(
            {
                "method": name,
                "training [min]": float(rows_of(results.training, method=name)["wall_s"].sum()) / seeds / 60,
                "tests [min]": float(rows_of(tested, method=name)["wall_s"].sum()) / seeds / 60,
            }
        )
    frame = pd.DataFrame(rows)
    return Table("wall_time", "Wall time", frame, _named(results, frame, ".1f"))


def rows_of(frame: pd.DataFrame, **values: object) -> pd.DataFrame:
    """Return the rows of a table that have these values."""
    chosen = pd.Series(True, index=frame.index)
    for column, value in values.items():
        chosen &= frame[column] == value
    return frame.loc[chosen]


def seeds_of(results: Results, method: str) -> list[int]:
    """Return the seeds of a method's finished trainings, or tests if it needs no training."""
    frame = results.training if method in results.study.learnt else results.tests
    return sorted(rows_of(frame, method=method)["seed"].unique().tolist())


def _last_tenth(frame: pd.DataFrame) -> pd.DataFrame:
    late: pd.DataFrame = frame.loc[frame["episode"] > 0.9 * frame["episode"].max()]
    return late


def _mean(values: "pd.Series[float]") -> float | None:
    return float(values.mean()) if len(values) else None


def _ratio(frame: pd.DataFrame, above: str, below: str) -> float | None:
    return float(frame[above].sum() / frame[below].sum()) if len(frame) else None


def _estimate_columns(name: str, found: Estimate | None) -> dict[str, object]:
    value, low, high = found or (None, None, None)
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def _interval(found: Estimate | None, form: str) -> str:
    if found is None:
        return NONE
    if found.low is None or found.high is None:
        return format(found.value, form)
    return f"{found.value:{form}} [{found.low:{form}}, {found.high:{form}}]"


def _beside(ours: float | None, theirs: float | None) -> str:
    shown = NONE if ours is None or np.isnan(ours) else f"{ours:.1f}".removesuffix(".0")
    return shown if theirs is None or np.isnan(theirs) else f"{shown} ({theirs:.0f})"


def _paper_rewards(row: Mapping[str, object], method: MethodConfig) -> dict[str, str]:
    """Return the cells of a row of the training table that the paper gives a number for."""
    titles = {
        FIGURES["collision_reward"][1]: paper.COLLISION_REWARD,
        FIGURES["off_road_reward"][1]: paper.OFF_ROAD_REWARD,
    }
    return {
        title: f"{row[title]:.2f} ({numbers[method.paper]:g})"
        for title, numbers in titles.items()
        if method.paper and method.paper in numbers and row[title] is not None
    }


def _labels(named: Mapping[str, MethodConfig]) -> list[str]:
    return [item.label for item in named.values()]


def _in_order(results: Results, frame: pd.DataFrame) -> pd.DataFrame:
    """Return rows by test, shield and method in the order of the study."""
    order = {
        name: place for place, name in enumerate([*results.study.tests, *results.study.methods, "off", "on"])
    }
    return frame.sort_values(
        ["test", "shield", "method"], key=lambda column: column.map(order), ignore_index=True
    )


def _named(results: Results, frame: pd.DataFrame, form: str = ".2f") -> pd.DataFrame:
    """Return a table with labels for names, and numbers as text."""
    labels = {name: item.label for name, item in results.study.methods.items()}
    labels |= {name: item.label for name, item in results.study.tests.items()}
    shown = {
        column: [
            labels.get(value, value) if column in ("method", "test") else _cell(value, form)
            for value in frame[column]
        ]
        for column in frame.columns
    }
    return pd.DataFrame(shown).rename(columns=lambda column: str(column).replace("_", " "))


def _cell(value: object, form: str) -> str:
    if isinstance(value, str):
        return value
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return NONE
    return str(value) if isinstance(value, int | np.integer) else format(value, form)
