"""The study's training figures: every method's reward per episode, with a band over seeds."""

import io
from collections.abc import Mapping
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drlsl.learning.figures import FIGURES, moving_average
from drlsl.study.results import Results
from drlsl.study.statistics import convergence_window, interquartile_mean

COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Told apart by people who do not see red or green. Source: Okabe and Ito, "Color universal design", 2008."""

STYLES: Final[tuple[str | tuple[int, tuple[int, ...]], ...]] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
"""Told apart without colour, in print."""


def training_figures(results: Results) -> Mapping[str, bytes]:
    """The paper's five figures as PNG, by file name without its ending."""
    if results.training.empty:
        return {}
    return {stem: _figure(results, column, title) for stem, (column, title) in FIGURES.items()}


def _figure(results: Results, column: str, title: str) -> bytes:
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for index, (name, method) in enumerate(results.study.methods.items()):
        found = results.training.loc[results.training["method"] == name]
        if len(found):
            _draw(axes, found, column, method.label, index)
    axes.set(xlabel="Episode", ylabel=title)
    axes.grid(alpha=0.3)
    # Below the axes, for more methods than fit beside the curves.
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize="small")
    buffer = io.BytesIO()
    # Without the writer's name and version in it, the same curves are the same file.
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()


def _draw(axes: Axes, found: pd.DataFrame, column: str, label: str, index: int) -> None:
    window = convergence_window(int(found["episode"].max()))
    runs = [np.asarray(run[column], np.float64) for _, run in found.groupby("seed")]
    curves = np.array([moving_average(rewards, window) for rewards in runs])
    episodes = np.arange(1, curves.shape[1] + 1)
    colour = COLOURS[index % len(COLOURS)]
    style = STYLES[(index + index // len(COLOURS)) % len(STYLES)]
    if len(curves) > 1:
        axes.fill_between(
            episodes, curves.min(axis=0), curves.max(axis=0), color=colour, alpha=0.18, linewidth=0
        )
    axes.plot(
        episodes, interquartile_mean(curves.T), color=colour, linestyle=style, linewidth=1.6, label=label
    )
