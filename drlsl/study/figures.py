"""The study's figures: rewards in training, and contacts against settings, with bands over seeds."""

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from drlsl.learning import FIGURES, moving_average
from drlsl.study.result_tables import rows_of, sweep_rows
from drlsl.study.results import Results
from drlsl.study.statistics import Estimate, convergence_window, estimate, interquartile_mean

COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Told apart by people who do not see red or green. Source: Okabe and Ito, "Color universal design", 2008."""

STYLES: Final[tuple[str | tuple[int, tuple[int, ...]], ...]] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
"""Told apart without colour, in print."""


MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
"""Told apart without colour."""

PANELS: Final = 2
"""Panels beside each other."""

FAULT_RATE: Final = "at_fault_per_1000_km"

FAULT_TICKS: Final = (0.0, 1.0, 10.0, 100.0, 1_000.0, 10_000.0)


def training_figures(results: Results) -> Mapping[str, bytes]:
    """Return the paper's five figures as PNG, by file name without its ending."""
    if results.training.empty:
        return {}
    return {stem: _figure(results, column, title) for stem, (column, title) in FIGURES.items()}


def sweep_figure(results: Results) -> bytes:
    """Draw contacts at fault against each setting, shield on, as PNG: a panel for each sweep."""
    sweeps = results.study.sweeps
    rows = math.ceil(len(sweeps) / PANELS)
    figure = Figure(figsize=(8.0, 0.6 + 2.6 * rows), layout="constrained")
    panels = figure.subplots(rows, min(PANELS, len(sweeps)), squeeze=False, sharey=True)
    for axes, (sweep, config) in zip(panels.flat, sweeps.items(), strict=False):
        found = rows_of(sweep_rows(results, sweep), shield="on")
        found = found.assign(share=100 * found["contacts_at_fault"] / found["episodes"])
        for index, (name, method) in enumerate(results.study.methods.items()):
            runs = rows_of(found, method=name).groupby("value")["share"].agg(["min", "mean", "max"])
            look = _look(index)
            axes.fill_between(
                runs.index, runs["min"], runs["max"], color=look["color"], alpha=0.18, linewidth=0
            )
            axes.plot(runs.index, runs["mean"], marker="o", markersize=3, label=method.label, **look)
        axes.set(xlabel=config.label)
        axes.grid(alpha=0.3)
    return _panels_png(figure, panels, len(sweeps), "At fault in 100 episodes")


def outcome_figure(results: Results) -> bytes:
    """Draw time saved against contacts at fault, as PNG: a panel for each test, a point for each method.

    The lines through a point are the intervals over seeds; a hollow point is a method without the shield.
    """
    tests = results.study.tests
    rows = math.ceil(len(tests) / PANELS)
    figure = Figure(figsize=(8.0, 0.8 + 2.9 * rows), layout="constrained")
    panels = figure.subplots(rows, min(PANELS, len(tests)), squeeze=False)
    for axes, (test, scenario) in zip(panels.flat, tests.items(), strict=False):
        for index, (name, method) in enumerate(results.study.methods.items()):
            for shield in ("on", "off"):
                found = rows_of(results.tests, method=name, test=test, shield=shield)
                saved, fault = (found[key].astype(float).dropna() for key in ("time_saved", FAULT_RATE))
                if len(saved) and len(fault):
                    label = method.label if shield == "on" else None
                    _point(
                        axes,
                        estimate([(100 * saved).tolist()]),
                        estimate([fault.tolist()]),
                        index,
                        shield == "on",
                        label,
                    )
        axes.set(title=scenario.label, xlabel="Time saved against lane keeping [%]")
        axes.set_yscale("symlog", linthresh=1.0)
        axes.yaxis.set_major_locator(FixedLocator(FAULT_TICKS))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_ylim(-0.3, max(2.0, 1.5 * axes.dataLim.y1))
        axes.grid(alpha=0.3)
    return _panels_png(figure, panels, len(tests), "At fault in 1,000 km")


def _panels_png(figure: Figure, panels: npt.NDArray[Any], used: int, ylabel: str) -> bytes:
    """Return a figure of several panels, of which the first are used, as PNG."""
    for axes in panels[:, 0]:
        axes.set(ylabel=ylabel)
    for axes in panels.flat[used:]:
        axes.remove()
    return _png(figure, *panels.flat[0].get_legend_handles_labels())


def _point(axes: Axes, x: Estimate, y: Estimate, index: int, filled: bool, label: str | None) -> None:
    colour = COLOURS[index % len(COLOURS)]
    axes.errorbar(
        x.value,
        y.value,
        xerr=_sides(x),
        yerr=_sides(y),
        color=colour,
        marker=MARKERS[index % len(MARKERS)],
        markerfacecolor=colour if filled else "white",
        linestyle="none",
        elinewidth=1.0,
        label=label,
    )


def _sides(found: Estimate) -> list[list[float]] | None:
    """Return the lengths of an interval's two sides; rounding must not make one negative."""
    if found.low is None or found.high is None:
        return None
    return [[max(0.0, found.value - found.low)], [max(0.0, found.high - found.value)]]


def _figure(results: Results, column: str, title: str) -> bytes:
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for index, (name, method) in enumerate(results.study.methods.items()):
        found = results.training.loc[results.training["method"] == name]
        if len(found):
            _draw(axes, found, column, method.label, index)
    axes.set(xlabel="Episode", ylabel=title)
    axes.grid(alpha=0.3)
    return _png(figure, *axes.get_legend_handles_labels())


def _png(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> bytes:
    """Return the figure with its legend below, for more methods than fit beside the curves."""
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize="small")
    buffer = io.BytesIO()
    # Without the writer's name and version in it, the same curves are the same file.
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()


def _draw(axes: Axes, found: pd.DataFrame, column: str, label: str, index: int) -> None:
    window = convergence_window(int(found["episode"].max()))
    runs = [np.asarray(run[column], np.float64) for _, run in found.groupby("seed")]
    curves = np.array([moving_average(rewards, window) for rewards in runs])
    episodes = np.arange(1, curves.shape[1] + 1)
    look = _look(index)
    if len(curves) > 1:
        axes.fill_between(
            episodes, curves.min(axis=0), curves.max(axis=0), color=look["color"], alpha=0.18, linewidth=0
        )
    axes.plot(episodes, interquartile_mean(curves.T), label=label, **look)


def _look(index: int) -> dict[str, Any]:
    """Return the colour and line style of a method, by its place in the study."""
    style = STYLES[(index + index // len(COLOURS)) % len(STYLES)]
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": style, "linewidth": 1.6}
