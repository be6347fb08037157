"""Hypothesis strategies for scenes: two to six lanes, both directions, touching boxes, wrong ways."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import strategies as st

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE, EGO, Road, Scene, Vehicle
from drlsl.traffic import Direction, Lane

EGO_LENGTH, EGO_WIDTH = 4.6, 1.9


def road(upper: int, lower: int, width: float = 3.5, limit: float = 36.0, time_step: float = 0.04) -> Road:
    """A road with `upper` lanes that run right to left above `lower` lanes that run left to right."""
    median = 2.0 if upper and lower else 0.0
    lanes = [
        Lane(index + 1, Direction.RIGHT_TO_LEFT, (index + 0.5) * width, width, limit)
        for index in range(upper)
    ] + [
        Lane(upper + index + 1, Direction.LEFT_TO_RIGHT, (upper + index + 0.5) * width + median, width, limit)
        for index in range(lower)
    ]
    return Road(tuple(lanes), time_step, 100.0, ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE)


@st.composite
def roads(draw: st.DrawFn) -> Road:
    """Two to six lanes over both directions, of one width, with one limit or a slower outer lane."""
    upper = draw(st.integers(0, 3))
    lower = draw(st.integers(2 if upper < 2 else 0, 3))
    base = road(
        upper,
        lower,
        draw(st.sampled_from([3.0, 3.5, 3.75])),
        draw(st.sampled_from([22.0, 30.0, 36.11])),
        draw(st.sampled_from([0.04, 0.1])),
    )
    if draw(st.booleans()):
        slow = base.lanes[0]
        lanes = (Lane(slow.id, slow.direction, slow.centre, slow.width, 13.9), *base.lanes[1:])
        return Road(
            lanes,
            base.time_step,
            base.radar_range,
            base.acceleration_limit,
            base.braking_limit,
            base.centre_tolerance,
        )
    return base


@st.composite
def vehicles(draw: st.DrawFn, name: str, on: Road, ego: Vehicle) -> Vehicle:
    """A vehicle near the ego: anywhere, bumper to bumper, at the same place, or at the end of the range.

    One in five drives against its lane's direction.
    """
    lane = draw(st.sampled_from(on.lanes))
    length = draw(st.sampled_from([4.0, 4.6, 12.0]))
    touching = (ego.length + length) / 2
    offset = draw(
        st.one_of(
            st.floats(-130.0, 130.0, allow_nan=False),
            st.sampled_from(
                [0.0, touching, -touching, on.radar_range, -on.radar_range, touching + 2.0, -touching - 2.0]
            ),
        )
    )
    shift = draw(st.one_of(st.just(0.0), st.floats(-2.0, 2.0, allow_nan=False)))
    speed = draw(st.one_of(st.sampled_from([0.0, abs(ego.vx)]), st.floats(0.0, 45.0, allow_nan=False)))
    wrong_way = draw(st.integers(0, 4)) == 0
    y = lane.centre + shift
    return Vehicle(
        name,
        on.lane_at(y),
        ego.x + offset,
        y,
        lane.direction.sign * (-speed if wrong_way else speed),
        draw(st.one_of(st.just(0.0), st.floats(-1.5, 1.5, allow_nan=False))),
        length,
        draw(st.sampled_from([1.8, 1.9, 2.5])),
    )


@st.composite
def scenes(draw: st.DrawFn, most: int = 8) -> Scene:
    """A scene with up to `most` vehicles; the ego is in a lane, perhaps on its way to a neighbouring one."""
    on = draw(roads())
    lane = draw(st.sampled_from(on.lanes))
    shift = draw(st.one_of(st.just(0.0), st.floats(-lane.width / 2, lane.width / 2, allow_nan=False)))
    speed = draw(st.one_of(st.sampled_from([0.0, lane.speed_limit]), st.floats(0.0, 40.0, allow_nan=False)))
    ego = Vehicle(
        EGO,
        lane.id,
        draw(st.sampled_from([0.0, 200.0])),
        lane.centre + shift,
        lane.direction.sign * speed,
        draw(st.sampled_from([0.0, 0.0, 1.0, -1.0])),
        EGO_LENGTH,
        EGO_WIDTH,
    )
    near = [
        other.id
        for other in on.lanes_of(lane.direction)
        if abs(other.centre - lane.centre) < 1.5 * lane.width and other.id != lane.id
    ]
    target = draw(st.sampled_from([lane.id, lane.id, *near]))
    count = draw(st.integers(0, most))
    others = tuple(draw(vehicles(f"v{index}", on, ego)) for index in range(count))
    return Scene(on, ego, others, target)


@st.composite
def scenes_with_ends(draw: st.DrawFn, most: int = 6) -> Scene:
    """A scene in which some lanes end: ahead, where the ego's braking matters, behind, or at its front."""
    scene = draw(scenes(most=most))
    front = scene.ego.x + scene.forward * scene.ego.length / 2
    lanes = []
    for lane in scene.road.lanes:
        room = draw(st.one_of(st.floats(-20.0, 60.0), st.floats(-300.0, 300.0), st.sampled_from([0.0, 2.0])))
        lanes.append(replace(lane, end=front + scene.forward * room if draw(st.booleans()) else None))
    return replace(scene, road=replace(scene.road, lanes=tuple(lanes)))


@st.composite
def scenes_with_one_coming_fast(draw: st.DrawFn) -> Scene:
    """A scene in which the ego keeps its lane, and a vehicle far behind comes nearer fast."""
    scene = draw(scenes(most=2))
    own = scene.road.lane(scene.ego.lane)
    assert own is not None
    ego = scene.ego._replace(y=own.centre, vy=0.0)
    lane = draw(st.sampled_from(scene.road.lanes_of(own.direction)))
    speed = abs(ego.vx) + draw(st.floats(7.0, 11.0))
    x = ego.x - scene.forward * draw(st.floats(60.0, 99.0))
    fast = Vehicle("fast", lane.id, x, lane.centre, scene.forward * speed, 0.0, 4.6, 1.9)
    return replace(scene, ego=ego, vehicles=(*scene.vehicles, fast), target_lane=own.id)


@st.composite
def scenes_with_one_catching_up(draw: st.DrawFn) -> Scene:
    """A scene in which the ego begins to change lanes, and a faster vehicle is behind in the lane it wants.

    The gap is around 2 m and the distance that the faster one needs to brake by UN R157.
    """
    scene = draw(scenes(most=2))
    own = scene.road.lane(scene.ego.lane)
    assert own is not None
    beside = [
        lane
        for lane in scene.road.lanes_of(own.direction)
        if lane != own and abs(lane.centre - own.centre) < 1.5 * own.width
    ]
    wanted = draw(st.sampled_from(beside)) if beside else own
    closing = draw(st.floats(4.0, 25.0))
    gap = 2.0 + closing * (closing / 12 + 0.35) + draw(st.floats(-4.0, 2.0))
    x = scene.ego.x - scene.forward * (gap + (scene.ego.length + 4.6) / 2)
    vx = scene.forward * (abs(scene.ego.vx) + closing)
    fast = Vehicle("fast", wanted.id, x, wanted.centre, vx, 0.0, 4.6, 1.9)
    return replace(scene, vehicles=(*scene.vehicles, fast), target_lane=wanted.id)


def turned(scene: Scene) -> Scene:
    """The scene with the road turned round: what ran right to left runs left to right."""

    def vehicle(one: Vehicle) -> Vehicle:
        return one._replace(x=-one.x, y=-one.y, vx=-one.vx, vy=-one.vy)

    ways = {
        Direction.LEFT_TO_RIGHT: Direction.RIGHT_TO_LEFT,
        Direction.RIGHT_TO_LEFT: Direction.LEFT_TO_RIGHT,
    }
    lanes = tuple(
        replace(lane, centre=-lane.centre, direction=ways[lane.direction]) for lane in scene.road.lanes
    )
    other = replace(scene.road, lanes=lanes)
    return Scene(other, vehicle(scene.ego), tuple(map(vehicle, scene.vehicles)), scene.target_lane)
