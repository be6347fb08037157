"""How fast training goes, beside its bare updates and Stable-Baselines3's DQN."""

import importlib
import importlib.util
import statistics
from collections.abc import Callable
from time import perf_counter
from typing import Any, Final

import gymnasium
import numpy as np
import torch

from drlsl import driving
from drlsl.config import TrainConfig, make_config, merged, preset_values
from drlsl.learning.fleet import VectorHighway, space_sizes
from drlsl.learning.replay import Batch
from drlsl.learning.session import make_training_env
from drlsl.learning.trainer import Trainer, make_learner

UPDATES: Final = 512
"""Updates of each measurement."""

Measurement = Callable[[], float]
"""Makes about `UPDATES` updates and gives how many a second."""


def training_speeds(runs: int, num_envs: int) -> dict[str, Any]:
    """Updates a second on one CPU thread, medians of `runs` runs in turn; preset paper, `num_envs` at a time.

    `updates_per_s`: a training with dqnsl, all included, one update per step. `bare_updates_per_s`: the same
    update on a minibatch that lies ready, without environment, replay memory and acting. `ratio`: of the
    former to the latter. `stable_baselines3_updates_per_s`: its DQN, where installed, with the same network,
    batch, optimiser and number of updates per step, in as many environments, whose shield answers for it.
    """
    config = make_config(
        merged(preset_values("paper"), {"num_envs": num_envs, "device": "cpu", "episodes": 10_000_000}),
        "benchmark",
    )
    env = make_training_env(config)
    measurements = {"bare_updates_per_s": _bare(env, config), "updates_per_s": _training(env, config)}
    if importlib.util.find_spec("stable_baselines3"):
        measurements["stable_baselines3_updates_per_s"] = _stable_baselines3(config)
    found = [{name: measure() for name, measure in measurements.items()} for _ in range(runs + 1)]
    # The first round warms up.
    found = found[1:]
    speeds: dict[str, Any] = {"num_envs": num_envs, "batch_size": config.learning.batch_size, "runs": runs}
    speeds |= {name: statistics.median(one[name] for one in found) for name in measurements}
    speeds["ratio"] = statistics.median(one["updates_per_s"] / one["bare_updates_per_s"] for one in found)
    if "stable_baselines3_updates_per_s" in measurements:
        speeds["stable_baselines3_ratio"] = statistics.median(
            one["updates_per_s"] / one["stable_baselines3_updates_per_s"] for one in found
        )
    return speeds


def _bare(env: VectorHighway, config: TrainConfig) -> Measurement:
    spaces = env.single_observation_space, env.single_action_space
    agent, _ = make_learner(*spaces, config)
    batch = _ready_batch(config.learning.batch_size, *space_sizes(*spaces))

    def measure() -> float:
        started = perf_counter()
        for _ in range(UPDATES):
            agent.update(batch)
        return UPDATES / (perf_counter() - started)

    return measure


def _ready_batch(size: int, observed: int, actions: int) -> Batch:
    """Transitions out of thin air: an update takes as long whatever they tell."""
    generator = torch.Generator().manual_seed(0)
    return Batch(
        observations=torch.rand(size, observed, generator=generator),
        actions=torch.randint(actions, (size,), generator=generator),
        rewards=torch.rand(size, generator=generator),
        next_observations=torch.rand(size, observed, generator=generator),
        terminated=torch.zeros(size, dtype=torch.bool),
        next_masks=torch.ones(size, actions, dtype=torch.bool),
    )


def _training(env: VectorHighway, config: TrainConfig) -> Measurement:
    trainer = Trainer(env, config)
    events = trainer.run()

    def measure() -> float:
        before, started = trainer.agent.updates, perf_counter()
        while trainer.agent.updates < before + UPDATES:
            next(events)
        return (trainer.agent.updates - before) / (perf_counter() - started)

    return measure


def _stable_baselines3(config: TrainConfig) -> Measurement:
    library = importlib.import_module("stable_baselines3")
    vectors = importlib.import_module("stable_baselines3.common.vec_env")
    learning, schedule = config.learning, config.schedule
    torch.set_num_threads(config.threads)
    model = library.DQN(
        "MlpPolicy",
        vectors.DummyVecEnv([lambda: _Shielded(driving.make_env(config.env))] * config.num_envs),
        learning_rate=schedule.learning_rate_start,
        buffer_size=learning.replay_capacity,
        learning_starts=learning.learning_starts,
        batch_size=learning.batch_size,
        gamma=learning.discount,
        train_freq=1,
        gradient_steps=config.num_envs,
        target_update_interval=learning.target_every,
        exploration_initial_eps=schedule.epsilon_start,
        exploration_final_eps=schedule.epsilon_start,
        policy_kwargs={"net_arch": list(config.network.hidden)},
        seed=config.seed,
        device="cpu",
    )
    model.learn(2 * learning.learning_starts)

    def measure() -> float:
        before, started = model._n_updates, perf_counter()
        model.learn(UPDATES, reset_num_timesteps=False)
        return float(model._n_updates - before) / (perf_counter() - started)

    return measure


class _Shielded(gymnasium.Wrapper[Any, np.int64, Any, np.int64]):
    """Drives something safe in place of what is not, so that episodes last as long as with a shield."""

    env: Any

    def step(self, action: np.int64) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        safe = self.env.action_masks()
        observation, reward, terminated, truncated, info = self.env.step(
            action if safe[action] else np.int64(safe.argmax())
        )
        return observation, reward, terminated, truncated, info
