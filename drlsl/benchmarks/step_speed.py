"""The speed of the environments, beside highway-env if it is installed."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.util import find_spec
from itertools import cycle
from typing import Any, Final

import gymnasium
import numpy as np

from drlsl.benchmarks.rule_speed import median_seconds, six_lanes
from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayVectorEnv
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import playbacks_of
from drlsl.traffic import NUMBERS, Recording, Tracks, VehicleClass, lanes_of_rows, pack

VEHICLES: Final = 40
"""Vehicles in every frame."""

SIZES: Final = (1, 256)
"""Environments side by side."""

FRAME_RATE: Final = 25.0
"""Steps per simulated second [Hz], as in highD."""

_LENGTH: Final = 420.0
"""Length of a road with 40 vehicles or fewer [m]."""

_ROWS: Final = 7
"""Places on it in each lane."""

_FRAMES: Final = 1500
_DRAWS: Final = 997
_DRAWN: Final = 500_000
_WARM_UP: Final = 2000
"""Steps before measuring, to fill the cache of entries."""


def env_speeds(runs: int) -> dict[str, Any]:
    """Return environment steps a second of this machine, now, on one core: medians of `runs` runs.

    `steps_per_s`: by the number of environments, with the rules, control, reward and resets, in traffic of 40
    vehicles; any offered action is taken. `highway_env`: one environment of highway-env, if installed, with
    40 vehicles, simulated and acting at 25 Hz; its vehicles are simulated, ours recorded.
    """
    speeds: dict[str, Any] = {"steps_per_s": {}}
    for size in SIZES:
        env = steady_envs(size)
        speeds["tier"] = env.shield.tier
        step = any_offered(env)
        for _ in range(max(_WARM_UP // size, 100)):
            step()
        speeds["steps_per_s"][str(size)] = size / median_seconds(step, runs)
    if find_spec("highway_env"):
        speeds["highway_env"] = 1 / median_seconds(_highway_env(), runs)
    return speeds


def steady_traffic(count: int = VEHICLES) -> Recording:
    """Return a recording with `count` vehicles in every frame: three lanes each way, each at its own speed.

    A vehicle that reaches the end of the stretch is replaced by a new one at its beginning. More vehicles
    than 40 are on a longer stretch, as dense as these.
    """
    lanes = six_lanes()
    rows = max(math.ceil(count / len(lanes)), _ROWS)
    length = _LENGTH * rows / _ROWS
    columns: list[list[np.ndarray[Any, np.dtype[Any]]]] = []
    frame = np.arange(_FRAMES)
    for vehicle in range(count):
        lane = lanes[vehicle % len(lanes)]
        speed = 15.0 + 2.0 * (lane.id % 3)
        driven = vehicle // len(lanes) * length / rows + speed * frame / FRAME_RATE
        along, rounds = driven % length, (driven // length).astype(np.int64)
        x = along if lane.direction.sign > 0 else length - along
        same = np.ones(_FRAMES)
        row = [frame, vehicle + count * rounds, x, lane.centre * same, lane.direction.sign * speed * same]
        columns.append([*row, 0.0 * same, 4.6 * same, 1.9 * same])
    frames, vehicles, *numbers = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    order = np.lexsort((frames, vehicles))
    tracks = Tracks(**dict(zip(NUMBERS, numbers, strict=True)), frame=frames, vehicle=vehicles).take(order)
    made = Recording(
        name="steady",
        frame_rate=FRAME_RATE,
        lanes=lanes,
        x_min=0.0,
        x_max=length,
        film=pack(tracks, lanes_of_rows(tracks.y, lanes), name="steady"),
        vehicle_class={int(one): VehicleClass.CAR for one in np.unique(tracks.vehicle)},
    )
    made.validate()
    return made


def steady_envs(size: int, vehicles: int = VEHICLES) -> HighwayVectorEnv:
    """Return environments in steady traffic of some `vehicles`."""
    recording = steady_traffic(vehicles)
    config = EnvConfig(recording=recording.name)
    playbacks = playbacks_of([recording], config.radar_range, config.lane_limits, config.entry)
    return HighwayVectorEnv(config, num_envs=size, shield=Shield.default(tier="auto"), playbacks=playbacks)


def any_offered(env: HighwayVectorEnv) -> Callable[[], object]:
    """Reset environments, and return a function that steps them with any of the offered actions."""
    env.reset(seed=0)
    draws = min(_DRAWS, max(7, _DRAWN // env.num_envs))
    weights = cycle(np.random.default_rng(0).random((draws, env.num_envs, 3)))
    return lambda: env.step((env.action_masks() * next(weights)).argmax(axis=1))


def _highway_env() -> Callable[[], object]:
    import highway_env

    gymnasium.register_envs(highway_env)
    config = {
        "vehicles_count": VEHICLES,
        "simulation_frequency": int(FRAME_RATE),
        "policy_frequency": int(FRAME_RATE),
        "lanes_count": 3,
        "duration": 40,
    }
    env = gymnasium.make("highway-v0", config=config)
    env.reset(seed=0)

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(1)
        if terminated or truncated:
            env.reset()

    return step
