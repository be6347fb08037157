"""The road around the ego from above, drawn with pygame."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.explain import Objection, dimension
from drlsl.driving.rendering.camera import Camera
from drlsl.driving.rendering.moment import Moment
from drlsl.driving.rendering.pygame_library import load_pygame
from drlsl.driving.scene import Action, Scene, Vehicle
from drlsl.files import printable
from drlsl.traffic import Direction, Lane

Colour: TypeAlias = tuple[int, int, int]

EGO: Final[Colour] = (0, 180, 90)
SEEN: Final[Colour] = (224, 60, 50)
UNSEEN: Final[Colour] = (245, 245, 245)
"""The ego, vehicles in radar range and all others. Source: the simulator's colours in the paper."""

_GRASS: Final[Colour] = (36, 44, 40)
_ASPHALT: Final[Colour] = (70, 74, 80)
_LINE: Final[Colour] = (215, 215, 215)
_RADAR: Final[Colour] = (120, 150, 190)
_OFFERED: Final[Colour] = (80, 220, 140)
_REFUSED: Final[Colour] = (255, 140, 60)
_GAP: Final[Colour] = (250, 250, 250)
_TEXT: Final[Colour] = (240, 240, 240)
_ALARM: Final[Colour] = (255, 90, 80)

_CHEVRON: Final[Colour] = (130, 134, 140)
_OUTLINE: Final[Colour] = (20, 20, 20)

COLOURS: Final[dict[str, Colour]] = {
    "ego": EGO,
    "seen": SEEN,
    "unseen": UNSEEN,
    "grass": _GRASS,
    "asphalt": _ASPHALT,
    "line": _LINE,
    "chevron": _CHEVRON,
    "outline": _OUTLINE,
    "radar": _RADAR,
    "offered": _OFFERED,
    "refused": _REFUSED,
    "gap": _GAP,
    "text": _TEXT,
    "alarm": _ALARM,
}
"""The colours by what they show, for other views of a drive."""

_ROAD_TOP, _ROAD_BOTTOM = 62, 96
"""Room above the road and below it, for words [pixel]."""

_SHOULDER: Final = 1.5
"""Width shown beside the outermost lanes [m]."""

_AHEAD: Final = 0.62
"""Share of the picture's width that lies ahead of the ego."""

_BEYOND: Final = 1.15
"""How far one sees ahead, in radar ranges."""

_STRETCHED: Final = 2.0
"""How many times as large as along the road lengths are drawn across it, at most."""

_DASH, _DASHES = 6.0, 18.0
"""Length of a dash of a lane's line and the distance from dash to dash [m]. Source: German RMS, motorways."""

_CHEVRONS: Final = 60.0
"""Distance between the marks of a lane's direction [m]."""

_ARROW: Final = 9.0
"""Length of the arrow of an action along the road [m]."""


class RoadView:
    """A view of the road that moves with the ego: it is green, what it sees is red, the rest white.

    Arrows are the offered actions; crossed ones are refused, with the reason below. A line from the ego to a
    vehicle that is too close is the gap, and its thick end is what is missing.
    """

    def __init__(self, size: tuple[int, int] = (1200, 400)) -> None:
        """Make a view of `size`, width and height in pixels.

        Raises:
            UserError: pygame is not installed.
        """
        self._pygame = load_pygame()
        self.size = size
        self._surface = self._pygame.Surface(size)

    def __reduce__(self) -> tuple[type[RoadView], tuple[tuple[int, int]]]:
        """Copy by making anew: what pygame holds cannot be copied."""
        return RoadView, (self.size,)

    @cached_property
    def _fonts(self) -> dict[int, Any]:
        self._pygame.font.init()
        return {size: self._pygame.font.Font(None, size) for size in (20, 22, 26)}

    def draw(self, moment: Moment) -> npt.NDArray[np.uint8]:
        """Return the picture of a moment, uint8 (height, width, 3)."""
        columns = self._pygame.surfarray.array3d(self.surface(moment))
        return np.ascontiguousarray(columns.swapaxes(0, 1))

    def surface(self, moment: Moment) -> Any:
        """Return the picture of a moment as pygame's Surface, which the next one is drawn on."""
        scene = moment.scene
        camera = self._camera(scene)
        self._surface.fill(_GRASS)
        self._draw_road(camera, scene)
        self._draw_radar(camera, scene)
        seen = {car.id for car in scene.in_range()}
        for car in scene.vehicles:
            self._draw_vehicle(camera, car, SEEN if car.id in seen else UNSEEN)
        self._draw_vehicle(camera, scene.ego, EGO)
        self._draw_gaps(camera, moment)
        self._draw_actions(camera, moment)
        self._write(moment)
        return self._surface

    def _camera(self, scene: Scene) -> Camera:
        """Return the camera: the ego at its place along the picture, all lanes across it."""
        width, height = self.size
        low = min(lane.centre - lane.width / 2 for lane in scene.road.lanes) - _SHOULDER
        high = max(lane.centre + lane.width / 2 for lane in scene.road.lanes) + _SHOULDER
        along = width * _AHEAD / (scene.road.radar_range * _BEYOND)
        room = height - _ROAD_TOP - _ROAD_BOTTOM
        across = min(room / (high - low), _STRETCHED * along)
        left = (1 - _AHEAD if scene.forward > 0 else _AHEAD) * width / along
        top = (low + high) / 2 - (_ROAD_TOP + room / 2) / across
        return Camera(scene.ego.x - left, top, along, across, width)

    def _draw_road(self, camera: Camera, scene: Scene) -> None:
        for lane in scene.road.lanes:
            top = camera.point(0.0, lane.centre - lane.width / 2)[1]
            height = math.ceil(lane.width * camera.across) + 1
            self._pygame.draw.rect(self._surface, _ASPHALT, (0, top, camera.width, height))
        for direction in Direction:
            lanes = scene.road.lanes_of(direction)
            for one, other in pairwise(lanes):
                self._draw_dashes(camera, (one.centre + one.width / 2 + other.centre - other.width / 2) / 2)
            if lanes:
                self._draw_line(camera, lanes[0].centre - lanes[0].width / 2)
                self._draw_line(camera, lanes[-1].centre + lanes[-1].width / 2)
            for lane in lanes:
                self._draw_chevrons(camera, lane)
        for lane in scene.road.lanes:
            if lane.end is not None:
                self._draw_end(camera, lane, lane.end)

    def _draw_end(self, camera: Camera, lane: Lane, end: float) -> None:
        """Draw grass beyond the end of a lane, and a line at it."""
        x, top = camera.point(end, lane.centre - lane.width / 2)
        height, sign = lane.width * camera.across, lane.direction.sign
        begin, stop = (x, camera.width) if sign > 0 else (0.0, x)
        # The outer line goes, the one to the next lane stays.
        beyond = (begin, top + 2 * sign, max(0.0, stop - begin) + 1, height + 1)
        self._pygame.draw.rect(self._surface, _GRASS, beyond)
        self._pygame.draw.line(self._surface, _LINE, (x, top), (x, top + height), 4)

    def _draw_line(self, camera: Camera, y: float) -> None:
        height = camera.point(0.0, y)[1]
        self._pygame.draw.line(self._surface, _LINE, (0, height), (camera.width, height), 2)

    def _draw_dashes(self, camera: Camera, y: float) -> None:
        for x in camera.multiples(_DASHES):
            ends = camera.point(x, y), camera.point(x + _DASH, y)
            self._pygame.draw.line(self._surface, _LINE, *ends, 2)

    def _draw_chevrons(self, camera: Camera, lane: Lane) -> None:
        depth, half = 1.2 * lane.direction.sign, 0.5
        for x in camera.multiples(_CHEVRONS):
            points = [
                camera.point(x - depth, lane.centre - half),
                camera.point(x, lane.centre),
                camera.point(x - depth, lane.centre + half),
            ]
            self._pygame.draw.lines(self._surface, _CHEVRON, False, points, 2)

    def _draw_radar(self, camera: Camera, scene: Scene) -> None:
        reach = scene.road.radar_range
        x, y = camera.point(scene.ego.x, scene.ego.y)
        across, along = reach * camera.across, reach * camera.along
        box = self._pygame.Rect(x - along, y - across, 2 * along, 2 * across)
        road = self._pygame.Rect(0, _ROAD_TOP, camera.width, self.size[1] - _ROAD_TOP - _ROAD_BOTTOM)
        self._surface.set_clip(road)
        self._pygame.draw.ellipse(self._surface, _RADAR, box, 2)
        self._surface.set_clip(None)

    def _draw_vehicle(self, camera: Camera, car: Vehicle, colour: Colour) -> None:
        if not (math.isfinite(car.x) and math.isfinite(car.y)):
            return
        left, top = camera.point(car.x - car.length / 2, car.y - car.width / 2)
        box = self._pygame.Rect(left, top, car.length * camera.along, car.width * camera.across)
        self._pygame.draw.rect(self._surface, colour, box, border_radius=4)
        self._pygame.draw.rect(self._surface, _OUTLINE, box, 1, border_radius=4)

    def _draw_gaps(self, camera: Camera, moment: Moment) -> None:
        cars = {car.id: car for car in moment.scene.in_range()}
        for _, objection in _all_objections(moment):
            car = cars.get(objection.vehicle or "")
            line = None if car is None else dimension(moment.scene.ego, car, objection)
            if line is None:
                continue
            ego, other, end = (camera.point(*place) for place in (line.ego, line.other, line.end))
            self._pygame.draw.line(self._surface, _GAP, (ego[0], other[1]), other, 2)
            self._pygame.draw.line(self._surface, _REFUSED, other, end, 5)
        for name in {name for _, objection in _all_objections(moment) for name in objection.names}:
            if name in cars:
                x, y = camera.point(cars[name].x, cars[name].y - cars[name].width / 2)
                self._text(f"{name}  {abs(cars[name].vx):.1f} m/s", int(x) - 30, int(y) - 16, 20, _TEXT)

    def _draw_actions(self, camera: Camera, moment: Moment) -> None:
        scene = moment.scene
        ego = scene.ego
        for action in Action:
            aside = {Action.LEFT_LANE_CHANGE: -1, Action.RIGHT_LANE_CHANGE: 1}.get(action, 0) * scene.forward
            nose = ego.x + scene.forward * (ego.length / 2 + 0.5)
            tip = nose + scene.forward * _ARROW, ego.y + aside * _lane_width(scene)
            begin, end = camera.point(nose, ego.y), camera.point(*tip)
            offered = action in moment.offered
            colour = _OFFERED if offered else _REFUSED
            self._pygame.draw.line(self._surface, colour, begin, end, 3)
            if offered:
                self._draw_head(begin, end, colour)
            else:
                x, y = end
                for dy in (-5, 5):
                    self._pygame.draw.line(self._surface, colour, (x - 5, y - dy), (x + 5, y + dy), 3)

    def _draw_head(self, begin: tuple[float, float], end: tuple[float, float], colour: Colour) -> None:
        angle = math.atan2(end[1] - begin[1], end[0] - begin[0])
        wings = [
            (end[0] - 10 * math.cos(angle + turn), end[1] - 10 * math.sin(angle + turn))
            for turn in (0.45, -0.45)
        ]
        self._pygame.draw.polygon(self._surface, colour, [end, *wings])

    def _write(self, moment: Moment) -> None:
        self._text(_state_words(moment), 12, 10, 26, _TEXT)
        offered = ", ".join(action.atom.replace("_", " ") for action in moment.offered)
        self._text(f"offered: {offered or 'nothing'}", 12, 36, 22, _OFFERED)
        if moment.alarm:
            self._text(printable(moment.alarm), self.size[0] // 2, 10, 26, _ALARM)
        below = self.size[1] - _ROAD_BOTTOM + 8
        for action, objection in [*_all_objections(moment)][:4]:
            words = f"no {action.atom.replace('_', ' ')}: {objection.words()}"
            self._text(words, 12, below, 20, _REFUSED)
            below += 21

    def _text(self, words: str, left: int, top: int, size: int, colour: Colour) -> None:
        self._surface.blit(self._fonts[size].render(words, True, colour), (left, top))


def _all_objections(moment: Moment) -> Iterator[tuple[Action, Objection]]:
    return ((action, one) for action, found in sorted(moment.unsafe.items()) for one in found)


def _lane_width(scene: Scene) -> float:
    lane = scene.road.lane(scene.ego.lane)
    return lane.width if lane is not None else scene.road.lanes[0].width


def _state_words(moment: Moment) -> str:
    words = [f"{abs(moment.scene.ego.vx):.1f} m/s"]
    if moment.target_speed is not None:
        words.append(f"target {moment.target_speed:.1f} m/s")
    if moment.distance is not None:
        words.append(f"{moment.distance:.0f} m")
    return "    ".join(words)
