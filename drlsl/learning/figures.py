"""The training figures: each reward term per episode, with its moving average."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drlsl.files import write_atomic

if TYPE_CHECKING:  # training begins without it
    import pandas as pd

WINDOW = 20
"""Episodes of the moving average."""

FIGURES: Mapping[str, tuple[str, str]] = {
    "cumulative_reward": ("return", "Cumulative reward"),
    "collision_reward": ("reward_collision", "Collision reward"),
    "off_road_reward": ("reward_off_road", "Off-road reward"),
    "lane_change_reward": ("reward_lane_change", "Lane-change reward"),
    "velocity_reward": ("reward_velocity", "Velocity reward"),
}
"""File name to column of the metrics and title, in the paper's order."""


def moving_average(values: NDArray[np.float64], window: int) -> NDArray[np.float64]:
    """Return the mean of each value and up to `window - 1` before it. Shape: (N,) to (N,)."""
    sums = np.cumsum(np.concatenate(([0.0], values)))
    stop = np.arange(1, len(values) + 1)
    start = np.maximum(stop - window, 0)
    averages: NDArray[np.float64] = (sums[stop] - sums[start]) / (stop - start)
    return averages


def write_training_figures(runs: Mapping[str, pd.DataFrame], folder: Path) -> list[Path]:
    """Draw the five figures of one or several runs, each with a name and its metrics, into `folder`.

    Source: the paper's figures of cumulative, collision, off-road, lane-change and velocity reward.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for stem, (column, title) in FIGURES.items():
        path = folder / f"{stem}.png"
        write_atomic(path, _png({name: frame[column] for name, frame in runs.items()}, title))
        paths.append(path)
    return paths


def _png(series: Mapping[str, pd.Series[float]], title: str) -> bytes:
    from matplotlib.figure import Figure  # takes longer to load than training to begin

    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for index, (name, values) in enumerate(series.items()):
        rewards = np.asarray(values, np.float64)
        episodes = np.arange(1, len(rewards) + 1)
        colour = f"C{index}"
        axes.plot(episodes, rewards, color=colour, alpha=0.3, linewidth=0.8)
        axes.plot(episodes, moving_average(rewards, WINDOW), color=colour, linewidth=1.8, label=name)
    axes.set(title=f"{title} per episode, mean of {WINDOW} in bold", xlabel="Episode", ylabel=title)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
