"""A picture of a decision: the offered actions, the objections to the others, and the missing metres."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from drlsl.driving.explain.dimension_line import dimension
from drlsl.driving.explain.drawing import (
    EGO_COLOUR,
    FOCUS_COLOUR,
    LABEL_SIZE,
    OTHER_COLOUR,
    Canvas,
    draw_road,
    draw_vehicles,
    text_size,
)
from drlsl.driving.explain.reasons import Objection, SpeedReason
from drlsl.driving.scene import Action, Scene, Vehicle
from drlsl.driving.shield import Decision

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Side: TypeAlias = Literal["above", "below"]

GO_COLOUR: Final = "#009E73"
LEADER_COLOUR: Final = "#CC79A7"
"""Bluish green and reddish purple, to go with the colours of other pictures. Source: Okabe and Ito (2008)."""

MOST_ROWS: Final = 4
"""Dimension lines on one side of the road; further vehicles are only named."""

_ROW: Final = 0.38
"""Height of a dimension line with its words [inch]."""

_ARROW: Final = 0.8
"""Length of the arrow of an action [inch]."""

_LEAST_LANE: Final = 0.62
"""Height of the narrowest lane [inch]: arrows and words need room."""


def draw_decision(
    scene: Scene,
    decision: Decision,
    unsafe: Mapping[Action, Sequence[Objection]],
    speed: SpeedReason | None = None,
) -> Figure:
    """Draw the scene with an arrow for every action, and the gaps of vehicles that object.

    Solid green arrows are offered; dashed vermilion ones that are crossed out are not, with the reason beside
    them, or, where vehicles are too close, as dimension lines beside the road. `speed` names the vehicle that
    decides the target speed.
    """
    cars = {car.id: car for car in scene.in_range()}
    rows = _rows(scene, unsafe, cars)
    lines = [
        line
        for row in rows
        for one in row.objections
        if (line := dimension(scene.ego, cars[one.vehicle or ""], one))
    ]
    canvas = draw_road(
        scene,
        title=_title(decision),
        caption=f"{_speed_words(decision, speed)}\n ",
        places=[line.end[0] for line in lines],
        above=sum(_ROW for row in rows if row.side == "above"),
        below=sum(_ROW for row in rows if row.side == "below"),
        least_lane=_LEAST_LANE,
    )
    named = {name for found in unsafe.values() for one in found for name in one.names if name in cars}
    colours = {} if speed is None else {speed.vehicle: LEADER_COLOUR}
    colours |= dict.fromkeys(named, FOCUS_COLOUR)
    _draw_actions(canvas, scene, decision, unsafe, cars)
    notes = {} if speed is None else {speed.vehicle: "decides the speed"}
    draw_vehicles(canvas, scene, colours=colours, notes=notes, ego_arrow=False)
    for row in rows:
        _draw_row(canvas, scene, row, cars)
    close = {one.vehicle for row in rows for one in row.objections}
    focus = "too close" if named <= close else "named in a reason"
    _draw_legend(canvas, colours, focus=focus, gaps=bool(close), others=len(cars) > len(colours))
    return canvas.figure


def _title(decision: Decision) -> str:
    offered = ", ".join(action.atom for action in decision.safe_actions)
    others = ", ".join(action.atom for action in Action if action not in decision.safe_actions)
    return f"offered: {offered}" + (f"    not offered: {others}" if others else "")


def _speed_words(decision: Decision, speed: SpeedReason | None) -> str:
    return f"target speed {decision.target_speed:.2f} m/s" + (f": {speed.words()}" if speed else "")


@dataclass(frozen=True, slots=True)
class _Row:
    """A line of words beside the road, the `number`-th from it, with the dimension that it is about.

    The last one of a side may be about several objections that there is no room to draw.
    """

    side: Side
    number: int
    objections: tuple[Objection, ...]

    def words(self) -> str:
        """Return the text of the line."""
        if len(self.objections) == 1:
            return self.objections[0].words()
        names = ", ".join(str(one.vehicle) for one in self.objections)
        return f"and {len(self.objections)} more that are too close: {names}"


def _rows(
    scene: Scene, unsafe: Mapping[Action, Sequence[Objection]], cars: Mapping[str, Vehicle]
) -> list[_Row]:
    """Return the rows on the side of the road that the action leads to, the nearest vehicle first."""
    sides: dict[Side, list[Objection]] = {"above": [], "below": []}
    for action, found in unsafe.items():
        close = [one for one in found if one.vehicle in cars and one.missing is not None]
        sides["above" if _turn(scene, action) < 0 else "below"].extend(close)
    rows = []
    for side, found in sides.items():
        most = MOST_ROWS if len(found) <= MOST_ROWS else MOST_ROWS - 1
        groups = [(one,) for one in found[:most]] + ([tuple(found[most:])] if found[most:] else [])
        rows += [_Row(side, number, group) for number, group in enumerate(groups)]
    return rows


def _turn(scene: Scene, action: Action) -> int:
    """Return the sign of y that an action leads to; 0 for lane keeping."""
    way = {Action.LANE_KEEPING: 0, Action.LEFT_LANE_CHANGE: -1, Action.RIGHT_LANE_CHANGE: 1}
    return way[action] * scene.forward


def _draw_row(canvas: Canvas, scene: Scene, row: _Row, cars: Mapping[str, Vehicle]) -> None:
    """Draw a dimension line with its words, and thin lines to what it measures."""
    axes, inch = canvas.axes, 1 / canvas.across
    lanes = [lane.centre + side * lane.width / 2 for lane in scene.road.lanes for side in (-1, 1)]
    bodies = [car.y + side * car.width / 2 for car in (scene.ego, *cars.values()) for side in (-1, 1)]
    if row.side == "above":
        base = min(*lanes, *bodies) - 1.0 - (row.number * _ROW + 0.06) * inch
        words = base - 0.15 * inch
    else:
        base = max(*lanes, *bodies) + 1.0 + (row.number * _ROW + 0.1) * inch
        words = base + 0.15 * inch
    first = row.objections[0]
    line = dimension(scene.ego, cars[first.vehicle or ""], first) if len(row.objections) == 1 else None
    centre = scene.ego.x
    if line is not None:
        centre = (line.ego[0] + line.end[0]) / 2
        along = line.measure == "bumpers"
        ends = [(line.ego[0], base), (line.other[0], base), (line.end[0], base)]
        points = ends if along else [line.ego, line.other, line.end]
        _draw_dimension(canvas, points, has_gap=(first.gap or 0.0) > 0)
        if along:
            for x, y in (line.ego, line.other):
                axes.plot([x, x], [y, base], color="#444444", linewidth=0.7, linestyle=":", zorder=2)
    width = text_size(row.words())[0] / 2 / canvas.along
    centre = min(max(centre, canvas.left + width), canvas.right - width)
    axes.text(centre, words, row.words(), ha="center", va="center", fontsize=LABEL_SIZE, zorder=7)


def _draw_dimension(canvas: Canvas, points: Sequence[tuple[float, float]], *, has_gap: bool) -> None:
    """Draw the gap as a thin line, the missing length as a bar, and ticks at their ends."""
    from matplotlib.patheffects import Normal, Stroke

    ego, other, end = points
    parts = [(other, end, FOCUS_COLOUR, 4.5)]
    if has_gap:
        parts.insert(0, (ego, other, "black", 1.4))
    for begin, stop, colour, width in parts:
        canvas.axes.plot(
            *zip(begin, stop, strict=True),
            color=colour,
            linewidth=width,
            zorder=6,
            solid_capstyle="butt",
            path_effects=[Stroke(linewidth=width + 2.0, foreground="white"), Normal()],
        )
    ticks = points if has_gap else points[1:]
    canvas.axes.plot(
        *zip(*ticks, strict=True), linestyle="none", marker="|", color="black", markersize=8, zorder=6
    )


def _draw_actions(
    canvas: Canvas,
    scene: Scene,
    decision: Decision,
    unsafe: Mapping[Action, Sequence[Objection]],
    cars: Mapping[str, Vehicle],
) -> None:
    """Draw an arrow for every action from the ego's front into the lane that it leads to."""
    from matplotlib.patheffects import Normal, Stroke

    ego, heading = scene.ego, scene.forward
    start = (ego.x + heading * ego.length / 2, ego.y)
    for action in Action:
        offered = action in decision.safe_actions
        tip = (start[0] + heading * _ARROW / canvas.along, _aim(scene, action))
        width = 2.2 if offered else 1.6
        arrow = canvas.axes.annotate(
            "",
            xy=tip,
            xytext=start,
            zorder=5,
            arrowprops={
                "arrowstyle": "-|>,head_length=0.6,head_width=0.3",
                "color": GO_COLOUR if offered else FOCUS_COLOUR,
                "linewidth": width,
                "linestyle": "-" if offered else (0, (3, 2)),
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
        )
        assert arrow.arrow_patch is not None
        arrow.arrow_patch.set_path_effects([Stroke(linewidth=width + 2.5, foreground="white"), Normal()])
        for share in (0.3, 0.5, 0.7, 0.9):
            x, y = (one + share * (other - one) for one, other in zip(start, tip, strict=True))
            canvas.block(x, y, 0.16 / canvas.along, 0.12 / canvas.across)
        if not offered:
            middle = [(one + other) / 2 for one, other in zip(start, tip, strict=True)]
            canvas.axes.plot(
                *middle, marker="X", markersize=11, color=FOCUS_COLOUR, markeredgecolor="white", zorder=6
            )
            words = [one.words() for one in unsafe.get(action, ()) if one.vehicle not in cars]
            if words:
                canvas.write(
                    [", ".join(words)], *tip, shifts=(0.0, 0.6, -0.6, 1.0, -1.0), colour=FOCUS_COLOUR
                )


def _aim(scene: Scene, action: Action) -> float:
    """Return the y that an action leads to: a lane's centre, or beside the road if there is no lane."""
    road, turn = scene.road, _turn(scene, action)
    own = road.lane(scene.ego.lane)
    if not turn:
        return scene.ego.y
    if own is None:
        return scene.ego.y + turn * 3.5
    ways = [turn * (lane.centre - own.centre) for lane in road.lanes_of(own.direction)]
    return own.centre + turn * min((way for way in ways if way > 0), default=own.width * 0.75)


def _draw_legend(canvas: Canvas, colours: Mapping[str, str], *, focus: str, gaps: bool, others: bool) -> None:
    """Draw the meaning of colours and lines below the picture."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def patches() -> Iterator[Patch | Line2D]:
        yield Patch(facecolor=EGO_COLOUR, edgecolor="black", label="ego")
        if FOCUS_COLOUR in colours.values():
            yield Patch(facecolor=FOCUS_COLOUR, edgecolor="black", label=focus)
        if LEADER_COLOUR in colours.values():
            yield Patch(facecolor=LEADER_COLOUR, edgecolor="black", label="decides the speed")
        if others:
            yield Patch(facecolor=OTHER_COLOUR, edgecolor="black", label="others")
        yield Line2D([], [], color=GO_COLOUR, linewidth=2.2, label="offered")
        yield Line2D(
            [], [], color=FOCUS_COLOUR, linewidth=1.6, linestyle=(0, (3, 2)), marker="X", label="not offered"
        )
        if gaps:
            yield Line2D([], [], color="black", linewidth=1.4, label="gap")
            yield Line2D([], [], color=FOCUS_COLOUR, linewidth=4.5, label="missing")

    handles = list(patches())
    canvas.figure.legend(
        handles=handles,
        loc="lower left",
        ncols=len(handles),
        fontsize=8,
        frameon=False,
        borderaxespad=0.1,
        handlelength=1.6,
        columnspacing=1.4,
    )
