"""A vector environment of Gymnasium as Stable-Baselines3 wants it, with its action masks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import repeat
from operator import is_
from typing import Any, Final, Literal, TypeAlias, get_args

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from drlsl.errors import UserError

try:
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    raise UserError(
        f"Sb3VecEnv needs stable-baselines3, {error.name} is missing: pip install 'drlsl[sb3]'"
    ) from error

_FINAL: Final = ("final_obs", "final_info")

Infos: TypeAlias = Literal["all", "ended"]
"""The environments of which a step tells: all, or those in which an episode ended."""


class Sb3VecEnv(VecEnv):
    """A vector environment, in one process, as the `VecEnv` of Stable-Baselines3.

    Its answers are those of a `DummyVecEnv` of the single environments, to the bit, and MaskablePPO of
    sb3-contrib finds its masks if it has a method `action_masks()`, which returns them (N, A). Methods and
    attributes that Stable-Baselines3 asks for are those of the vector environment, one for all.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], infos: Infos = "all") -> None:
        """Show `env`, whose episodes begin within the step that ends one: its autoreset mode is SAME_STEP.

        With `infos="ended"` a step tells only of those environments in which an episode ended, and of the
        others no more than that none was cut short: all that Stable-Baselines3 reads, and faster.

        Raises:
            UserError: its autoreset mode is another, or `infos` is.
        """
        if infos not in get_args(Infos):
            raise UserError(f"infos is {infos!r}; expected one of {', '.join(get_args(Infos))}")
        mode = AutoresetMode(env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP))
        if mode is not AutoresetMode.SAME_STEP:
            raise UserError(
                f"the autoreset mode of the vector environment is {mode.value}, and Stable-Baselines3 needs "
                f"SameStep: make the environment with autoreset_mode='SameStep'"
            )
        self.env: Final = env
        self._infos: Final = infos
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._actions: npt.NDArray[Any] = np.zeros(0, dtype=np.int64)

    def reset(self) -> Any:
        """Begin an episode in every environment and return the observations.

        The seeds and options are those that were set since the last call.

        Raises:
            UserError: the options of the environments differ.
        """
        seeds: Any = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        options = self._options[0]
        if any(one != options for one in self._options):
            raise UserError("a vector environment takes the same options for all of its environments")
        observations, info = self.env.reset(seed=seeds, options=options or None)
        self.reset_infos = _rows(info, range(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Keep the actions (N,) of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, npt.NDArray[np.float32], npt.NDArray[np.bool_], list[dict[str, Any]]]:
        """Take the step and return observations, rewards (N,), whether an episode ended (N,), and infos.

        The info of an episode that ended is its last one, with `terminal_observation`; the observation is
        the first of the next episode, and its info is in `reset_infos`.
        """
        observations, rewards, terminated, truncated, info = self.env.step(self._actions)
        over = np.asarray(terminated | truncated)
        ended = np.flatnonzero(over).tolist()
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        told = range(self.num_envs) if self._infos == "all" else ended
        for place, row in zip(told, _rows(info, told), strict=True):
            infos[place] = row
        for place, final in zip(ended, _rows(info.get("final_info", {}), ended), strict=True):
            self.reset_infos[place] = infos[place]
            # Wrappers add what they tell of an episode to the info of the step.
            infos[place] = infos[place] | final | {"terminal_observation": info["final_obs"][place]}
        for one, cut in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            one["TimeLimit.truncated"] = cut
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the vector environment."""
        self.env.close()

    def get_images(self) -> Sequence[npt.NDArray[np.uint8] | None]:
        """Return a picture of every environment."""
        pictures: Any = self.env.render()
        return [None] * self.num_envs if pictures is None else list(pictures)

    def has_attr(self, attr_name: str) -> bool:
        """Return whether the vector environment has an attribute."""
        return attr_name in _SINGLE or any(hasattr(layer, attr_name) for layer in _layers(self.env))

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute of the vector environment for each of the environments.

        Raises:
            AttributeError: there is none.
        """
        return [_attribute(self.env, attr_name)] * len(self._places(indices))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Set an attribute of the vector environment.

        Raises:
            UserError: it is to be set for some of the environments alone.
        """
        if self._places(indices) != list(range(self.num_envs)):
            raise UserError(
                f"{attr_name!r} cannot be set for {indices} alone: the environments are one object"
            )
        setattr(self.env, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of the vector environment and return its answer for each of the environments.

        Raises:
            AttributeError: there is no such method.
            UserError: the answer is not one for each environment.
        """
        answer = _attribute(self.env, method_name)(*method_args, **method_kwargs)
        places = self._places(indices)
        if answer is None:
            return [None] * len(places)
        if not isinstance(answer, (np.ndarray, Sequence)) or len(answer) != self.num_envs:
            raise UserError(
                f"{method_name}() of the vector environment gives one {type(answer).__name__}, not an answer "
                f"for each of {self.num_envs} environments: call it on the attribute env"
            )
        return list(answer) if indices is None else [answer[place] for place in places]

    def env_is_wrapped(
        self,
        wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]],
        indices: int | Iterable[int] | None = None,
    ) -> list[bool]:
        """Return for each of the environments whether the vector environment is wrapped in a class."""
        found = any(isinstance(layer, wrapper_class) for layer in _layers(self.env))
        return [found] * len(self._places(indices))

    def _places(self, indices: int | Iterable[int] | None) -> list[int]:
        return list(self._get_indices(indices))


_SINGLE: Final = ("observation_space", "action_space")
"""What Stable-Baselines3 means of one environment where Gymnasium means it of all."""


def _layers(env: VectorEnv[Any, Any, Any]) -> Iterator[VectorEnv[Any, Any, Any]]:
    """Return the vector environment and those inside it, from the outside in."""
    yield env
    while isinstance(env, VectorWrapper):
        env = env.env
        yield env


def _attribute(env: VectorEnv[Any, Any, Any], name: str) -> Any:
    """Return an attribute of the outermost layer that has it.

    Raises:
        AttributeError: none has.
    """
    name = f"single_{name}" if name in _SINGLE else name
    for layer in _layers(env):
        if hasattr(layer, name):
            return getattr(layer, name)
    raise AttributeError(f"the vector environment {env} has no {name!r}")


def _rows(info: Mapping[str, Any], places: Sequence[int]) -> list[dict[str, Any]]:
    """Return the infos of some of the environments, given that of all.

    In that of all, `_key` marks the environments that have `key`; a key without a mark is everyone's.
    """
    if not places:
        return []
    chosen = slice(None) if isinstance(places, range) else places
    same: dict[str, Any] = {}
    different: list[tuple[str, Sequence[Any]]] = []
    lacking: list[tuple[str, npt.NDArray[np.bool_]]] = []
    everyone: Any = None
    for name, column in info.items():
        if name.startswith("_") or name in _FINAL:
            continue
        mark = info.get(f"_{name}", everyone)
        if mark is not everyone:
            # Environments that tell the same of all share one mark, which is then looked at once.
            if mark[chosen].all():
                everyone = mark
            else:
                lacking.append((name, mark[chosen]))
        values = _rows(column, places) if isinstance(column, Mapping) else _values(column[chosen])
        # Most infos are the same in all environments nearly always, and a copy is made at once.
        if all(map(is_, values, repeat(values[0]))):
            same[name] = values[0]
        else:
            different.append((name, values))
    rows = [same.copy() for _ in places]
    for name, values in different:
        for row, value in zip(rows, values, strict=True):
            row[name] = value
    for name, there in lacking:
        for place in np.flatnonzero(~there).tolist():
            del rows[place][name]
    return rows


def _values(column: npt.NDArray[Any]) -> Sequence[Any]:
    """Return the values of a column, plain ones of Python where they are scalars."""
    return column.tolist() if column.ndim == 1 else list(column)
