"""The benchmark: the outcome of each method in each scenario, as plain values for a file."""

from typing import Any, Final

import pandas as pd

from drlsl.learning import ShieldState
from drlsl.study.result_tables import rows_of
from drlsl.study.results import Results
from drlsl.study.statistics import estimate

_COUNTS: Final = {
    "episodes": "episodes",
    "completed": "completed",
    "at_fault": "contacts_at_fault",
    "excused": "contacts_not_at_fault",
    "off_road": "off_road",
    "fail_safe": "fail_safe",
}
"""Sums over seeds: the key of the benchmark and the column of the totals."""

_MEANS: Final = (
    "at_fault_per_1000_km",
    "excused_per_1000_km",
    "lane_changes_per_km",
    "windows_per_km",
    "interventions_per_km",
    "mean_speed",
    "headway_5",
    "headway_50",
    "short_ttc",
    "hard_braking",
    "jerk_rms",
    "imposed_braking",
    "imposed_hard_braking",
)
"""Means over seeds."""


def benchmark(results: Results, shield: ShieldState = "on") -> dict[str, dict[str, dict[str, Any]]]:
    """Return, by scenario and method, counts, means and the time saved against lane keeping.

    `time_saved` is a share of lane keeping's time over the episodes that both completed, the interquartile
    mean over seeds; `time_saved_interval` is its bootstrap interval, [low, high]. Missing values are None.
    """
    return {
        test: {
            name: _outcome(found)
            for name in results.study.methods
            if len(found := rows_of(results.tests, method=name, test=test, shield=shield))
        }
        for test in results.study.tests
    }


def _outcome(found: pd.DataFrame) -> dict[str, Any]:
    saved = found["time_saved"].astype(float).dropna()
    time = estimate([saved.tolist()]) if len(saved) else None
    result: dict[str, Any] = {
        "time_saved": None if time is None else time.value,
        "time_saved_interval": None if time is None or time.low is None else [time.low, time.high],
        "seeds": len(found),
    }
    result |= {key: int(found[column].sum()) for key, column in _COUNTS.items()}
    for name in _MEANS:
        values = found[name].astype(float).dropna()
        result[name] = float(values.mean()) if len(values) else None
    return result
