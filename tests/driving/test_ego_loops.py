"""The loops over egos: machine code does what the plain functions do, and what the world did before."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving import EnvConfig
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import StepResult, World, ego_loops, egos, in_direction, playbacks_of, world
from drlsl.driving.simulation.reward import TERMS
from drlsl.lowering.backends import machine_code
from drlsl.traffic import CELL, PIECE, load_recording

KERNELS = (ego_loops.steer, ego_loops.find_targets, ego_loops.drive, ego_loops.look, ego_loops.finish)


class Drawn:
    """Random arguments of a kernel, by the names of its parameters."""

    def __init__(self, seed: int, egos: int, lanes: int, slots: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.egos, self.lanes, self.slots, self.rows, self.memory = egos, lanes, slots, 7, 4
        self.own_slots = self.integers(1, slots + 1, egos)

    def floats(self, low: float, high: float, *shape: int) -> Any:
        # Coarse, so that bounds are met exactly, too.
        return np.round(self.rng.uniform(low, high, shape) * 4) / 4

    def integers(self, low: int, high: int, *shape: int) -> Any:
        return self.rng.integers(low, high, shape)

    def words(self, low: int, high: int, count: int) -> Any:
        return self.rng.integers(low, high, count, dtype=np.int32)

    def films(self) -> tuple[Any, Any]:
        """The cells of a film for each ego, one behind the other, and the places where these begin."""
        films, begins = [self.words(0, 9, 3)], []
        for own in self.own_slots.tolist():
            begins.append(sum(map(len, films)))
            film = self.words(-60_000, 60_000, self.rows * CELL * own).reshape(-1, CELL, own)
            film[:, PIECE] = self.words(0, 4, self.rows * own).reshape(-1, own)
            films.append(film.reshape(-1))
        return np.concatenate(films), np.array(begins)

    def mask(self, *shape: int) -> Any:
        return self.rng.random(shape) < 0.5

    def arguments(self, names: tuple[str, ...]) -> list[Any]:
        n = self.egos
        cells, begins = self.films()
        whole: dict[str, Callable[[], Any]] = {
            "actions": lambda: self.integers(0, 3, n),
            "places": lambda: self.rng.permutation(n),
            "lane_to_keep": lambda: self.integers(1, self.lanes + 1 + (self.rng.random() < 0.2), n),
            "target_lane": lambda: self.integers(1, self.lanes + 1, n),
            "lanes": lambda: np.full(n, self.lanes),
            "lane_id": lambda: np.tile(np.arange(1, self.lanes + 1), (n, 1)),
            "sign": lambda: self.rng.choice([-1.0, 1.0], n),
            "dt": lambda: self.rng.choice([0.04, 0.1], n),
            "frame": lambda: self.integers(0, 9, n),
            "frames": lambda: self.integers(1, self.rows + 1, n),
            "cells_begin": lambda: begins,
            "first_piece": lambda: self.integers(0, 3, n),
            "own_slots": lambda: self.own_slots,
            "kept": lambda: self.integers(1, 6, n),
            "playback": lambda: self.integers(0, 2, n),
            "track_length": lambda: self.floats(1.0, 50.0, 2),
            "now": lambda: int(self.rng.integers(self.memory)),
            "comfortable": lambda: np.where(self.mask(n), np.inf, self.floats(-8.0, 3.0, n)),
            "ego_length": lambda: 4.6,
            "ego_width": lambda: 1.9,
            "reach": lambda: 40.0,
            "weights": lambda: self.floats(-2.0, 2.0, 9),
            "terms": lambda: self.rng.permutation(len(TERMS)),
            "tracks": lambda: self.floats(-30.0, 30.0, self.memory, 3, n),
            "cells": lambda: cells,
            "table": lambda: self.words(-1, 60_000, 40).reshape(8, 5),
            "centre": lambda: self.floats(-6.0, 6.0, n, self.lanes),
            "width": lambda: self.floats(2.0, 4.0, n, self.lanes),
            "lag": lambda: self.floats(0.0, 1.0, n * int(self.rng.random() < 0.5), self.slots),
            "lag_speed": lambda: self.floats(0.0, 30.0, n, self.slots),
            "found": lambda: np.zeros((n, 3)),
            "numbers": lambda: np.zeros((5 + len(TERMS), n)),
            "events": lambda: np.zeros((6, n), dtype=np.bool_),
            "changed": lambda: self.mask(n),
            "front_is_free": lambda: self.mask(n),
            "ended": lambda: self.mask(n),
            "touching": lambda: self.mask(n, self.slots),
        }
        if "cells" in names:
            shape = n, self.slots
            whole |= {
                "numbers": lambda: np.zeros((6, *shape)),
                "valid": lambda: np.zeros(shape, dtype=np.bool_),
            }
            whole |= {name: lambda: np.zeros(shape, dtype=np.int64) for name in ("vehicle", "lane")}
        return [whole[name]() if name in whole else self.floats(-5.0, 5.0, n) for name in names]


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: str(kernel.__name__))
@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), egos=st.integers(1, 9), lanes=st.integers(1, 4), slots=st.integers(1, 5)
)
def test_machine_code_does_what_the_function_does(
    kernel: Any, seed: int, egos: int, lanes: int, slots: int
) -> None:
    names = tuple(name for name in kernel.__annotations__ if name != "return")
    compiled, plain = (Drawn(seed, egos, lanes, slots).arguments(names) for _ in range(2))
    assert machine_code(kernel)(*compiled) == kernel(*plain)
    for name, one, other in zip(names, compiled, plain, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


def test_an_array_of_another_kind_is_refused() -> None:
    names = tuple(name for name in ego_loops.drive.__annotations__ if name != "return")
    arguments = Drawn(0, 3, 2, 2).arguments(names)
    arguments[names.index("kept")] = arguments[names.index("kept")].astype(np.int32)
    with pytest.raises(TypeError, match="No matching definition"):
        machine_code(ego_loops.drive)(*arguments)


PINNED = {
    "freeway": "fb74382f835f6919",
    "highway-test": "2df200ca16162502",
    "highway-train": "1cf723076962ea78",
    "overtake-dense-test": "c98a89db60dc9de7",
    "overtake-test": "08bb1a89dc6b899a",
    "overtake-train": "d0808eb6f85cb1d3",
}
"""What 16 egos did in 150 frames, to a millionth, at commit 3bfc572: with steps made of NumPy's functions."""


def driven(name: str) -> str:
    """Return a digest of a drive, which depends on the recording, the published rules and the world."""
    config = EnvConfig.model_validate(
        {
            "recording": name,
            "rules": ["paper.pl"],
            "track_length": 300.0,
            "reward": {"terms": ["paper", "lost_speed", "comfort", "jerk"], "lane_change_behind": 1.0},
        }
    )
    shield = Shield.from_files(config.rules, tier="numba")
    playbacks = in_direction(playbacks_of([load_recording(name)], config.radar_range), config)
    made = World(config, [playbacks] * 16, shield)
    made.reset(list(range(16)), [np.random.default_rng([7, ego]) for ego in range(16)])
    rng, found = np.random.default_rng(3), hashlib.sha256()
    ended = np.zeros(16, dtype=np.bool_)
    for _ in range(150):
        actions = np.where(rng.random(16) < 0.02, rng.integers(1, 3, size=16), 0)
        result = made.step(actions)
        for values in told(result):
            # What befalls an ego after its episode is not defined. Numbers count to a millionth.
            found.update((np.where(ended, 0, values.astype(np.float64)).round(6) + 0).tobytes())
        found.update(
            str({ego: (met.vehicle, met.verdict.value) for ego, met in result.contacts.items()}).encode()
        )
        ended |= result.terminated | result.truncated
    return found.hexdigest()[:16]


def told(result: StepResult) -> list[Any]:
    scenes, decisions = result.scenes, result.decisions
    others = np.where(scenes.valid, scenes.x + scenes.y + scenes.vx + scenes.id, 0.0).sum(axis=1)
    events = [result.terminated, result.truncated, result.changed, result.off_road, result.entered]
    numbers = [result.reward, *result.rewards.values(), result.distance, result.speed, others]
    return [*events, *numbers, *decisions.observation.T, *decisions.action_mask.T, decisions.target_speed]


@pytest.mark.parametrize("name", PINNED)
def test_a_drive_is_what_it_was(name: str) -> None:
    assert driven(name) == PINNED[name]


def test_without_numba_the_plain_functions_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    used = []

    def plain(function: Any) -> Any:
        used.append(function.__name__)
        return function

    for module in (egos, world):
        monkeypatch.setattr(module, "machine_code", plain)
    assert driven("freeway") == PINNED["freeway"]
    assert {"steer", "drive", "look", "finish"} <= set(used)
