"""The speed of training, beside its bare updates, a plain module's, and Stable-Baselines3's DQN."""

import importlib
import importlib.util
import statistics
from collections import Counter
from collections.abc import Callable, Mapping
from time import perf_counter_ns
from types import MappingProxyType
from typing import Any, Final

import gymnasium
import numpy as np

from drlsl import driving
from drlsl.learning import (
    Replay,
    StackedTrainer,
    TrainConfig,
    Trainer,
    VectorHighway,
    make_config,
    make_learner,
    make_training_env,
    merged,
    preset_values,
    space_sizes,
)

UPDATES: Final = 128
"""Updates of one kind before it is another kind's turn."""

TURNS: Final = 4
"""Turns of each kind in a run: the machine may be busier now than a moment ago."""

PLAIN: Final = "drlsl.learning.architectures:mlp"
"""The paper's network as a plain module."""

Turn = Callable[[], int]
"""Makes about `UPDATES` updates and returns their number."""


def training_speeds(
    runs: int, num_envs: int, settings: Mapping[str, Any] = MappingProxyType({}), seeds: int | None = None
) -> dict[str, Any]:
    """Return updates a second on one CPU thread with preset paper: medians of `runs` runs in turn.

    `settings`: those that differ from the preset. `updates_per_s`: training with dqnsl as a whole, `num_envs`
    environments, one update per step, the replay memory full; `updates_per_s_at_first`: while there are few
    transitions, which are drawn often. `bare_updates_per_s`: the same update on a ready minibatch,
    without environment, replay memory, kept targets and acting.
    `ratio`: of `updates_per_s` to it. `module_updates_per_s`: bare updates of the same network as a plain
    module, by autograd; `module_ratio`: the ratio of their times. `stable_baselines3_updates_per_s`: its DQN,
    if installed, with the same network, batch, optimiser and number of updates per step, in as many
    environments, whose shield replaces its unsafe actions. `stacked_updates_per_s`: of `seeds` trainings
    together, if given, which would otherwise follow one another at `updates_per_s`; `stacked_ratio`: to that.

    Raises:
        UserError: a setting has a value that it cannot have, or seeds cannot be stacked with.
    """
    fixed = {"num_envs": num_envs, "device": "cpu", "episodes": 10_000_000}
    config = make_config(merged(merged(preset_values("paper"), settings), fixed), "benchmark")
    env = make_training_env(config)
    module = make_config(merged(config.model_dump(), {"network": {"factory": PLAIN}}), "benchmark")
    kinds = {
        "bare_updates_per_s": _bare(env, config),
        "module_updates_per_s": _bare(env, module),
        "updates_per_s_at_first": _training(config, full=False),
        "updates_per_s": _training(config, full=True),
    }
    if seeds is not None:
        kinds["stacked_updates_per_s"] = _stacked(config, seeds)
    if importlib.util.find_spec("stable_baselines3"):
        kinds["stable_baselines3_updates_per_s"] = _stable_baselines3(config)
    _run(kinds)  # Warms up.
    found = [_run(kinds) for _ in range(runs)]
    speeds: dict[str, Any] = {"num_envs": num_envs, "batch_size": config.learning.batch_size, "runs": runs}
    speeds |= {name: statistics.median(run[name] for run in found) for name in kinds}
    speeds["ratio"] = statistics.median(run["updates_per_s"] / run["bare_updates_per_s"] for run in found)
    speeds["module_ratio"] = statistics.median(
        run["bare_updates_per_s"] / run["module_updates_per_s"] for run in found
    )
    if "stacked_updates_per_s" in kinds:
        speeds["seeds"] = seeds
        speeds["stacked_ratio"] = statistics.median(
            run["stacked_updates_per_s"] / run["updates_per_s"] for run in found
        )
    if "stable_baselines3_updates_per_s" in kinds:
        speeds["stable_baselines3_ratio"] = statistics.median(
            run["updates_per_s"] / run["stable_baselines3_updates_per_s"] for run in found
        )
    return speeds


def _run(kinds: Mapping[str, Turn]) -> dict[str, float]:
    """Return updates a second of each kind."""
    made, taken = Counter[str](), Counter[str]()
    for _ in range(TURNS):
        for name, turn in kinds.items():
            started = perf_counter_ns()
            made[name] += turn()
            taken[name] += perf_counter_ns() - started
    return {name: 1e9 * made[name] / taken[name] for name in kinds}


def _bare(env: VectorHighway, config: TrainConfig) -> Turn:
    agent, replay = make_learner(env.single_observation_space, env.single_action_space, config)
    _add_transitions(env, replay, config.learning.batch_size)
    (batch,) = replay.sample(1).batches

    def turn() -> int:
        for _ in range(UPDATES):
            agent.update(batch)
        return UPDATES

    return turn


def _training(config: TrainConfig, *, full: bool) -> Turn:
    env = make_training_env(config)
    trainer = Trainer(env, config)
    if full:
        _add_transitions(env, trainer.replay, config.learning.replay_capacity)
    events = trainer.run()

    def turn() -> int:
        before = trainer.agent.updates
        while trainer.agent.updates < before + UPDATES:
            next(events)
        return trainer.agent.updates - before

    return turn


def _stacked(config: TrainConfig, seeds: int) -> Turn:
    trainers = []
    for seed in range(seeds):
        env = make_training_env(config)
        trainers.append(Trainer(env, config.model_copy(update={"seed": seed})))
        _add_transitions(env, trainers[-1].replay, config.learning.replay_capacity)
    steps = StackedTrainer(trainers, config).run()

    def turn() -> int:
        made = 0
        while made < UPDATES:
            made += sum(len(event.losses) for event in next(steps).values())
        return made

    return turn


def _add_transitions(env: VectorHighway, replay: Replay, rows: int) -> None:
    """Add random transitions: the time of an update does not depend on their values."""
    size, count = space_sizes(env.single_observation_space, env.single_action_space)
    rng = np.random.default_rng(0)
    replay.add(
        observations=rng.random((rows, size), np.float32),
        actions=rng.integers(count, size=rows),
        rewards=rng.random(rows),
        next_observations=rng.random((rows, size), np.float32),
        terminated=np.zeros(rows, np.bool_),
        next_masks=np.ones((rows, count), np.bool_),
    )


def _stable_baselines3(config: TrainConfig) -> Turn:
    import torch

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

    def turn() -> int:
        before = int(model._n_updates)
        model.learn(UPDATES, reset_num_timesteps=False)
        return int(model._n_updates) - before

    return turn


class _Shielded(gymnasium.Wrapper[Any, np.int64, Any, np.int64]):
    """Replaces unsafe actions by safe ones, so that episodes last as long as with a shield."""

    env: Any

    def step(self, action: np.int64) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        safe = self.env.action_masks()
        observation, reward, terminated, truncated, info = self.env.step(
            action if safe[action] else np.int64(safe.argmax())
        )
        return observation, reward, terminated, truncated, info
