"""Wrappers that give any environment's action masks the format of a library."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from drlsl.errors import UserError
from drlsl.masks.formats import MaskFormat, mask_format


class FormatMask(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """An environment whose action mask has the format of a library.

    It needs discrete actions and a method `action_masks()`, which returns the mask (A,) of the actions that
    are offered now.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], mask_format: str) -> None:
        """Wrap `env`; `mask_format` is a key of `FORMATS`.

        Raises:
            UserError: there is no such format, or the environment has no masks.
        """
        RecordConstructorArgs.__init__(self, mask_format=mask_format)
        super().__init__(env)
        self._format = _format_for(mask_format, env.action_space, env.has_wrapper_attr("action_masks"))
        actions = _discrete(env.action_space)
        self.observation_space = self._format.space(env.observation_space, int(actions.n))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._format.one(observation, info, self.action_masks())

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take a step."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        observation, info = self._format.one(observation, info, self.action_masks())
        return observation, reward, terminated, truncated, info

    def action_masks(self) -> npt.NDArray[np.bool_]:
        """Return the mask of the actions that are offered now, shape (A,)."""
        return np.asarray(self.env.get_wrapper_attr("action_masks")(), dtype=np.bool_)


class FormatVectorMask(VectorWrapper, RecordConstructorArgs):  # no [...]: in Gymnasium 1.2 it is not generic
    """A vector environment whose action masks have the format of a library.

    It needs discrete actions and a method `action_masks()`, which returns the masks (N, A); with SAME_STEP
    its `final_info` must hold `action_mask`. Wrap the environments of a `SyncVectorEnv` or `AsyncVectorEnv`
    in `FormatMask` instead.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], mask_format: str) -> None:
        """Wrap `env`; `mask_format` is a key of `FORMATS`.

        Raises:
            UserError: there is no such format, or the environment has no masks.
        """
        RecordConstructorArgs.__init__(self, mask_format=mask_format)
        super().__init__(env)
        has_masks = hasattr(env, "action_masks")
        self._format = _format_for(mask_format, env.single_action_space, has_masks)
        actions = _discrete(env.single_action_space)
        self.single_observation_space = self._format.space(env.single_observation_space, int(actions.n))
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, info = self.env.reset(seed=seed, options=options)
        return self._format.many(observations, info, self.action_masks())

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Take a step in every environment."""
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        observations, info = self._format.many(observations, info, self.action_masks())
        return observations, rewards, terminated, truncated, info

    def action_masks(self) -> npt.NDArray[np.bool_]:
        """Return the masks of the actions that are offered now, shape (N, A)."""
        return np.asarray(self.env.action_masks(), dtype=np.bool_)  # type: ignore[attr-defined]  # checked above


def _format_for(name: str, actions: gymnasium.Space[Any], has_masks: bool) -> MaskFormat:
    """Return the format of that name for an environment.

    Raises:
        UserError: there is no such format, or the environment has no masks.
    """
    found = mask_format(name)
    if not has_masks:
        raise UserError(f"mask_format {name!r}: the environment has no action_masks() to give")
    _discrete(actions)
    return found


def _discrete(actions: gymnasium.Space[Any]) -> gymnasium.spaces.Discrete:
    """Return the space of actions, which is discrete.

    Raises:
        UserError: it is not.
    """
    if not isinstance(actions, gymnasium.spaces.Discrete):
        raise UserError(f"the actions are {actions}; masks are of discrete ones: gymnasium.spaces.Discrete")
    return actions
