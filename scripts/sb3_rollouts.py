"""Measure masked PPO of sb3-contrib on many environments in one process: how fast it drives, what it learns.

python scripts/sb3_rollouts.py                  # the share of the environments' own speed
python scripts/sb3_rollouts.py --train 300000   # and the returns before and after a training
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from time import process_time
from typing import Any, Final, Literal

import numpy as np
import torch
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.evaluation import evaluate_policy
from stable_baselines3.common.callbacks import ConvertCallback
from stable_baselines3.common.vec_env import VecMonitor

from drlsl.driving import HighwayVectorEnv
from drlsl.masks import Mode, Sb3VecEnv

STEPS: Final = 128
"""Steps of each environment from one update to the next."""

ROLLOUTS: Final = 16


OVERTAKING: Final[dict[str, Any]] = {
    "recording": "overtake-train",
    "decision_period": 0.5,
    "reward": {"terms": ["paper", "lost_speed"]},
}
"""What is trained on: traffic in which overtaking pays."""


def highways(count: int, mode: Mode = "raise", **settings: Any) -> HighwayVectorEnv:
    """Return so many environments, whose episodes begin within the step that ends one."""
    return HighwayVectorEnv(num_envs=count, autoreset_mode="SameStep", mode=mode, **settings)


class Passes:
    """Processor time spent in the passes of a policy [s]."""

    def __init__(self, policy: Any) -> None:
        self.seconds = 0.0
        for name in ("forward", "predict_values"):
            setattr(policy, name, self._timed(getattr(policy, name)))

    def _timed(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any, **kwargs: Any) -> Any:
            began = process_time()
            try:
                return call(*args, **kwargs)
            finally:
                self.seconds += process_time() - began

        return timed


def drive(envs: HighwayVectorEnv, rng: np.random.Generator, *, offered: bool) -> float:
    """Take random actions, or offered ones, for as long as a rollout; return processor time in seconds."""
    draws = rng.random((STEPS, envs.num_envs, 3))
    began = process_time()
    for draw in draws:
        envs.step((draw * envs.action_masks() if offered else draw).argmax(axis=1))
    return process_time() - began


class Collector:
    """Collects rollouts of masked PPO; `infos` as in `Sb3VecEnv`."""

    def __init__(self, envs: HighwayVectorEnv, infos: Literal["all", "ended"]) -> None:
        self.infos = infos
        self._model = MaskablePPO("MlpPolicy", Sb3VecEnv(envs, infos), n_steps=STEPS, seed=0, device="cpu")
        self._passes = Passes(self._model.policy)
        self._model.learn(1)  # the first rollout and update, not measured

    def collect(self) -> tuple[float, float]:
        """Collect a rollout; return its processor time [s], with the passes of the policy and without."""
        model, callback = self._model, ConvertCallback(None)
        callback.init_callback(model)
        assert model.env is not None
        self._passes.seconds, began = 0.0, process_time()
        model.collect_rollouts(model.env, callback, model.rollout_buffer, STEPS)
        whole = process_time() - began
        return whole, whole - self._passes.seconds


def measure(count: int, recording: str) -> None:
    """Print how fast environments drive at random, and how fast masked PPO collects rollouts on them."""
    free, masked = highways(count, "mask", recording=recording), highways(count, recording=recording)
    for envs in (free, masked):
        envs.reset(seed=0)
    collectors = [Collector(highways(count, recording=recording), infos) for infos in ("all", "ended")]
    rng = np.random.default_rng(0)
    seconds = [
        (
            drive(free, rng, offered=False),
            drive(masked, rng, offered=True),
            *(second for one in collectors for second in one.collect()),
        )
        for _ in range(ROLLOUTS)
    ]
    # Totals: an episode begins in all environments at once, so that some rollouts have far more ends.
    steps = ROLLOUTS * STEPS * count
    random, offered, *found = (steps / sum(column) for column in zip(*seconds, strict=True))
    print(f"{count} environments of {recording}, steps per second of processor time over {steps:,} steps:")
    print(f"  random actions                 {random:10,.0f}")
    print(f"  random offered actions         {offered:10,.0f}")
    for one, whole, without in zip(collectors, found[::2], found[1::2], strict=True):
        print(f"  masked PPO, infos={one.infos:<13}{whole:10,.0f}")
        print(f"  without the policy's passes    {without:10,.0f}", end="   ")
        print(f"{without / random:.0%} of random actions, {without / offered:.0%} of random offered ones")


def train(count: int, steps: int) -> None:
    """Print the mean return of masked PPO before and after a training."""
    envs, judged = (VecMonitor(Sb3VecEnv(highways(count, **OVERTAKING))) for _ in range(2))
    model = MaskablePPO("MlpPolicy", envs, n_steps=STEPS, batch_size=1024, gamma=0.99, seed=1, device="cpu")
    for when in ("before", f"after {steps:,} steps"):
        if when != "before":
            model.learn(steps)
        judged.seed(1000)
        mean, deviation = evaluate_policy(model, judged, n_eval_episodes=2 * count, deterministic=False)
        print(f"return {when}: {mean:.1f}, deviation {deviation:.1f} over {2 * count} episodes")


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--recording", default="highway-test")
    parser.add_argument("--train", type=int, default=0, metavar="STEPS")
    options = parser.parse_args()
    torch.set_num_threads(1)
    measure(options.envs, options.recording)
    if options.train:
        train(options.envs, options.train)


if __name__ == "__main__":
    main()
