"""Make recordings with the traffic simulator SUMO (extra `sumo`).

A longer road is simulated, and a stretch in its middle is recorded once the traffic has settled. Cars follow
with the extended intelligent driver model and change lanes with SUMO's sublane model, so that a lane change
is a continuous motion with bounded lateral speed and acceleration.

Source: M. Treiber, A. Kesting, Traffic Flow Dynamics, 2013 (IDM); D. Salles et al., Extending the Intelligent
Driver Model in SUMO and Verifying the Drive Off Trajectories with Aerial Measurements, SUMO Conference 2020
(EIDM).
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.highd_writer import HighdContent
from drlsl.traffic.recording import VehicleClass
from drlsl.traffic.road import Direction
from drlsl.traffic.tracks import Tracks

UPPER_EDGE = 8.0
"""y of the topmost marking [m]; about where it lies in highD."""

MEDIAN = 4.0
"""Distance between the inner markings of the two directions [m]."""

STRETCH = 420.0
"""Length of the recorded stretch of road [m], as in highD."""

MARGIN = 50.0
"""Length of road simulated beyond both ends of the stretch, for smoothing and differences [m]."""

SMOOTHING = 0.4
"""Standard deviation of the Gaussian that smooths the lateral motion [s].

SUMO's lateral speed starts and ends with a jolt, and a cancelled lane change may set a vehicle back by half a
metre in one step. The tracks of highD are smoothed too.
"""

LONGEST = 120.0
"""Most minutes made at once; a longer recording would not fit in memory."""

HARDEST_BRAKING = 8.0
"""Emergency deceleration of every vehicle [m/s²], the limit of a dry road."""


FREE_SPEED = 50.0
"""Speed limit given to SUMO where only the drivers' wishes count [m/s]."""

LANE_CHANGING = (
    'maxSpeedLat="1.0" lcAccelLat="0.8" lcSublane="1" minGapLat="0.3" lcSigma="0.2" lcKeepRight="2"'
)
"""SUMO's parameters of lane changes: at most 1 m/s sideways, reached with 0.8 m/s²; a change takes 5 s."""


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution cut off at both ends."""

    mean: float
    deviation: float
    low: float
    high: float

    def draw(self, random: np.random.Generator) -> float:
        """Return one value; draws beyond an end land on it."""
        return float(np.clip(random.normal(self.mean, self.deviation), self.low, self.high))


@dataclass(frozen=True, slots=True)
class Drivers:
    """Wishes of the drivers of one class [m/s, s, m/s²] and sizes of their vehicles [m]."""

    speed: Normal
    headway: Normal
    acceleration: Normal
    braking: Normal
    length: Normal
    width: Normal


CARS = Drivers(
    speed=Normal(36.0, 4.5, 27.0, 46.0),
    headway=Normal(1.0, 0.15, 0.7, 1.4),
    acceleration=Normal(1.8, 0.25, 1.2, 2.4),
    braking=Normal(3.0, 0.3, 2.2, 3.8),
    length=Normal(4.5, 0.45, 3.5, 5.8),
    width=Normal(1.87, 0.1, 1.6, 2.2),
)
LATERAL_OFFSET = Normal(0.0, 0.15, -0.4, 0.4)
"""Preferred offset of a driver to the left of the lane's centre [m]."""

TRUCKS = Drivers(
    speed=Normal(24.0, 0.8, 22.2, 26.0),
    headway=Normal(1.5, 0.2, 1.1, 2.0),
    acceleration=Normal(1.0, 0.1, 0.7, 1.3),
    braking=Normal(2.5, 0.2, 2.0, 3.0),
    length=Normal(14.5, 3.0, 8.0, 18.5),
    width=Normal(2.5, 0.05, 2.3, 2.6),
)


@dataclass(frozen=True, slots=True)
class Preset:
    """A kind of road and traffic.

    `flow` [vehicles/h] is the demand of one direction; `run_up` [m] and `run_out` [m] are simulated before
    and behind the recorded stretch, for `warm_up` [s] before the recording starts. `bottleneck` [m/s], if
    given, is the speed limit behind the stretch, which congests the traffic in it. `eagerness` is SUMO's
    weight of a gain in speed in changing lanes, 1 by default. `speed_limit` [m/s] is the one that the
    recording states, None for no limit.
    """

    directions: tuple[Direction, ...]
    lanes: int
    lane_width: float
    speed_limit: float | None
    frame_rate: float
    flow: float
    truck_share: float
    run_up: float
    run_out: float
    warm_up: float
    minutes: float
    seed: int
    eagerness: float
    bottleneck: float | None = None

    @property
    def upper_markings(self) -> tuple[float, ...]:
        """y of the markings of the lanes from right to left [m], top first; empty where there are none."""
        if Direction.RIGHT_TO_LEFT not in self.directions:
            return ()
        return tuple(UPPER_EDGE + self.lane_width * number for number in range(self.lanes + 1))

    @property
    def lower_markings(self) -> tuple[float, ...]:
        """y of the markings of the lanes from left to right [m], top first; empty where there are none."""
        if Direction.LEFT_TO_RIGHT not in self.directions:
            return ()
        top = self.upper_markings[-1] + MEDIAN if self.upper_markings else UPPER_EDGE
        return tuple(top + self.lane_width * number for number in range(self.lanes + 1))


_HIGHWAY = Preset(
    directions=(Direction.LEFT_TO_RIGHT, Direction.RIGHT_TO_LEFT),
    lanes=3,
    lane_width=3.75,
    speed_limit=None,
    frame_rate=25.0,
    flow=5100.0,
    truck_share=0.11,
    run_up=700.0,
    run_out=500.0,
    warm_up=90.0,
    minutes=5.0,
    seed=1,
    eagerness=5.0,
)

PRESETS: Mapping[str, Preset] = {
    "highway-train": _HIGHWAY,
    "highway-test": replace(_HIGHWAY, minutes=2.0, seed=2),
    "freeway": Preset(
        directions=(Direction.LEFT_TO_RIGHT,),
        lanes=5,
        lane_width=3.66,
        speed_limit=29.06,
        frame_rate=10.0,
        flow=9000.0,
        truck_share=0.03,
        run_up=900.0,
        run_out=500.0,
        warm_up=300.0,
        minutes=2.0,
        seed=4,
        eagerness=0.5,
        bottleneck=8.0,
    ),
}
"""Presets of `drlsl data generate`; the bundled recordings are made with their defaults.

Flow and truck share of the highway are those of a busy highD recording, 1,700 vehicles in ten minutes. The
freeway resembles US-101 in the rush hour: five lanes of 12 ft, 65 mph, traffic held up downstream.
"""


def find_preset(name: str) -> Preset:
    """Return the preset of this name.

    Raises:
        UserError: there is none.
    """
    if name not in PRESETS:
        raise UserError(f"no preset {name!r}; there are {', '.join(PRESETS)}")
    return PRESETS[name]


def simulate(preset: Preset, *, seed: int, minutes: float) -> HighdContent:
    """Simulate a road and record the stretch in its middle.

    The same preset, seed, minutes and version of SUMO give the same rows. A vehicle is recorded while its box
    is wholly within the stretch. Velocities are differences of successive positions.

    Raises:
        UserError: SUMO is not installed or the minutes are out of range.
    """
    if not 0 < minutes <= LONGEST:
        raise UserError(f"a recording needs more than 0 and at most {LONGEST:g} minutes, not {minutes:g}")
    libsumo, netconvert = _sumo()
    random = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory(prefix="drlsl-sumo-") as folder:
        network = _write_network(Path(folder), preset, netconvert)
        routes = Path(folder) / "traffic.rou.xml"
        trucks = _write_routes(routes, preset, random, preset.warm_up + 60 * minutes)
        rows = _drive(libsumo, preset, network, routes, seed=seed, minutes=minutes)
    return _as_tracks(rows, preset, trucks)


def _sumo() -> tuple[ModuleType, Path]:
    """Return the module libsumo and the path of netconvert.

    Raises:
        UserError: the extra is not installed.
    """
    try:
        import libsumo
        import sumo
    except ImportError as error:
        raise UserError(
            f"generating traffic needs the simulator SUMO ({error.name} is missing); "
            "install it with: pip install 'drlsl[sumo]'"
        ) from error
    return libsumo, Path(sumo.SUMO_HOME) / "bin" / "netconvert"


def _write_network(folder: Path, preset: Preset, netconvert: Path) -> Path:
    """Write one straight road per direction, all towards +x, unlike in the picture; return the file."""
    end = preset.run_up + STRETCH + MARGIN
    nodes, edges = [], []
    for number, direction in enumerate(preset.directions):
        name, y = direction.value, -1000.0 * number
        for node, x in (("start", 0.0), ("middle", end), ("end", end + preset.run_out)):
            nodes.append(f'<node id="{name}_{node}" x="{x}" y="{y}"/>')
        for part, begin, finish, speed in (
            ("road", "start", "middle", FREE_SPEED),
            ("exit", "middle", "end", preset.bottleneck or FREE_SPEED),
        ):
            edges.append(
                f'<edge id="{name}_{part}" from="{name}_{begin}" to="{name}_{finish}" '
                f'numLanes="{preset.lanes}" width="{preset.lane_width}" speed="{speed}"/>'
            )
    (folder / "road.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    (folder / "road.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    network = folder / "road.net.xml"
    command = [str(netconvert), "-n", "road.nod.xml", "-e", "road.edg.xml", "-o", network.name]
    command += [
        "--no-turnarounds",
        "true",
        "--offset.disable-normalization",
        "true",
        "--xml-validation",
        "never",
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"netconvert failed: {done.stderr.strip()}")
    return network


def _write_routes(path: Path, preset: Preset, random: np.random.Generator, seconds: float) -> frozenset[int]:
    """Write every vehicle with its own driver, by time of departure; return the ids of the trucks."""
    departures = sorted(
        (time, number, direction)
        for number, direction in enumerate(preset.directions)
        for time in _arrivals(preset.flow, random, seconds)
    )
    shuffled = random.permutation(len(departures))
    trucks = frozenset(shuffled[: round(preset.truck_share * len(departures))].tolist())
    lines = []
    for index, (time, _, direction) in enumerate(departures):
        truck = index in trucks
        lane = "0" if truck else "best"
        lines.append(_vehicle_type(f"type{index}", preset, truck, random))
        lines.append(
            f'<vehicle id="{index}" type="type{index}" depart="{time:.2f}" departLane="{lane}" '
            f'departPos="base" departSpeed="max">'
            f'<route edges="{direction.value}_road {direction.value}_exit"/></vehicle>'
        )
    path.write_text("<routes>" + "\n".join(lines) + "</routes>")
    return trucks


def _arrivals(flow: float, random: np.random.Generator, seconds: float) -> list[float]:
    """Return the departure times of a Poisson process."""
    gaps = random.exponential(3600 / flow, size=int(seconds * flow / 3600 * 1.5) + 50)
    times = np.cumsum(gaps)
    return [float(time) for time in times[times < seconds]]


def _vehicle_type(name: str, preset: Preset, truck: bool, random: np.random.Generator) -> str:
    drivers = TRUCKS if truck else CARS
    values = {
        "maxSpeed": drivers.speed.draw(random),
        "tau": drivers.headway.draw(random),
        "accel": drivers.acceleration.draw(random),
        "decel": drivers.braking.draw(random),
        "length": drivers.length.draw(random),
        "width": drivers.width.draw(random),
        "latAlignment": LATERAL_OFFSET.draw(random),
    }
    drawn = " ".join(f'{key}="{value:.2f}"' for key, value in values.items())
    return (
        f'<vType id="{name}" vClass="{"truck" if truck else "passenger"}" {drawn} minGap="2.5" '
        f'emergencyDecel="{HARDEST_BRAKING}" speedFactor="1" speedDev="0" carFollowModel="EIDM" '
        f'laneChangeModel="SL2015" lcSpeedGain="{preset.eagerness}" {LANE_CHANGING}/>'
    )


def _drive(
    libsumo: ModuleType, preset: Preset, network: Path, routes: Path, *, seed: int, minutes: float
) -> list[tuple[float, ...]]:
    """Return rows (frame, direction, vehicle, front, side, length, width), in the driver's view [m].

    `front` is the distance of the front bumper from the start of the stretch, `side` that of the centre line
    from the left edge of the carriageway. A little more than the stretch is kept, for the velocities at its
    start.
    """
    command = ["sumo", "-n", str(network), "-r", str(routes), "--seed", str(seed)]
    command += ["--step-length", str(1 / preset.frame_rate), "--lateral-resolution", str(preset.lane_width)]
    command += ["--collision.action", "warn", "--collision.mingap-factor", "0", "--time-to-teleport", "-1"]
    command += ["--no-step-log", "true", "--no-warnings", "true", "--xml-validation", "never"]
    rows: list[tuple[float, ...]] = []
    libsumo.start(command)
    try:
        for _ in range(round(preset.warm_up * preset.frame_rate)):
            libsumo.simulationStep()
        for frame in range(round(minutes * 60 * preset.frame_rate) + 2):
            libsumo.simulationStep()
            rows.extend(_seen(libsumo.vehicle, preset, frame))
    finally:
        libsumo.close()
    return rows


def _seen(vehicles: Any, preset: Preset, frame: int) -> Iterator[tuple[float, ...]]:
    """Yield the rows of one frame."""
    for vehicle in vehicles.getIDList():
        road, _, part = vehicles.getRoadID(vehicle).rpartition("_")
        front = vehicles.getLanePosition(vehicle) - preset.run_up
        if part == "road" and front >= -MARGIN:
            lanes_from_left = preset.lanes - 1 - vehicles.getLaneIndex(vehicle)
            side = (lanes_from_left + 0.5) * preset.lane_width - vehicles.getLateralLanePosition(vehicle)
            number = preset.directions.index(Direction(road))
            length, width = vehicles.getLength(vehicle), vehicles.getWidth(vehicle)
            yield frame, number, int(vehicle), front, side, length, width


def _as_tracks(rows: list[tuple[float, ...]], preset: Preset, trucks: frozenset[int]) -> HighdContent:
    """Return tracks in the picture's coordinates, within the stretch, vehicles numbered by appearance."""
    table = np.array(rows)
    table = table[np.lexsort((table[:, 0], table[:, 2]))]
    frame, number, vehicle, front, side, length, width = table.T
    sign = np.array([direction.sign for direction in preset.directions])[number.astype(int)]
    left_edge = np.where(sign > 0, (*preset.lower_markings, 0.0)[0], (0.0, *preset.upper_markings)[-1])
    along = front - length / 2
    x = np.where(sign > 0, along, STRETCH - along)
    y = left_edge + sign * _smoothed(side, vehicle, SMOOTHING * preset.frame_rate)
    vx, vy = (_differences(values, vehicle) * preset.frame_rate for values in (x, y))
    ax, ay = (_differences(values, vehicle) * preset.frame_rate for values in (vx, vy))
    inside = (front - length >= 0) & (front <= STRETCH) & np.isfinite(ax)
    tracks = Tracks(x, y, vx, vy, length, width, frame.astype(np.int64), vehicle.astype(np.int64)).take(
        inside
    )
    by_appearance = tracks.vehicle[np.argsort(tracks.frame, kind="stable")]
    ids = {old: new for new, old in enumerate(dict.fromkeys(by_appearance.tolist()), start=1)}
    numbered = np.array([ids[old] for old in tracks.vehicle.tolist()])
    tracks = replace(tracks, vehicle=numbered, frame=tracks.frame - tracks.frame.min())
    classes = {new: VehicleClass.TRUCK if old in trucks else VehicleClass.CAR for old, new in ids.items()}
    order = np.lexsort((tracks.frame, tracks.vehicle))
    return HighdContent(
        tracks=tracks.take(order),
        ax=ax[inside][order],
        ay=ay[inside][order],
        vehicle_class=classes,
        frame_rate=preset.frame_rate,
        upper_markings=preset.upper_markings,
        lower_markings=preset.lower_markings,
        speed_limit=preset.speed_limit,
    )


def _smoothed(values: Floats, vehicle: Floats, deviation: float) -> Floats:
    """Return each vehicle's values, sorted by frame, smoothed by a Gaussian of `deviation` frames."""
    reach = int(np.ceil(3 * deviation))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    borders = np.flatnonzero(np.diff(vehicle)) + 1
    tracks = (np.pad(track, reach, mode="edge") for track in np.split(values, borders))
    return np.concatenate([np.convolve(track, kernel / kernel.sum(), mode="valid") for track in tracks])


def _differences(values: Floats, vehicle: Floats) -> Floats:
    """Return the change since the vehicle's previous frame; NaN in its first."""
    change = np.full(values.shape, np.nan)
    change[1:] = np.where(np.diff(vehicle) == 0, np.diff(values), np.nan)
    return change
