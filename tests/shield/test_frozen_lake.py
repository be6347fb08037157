"""The rules for FrozenLake, against what its own table of transitions says."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.shield import ActionRules
from drlsl.shield.environments import frozen_lake_facts, shield_frozen_lake
from scripts.shielded_environments import CASES, played

EXAMPLE = Path(__file__).parents[2] / "examples" / "shield_frozen_lake.py"
MOVES = ("left", "down", "right", "up")
STEPS = 4


class Lake:
    """What may be offered on a lake, by sets and sums over the transitions that Gymnasium plays by."""

    def __init__(self, env: Any) -> None:
        self.ways = {
            (cell, move): [(chance, end) for chance, end, *_ in ways if chance > 0]
            for cell, moves in env.P.items()
            for move, ways in moves.items()
        }
        letters = env.desc.ravel()
        self.cells = range(len(letters))
        self.holes = {cell for cell in self.cells if letters[cell] == b"H"}
        self.goals = {cell for cell in self.cells if letters[cell] == b"G"}
        self.sure = self.sure_ground()

    def ends(self, cell: int, move: int) -> set[int]:
        return {end for _, end in self.ways[cell, move]}

    def sure_ground(self) -> set[int]:
        """The greatest fixpoint, of cells that reach the goal within it, by the least one inside."""
        ground = set(self.cells) - self.holes
        while True:
            reached = set(self.goals)
            for _ in self.cells:
                reached |= {
                    cell
                    for cell in ground
                    if any(
                        self.ends(cell, move) <= ground and self.ends(cell, move) & reached
                        for move in range(4)
                    )
                }
            if reached == ground:
                return ground
            ground = reached

    def survival(self, steps: int) -> Any:
        """The chance (cell, move) of being in no hole after some moves, the first of which is given."""
        best = np.array([float(cell not in self.holes) for cell in self.cells])
        for _ in range(steps):
            after = np.array(
                [
                    [sum(chance * best[end] for chance, end in self.ways[cell, move]) for move in range(4)]
                    for cell in self.cells
                ]
            )
            best = after.max(axis=1)
        return after

    def offered(self, cell: int) -> set[str]:
        if cell in self.sure:
            return {name for move, name in enumerate(MOVES) if self.ends(cell, move) <= self.sure}
        after = self.survival(STEPS)[cell]
        return {name for name, chance in zip(MOVES, after, strict=True) if chance >= after.max() - 1e-9}


@st.composite
def lakes(draw: st.DrawFn) -> Any:
    rows, columns = draw(st.integers(1, 5)), draw(st.integers(2, 5))  # Gymnasium takes no single column
    letters = draw(st.lists(st.sampled_from("FFFFHG"), min_size=rows * columns, max_size=rows * columns))
    letters[draw(st.integers(0, len(letters) - 1))] = "S"
    desc = ["".join(letters[row * columns : (row + 1) * columns]) for row in range(rows)]
    slips: dict[str, Any] = draw(
        st.sampled_from(
            [{"is_slippery": False}, {}, {"success_rate": 0.8}, {"success_rate": 1.0}, {"success_rate": 0.0}]
        )
    )
    return gymnasium.make("FrozenLake-v1", desc=desc, **slips).unwrapped


@pytest.fixture(scope="module")
def rules() -> ActionRules:
    return ActionRules("envs/frozen_lake.pl", MOVES, fallback="left", tier="interpreter")


def assert_offers_what_is_known(rules: ActionRules, lake: Any, known: Lake, cell: int) -> None:
    lake.s = cell
    facts = frozen_lake_facts(lake)
    offer = rules.offer(facts)
    assert not offer.failure
    assert set(offer.actions) == known.offered(cell)
    assert {move for move in MOVES if not rules.objections(facts, move)} == known.offered(cell)


@settings(max_examples=50, deadline=None)
@given(lakes(), st.data())
def test_it_offers_what_the_transitions_say(rules: ActionRules, lake: Any, data: st.DataObject) -> None:
    known = Lake(lake)
    walkable = sorted(set(known.cells) - known.holes - known.goals)
    assume(walkable)
    lake.reset(seed=0)
    for cell in data.draw(st.lists(st.sampled_from(walkable), min_size=1, max_size=3, unique=True)):
        event(f"on sure ground: {cell in known.sure}")
        assert_offers_what_is_known(rules, lake, known, cell)


@pytest.mark.parametrize("rate", [1 / 3, 0.6])
def test_it_offers_what_the_transitions_say_anywhere(rules: ActionRules, rate: float) -> None:
    """Between the goals of this lake it matters how safe each is, and on the map 4x4 how far one looks."""
    for desc in (["SFFF", "FHFH", "FFFH", "HFFG"], ["HFHG", "FSFF", "GFHF", "FHFH"]):
        lake: Any = gymnasium.make("FrozenLake-v1", desc=desc, success_rate=rate).unwrapped
        lake.reset(seed=0)
        known = Lake(lake)
        for cell in sorted(set(known.cells) - known.holes - known.goals):
            assert_offers_what_is_known(rules, lake, known, cell)


@pytest.mark.parametrize(
    ("name", "most", "arrivals"),
    [
        ("FrozenLake 4x4", 0, 100),
        ("FrozenLake 8x8", 0, 20),
        ("FrozenLake 4x4, slippery", 66, 80),
        ("FrozenLake 8x8, slippery", 0, 10),
    ],
)
def test_a_random_walk_arrives_and_seldom_falls(name: str, most: int, arrivals: int) -> None:
    """The rules that look one step ahead leave 132 falls on the slippery lake 4x4."""
    held = played(CASES[name], range(200), shielded=True)
    assert held.accidents <= most
    assert held.arrivals >= arrivals


def test_a_move_not_offered_is_explained() -> None:
    env = shield_frozen_lake(gymnasium.make("FrozenLake-v1", is_slippery=False), mode="replace")
    env.reset(seed=0)
    env.step(MOVES.index("down"))
    *_, info = env.step(MOVES.index("right"))
    assert info["shield"]["reason"] == "leaves_sure_ground(1,1)"
    assert info["shield"]["taken"] == "left"
    slippery = shield_frozen_lake(gymnasium.make("FrozenLake-v1"))
    lake: Any = slippery.unwrapped
    slippery.reset(seed=0)
    lake.s = 8
    chance = 1 - Lake(lake).survival(STEPS)[8, MOVES.index("down")]
    (reason,) = slippery.rules.objections(frozen_lake_facts(lake), "down")
    assert reason.startswith(f"falls_within({STEPS},{chance:.6f}"[:-1])


def test_the_example_crosses_the_lake() -> None:
    done = subprocess.run([sys.executable, EXAMPLE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    without, shielded = (
        [int(word) for word in line.split() if word.isdigit()] for line in done.stdout.splitlines()
    )
    assert without[0] > 40
    assert shielded[0] == 0
    assert shielded[1] > without[1]


@pytest.mark.parametrize("name", ["CartPole-v1", "Blackjack-v1"])
def test_another_environment_is_refused(name: str) -> None:
    with pytest.raises(UserError, match=r"has no .*; expected FrozenLake; drlsl\.LogicShield takes any$"):
        shield_frozen_lake(gymnasium.make(name))
