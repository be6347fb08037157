"""Masks as libraries want them, and what happens with actions that were not offered."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from drlsl.errors import UserError
from drlsl.masks import (
    FORMATS,
    MODES,
    ActionNotOffered,
    FormatMask,
    FormatVectorMask,
    check_mode,
    mask_format,
    settle,
)

NAMES = ("keep", "left", "right")


class Counting(gymnasium.Env[NDArray[np.float32], np.int64]):
    """Counts to five; the mask changes with every step."""

    def __init__(self) -> None:
        self.observation_space = gymnasium.spaces.Box(0, 9, (2,), np.float32)
        self.action_space = gymnasium.spaces.Discrete(3)
        self.count = 0

    def action_masks(self) -> NDArray[np.bool_]:
        return np.array([True, self.count % 2 == 0, self.count % 3 == 0])

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        super().reset(seed=seed)
        self.count = 0
        return self._told()

    def step(self, action: Any) -> Any:
        self.count += 1
        observation, info = self._told()
        return observation, 1.0, self.count == 5, False, info

    def _told(self) -> tuple[NDArray[np.float32], dict[str, Any]]:
        told = {"count": self.count, "word": "one", "terms": {"a": 1.0}, "action_mask": self.action_masks()}
        return np.full(2, self.count, np.float32), told


class Together(SyncVectorEnv):
    """Several of them, with their masks."""

    def action_masks(self) -> NDArray[np.bool_]:
        return np.stack(self.call("action_masks"))


PLACES = {
    "gymnasium": (np.int8, None, None),
    "sb3": (np.bool_, None, None),
    "tianshou": (np.bool_, "obs", "mask"),
    "torchrl": (np.bool_, "observation", "action_mask"),
    "rllib": (np.float32, "observations", "action_mask"),
    "agilerl": (np.int8, None, None),
    "pettingzoo": (np.int8, "observation", "action_mask"),
}


def test_every_library_has_its_format() -> None:
    assert set(FORMATS) == set(PLACES)
    with pytest.raises(UserError, match=r"mask_format 'sb4': no such format; expected one of gymnasium, sb3"):
        mask_format("sb4")


@pytest.mark.parametrize("name", FORMATS)
def test_the_mask_is_where_the_library_looks_for_it(name: str) -> None:
    dtype, observation_key, mask_key = PLACES[name]
    env = FormatMask(Counting(), name)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
        check_env(env, skip_render_check=True)
    told: Any = env.reset(seed=0)
    for _ in range(4):
        observation, info = told[0], told[-1]
        assert env.observation_space.contains(observation)
        masks = [] if name == "torchrl" else [info["action_mask"]]
        if mask_key is not None:
            assert set(observation) == {observation_key, mask_key}
            masks.append(observation[mask_key])
        for mask in masks:
            assert mask.dtype == dtype
            assert mask.tolist() == Counting.action_masks(env.unwrapped).tolist()  # type: ignore[arg-type]  # it is
        told = env.step(0)


def test_the_info_for_torchrl_is_arrays_of_numbers() -> None:
    env = FormatMask(Counting(), "torchrl")
    _, info = env.reset(seed=0)
    assert set(info) == {"count"}
    assert info["count"].dtype.kind == "i"


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("name", FORMATS)
def test_many_are_told_as_one_is(name: str, mode: AutoresetMode) -> None:
    """The wrapper around a vector environment is a vector environment of wrapped ones."""
    ours = FormatVectorMask(Together([Counting] * 3, autoreset_mode=mode), name)
    theirs = SyncVectorEnv([lambda: FormatMask(Counting(), name)] * 3, autoreset_mode=mode)
    assert ours.observation_space == theirs.observation_space
    mine: tuple[Any, ...] = ours.reset(seed=1)
    other: tuple[Any, ...] = theirs.reset(seed=1)
    finals = 0
    for _ in range(13):
        for left, right in zip(mine, other, strict=True):
            assert_same(left, right)
        finals += "final_obs" in mine[-1]
        mine, other = ours.step(np.zeros(3, int)), theirs.step(np.zeros(3, int))
    assert finals == (2 if mode is AutoresetMode.SAME_STEP else 0)


def assert_same(left: Any, right: Any) -> None:
    if isinstance(left, dict):
        assert set(left) == set(right)
        for key in left:
            assert_same(left[key], right[key])
    elif isinstance(left, np.ndarray) and left.dtype != object:
        assert left.dtype == right.dtype
        assert np.array_equal(left, right)
    elif isinstance(left, np.ndarray):
        for one, other in zip(left, right, strict=True):
            assert_same(one, other)
    else:
        assert left == right


def test_environments_without_masks_or_without_discrete_actions_are_refused() -> None:
    with pytest.raises(UserError, match=r"no action_masks\(\)"):
        FormatMask(gymnasium.make("CartPole-v1"), "sb3")
    with pytest.raises(UserError, match=r"no action_masks\(\)"):
        FormatVectorMask(SyncVectorEnv([Counting]), "sb3")
    steered = Counting()
    steered.action_space = gymnasium.spaces.Box(0, 1)  # type: ignore[assignment]  # the mistake
    with pytest.raises(UserError, match="masks are of discrete ones"):
        FormatMask(steered, "sb3")


@given(
    masks=st.lists(st.lists(st.booleans(), min_size=3, max_size=3).filter(any), min_size=1), data=st.data()
)
def test_an_action_that_was_not_offered_is_told_whatever_the_mode(
    masks: list[list[bool]], data: st.DataObject
) -> None:
    asked = np.array(data.draw(st.lists(st.integers(0, 2), min_size=len(masks), max_size=len(masks))))
    table = np.array(masks)
    offered = [row[action] for row, action in zip(masks, asked.tolist(), strict=True)]
    for mode in ("mask", "penalise"):
        taken = settle(asked, table, mode, fallback=0, names=NAMES)
        assert taken.taken.tolist() == asked.tolist()
        assert taken.offered.tolist() == offered
    replaced = settle(asked, table, "replace", fallback=2, names=NAMES)
    assert replaced.offered.tolist() == offered
    for row, was, given_action, taken_action in zip(
        masks, offered, asked.tolist(), replaced.taken.tolist(), strict=True
    ):
        assert row[taken_action]
        assert taken_action == (given_action if was else 2 if row[2] else row.index(True))
    if not all(offered):
        where = offered.index(False)
        with pytest.raises(ActionNotOffered, match=f"{asked[where]} {NAMES[asked[where]]} was not offered"):
            settle(asked, table, "raise", fallback=0, names=NAMES)
        free = ~np.array(offered)
        assert settle(asked, table, "raise", fallback=0, names=NAMES, free=free).offered.all()


def test_modes_have_names() -> None:
    assert [check_mode(mode) for mode in MODES] == ["mask", "replace", "penalise", "raise"]
    with pytest.raises(UserError, match="mode 'penalise': no such mode; expected one of mask, raise"):
        check_mode("penalise", ("mask", "raise"))
