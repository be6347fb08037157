"""Shield an environment of your own with four lines of Prolog: python examples/shield_cliff.py."""

import gymnasium

from drlsl import LogicShield

RULES = """
:- dynamic(cell/2).
move(up, -1, 0).  move(right, 0, 1).  move(down, 1, 0).  move(left, 0, -1).
offered(Move) :- move(Move, _, _), \\+ objection(Move, _).
objection(Move, cliff) :- move(Move, Down, Right), cell(Row, Column), cliff(Row + Down, Column + Right).
cliff(R, C) :- Row is R, Column is C, Row >= 3, Column > 0, Column < 11.
"""


def falls(mode: str, steps: int = 2000) -> int:
    """Return how often a random walk falls from the cliff in some steps."""
    env = LogicShield(
        gymnasium.make("CliffWalking-v1"),
        RULES,
        actions={"up": 0, "right": 1, "down": 2, "left": 3},
        facts=lambda cliff: {("cell", 2): [divmod(int(cliff.s), 12)]},
        fallback="up",
        mode=mode,
    )
    env.action_space.seed(0)
    env.reset(seed=0)
    fallen = 0
    for _ in range(steps):
        _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        fallen += reward == -100
        if terminated or truncated:
            env.reset()
    return fallen


print(f"falls in 2000 random steps: {falls('mask')} without the rules, {falls('replace')} with them")
