"""A picture of a scene, seen from above; matplotlib is loaded only when one is drawn."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Final

from drlsl.driving.scene import Scene, Vehicle
from drlsl.errors import UserError
from drlsl.files import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EGO_COLOUR: Final = "#0072B2"
FOCUS_COLOUR: Final = "#D55E00"
OTHER_COLOUR: Final = "#999999"
"""Blue, vermilion and grey: told apart with any colour vision, and in print. Source: Okabe and Ito (2008)."""

ARROW_TIME: Final = 0.25
"""Velocity arrows show the distance driven in this time [s]."""

LABEL_SIZE: Final = 8.0
"""Size of letters [point]."""

LEAST_LANE: Final = 0.5
"""Height of the narrowest lane in a picture [inch]: below it the road is stretched across."""

_WIDTH: Final = 10.0
"""Width of a picture [inch]."""

_LEFT: Final = 1.05
_RIGHT: Final = 0.2
_ABOVE: Final = 0.1
_BELOW: Final = 0.55
"""Margins around the road: lanes to the left, the scale of x below [inch]."""

_TITLE_LETTERS: Final = 105
"""Number of letters of a title that fit in one line."""

_LINE: Final = 0.2
"""Height of a line of text [inch]."""

_BESIDE: Final = 8.0
"""Length of road shown beyond the outermost vehicles [m]."""

_SHORTEST: Final = 40.0
"""The least length of road in a picture [m]."""

_POINT: Final = 1 / 72
"""A point [inch]."""


@dataclass(slots=True)
class Canvas:
    """The axes of a picture, and the places of its words; x and y in m, places on paper in inches.

    `left`, `right` [m] are the ends of the road that is shown, `top` the least y [m]; a metre along the road
    is `along` inches on paper, one across it `across`.
    """

    figure: Figure
    axes: Axes
    left: float
    right: float
    top: float
    along: float
    across: float
    _taken: list[tuple[float, float, float, float]] = field(default_factory=list)

    def block(self, x: float, y: float, length: float, width: float) -> None:
        """Keep words off a box with that centre."""
        self._taken.append(
            (
                (x - length / 2 - self.left) * self.along,
                (y - width / 2 - self.top) * self.across,
                (x + length / 2 - self.left) * self.along,
                (y + width / 2 - self.top) * self.across,
            )
        )

    def write(
        self,
        variants: Iterable[str],
        x: float,
        y: float,
        *,
        half: float = 0.0,
        shifts: Sequence[float] = (0.0, 0.3, -0.3),
        colour: str = "black",
    ) -> bool:
        """Write the first of the variants that fits above or below a place; return whether one does.

        `half` [m] is the distance of the words from y; `shifts`, in widths of the words, are tried along x.
        """
        for words in variants:
            width, height = text_size(words)
            for side in (-1, 1):
                for shift in shifts:
                    centre = (x - self.left) * self.along + shift * width
                    edge = (y - self.top) * self.across
                    middle = edge + side * (half * self.across + 2.5 * _POINT + height / 2)
                    if self._is_free(centre, middle, width, height):
                        self._put(words, centre, middle, width, height, colour)
                        return True
        return False

    def _is_free(self, x: float, y: float, width: float, height: float) -> bool:
        left, right, top, bottom = x - width / 2, x + width / 2, y - height / 2, y + height / 2
        if left < 0.0 or right > (self.right - self.left) * self.along or top < 0.0:
            return False
        return all(
            right <= one[0] or left >= one[2] or bottom <= one[1] or top >= one[3] for one in self._taken
        )

    def _put(self, words: str, x: float, y: float, width: float, height: float, colour: str) -> None:
        self._taken.append((x - width / 2, y - height / 2, x + width / 2, y + height / 2))
        self.axes.text(
            self.left + x / self.along,
            self.top + y / self.across,
            words,
            ha="center",
            va="center",
            fontsize=LABEL_SIZE,
            color=colour,
            linespacing=1.1,
            zorder=7,
            bbox={"boxstyle": "round,pad=0.08", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )


def text_size(words: str) -> tuple[float, float]:
    """Return width and height of words on paper [inch], with a small margin."""
    from matplotlib.textpath import TextPath

    lines = words.splitlines()
    width = max(TextPath((0, 0), line, size=LABEL_SIZE).get_extents().width for line in lines)
    return (width + 5) * _POINT, (len(lines) * LABEL_SIZE * 1.25 + 2.5) * _POINT


def draw_scene(
    scene: Scene,
    *,
    title: str = "",
    caption: str = "",
    focus: str | None = None,
    notes: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the road with its lanes and directions, the ego, the vehicles in range and their velocities.

    `focus` is a vehicle to draw in a colour of its own; `notes` are words beside vehicles, by id; `caption`
    is written below. If the road is too long to be drawn to scale in both axes, it is stretched across by a
    whole factor, which the picture states.
    """
    canvas = draw_road(scene, title=title, caption=caption)
    colours = {} if focus is None else {focus: FOCUS_COLOUR}
    draw_vehicles(canvas, scene, colours=colours, notes=notes or {})
    return canvas.figure


def save_picture(figure: Figure, path: str | Path) -> None:
    """Write a picture; the format follows from the ending of the name, such as `.png`, `.pdf` or `.svg`.

    Raises:
        UserError: the format is unknown, or the file cannot be written.
    """
    check_picture_path(path)
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise UserError(f"cannot write the picture {path}: {error.strerror}") from error


def scene_png(scene: Scene) -> bytes:
    """Return the picture of a scene as PNG, for notebooks."""
    picture = BytesIO()
    draw_scene(scene).savefig(picture, format="png", dpi=100)
    return picture.getvalue()


def check_picture_path(path: str | Path) -> None:
    """Check that the name of a picture ends in a format that matplotlib can write.

    Raises:
        UserError: it does not.
    """
    from matplotlib.backend_bases import FigureCanvasBase

    kinds = FigureCanvasBase.get_supported_filetypes()
    if Path(path).suffix.removeprefix(".").lower() not in kinds:
        raise UserError(f"no picture is called {path}: the name must end in .{', .'.join(sorted(kinds))}")


def draw_road(
    scene: Scene,
    *,
    title: str,
    caption: str,
    places: Iterable[float] = (),
    above: float = 0.0,
    below: float = 0.0,
    least_lane: float = LEAST_LANE,
) -> Canvas:
    """Draw the road around vehicles and `places` [m], each lane at least `least_lane` [inch] high.

    Beside the road `above` and `below` [inch] are left free.
    """
    from matplotlib.figure import Figure

    left, right, top, bottom = _extent(scene, places)
    along = (_WIDTH - _LEFT - _RIGHT) / (right - left)
    narrowest = min(lane.width for lane in scene.road.lanes)
    stretch = max(1, math.ceil(least_lane / (narrowest * along)))
    across = along * stretch
    wrapped = textwrap.fill(title, _TITLE_LETTERS)
    head = _ABOVE + _LINE * len(wrapped.splitlines())
    foot = _BELOW + _LINE * len(caption.splitlines())
    road = (bottom - top) * across + above + below
    height = head + road + foot
    figure = Figure(figsize=(_WIDTH, height))
    axes = figure.add_axes((_LEFT / _WIDTH, foot / height, (_WIDTH - _LEFT - _RIGHT) / _WIDTH, road / height))
    axes.set_xlim(left, right)
    axes.set_ylim(bottom + below / across, top - above / across)  # y points downward
    axes.set_aspect(stretch)
    _draw_lanes(axes, scene, left, right)
    scale = "to scale" if stretch == 1 else f"across the road stretched {stretch} times"
    axes.set_xlabel(f"x in m ({scale}; thin arrows: {ARROW_TIME:g} s of motion)", fontsize=9)
    for number, line in enumerate(wrapped.splitlines()):
        place = 1 - (_ABOVE * 0.5 + _LINE * number) / height
        figure.text(0.01, place, line, va="top", fontsize=11, fontweight="bold")
    for number, line in enumerate(reversed(caption.splitlines())):
        figure.text(0.01, (0.06 + _LINE * number) / height, line, va="bottom", fontsize=9)
    return Canvas(figure, axes, left, right, top - above / across, along, across)


def _extent(scene: Scene, places: Iterable[float]) -> tuple[float, float, float, float]:
    """Return the limits of the picture: least and greatest x, least and greatest y [m]."""
    cars = (scene.ego, *scene.in_range())
    ends = [car.x + side * car.length / 2 for car in cars for side in (-1, 1)]
    ends += [car.x + car.vx * ARROW_TIME + math.copysign(car.length / 2, car.vx) for car in cars]
    ends += places
    left, right = min(ends) - _BESIDE, max(ends) + _BESIDE
    missing = max(0.0, _SHORTEST - (right - left)) / 2
    sides = [lane.centre + side * lane.width / 2 for lane in scene.road.lanes for side in (-1, 1)]
    sides += [car.y + side * car.width / 2 for car in cars for side in (-1, 1)]
    return left - missing, right + missing, min(sides) - 1.0, max(sides) + 1.0


def _draw_lanes(axes: Axes, scene: Scene, left: float, right: float) -> None:
    """Draw lanes as strips, the ego's target lane darker, with arrows for their directions."""
    lanes = scene.road.lanes
    edges: dict[float, int] = {}
    names = []
    for lane in lanes:
        shade = "#D9D9D9" if lane.id == scene.target_lane else "#EFEFEF"
        low, high = lane.centre - lane.width / 2, lane.centre + lane.width / 2
        axes.axhspan(low, high, color=shade, zorder=0, linewidth=0)
        if lane.end is not None and left <= lane.end <= right:
            axes.vlines(lane.end, low, high, color="black", linewidth=4.0, zorder=1)
        for edge in (low, high):
            near = next((known for known in edges if abs(known - edge) < 0.01), edge)
            edges[near] = edges.get(near, 0) + 1
        sign = lane.direction.sign
        for step in range(2):
            axes.plot(
                (left if sign > 0 else right) + sign * (0.008 + 0.008 * step) * (right - left),
                lane.centre,
                marker=5 if sign > 0 else 4,  # matplotlib's carets
                color="#666666",
                markersize=6,
                zorder=1,
            )
        target = " (target)" if lane.id == scene.target_lane else ""
        names.append(f"lane {lane.id}{target}\ny = {lane.centre:.4g} m")
    for edge, strips in edges.items():
        axes.axhline(
            edge, color="black", linewidth=1.0, linestyle="-" if strips == 1 else (0, (8, 6)), zorder=1
        )
    axes.set_yticks([lane.centre for lane in lanes], names)
    axes.tick_params(labelsize=8)
    axes.tick_params(axis="y", length=0)
    for side in ("top", "left", "right"):
        axes.spines[side].set_visible(False)


def draw_vehicles(
    canvas: Canvas,
    scene: Scene,
    *,
    colours: Mapping[str, str],
    notes: Mapping[str, str],
    ego_arrow: bool = True,
) -> None:
    """Draw the ego and the vehicles in range to scale, with velocities, names and speeds.

    `colours` and `notes` are by id. If there is no room for all words, those of vehicles without a colour of
    their own are left out first, the farthest first.
    """
    cars = [*scene.in_range(), scene.ego]
    for car in cars:
        colour = EGO_COLOUR if car is scene.ego else colours.get(car.id, OTHER_COLOUR)
        _draw_vehicle(canvas.axes, car, colour, arrow=ego_arrow or car is not scene.ego)
        canvas.block(car.x, car.y, car.length, car.width)

    def rank(car: Vehicle) -> tuple[bool, bool, float]:
        return car is not scene.ego, car.id not in colours, abs(car.x - scene.ego.x)

    for car in sorted(cars, key=rank):
        name = printable(car.id)
        speed = f"{name}  {math.hypot(car.vx, car.vy):.1f} m/s"
        variants = [speed, name]
        if car.id in notes:
            variants.insert(0, f"{speed}\n{notes[car.id]}")
        canvas.write(variants, car.x, car.y, half=car.width / 2)


def _draw_vehicle(axes: Axes, car: Vehicle, colour: str, *, arrow: bool) -> None:
    """Draw a box to scale with its velocity."""
    from matplotlib.patches import Rectangle

    corner = (car.x - car.length / 2, car.y - car.width / 2)
    axes.add_patch(
        Rectangle(corner, car.length, car.width, facecolor=colour, edgecolor="black", linewidth=0.8, zorder=3)
    )
    if arrow and (abs(car.vx) * ARROW_TIME > 0.1 or abs(car.vy) * ARROW_TIME > 0.1):
        start = (car.x + math.copysign(car.length / 2, car.vx), car.y)
        axes.annotate(
            "",
            xy=(start[0] + car.vx * ARROW_TIME, car.y + car.vy * ARROW_TIME),
            xytext=start,
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "linewidth": 1.4,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
            zorder=4,
        )
