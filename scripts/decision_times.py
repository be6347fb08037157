"""Print the processor time of a decision of the rules for highway-fast-v0: pip install highway-env==1.12.1

    python scripts/decision_times.py [--states 1000]

States are those of a random drive among the actions offered. One at a time, the facts are gathered and the
rules asked on the scalar tier; in batches of 100, the rules are asked on Numba about facts in arrays. Each is
the least of some repetitions.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any, Final

import gymnasium
import highway_env  # noqa: F401  # registers its environments
import numpy as np

from drlsl.lowering import Rows
from drlsl.shield import ActionRules, Facts
from drlsl.shield.environments.straight_road import (
    ROAD_SCHEMA,
    RULES,
    shield_straight_road,
    straight_road_facts,
)

BATCH: Final = 100
REPETITIONS: Final = 25


def states(count: int) -> tuple[list[Any], list[str]]:
    """Return worlds of random drives, and the names of the actions."""
    env = shield_straight_road(gymnasium.make("highway-fast-v0"))
    rng, found = np.random.default_rng(0), list[Any]()
    over = True
    while len(found) < count:
        if over:
            _, info = env.reset(seed=len(found))
        found.append(deepcopy(env.unwrapped))
        *_, terminated, truncated, info = env.step(rng.choice(np.flatnonzero(info["action_mask"])))
        over = terminated or truncated
    return found, list(env.rules.actions)


def in_arrays(rules: ActionRules, facts: Sequence[Facts]) -> dict[tuple[str, int], Rows]:
    """Return the facts of many states as arrays."""
    result = {}
    for key, relation in ROAD_SCHEMA.relations.items():
        rows = [list(each[key]) for each in facts]
        valid = np.array([[place < len(each) for place in range(max(map(len, rows)))] for each in rows])
        columns = []
        for place, kind in enumerate(relation.columns):
            column = np.zeros(valid.shape, dtype=np.float64 if kind == "float" else np.int64)
            cells = [row[place] for each in rows for row in each]
            column[valid] = [rules.code(cell) for cell in cells] if kind == "atom" else cells
            columns.append(column[:, 0] if relation.single else column)
        result[key] = Rows(columns) if relation.single else Rows(columns, valid)
    return result


def least(run: Callable[[], object]) -> float:
    """Return the least processor time of some calls [s]."""
    found = []
    for _ in range(REPETITIONS):
        start = time.process_time()
        run()
        found.append(time.process_time() - start)
    return min(found)


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--states", type=int, default=1000)
    count = parser.parse_args().states
    worlds, actions = states(count)
    one, many = (
        ActionRules(RULES, actions, fallback="slower", tier=tier, schema=ROAD_SCHEMA)
        for tier in ("scalar", "numba")
    )
    facts = [straight_road_facts(world) for world in worlds]
    gathering = least(lambda: [straight_road_facts(world) for world in worlds])
    asking = least(lambda: [one.offer(each) for each in facts])
    batches = [in_arrays(many, facts[start : start + BATCH]) for start in range(0, count - BATCH + 1, BATCH)]
    masks = np.concatenate([many.offers(batch).mask for batch in batches])
    assert [tuple(np.array(actions)[row]) for row in masks] == [
        tuple(name for name in actions if name in one.offer(each).actions) for each in facts[: len(masks)]
    ]
    together = least(lambda: [many.offers(batch) for batch in batches])
    print(f"facts            {1e3 * gathering / count:7.3f} ms a state")
    print(f"rules, scalar    {1e3 * asking / count:7.3f} ms a state")
    print(f"both             {1e3 * (gathering + asking) / count:7.3f} ms a decision")
    print(f"rules, Numba     {1e6 * together / len(masks):7.2f} us a state in batches of {BATCH}")


if __name__ == "__main__":
    main()
