"""Make recordings with the traffic simulator SUMO (extra `sumo`).

A longer road is simulated, and a stretch in its middle is recorded once the traffic has settled. Cars follow
with the extended intelligent driver model and change lanes with SUMO's sublane model, so that a lane change
is a continuous motion with bounded lateral speed and acceleration.

Source: M. Treiber, A. Kesting, Traffic Flow Dynamics, 2013 (IDM); D. Salles et al., Extending the Intelligent
Driver Model in SUMO and Verifying the Drive Off Trajectories with Aerial Measurements, SUMO Conference 2020
(EIDM).
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.highd_writer import HighdContent
from drlsl.traffic.recording import VehicleClass
from drlsl.traffic.road_network import APART, MARGIN, RAMP_EDGE, write_network
from drlsl.traffic.road_presets import RAMP, Preset
from drlsl.traffic.simulated_drivers import write_routes
from drlsl.traffic.tracks import Tracks

SMOOTHING = 0.4
"""Standard deviation of the Gaussian that smooths the lateral motion [s].

SUMO's lateral speed starts and ends with a jolt, and a cancelled lane change may set a vehicle back by half a
metre in one step. The tracks of highD are smoothed too.
"""

LONGEST = 120.0
"""Most minutes made at once; a longer recording would not fit in memory."""

NOBODY = "no vehicle was on the stretch: ask for more minutes or more flow"


def simulate(preset: Preset, *, seed: int, minutes: float) -> HighdContent:
    """Simulate a road and record the stretch in its middle.

    The same preset, seed, minutes and version of SUMO give the same rows. A vehicle is recorded while its box
    is wholly within the stretch. Velocities are differences of successive positions.

    Raises:
        UserError: SUMO is not installed, the minutes are out of range, or no vehicle comes in them.
    """
    if not 0 < minutes <= LONGEST:
        raise UserError(f"a recording needs more than 0 and at most {LONGEST:g} minutes, not {minutes:g}")
    libsumo, netconvert = _sumo()
    random = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory(prefix="drlsl-sumo-") as folder:
        network = write_network(Path(folder), preset, netconvert)
        routes = Path(folder) / "traffic.rou.xml"
        trucks = write_routes(routes, preset, random, preset.warm_up + 60 * minutes)
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
        x, y = vehicles.getPosition(vehicle)
        front = x - preset.run_up
        begin = -MARGIN
        _, ramp, place = vehicles.getRoadID(vehicle).partition(RAMP_EDGE)
        if ramp:
            begin = preset.merges[int(place)].at - RAMP
        if begin <= front <= preset.stretch + MARGIN:
            number = round(-y / APART)
            side = -APART * number - y
            length, width = vehicles.getLength(vehicle), vehicles.getWidth(vehicle)
            yield frame, number, int(vehicle), front, side, length, width


def _as_tracks(rows: list[tuple[float, ...]], preset: Preset, trucks: frozenset[int]) -> HighdContent:
    """Return tracks in the picture's coordinates, within the stretch, vehicles numbered by appearance."""
    if not rows:
        raise UserError(NOBODY)
    table = np.array(rows)
    table = table[np.lexsort((table[:, 0], table[:, 2]))]
    frame, number, vehicle, front, side, length, width = table.T
    sign = np.array([direction.sign for direction in preset.directions])[number.astype(int)]
    left_edge = np.where(sign > 0, (*preset.lower_markings, 0.0)[0], (0.0, *preset.upper_markings)[-1])
    along = front - length / 2
    x = np.where(sign > 0, along, preset.stretch - along)
    y = left_edge + sign * _smoothed(side, vehicle, SMOOTHING * preset.frame_rate)
    vx, vy = (_differences(values, vehicle) * preset.frame_rate for values in (x, y))
    ax, ay = (_differences(values, vehicle) * preset.frame_rate for values in (vx, vy))
    inside = (front - length >= 0) & (front <= preset.stretch) & np.isfinite(ax)
    if not inside.any():
        raise UserError(NOBODY)
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
        ax=ax[inside][order] if preset.accelerations else None,
        ay=ay[inside][order] if preset.accelerations else None,
        vehicle_class=classes,
        frame_rate=preset.frame_rate,
        upper_markings=preset.upper_markings,
        lower_markings=preset.lower_markings,
        speed_limit=max(preset.lane_limits) if preset.lane_limits else preset.speed_limit,
        lane_limits=preset.limits_from_the_top,
        merging_lanes=preset.merging_lanes,
        traffic=preset.traffic,
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
