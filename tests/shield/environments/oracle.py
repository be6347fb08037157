"""What rules/envs/straight_road.pl offers, written a second time, without the rules."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

LAG = 0.6
SIDE_MARGIN = 0.5
PATIENCE = 20.0


@dataclass(frozen=True)
class Motion:
    """A vehicle: centre, velocity, size, and the Y that it comes over to."""

    x: float
    y: float
    vx: float
    vy: float
    length: float
    width: float
    goal: float = 0.0
    sees: bool = True

    @property
    def band(self) -> tuple[float, float]:
        """The range of Y that it is in or comes to."""
        ys = (self.y, self.y + 1.5 * self.vy, self.goal)
        return min(ys) - self.width / 2, max(ys) + self.width / 2


def braked(speed: float, braking: float, time: float) -> float:
    """How far a vehicle comes that brakes."""
    speed = max(speed, 0.0)
    lasts = min(time, speed / braking)
    return speed * lasts - braking * lasts**2 / 2


def steered(speed: float, target: float, time: float, fade: float) -> tuple[float, float]:
    """How far the ego comes that steers for a speed, and how fast it is then."""
    return target * time + (speed - target) * LAG * (1 - fade), target + (speed - target) * fade


class World:
    """The facts of one state."""

    def __init__(self, facts: Mapping[tuple[str, int], Sequence[Sequence[Any]]]) -> None:
        (ego,) = facts["ego", 6]
        x, y, vx, vy, length, width = ego
        self.ego = Motion(x, y, vx, vy, length, width)
        self.others = [
            Motion(x, y, vx, vy, length, width, goal, sees == "yes")
            for _, x, y, vx, vy, length, width, goal, sees in facts["vehicle", 9]
        ]
        self.aims = {action: (y, v) for action, y, v in facts["aim", 3]}
        ((self.low, self.step),) = facts["speeds", 2]
        ((self.period, self.fade),) = facts["period", 2]

    def offered(self) -> set[str]:
        """The actions offered."""
        return self.good() or self.ways_out() or {"slower"}

    def safe(self) -> set[str]:
        """The actions without danger."""
        return {action for action in self.aims if not self.is_dangerous(action)}

    def good(self) -> set[str]:
        """The safe actions that lead behind no vehicle that is too slow."""
        return {act for act in self.safe() if min(self.reached(act), default=math.inf) >= PATIENCE}

    def ways_out(self) -> set[str]:
        """The lane changes that are taken where no action is good."""
        safe = self.safe()
        changes = self.aims.keys() & {"lane_left", "lane_right"}
        out = {action for action in changes & safe if self.gains(self.reached, action)}
        if not safe:
            out |= {
                action
                for action in changes
                if self.gains(self.contacts, action)
                and not self.is_too_near_behind(action)
                and not self.is_squeezed(action)
            }
        return out

    def gains(self, times: Any, action: str) -> bool:
        """Whether an action postpones what going slower leads to by a second."""
        slower = min(times("slower"), default=None)
        return slower is not None and all(time >= min(PATIENCE, slower + 1) for time in times(action))

    def gap(self, car: Motion) -> float:
        return abs(car.x - self.ego.x) - (self.ego.length + car.length) / 2

    def lane(self, action: str) -> tuple[float, float]:
        reach = self.ego.width / 2 + SIDE_MARGIN
        return self.aims[action][0] - reach, self.aims[action][0] + reach

    def way_there(self, action: str) -> tuple[float, float] | None:
        y, reach = self.aims[action][0], self.ego.width / 2 + SIDE_MARGIN
        if abs(self.ego.y - y) <= SIDE_MARGIN:
            return None
        return min(self.ego.y, y) - reach, max(self.ego.y, y) + reach

    def ahead(self, strip: tuple[float, float] | None) -> Iterator[Motion]:
        for car in self.others:
            low, high = car.band
            if strip and car.x >= self.ego.x and low < strip[1] and high > strip[0]:
                yield car

    def three_decisions(self, action: str) -> float:
        """How far the ego comes in three decisions, the first of them this action, the others slower."""
        way, speed, target = 0.0, self.ego.vx, self.aims[action][1]
        for _ in range(3):
            more, speed = steered(speed, target, self.period, self.fade)
            way, target = way + more, max(self.low, target - self.step)
        return way

    def within(self, action: str, time: float) -> float:
        return steered(self.ego.vx, self.aims[action][1], time, math.exp(-time / LAG))[0]

    def is_dangerous(self, action: str) -> bool:
        y = self.aims[action][0]
        for car in self.ahead(self.lane(action)):
            way = self.three_decisions(action) - braked(car.vx, 5, 3 * self.period)
            if self.gap(car) < max(0.0, way) + 3.0:
                return True
        for car in self.ahead(self.way_there(action)):
            if self.gap(car) < max(0.0, self.within(action, 1.2) - braked(car.vx, 3, 1.2)) + 2.0:
                return True
        for car in self.others:
            beside = max(0.0, self.within(action, 2.0) - braked(car.vx, 3, 2.0)) + 2.0
            is_ahead = car.x >= self.ego.x
            if abs(car.y - y) >= 5.0:
                continue
            if is_ahead and not car.sees and self.gap(car) < beside:
                return True
            is_beyond = (car.y - y) * (y - self.ego.y) > 0 and action.startswith("lane")
            if is_beyond and self.gap(car) < (beside if is_ahead else 2.0):
                return True
        return self.is_too_near_behind(action)

    def is_too_near_behind(self, action: str) -> bool:
        if not action.startswith("lane"):
            return False
        low, high = self.lane(action)
        for car in self.others:
            closing = max(0.0, car.vx - min(self.ego.vx, self.aims[action][1]))
            is_there = car.x < self.ego.x and car.band[0] < high and car.band[1] > low
            if is_there and self.gap(car) < closing * 0.7 + closing**2 / 6 + 3.0:
                return True
        return False

    def reached(self, action: str) -> list[float]:
        """The times until the ego is at slower vehicles."""
        ahead = [car for car in self.ahead(self.lane(action)) if car.vx < self.low]
        return [max(0.0, self.gap(car) - 2.0) / (self.low - car.vx) for car in ahead]

    def contacts(self, action: str) -> list[float]:
        """The times until the ego, at its speed, is at vehicles ahead."""
        speed = max(self.ego.vx, self.aims[action][1])
        ahead = self.ahead(self.lane(action))
        return [max(0.0, self.gap(car) - 2.0) / max(0.1, speed - car.vx) for car in ahead]

    def is_squeezed(self, action: str) -> bool:
        return any(
            self.gap(car) < self.within(action, 0.8) - braked(car.vx, 3, 0.8) + 0.5
            for car in self.ahead(self.way_there(action))
        )
