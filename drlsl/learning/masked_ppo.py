"""Masked PPO of sb3-contrib, trained where a DQN of ours would be: a baseline for studies."""

import dataclasses
import importlib
import io
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any, Final

import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorWrapper
from numpy.typing import NDArray

from drlsl import masks
from drlsl.driving import HighwayVectorEnv, make_vec
from drlsl.errors import UserError
from drlsl.files import write_atomic
from drlsl.learning.checkpoint import as_arrays, as_tensors, load_state, save_state
from drlsl.learning.config import PpoConfig, TrainConfig
from drlsl.learning.episode import TRAINING_STREAM, EpisodeTally, episode_seed
from drlsl.learning.rundir import CHECKPOINT, MODEL, RunFolder
from drlsl.learning.trainer import EpisodeEvent


def require_masked_ppo() -> ModuleType:
    """Return the package sb3_contrib.

    Raises:
        UserError: it is not installed.
    """
    try:
        return importlib.import_module("sb3_contrib")
    except ModuleNotFoundError as error:
        raise UserError("masked PPO needs sb3-contrib, which is missing: pip install 'drlsl[sb3]'") from error


def train_masked_ppo(
    root: Path, config: TrainConfig, settings: PpoConfig, stop: Callable[[], bool] = lambda: False
) -> RunFolder | None:
    """Train in a run folder and return it, with the model in `MODEL`; None if it was stopped before the end.

    Goes on from the checkpoint of the last update, if there is one, as if it had never been stopped.

    Raises:
        UserError: sb3-contrib is missing, the configuration does not fit, the environment cannot be made, the
            run's files are damaged, or a loss is not finite.
    """
    require_masked_ppo()
    settings.check_fits(config)
    resumed = (root / CHECKPOINT).is_file()
    folder = RunFolder.open(root) if resumed else RunFolder.create(root, config, force=root.exists())
    with folder.lock():
        training = _Training(folder, settings)
        if resumed:
            training.resume()
        while training.finished < config.episodes:
            if not training.update(stop):
                return None
            training.checkpoint()
        training.save_model()
    return folder


class _Training:
    """Masked PPO, its environments and its run folder."""

    def __init__(self, folder: RunFolder, settings: PpoConfig) -> None:
        self._folder = folder
        config = folder.config
        count = config.num_envs
        torch.set_num_threads(config.threads)
        self._env = _Counted(config)
        self._model = require_masked_ppo().MaskablePPO(
            "MlpPolicy",
            masks.Sb3VecEnv(self._env, infos="ended"),
            learning_rate=settings.learning_rate,
            n_steps=settings.steps,
            batch_size=settings.batch_size,
            n_epochs=settings.epochs,
            gamma=config.learning.discount,
            gae_lambda=settings.gae_lambda,
            clip_range=settings.clip_range,
            ent_coef=settings.entropy,
            policy_kwargs={"net_arch": list(config.network.hidden)},
            # Environment i takes the seed + i: the seeds of two runs must be far from each other.
            seed=episode_seed(config.seed, TRAINING_STREAM, 0),
            device="cpu",
        )
        self._decisions = settings.steps * count
        self._intervened = np.zeros(count, np.int64)
        self._loss: float | None = None
        self.finished = 0

    def update(self, stop: Callable[[], bool]) -> bool:
        """Drive until the next update, and make it; return False if it was stopped before."""
        model, before = self._model, self._model._n_updates

        def driven(found: dict[str, Any], _: object) -> bool:
            self._count(found)
            return not stop()

        model.learn(self._decisions, callback=driven, log_interval=None, reset_num_timesteps=False)
        if model._n_updates == before:
            return False
        self._loss = float(model.logger.name_to_value["train/loss"])
        if not math.isfinite(self._loss):
            raise UserError(f"the loss is {self._loss}: train again with a lower ppo.learning_rate")
        return True

    def _count(self, found: dict[str, Any]) -> None:
        """Add a step to the episodes, and write the rows of those that ended.

        `found`: the names and values inside sb3-contrib's loop of steps.
        """
        offered = np.asarray(found["action_masks"], np.bool_)
        with torch.no_grad():
            wanted = self._model.policy.get_distribution(found["obs_tensor"]).distribution.logits
        preferred = wanted.argmax(dim=1).numpy()
        self._intervened += ~offered[np.arange(len(offered)), preferred]
        for index in np.flatnonzero(found["dones"]).tolist():
            info, intervened = found["infos"][index], int(self._intervened[index])
            self._intervened[index] = 0
            if self.finished == self._folder.config.episodes:
                # Enough: it keeps driving, uncounted, until the last update.
                continue
            self.finished += 1
            self._folder.append_metrics(
                EpisodeEvent(
                    episode=self.finished,
                    finished=self.finished,
                    total_steps=self._model.num_timesteps,
                    summary=dataclasses.replace(info["summary"], interventions=intervened),
                    epsilon=0.0,
                    learning_rate=self._model.learning_rate,
                    loss=self._loss,
                    wall_s=info["wall_s"],
                )
            )

    def checkpoint(self) -> None:
        """Write all that the next update depends on."""
        model = self._model
        state = {
            "metrics": self._folder.sync_metrics(),
            "finished": self.finished,
            "loss": self._loss,
            "intervened": self._intervened,
            "parameters": model.get_parameters(),
            "decisions": model.num_timesteps,
            "updates": model._n_updates,
            "observations": model._last_obs,
            "episode_starts": model._last_episode_starts,
            "envs": self._env.get_state(),
            # Stable-Baselines3 draws actions from PyTorch's generator, and minibatches from NumPy's.
            "torch": torch.get_rng_state(),
            "numpy": np.random.get_state(legacy=False),  # noqa: NPY002  (what it draws from)
        }
        save_state(self._folder.checkpoint, "checkpoint", as_tensors(state))

    def resume(self) -> None:
        """Take over the checkpoint; metrics rows after it are dropped, to be made again.

        Raises:
            UserError: a file is damaged, or not of this training.
        """
        path, model = self._folder.checkpoint, self._model
        state = load_state(path, "checkpoint")
        parameters, generator = state["parameters"], state["torch"]
        held = as_arrays(state)
        if isinstance(held["envs"], list):
            raise UserError(
                f"{path}: written by an earlier version of DRLSL, which cannot go on: train again"
            )
        self.finished, self._loss = held["finished"], held["loss"]
        self._intervened = held["intervened"]
        self._folder.keep_metrics(range(1, self.finished + 1), held["metrics"])
        model.set_parameters(parameters)
        model.num_timesteps, model._n_updates = held["decisions"], held["updates"]
        model._last_obs, model._last_episode_starts = held["observations"], held["episode_starts"]
        self._env.set_state(held["envs"])
        torch.set_rng_state(generator)
        np.random.set_state(held["numpy"])  # noqa: NPY002

    def save_model(self) -> None:
        """Write the model for `drlsl eval` and for sb3-contrib."""
        buffer = io.BytesIO()
        self._model.save(buffer)
        write_atomic(self._folder.root / MODEL, buffer.getvalue())


class _Counted(VectorWrapper):
    """Environments that add up their episodes: the info of a last step has the `summary` and `wall_s`."""

    env: HighwayVectorEnv

    def __init__(self, config: TrainConfig) -> None:
        count, discount = config.num_envs, config.learning.discount
        super().__init__(make_vec(config.env, count, AutoresetMode.SAME_STEP, discount=discount))
        self._tally: Final = EpisodeTally(count)
        self._began = np.full(count, perf_counter())

    def step(self, actions: NDArray[np.int64]) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Drive one decision."""
        offered = self.env.action_masks()
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        over = terminated | truncated
        # The next episode begins within the step; what was told of the last one is in final_info.
        last = _overlaid(over, info["final_info"], info) if over.any() else info
        # Who intervened is for the policy to say.
        self._tally.add(rewards, last, offered, np.zeros(len(over), np.bool_))
        if over.any():
            now, summaries = perf_counter(), np.full(len(over), None, dtype=object)
            for index in np.flatnonzero(over).tolist():
                summaries[index] = self._tally.summary(index, info["final_info"])
                self._tally.clear(index)
            info["final_info"] |= {"summary": summaries, "wall_s": now - self._began}
            self._began[over] = now
        return observations, rewards, terminated, truncated, info

    def get_state(self) -> dict[str, Any]:
        """Return all that the next steps depend on."""
        elapsed = perf_counter() - self._began
        return {"env": self.env.get_state(), "tally": self._tally.sums.copy(), "elapsed_s": elapsed}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take over what `get_state` gave."""
        self.env.set_state(state["env"])
        self._tally.restore(state["tally"])
        self._began = perf_counter() - state["elapsed_s"]


def _overlaid(over: NDArray[np.bool_], one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that `one` has: its values where `over`, elsewhere those of `other`."""
    columns: dict[str, Any] = {}
    for name, column in one.items():
        if isinstance(column, Mapping):
            columns[name] = _overlaid(over, column, other[name])
        else:
            columns[name] = np.array(other[name])
            columns[name][over] = column[over]
    return columns
