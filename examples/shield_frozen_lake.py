"""Cross a slippery frozen lake behind the rules that ship: python examples/shield_frozen_lake.py."""

import gymnasium

from drlsl.shield.environments import shield_frozen_lake

EPISODES = 50


def play(*, shielded: bool) -> tuple[int, int]:
    """Return how often a random walk falls into a hole and how often it reaches the goal."""
    env = shield_frozen_lake(gymnasium.make("FrozenLake-v1", map_name="8x8", is_slippery=True))
    env.action_space.seed(0)
    falls = goals = 0
    for episode in range(EPISODES):
        _, info = env.reset(seed=episode)
        over = False
        while not over:
            action = env.action_space.sample(info["action_mask"] if shielded else None)
            _, reward, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        falls += terminated and reward == 0
        goals += reward > 0
    return falls, goals


for shielded in (False, True):
    falls, goals = play(shielded=shielded)
    print(
        f"{'with' if shielded else 'without'} the rules: {falls} falls, {goals} goals in {EPISODES} episodes"
    )
