"""A picture of a scene, seen from above; matplotlib is loaded only when one is drawn."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from drlsl.driving.scene import Scene, Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EGO_COLOUR: Final = "#0072B2"
FOCUS_COLOUR: Final = "#D55E00"
OTHER_COLOUR: Final = "#999999"
"""Blue, vermilion and grey: told apart with any colour vision, and in print. Source: Okabe and Ito (2008)."""

ARROW_TIME: Final = 0.25
"""Velocity arrows are as long as the way in this time [s]."""

_WIDTH: Final = 10.0
"""Width of a picture [inch]."""

_TITLE_LETTERS: Final = 105
"""Letters of a title that fit in one line."""

_LINE: Final = 0.2
"""Height of a line of text [inch]."""

_LEAST_HEIGHT: Final = 1.8
"""Height of the road in a picture [inch]: below it the road is stretched across."""

_BESIDE: Final = 8.0
"""What is shown beyond the outermost vehicles along the road [m]."""

_SHORTEST: Final = 40.0
"""The least length of road in a picture [m]."""


def draw_scene(
    scene: Scene,
    *,
    title: str = "",
    caption: str = "",
    focus: str | None = None,
    notes: Mapping[str, str] | None = None,
) -> Figure:
    """The road with its lanes and directions, the ego, the vehicles in range and their velocities.

    `focus` is the vehicle that matters, drawn in a colour of its own; `notes` are words beside vehicles, by
    id; `caption` stands below. Where the road is too long to be drawn to scale in both axes, it is stretched
    across by a whole factor, which the picture states.
    """
    from matplotlib.figure import Figure

    left, right, top, bottom = _extent(scene)
    scale = _WIDTH / (right - left)  # inches per metre
    stretch = max(1, math.ceil(_LEAST_HEIGHT / ((bottom - top) * scale)))
    wrapped = textwrap.fill(title, _TITLE_LETTERS)
    lines = len([*wrapped.splitlines(), *caption.splitlines()])
    height = (bottom - top) * scale * stretch + 0.7 + _LINE * lines
    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    axes = figure.add_subplot()
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)  # y points downward
    axes.set_aspect(stretch)
    _draw_road(axes, scene, left, right)
    for car in (*scene.in_range(), scene.ego):
        is_ego = car is scene.ego
        colour = EGO_COLOUR if is_ego else FOCUS_COLOUR if car.id == focus else OTHER_COLOUR
        _draw_vehicle(axes, car, colour, (notes or {}).get(car.id, ""))
    across = "to scale" if stretch == 1 else f"across the road stretched {stretch} times"
    axes.set_xlabel(f"x in m ({across}; arrows: {ARROW_TIME:g} s of motion)")
    axes.set_ylabel("y in m")
    if title:
        figure.suptitle(wrapped, x=0.01, ha="left", fontsize=11, fontweight="bold")
    if caption:
        figure.supxlabel(caption, x=0.01, ha="left", fontsize=9)
    return figure


def save_picture(figure: Figure, path: str | Path) -> None:
    """Write a picture; the kind of file follows from the name's ending, as `.png`, `.pdf` or `.svg`."""
    figure.savefig(path, dpi=150)


def _extent(scene: Scene) -> tuple[float, float, float, float]:
    """What is shown: least and greatest x, least and greatest y [m]."""
    cars = (scene.ego, *scene.in_range())
    ends = [car.x + side * car.length / 2 for car in cars for side in (-1, 1)]
    tips = [car.x + car.vx * ARROW_TIME + math.copysign(car.length / 2, car.vx) for car in cars]
    left, right = min(*ends, *tips) - _BESIDE, max(*ends, *tips) + _BESIDE
    missing = max(0.0, _SHORTEST - (right - left)) / 2
    sides = [lane.centre + side * lane.width / 2 for lane in scene.road.lanes for side in (-1, 1)]
    sides += [car.y + side * car.width / 2 for car in cars for side in (-1, 1)]
    return left - missing, right + missing, min(sides) - 1.0, max(sides) + 1.0


def _draw_road(axes: Axes, scene: Scene, left: float, right: float) -> None:
    """Lanes as strips, the ego's target lane darker, with arrows that say which way they run."""
    lanes = scene.road.lanes
    edges: dict[float, int] = {}
    for lane in lanes:
        shade = "#D9D9D9" if lane.id == scene.target_lane else "#EFEFEF"
        low, high = lane.centre - lane.width / 2, lane.centre + lane.width / 2
        axes.axhspan(low, high, color=shade, zorder=0, linewidth=0)
        for edge in (low, high):
            near = next((known for known in edges if abs(known - edge) < 0.01), edge)
            edges[near] = edges.get(near, 0) + 1
        sign = lane.direction.sign
        start = left + 0.02 * (right - left) if sign > 0 else right - 0.02 * (right - left)
        for step in range(2):
            axes.plot(
                start + sign * 1.6 * step,
                lane.centre,
                marker=5 if sign > 0 else 4,  # matplotlib's carets
                color="#666666",
                markersize=7,
                zorder=1,
            )
        words = f"lane {lane.id}{', target' if lane.id == scene.target_lane else ''}"
        place = start + sign * 3.5
        axes.text(
            place,
            lane.centre,
            words,
            fontsize=8,
            color="#444444",
            va="center",
            ha="left" if sign > 0 else "right",
        )
    for edge, strips in edges.items():
        axes.axhline(
            edge, color="black", linewidth=1.0, linestyle="-" if strips == 1 else (0, (8, 6)), zorder=1
        )


def _draw_vehicle(axes: Axes, car: Vehicle, colour: str, note: str) -> None:
    """A box to scale with its velocity, name, speed and what is noted of it."""
    from matplotlib.patches import Rectangle

    corner = (car.x - car.length / 2, car.y - car.width / 2)
    axes.add_patch(
        Rectangle(corner, car.length, car.width, facecolor=colour, edgecolor="black", linewidth=0.8, zorder=3)
    )
    tip = (car.x + car.vx * ARROW_TIME + math.copysign(car.length / 2, car.vx), car.y + car.vy * ARROW_TIME)
    if abs(car.vx) * ARROW_TIME > 0.1 or abs(car.vy) * ARROW_TIME > 0.1:
        start = (car.x + math.copysign(car.length / 2, car.vx), car.y)
        axes.annotate(
            "",
            xy=tip,
            xytext=start,
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.4},
            zorder=4,
        )
    words = f"{car.id}  {math.hypot(car.vx, car.vy):.1f} m/s" + (f"\n{note}" if note else "")
    axes.annotate(
        words,
        xy=(car.x, car.y - car.width / 2),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=8,
        zorder=5,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
    )
