"""The formats in which training libraries read action masks: place, key and type."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
from gymnasium import Space, spaces

from drlsl.errors import UserError

Masks: TypeAlias = npt.NDArray[Any]
"""The mask of one environment (A,), or those of many (N, A)."""

INFO_KEY: Final = "action_mask"
"""The key of the mask in `info`."""

_FINAL: Final = ("final_obs", "_final_obs", "final_info", "_final_info")


@dataclass(frozen=True, slots=True)
class MaskFormat:
    """The format of a library: the mask's `dtype`, and where it stands.

    It is in `info["action_mask"]`, and with `mask_key` in the observation, too, which then is a dict of the
    observation under `observation_key` and the mask under `mask_key`. `plain`: the library reads every value
    of `info` as an array of numbers; texts and dicts are left out of it, and the mask, which is observed.
    """

    name: str
    dtype: npt.DTypeLike
    observation_key: str = ""
    mask_key: str = ""
    plain: bool = False

    @property
    def observed(self) -> bool:
        """True if the mask is part of the observation."""
        return bool(self.mask_key)

    def space(self, space: Space[Any], actions: int) -> Space[Any]:
        """Return the space of observations of one environment, given that of those without the mask."""
        if not self.observed:
            return space
        mask = spaces.Box(0, 1, (actions,), dtype=self.dtype)  # type: ignore[arg-type]  # a dtype of NumPy's
        return spaces.Dict({self.observation_key: space, self.mask_key: mask})

    def one(self, observation: Any, info: Mapping[str, Any], mask: Masks) -> tuple[Any, dict[str, Any]]:
        """Return the observation and the info of an environment, with its mask (A,)."""
        return self._observation(observation, mask), self._info(info, mask)

    def many(self, observations: Any, info: Mapping[str, Any], masks: Masks) -> tuple[Any, dict[str, Any]]:
        """Return the observations and the info of N environments, with their masks (N, A).

        `final_obs` and `final_info`, as Gymnasium has them, get the masks of `final_info`.

        Raises:
            UserError: `final_info` has none.
        """
        final = {key: info[key] for key in _FINAL if key in info}
        if not final:
            return self.one(observations, info, masks)
        told = self._info({key: value for key, value in info.items() if key not in final}, masks)
        return self._observation(observations, masks), told | self._final(final)

    def _final(self, final: Mapping[str, Any]) -> dict[str, Any]:
        """Return what was last told in episodes that are over, with its masks."""
        last = final["final_info"]
        if INFO_KEY not in last:
            raise UserError(f"mask_format {self.name!r}: final_info has no {INFO_KEY}, which final_obs needs")
        observations = np.full(len(last[INFO_KEY]), None, dtype=object)
        for index in np.flatnonzero(final["_final_obs"]).tolist():
            observations[index] = self._observation(final["final_obs"][index], last[INFO_KEY][index])
        return {**final, "final_obs": observations, "final_info": self._info(last, last[INFO_KEY])}

    def _observation(self, observation: Any, masks: Masks) -> Any:
        if not self.observed:
            return observation
        return {self.observation_key: observation, self.mask_key: masks.astype(self.dtype)}

    def _info(self, info: Mapping[str, Any], masks: Masks) -> dict[str, Any]:
        if not self.plain:
            return {**info, INFO_KEY: masks.astype(self.dtype)}
        # The mask stands in the observation, under the key that the reader of info would write to.
        arrays = {
            key: np.asarray(value)
            for key, value in info.items()
            if not isinstance(value, dict) and key.removeprefix("_") != INFO_KEY
        }
        numbers = {key for key, value in arrays.items() if value.dtype.kind in "biuf"}
        return {key: arrays[key] for key in arrays if key in numbers and key.removeprefix("_") in numbers}


FORMATS: Final = {
    one.name: one
    for one in (
        MaskFormat("gymnasium", np.int8),
        MaskFormat("sb3", np.bool_),
        MaskFormat("tianshou", np.bool_, "obs", "mask"),
        MaskFormat("torchrl", np.bool_, "observation", "action_mask", plain=True),
        MaskFormat("rllib", np.float32, "observations", "action_mask"),
        MaskFormat("agilerl", np.int8),
        MaskFormat("pettingzoo", np.int8, "observation", "action_mask"),
    )
}
"""The formats by the names of the libraries.

Source: Gymnasium's `Discrete.sample` takes int8 alone, TorchRL's masked actors bool alone, and AgileRL's DQN
raises an error for bool; the keys are those of the libraries' examples.
"""


def mask_format(name: str) -> MaskFormat:
    """Return the format of that name.

    Raises:
        UserError: there is none.
    """
    if name not in FORMATS:
        raise UserError.no_such("mask_format", name, FORMATS)
    return FORMATS[name]
