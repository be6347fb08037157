"""The rules of highway.pl written by hand in Python, from their meaning and not from their text."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drlsl.driving.scene import Scene, Vehicle
from drlsl.traffic import Lane

RESPONSE_TIME, RESPONSE_ACCELERATION, REAR_BRAKING, FRONT_BRAKING = 0.35, 3.0, 6.0, 8.0
STANDSTILL, MARGIN, SIDE_TIME = 2.0, 0.3, 1.0
COMFORT_ACCELERATION, COMFORT, TIME_GAP, QUEUE_GAP, GIVING_WAY = 1.4, 2.0, 1.5, 3.0, 0.3
HORIZON = {"now": 0.0, "own": 1.0, "soon": 3.0, "home": 1.0, "entry": 3.0, "left": 3.0, "right": 3.0}
SECTIONS = {
    "front": ("own", "ahead"),
    "front_right": ("right", "ahead"),
    "right": ("right", "alongside"),
    "back_right": ("right", "behind"),
    "back": ("own", "behind"),
    "back_left": ("left", "behind"),
    "left": ("left", "alongside"),
    "front_left": ("left", "ahead"),
}


def stopping_way(speed: float) -> float:
    """RSS: how far a vehicle comes that speeds up until it responds, and then brakes as it must."""
    reached = speed + RESPONSE_ACCELERATION * RESPONSE_TIME
    responding = speed * RESPONSE_TIME + RESPONSE_ACCELERATION * RESPONSE_TIME * RESPONSE_TIME / 2
    return responding + reached * reached / (2 * REAR_BRAKING)


def critical_distance(rear: float, front: float) -> float:
    """RSS, Definition 1."""
    return max(0.0, stopping_way(rear) - front * front / (2 * FRONT_BRAKING))


def opposite_distance(one: float, other: float) -> float:
    """RSS, Definition 2."""
    return stopping_way(one) + stopping_way(other)


@dataclass(frozen=True)
class Oracle:
    """What the rules should say about one scene."""

    scene: Scene

    @property
    def ego(self) -> Vehicle:
        return self.scene.ego

    @property
    def lane(self) -> Lane:
        lane = self.scene.road.lane(self.ego.lane)
        assert lane is not None
        return lane

    @property
    def target(self) -> Lane:
        lane = self.scene.road.lane(self.scene.target_lane)
        assert lane is not None
        return lane

    @property
    def sign(self) -> int:
        return self.lane.direction.sign

    def velocity(self, car: Vehicle) -> float:
        return self.sign * car.vx

    def speed(self, car: Vehicle) -> float:
        return max(0.0, self.velocity(car))

    def targets(self) -> list[Vehicle]:
        ego = self.ego
        return [
            car
            for car in self.scene.in_range()
            if math.sqrt((ego.x - car.x) * (ego.x - car.x) + (ego.y - car.y) * (ego.y - car.y))
            <= self.scene.road.radar_range
        ]

    def offset(self, car: Vehicle) -> float:
        return self.sign * (car.x - self.ego.x)

    def gap(self, car: Vehicle) -> float:
        return abs(self.offset(car)) - (self.ego.length + car.length) / 2

    def side_lane(self, side: str) -> Lane | None:
        turn = {"left": -1, "right": 1}[side] * self.sign
        same_way = sorted(self.scene.road.lanes_of(self.lane.direction), key=lambda lane: lane.centre)
        index = same_way.index(self.lane) + turn
        return same_way[index] if 0 <= index < len(same_way) else None

    def way(self, side: str) -> tuple[float, float] | None:
        if side in ("own", "now", "soon"):
            low, high = sorted((self.ego.y, self.target.centre))
            return low - self.ego.width / 2 - MARGIN, high + self.ego.width / 2 + MARGIN
        lane = self.lane if side in ("home", "entry") else self.side_lane(side)
        return (lane.centre - lane.width / 2, lane.centre + lane.width / 2) if lane else None

    def in_way(self, car: Vehicle, side: str) -> bool:
        way = self.way(side)
        if way is None:
            return False
        low, high = sorted((car.y, car.y + car.vy * HORIZON[side]))
        return low - car.width / 2 < way[1] and high + car.width / 2 > way[0]

    def place(self, car: Vehicle) -> str:
        if self.gap(car) <= 0:
            return "alongside"
        return "ahead" if self.offset(car) > 0 else "behind"

    def section(self, name: str) -> list[Vehicle]:
        side, place = SECTIONS[name]
        return [car for car in self.targets() if self.place(car) == place and self.in_way(car, side)]

    def busy(self, name: str) -> bool:
        return bool(self.section(name))

    def needed_gap(self, car: Vehicle) -> float:
        own, other = self.speed(self.ego), self.velocity(car)
        if self.offset(car) < 0:
            return critical_distance(self.speed(car), own) + STANDSTILL
        distance = opposite_distance(own, -other) if other < 0 else critical_distance(own, other)
        return distance + STANDSTILL

    def obstacles(self, side: str) -> list[Vehicle]:
        return [
            car for car in self.targets() if self.in_way(car, side) and self.gap(car) < self.needed_gap(car)
        ]

    @property
    def settled(self) -> bool:
        return (
            self.target == self.lane
            and abs(self.ego.y - self.target.centre) <= self.scene.road.centre_tolerance
        )

    def is_safe(self, side: str) -> bool:
        return not self.obstacles(side)

    def is_valid(self, side: str) -> bool:
        return self.side_lane(side) is not None

    def actions(self) -> list[str]:
        offered = ["lane_keeping"]
        for side in ("left", "right"):
            if self.settled and self.is_valid(side) and self.is_safe(side):
                offered.append(f"{side}_lane_change")
        return offered

    def closing(self, car: Vehicle) -> float:
        own, other = self.speed(self.ego), self.velocity(car)
        return max(0.0, own - other if self.offset(car) >= 0 else other - own)

    def beside(self, side: str) -> bool:
        return any(
            self.in_way(car, side) and self.gap(car) < STANDSTILL + self.closing(car) * SIDE_TIME
            for car in self.targets()
        )

    def catches_up(self, side: str) -> bool:
        """Somebody behind in a way is too near by UN R157 to brake down to the ego's speed."""
        for car in self.targets():
            closing = self.closing(car)
            time = closing / (2 * REAR_BRAKING) + RESPONSE_TIME
            near = self.gap(car) < STANDSTILL + closing * time
            if near and self.place(car) == "behind" and self.in_way(car, side):
                return True
        return False

    def lane_to_keep(self) -> int:
        for side in ("left", "right"):
            taken = self.beside(side) or self.catches_up(side)
            if self.side_lane(side) == self.target and taken and not self.beside("home"):
                return self.lane.id
        return self.target.id

    def leaders(self, side: str) -> list[tuple[float, float]]:
        """Gap and speed of those ahead in a way; who is oncoming stands where it will stop."""
        found = []
        for car in self.targets():
            if self.place(car) == "ahead" and self.in_way(car, side):
                velocity = self.velocity(car)
                way = stopping_way(-velocity) if velocity < 0 else 0.0
                found.append((self.gap(car) - way, max(0.0, velocity)))
        return found

    def merges(self, side: str) -> bool:
        """Somebody alongside, centre ahead, comes into a way."""
        return any(
            self.offset(car) > 0 and self.place(car) == "alongside" and self.in_way(car, side)
            for car in self.targets()
        )

    def braking_needed(self, gap: float, other: float) -> float:
        road, own = self.scene.road, self.speed(self.ego)
        room = gap + other * other / (2 * FRONT_BRAKING) - own * road.time_step
        return own * own / (2 * room) if room > 0 else road.braking_limit

    def in_limits(self, acceleration: float) -> float:
        road = self.scene.road
        return max(-road.braking_limit, min(road.acceleration_limit, acceleration))

    def allowed(self, gap: float, other: float) -> float:
        """The acceleration that a leader allows."""
        road, own = self.scene.road, self.speed(self.ego)
        step = road.time_step
        stop = own * own / (2 * road.braking_limit) + step * step
        if gap <= 0 or gap + other * other / (2 * FRONT_BRAKING) - own * step <= stop:
            return -road.braking_limit
        far = gap > critical_distance(own, other) + STANDSTILL
        return (
            road.acceleration_limit
            if far and self.braking_needed(gap, other) <= REAR_BRAKING
            else -GIVING_WAY
        )

    def acceleration(self) -> float:
        road, own = self.scene.road, self.speed(self.ego)
        allowed = [max(-COMFORT, (self.lane.speed_limit - own) / road.time_step)]
        allowed += [self.allowed(gap, other) for gap, other in self.leaders("now")]
        allowed += [-GIVING_WAY] if self.merges("now") else []
        return self.in_limits(min(allowed))

    def target_speed(self) -> float:
        step, own = self.scene.road.time_step, self.speed(self.ego)
        reached = own + self.acceleration() * step
        return max(0.0, min(max(self.lane.speed_limit, own - COMFORT * step), reached))

    def kept_distance(self, gap: float, other: float) -> float:
        """What the Intelligent Driver Model suggests behind a leader, without its overreaction."""
        own = self.speed(self.ego)
        if gap <= 0:
            return -self.scene.road.braking_limit
        closing = own * (own - other) / (2 * math.sqrt(COMFORT_ACCELERATION * COMFORT))
        wanted = QUEUE_GAP + max(0.0, own * TIME_GAP + closing)
        faster = max(0.0, own - other)
        suggested = COMFORT_ACCELERATION * (1 - (wanted / gap) * (wanted / gap))
        return max(suggested, -faster * faster / (2 * gap) - COMFORT)

    def comfortable_acceleration(self) -> float:
        hardest = self.scene.road.braking_limit
        share = self.speed(self.ego) / min(self.lane.speed_limit, self.target.speed_limit)
        wanted = [max(-COMFORT, COMFORT_ACCELERATION * (1 - share * share * share * share))]
        wanted += [self.kept_distance(gap, other) for gap, other in self.leaders("soon")]
        for gap, other in self.leaders("now"):
            needed = self.braking_needed(gap, other)
            if gap > 0 and needed > REAR_BRAKING:
                firmer = (hardest - COMFORT) * (needed - REAR_BRAKING) / (hardest - REAR_BRAKING)
                wanted.append(-COMFORT - firmer)
        wanted += [-COMFORT] if self.merges("soon") else []
        wanted += [-REAR_BRAKING] if self.merges("now") else []
        return self.in_limits(min(wanted))

    def room(self, name: str) -> float:
        if self.way(SECTIONS[name][0]) is None:
            return 0.0
        gaps = [self.gap(car) for car in self.section(name)]
        return max(0.0, min(1.0, min(gaps) / self.scene.road.radar_range)) if gaps else 1.0

    def faster(self, name: str) -> float:
        """How much faster than the ego the nearest vehicle is, as a share of the highest limit."""
        cars = self.section(name)
        if not cars:
            return 0.0
        nearest = min(cars, key=self.gap)
        return self.signed_share(self.velocity(nearest) - self.speed(self.ego))

    def signed_share(self, speed: float) -> float:
        return max(-1.0, min(1.0, speed / max(lane.speed_limit for lane in self.scene.road.lanes)))

    def limit(self, side: str) -> float:
        lane = self.lane if side == "own" else self.side_lane(side)
        return -1.0 if lane is None else self.signed_share(lane.speed_limit - self.speed(self.ego))

    def ten_numbers(self) -> dict[str, float]:
        """The paper's observation by name."""
        lanes = self.scene.road.lanes_of(self.lane.direction)
        rightward = sum(self.sign * (lane.centre - self.lane.centre) > 0 for lane in lanes)
        highest = max(lane.speed_limit for lane in self.scene.road.lanes)
        return {
            **{name: self.room(name) for name in SECTIONS},
            "lane": rightward / max(1.0, len(lanes) - 1.0),
            "speed": max(0.0, min(1.0, self.speed(self.ego) / highest)),
        }

    def observation(self) -> dict[str, float]:
        """The observation of highway.pl by name."""
        moving = [name for name in SECTIONS if name not in ("left", "right")]
        offered = self.actions()
        return {
            **self.ten_numbers(),
            **{f"{name}_faster": self.faster(name) for name in moving},
            **{f"{side}_limit": self.limit(side) for side in ("own", "right", "left")},
            **{f"{side}_offered": float(f"{side}_lane_change" in offered) for side in ("left", "right")},
        }
