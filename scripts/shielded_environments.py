"""Print how a random policy fares in known environments, without and with the rules that ship for them.

    python scripts/shielded_environments.py [--episodes 200] [--first-seed 0] [ENVIRONMENT ...]

The policy draws from all actions, or from those that are offered. Environments whose package is missing are
left out, and told. The table is that of docs/shielded-environments.md; other seeds are told by --first-seed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any, Final

import gymnasium
import numpy as np

from drlsl import LogicShield
from drlsl.shield.environments import (
    shield_crossing,
    shield_frozen_lake,
    shield_minigrid,
    shield_straight_road,
)


@dataclass(frozen=True, slots=True)
class Case:
    """An environment, its shield, and what counts.

    `accident` and `arrival` tell of the reward and of the environment after a last step whether it was one.
    """

    make: Callable[[], gymnasium.Env[Any, Any]]
    shield: Callable[[gymnasium.Env[Any, Any]], LogicShield]
    accident: Callable[[float, Any], bool]
    arrival: Callable[[float, Any], bool]
    package: str = "gymnasium"


@dataclass(slots=True)
class Tally:
    """What happened in some episodes; `total` reward; `seconds` of processor time in the shield alone."""

    accidents: int = 0
    arrivals: int = 0
    steps: int = 0
    total: float = 0.0
    seconds: float = 0.0

    def per_step(self) -> str:
        """Return the milliseconds that the shield adds to a step."""
        return f"{1000 * self.seconds / max(1, self.steps):.2f}"


def _lake(size: str, *, slippery: bool) -> Case:
    return Case(
        partial(gymnasium.make, "FrozenLake-v1", map_name=size, is_slippery=slippery),
        shield_frozen_lake,
        accident=lambda _, lake: lake.desc.flat[lake.s] == b"H",
        arrival=lambda reward, _: reward > 0,
    )


def _grid(name: str) -> Case:
    return Case(
        partial(gymnasium.make, f"minigrid:MiniGrid-{name}-v0"),
        shield_minigrid,
        accident=lambda _, world: getattr(world.grid.get(*world.agent_pos), "type", "") == "lava",
        arrival=lambda reward, _: reward > 0,
        package="minigrid",
    )


def _road(
    name: str,
    shield: Callable[[gymnasium.Env[Any, Any]], LogicShield] = shield_straight_road,
    has_arrived: Callable[[Any], bool] = lambda _: True,
) -> Case:
    """Return an environment of highway-env."""
    return Case(
        partial(gymnasium.make, f"highway_env:{name}"),
        shield,
        accident=lambda _, world: world.vehicle.crashed,
        arrival=lambda _, world: not world.vehicle.crashed and has_arrived(world),
        package="highway_env",
    )


CASES: Final[Mapping[str, Case]] = {
    "FrozenLake 4x4": _lake("4x4", slippery=False),
    "FrozenLake 8x8": _lake("8x8", slippery=False),
    "FrozenLake 4x4, slippery": _lake("4x4", slippery=True),
    "FrozenLake 8x8, slippery": _lake("8x8", slippery=True),
    "MiniGrid LavaGapS7": _grid("LavaGapS7"),
    "MiniGrid LavaCrossingS9N1": _grid("LavaCrossingS9N1"),
    "MiniGrid DistShift1": _grid("DistShift1"),
    **{name: _road(name) for name in ("highway-fast-v0", "highway-v0", "merge-v0")},
    "roundabout-v0": _road(
        "roundabout-v0", shield_crossing, lambda world: world.vehicle.lane_index[0] in ("nx", "nxs")
    ),
    # The last one: it changes the drivers of every later environment of the process.
    "intersection-v0": _road(
        "intersection-v0", shield_crossing, lambda world: world.has_arrived(world.vehicle)
    ),
}


class Timed(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment that counts the processor time that it takes itself [s]."""

    seconds = 0.0

    def reset(self, **given: Any) -> Any:
        """Begin an episode."""
        started = time.process_time()
        answer = self.env.reset(**given)
        self.seconds += time.process_time() - started
        return answer

    def step(self, action: Any) -> Any:
        """Take an action."""
        started = time.process_time()
        answer = self.env.step(action)
        self.seconds += time.process_time() - started
        return answer


def played(case: Case, seeds: range, *, shielded: bool) -> Tally:
    """Return what happens in one episode for each of the seeds."""
    inner = Timed(case.make())
    env: Any = case.shield(inner) if shielded else inner
    rng = np.random.default_rng(seeds.start)
    tally = Tally()
    for seed in seeds:
        started = time.process_time()
        _, info = env.reset(seed=seed)
        tally.seconds += time.process_time() - started
        over = False
        reward: Any = 0.0
        while not over:
            action = rng.choice(np.flatnonzero(info["action_mask"])) if shielded else _any(env, rng)
            started = time.process_time()
            _, reward, terminated, truncated, info = env.step(int(action))
            tally.seconds += time.process_time() - started
            tally.steps += 1
            tally.total += float(reward)
            over = terminated or truncated
        tally.accidents += case.accident(float(reward), env.unwrapped)
        tally.arrivals += case.arrival(float(reward), env.unwrapped)
    tally.seconds -= inner.seconds
    if shielded and env.counts.fail_safes:
        print(f"the fallback was needed: {env.counts}", file=sys.stderr)
    env.close()
    return tally


def _any(env: gymnasium.Env[Any, Any], rng: np.random.Generator) -> int:
    assert isinstance(env.action_space, gymnasium.spaces.Discrete)
    return int(rng.integers(env.action_space.n))


def main(arguments: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Play known environments without and with their rules.")
    parser.add_argument("environments", nargs="*", metavar="ENVIRONMENT", help=f"of {', '.join(CASES)}")
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=0, help="of as many seeds as there are episodes")
    given = parser.parse_args(arguments)
    unknown = set(given.environments) - set(CASES)
    if unknown:
        parser.error(f"{min(unknown)}: no such environment; expected one of {', '.join(CASES)}")
    columns = "accidents, with the rules, arrivals, with the rules, return, with the rules, ms a decision"
    print(f"| {given.episodes} episodes | {columns.replace(', ', ' | ')} |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    for name in given.environments or CASES:
        case = CASES[name]
        if find_spec(case.package) is None:
            print(f"{name} is left out: pip install {case.package}", file=sys.stderr)
            continue
        seeds = range(given.first_seed, given.first_seed + given.episodes)
        free, held = (played(case, seeds, shielded=shielded) for shielded in (False, True))
        returns = [f"{tally.total / given.episodes:.2f}" for tally in (free, held)]
        counts = [free.accidents, held.accidents, free.arrivals, held.arrivals, *returns, held.per_step()]
        print(f"| {name} | {' | '.join(map(str, counts))} |", flush=True)


if __name__ == "__main__":
    main()
