"""The keys of a scene file, declared once; their names state the units.

Pydantic is not needed for a file without mistakes: it takes longer to load than a scene takes to decide.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

from drlsl.traffic import Direction

Kind: TypeAlias = "Callable[[Any], bool] | Part"
"""What a value is: a function that says whether it surely is that, or the parts that it has."""


DIRECTIONS: Final = tuple(one.value for one in Direction)


class Key(NamedTuple):
    """A key: the kind of its value, a sentence about it, and its default.

    Without a default it must be given; with None it may be null, too.
    """

    kind: Kind
    words: str
    default: Any = ...


class Part(NamedTuple):
    """An object of a scene file; with `fewest`, a list of at least so many."""

    name: str
    words: str
    keys: Mapping[str, Key]
    fewest: int | None = None

    def __call__(self, value: Any) -> bool:
        """Return whether a value surely is such an object, or such a list."""
        if self.fewest is None:
            return self._is_one(value)
        return type(value) is list and len(value) >= self.fewest and all(map(self._is_one, value))

    def _is_one(self, value: Any) -> bool:
        if type(value) is not dict or not value.keys() <= self.keys.keys():
            return False
        for name, key in self.keys.items():
            given = value.get(name, key.default)
            if given is ... or not (key.kind(given) or given is key.default):
                return False
        return True

    def filled(self, value: Any) -> Any:
        """Return such an object, or list, with the defaults of what it leaves out and numbers as floats."""
        return self._filled_one(value) if self.fewest is None else list(map(self._filled_one, value))

    def _filled_one(self, value: Mapping[str, Any]) -> dict[str, Any]:
        return {name: _filled(key, value.get(name, key.default)) for name, key in self.keys.items()}


def _filled(key: Key, value: Any) -> Any:
    if value is None:
        return None
    if isinstance(key.kind, Part):
        return key.kind.filled(value)
    return float(value) if key.kind in (number, positive) else value


def number(value: Any) -> bool:
    """Return whether a value is a number in the range of floats."""
    return type(value) in (float, int) and abs(value) <= sys.float_info.max


def positive(value: Any) -> bool:
    """Return whether a value is a number above 0."""
    return number(value) and value > 0


def whole(value: Any) -> bool:
    """Return whether a value is an integer."""
    return type(value) is int


def count(value: Any) -> bool:
    """Return whether a value is an integer from 1."""
    return type(value) is int and value >= 1


def direction(value: Any) -> bool:
    """Return whether a value is a direction of travel."""
    return type(value) is str and value in DIRECTIONS


def text(value: Any) -> bool:
    """Return whether a value is a text of one character at least; half a surrogate pair is none."""
    return type(value) is str and value != "" and (value.isascii() or value.isprintable())


LANE: Final = Part(
    "LaneModel",
    "One lane of the road.",
    {
        "id": Key(count, "The lane's number; any order, each once."),
        "direction": Key(
            direction, "Direction of travel: left_to_right is +x; y points downward, so its left is -y."
        ),
        "centre_m": Key(number, "The y of its centre line."),
        "width_m": Key(positive, "Its width."),
        "speed_limit_mps": Key(positive, "Its speed limit."),
        "end_m": Key(number, "The x where it ends; if not given, it goes on.", None),
    },
    fewest=1,
)

ROAD: Final = Part(
    "RoadModel",
    "The road and the sensing.",
    {
        "lanes": Key(LANE, "Every lane, of both directions."),
        "time_step_s": Key(positive, "The time until the rules are asked again.", 0.04),
        "radar_range_m": Key(positive, "Range of the ego's sensing.", 100.0),
    },
)

BOX: Final = {
    "x_m": Key(number, "The centre along the road."),
    "y_m": Key(number, "The centre across the road, downward."),
    "vx_mps": Key(number, "Velocity along x: negative for right_to_left."),
    "vy_mps": Key(number, "Velocity along y: positive is downward.", 0.0),
    "length_m": Key(positive, "Length along the road.", 4.6),
    "width_m": Key(positive, "Width across the road.", 1.9),
    "lane": Key(whole, "Its lane; if not given, the lane that holds its centre.", None),
}
"""A vehicle's box and velocity."""

EGO: Final = Part(
    "EgoModel",
    "The ego.",
    {**BOX, "target_lane": Key(whole, "The lane it steers for; if not given, the lane it is in.", None)},
)

VEHICLES: Final = Part(
    "VehicleModel",
    "Another vehicle.",
    {**BOX, "id": Key(text, "Its name; each once, and not 'ego'.")},
    fewest=0,
)

SCENE: Final = Part(
    "SceneModel",
    "A scene: the road, the ego and the vehicles around it.",
    {
        "road": Key(ROAD, ""),
        "ego": Key(EGO, ""),
        "vehicles": Key(VEHICLES, "The other vehicles, in any order.", []),
    },
)
