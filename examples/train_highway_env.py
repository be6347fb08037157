"""Train MaskablePPO on highway-env behind the rules, or without: pip install "drlsl[sb3]" highway-env==1.12.1

python examples/train_highway_env.py --seed 0
python examples/train_highway_env.py --seed 0 --bare
"""

import argparse

import gymnasium
import highway_env  # noqa: F401  # registers its environments
from sb3_contrib import MaskablePPO

from drlsl.shield.environments import shield_straight_road

parser = argparse.ArgumentParser()
parser.add_argument("--env", default="highway-fast-v0")
parser.add_argument("--steps", type=int, default=5_000)
parser.add_argument("--episodes", type=int, default=50)
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--bare", action="store_true", help="without the shield")
wanted = parser.parse_args()

env = gymnasium.make(wanted.env)
env = env if wanted.bare else shield_straight_road(env)
model = MaskablePPO("MlpPolicy", env, n_steps=500, batch_size=100, gamma=0.9, seed=wanted.seed, device="cpu")
model.learn(wanted.steps, use_masking=not wanted.bare)

crashes, total = 0, 0.0
for episode in range(wanted.episodes):
    observation, info = env.reset(seed=100_000 + episode)
    over = False
    while not over:
        action, _ = model.predict(observation, action_masks=info.get("action_mask"), deterministic=True)
        observation, reward, terminated, truncated, info = env.step(int(action))
        total, over = total + float(reward), terminated or truncated
    crashes += info["crashed"]
print(f"{crashes} crashes in {wanted.episodes} episodes, return {total / wanted.episodes:.2f}")
