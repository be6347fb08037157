"""A wrapper that shields many environments at once by rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv, VectorWrapper

from drlsl.errors import UserError
from drlsl.masks import settle
from drlsl.shield.fact_batch import ManyFacts, some_of
from drlsl.shield.fact_forms import Facts
from drlsl.shield.named_actions import check_facts_function, told_facts
from drlsl.shield.offers import NOT_OFFERED
from drlsl.shield.shielding import Shielding


def of_each(facts: Callable[[Any], Facts]) -> Callable[[Any], list[Facts]]:
    """Return the function of a `SyncVectorEnv` that gives the facts of each of its environments.

    Raises:
        UserError: `facts` is no function. What is returned raises one where the vector environment is of
            another class, or `facts` raises an error, and says in which environment.
    """
    return partial(_facts_of_all, check_facts_function(facts))


def _facts_of_all(facts: Callable[[Any], Facts], envs: Any) -> list[Facts]:
    """Return the facts of each environment of a `SyncVectorEnv`.

    Raises:
        UserError: the vector environment is of another class, or `facts` raises an error.
    """
    if not isinstance(envs, SyncVectorEnv):
        instead = "shield each by itself: wrappers=[lambda env: LogicShield(env, ...)]"
        if not isinstance(envs, AsyncVectorEnv):
            instead = 'make it with vectorization_mode="sync"'
        raise UserError(
            f"facts of each environment are asked of {type(envs).__name__}, and only a SyncVectorEnv has "
            f"them at hand; {instead}"
        )
    return [told_facts(facts, env.unwrapped, f"of environment {at}") for at, env in enumerate(envs.envs)]


class LogicVectorShield(Shielding[VectorEnv[Any, Any, Any], ManyFacts], VectorWrapper, RecordConstructorArgs):
    """N environments with discrete actions, of which rules say which are offered, in one call for all.

    `info` holds `action_mask` int8 (N, A) and `shield` as a `SyncVectorEnv` of `LogicShield` has them: arrays
    (N,), each with a mask beside it. With SAME_STEP `shield` tells, of an environment whose episode ended,
    the action that ended it and the offer of the next episode; `final_info` has no mask, since the state in
    which an episode ended is not seen from outside: use `LogicShield` inside where that is needed.
    """

    @staticmethod
    def _action_space_of(env: VectorEnv[Any, Any, Any]) -> gymnasium.Space[Any]:
        return env.single_action_space

    def _begin(self) -> None:
        self._fallback = self._place_of[self.rules.fallback]
        self._autoreset = self.env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        self._facts: ManyFacts = []
        self._asked: npt.NDArray[np.int64] = np.arange(0)  # the environments that `_facts` are of
        self._terminated = np.zeros(self.num_envs, dtype=np.bool_)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        self._mask: npt.NDArray[np.bool_] | None = None
        self._failures: Mapping[int, str] = {}

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes, and ask the rules about their first states.

        Raises:
            UserError: `facts` raised an error, or the facts are not as declared.
        """
        chosen = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_))
        observations, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]  # int alone
        self._terminated = self._terminated & ~chosen
        self._over = self._over & ~chosen
        self._ask()
        nobody, nothing = [""] * self.num_envs, np.zeros(self.num_envs)
        return observations, self._told(infos, asked=nobody, taken=nobody, reasons=nobody, penalties=nothing)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Take an action in each environment, by the mode if it was not offered.

        Raises:
            ActionNotOffered: one was not, in the mode `raise`; nothing is done.
            TypeError, ValueError: they are not actions of the environments; nothing is done.
            UserError: `facts` raised an error, or the facts are not as declared.
        """
        labels, asked = self._actions.labels, self._actions.all_places(actions, self.num_envs)
        begin = self._over if self._autoreset is AutoresetMode.NEXT_STEP else np.zeros_like(self._over)
        settled = settle(
            asked, self.action_masks(), self._mode, fallback=self._fallback, names=labels, free=begin
        )
        refused: list[int] = np.flatnonzero(~settled.offered).tolist()
        reasons = [""] * self.num_envs
        for place in refused:
            reasons[place] = self._reason(place, labels[asked[place]])
        self.counts.not_offered += len(refused)
        self.counts.replaced += int((settled.taken != asked).sum())
        given = actions if not refused else settled.taken + self._actions.start
        observations, rewards, terminated, truncated, infos = self.env.step(given)
        penalties = np.where(settled.offered | (self._mode != "penalise"), 0.0, self._penalty)
        if penalties.any():
            rewards = rewards - penalties
        self._over = np.asarray(terminated | truncated)
        is_left = self._autoreset is not AutoresetMode.SAME_STEP  # in the state in which it ended
        self._terminated = np.asarray(terminated) & is_left
        self._ask()
        names = ["" if new else labels[place] for new, place in zip(begin, asked, strict=True)]
        taken = ["" if new else labels[place] for new, place in zip(begin, settled.taken, strict=True)]
        told = self._told(infos, asked=names, taken=taken, reasons=reasons, penalties=penalties)
        return observations, rewards, terminated, truncated, told

    def action_masks(self) -> npt.NDArray[np.bool_]:
        """Return the masks of the actions that are offered now, shape (N, A)."""
        if self._mask is None:
            raise RuntimeError("reset the environments first: no action is offered yet")
        return self._mask.copy()

    def _ask(self) -> None:
        """Ask the rules about each state but those in which an episode has terminated."""
        self._asked = np.flatnonzero(~self._terminated)
        self._mask = np.zeros((self.num_envs, len(self._actions.labels)), dtype=np.bool_)
        self._mask[self._terminated, self._fallback] = True
        self._failures = {}
        if len(self._asked):
            facts = told_facts(self._facts_of, self.env.unwrapped)
            self._facts = some_of(facts, self._asked, self.num_envs)
            offers = self.rules.offers(self._facts)
            self._mask[self._asked[:, None], list(self._actions.places)] = offers.mask
            self._failures = {int(self._asked[place]): why for place, why in offers.failures.items()}

    def _reason(self, index: int, action: str) -> str:
        """Return why an action is not offered in one of the environments."""
        if index in self._failures or self._terminated[index] or action not in self.rules.actions:
            return self._failures.get(index, NOT_OFFERED)
        place = int(np.searchsorted(self._asked, index))
        return "; ".join(self.rules.objections_in(self._facts, place, action)) or NOT_OFFERED

    def _told(
        self,
        infos: dict[str, Any],
        *,
        asked: list[str],
        taken: list[str],
        reasons: list[str],
        penalties: npt.NDArray[np.float64],
    ) -> dict[str, Any]:
        masks, labels = self.action_masks(), self._actions.labels
        failures = [self._failures.get(place, "") for place in range(self.num_envs)]
        offered = np.empty(self.num_envs, dtype=object)
        offered[:] = [
            tuple(label for label, there in zip(labels, row, strict=True) if there) for row in masks
        ]
        told = {
            "offered": offered,
            "asked": np.array(asked, dtype=object),
            "taken": np.array(taken, dtype=object),
            "replaced": np.array([one != other for one, other in zip(asked, taken, strict=True)]),
            "reason": np.array(reasons, dtype=object),
            "penalty": penalties,
            "fail_safe": np.array([bool(why) for why in failures]),
            "fail_safe_reason": np.array(failures, dtype=object),
        }
        there = np.ones(self.num_envs, dtype=np.bool_)
        shield = told | {f"_{key}": there.copy() for key in told}
        added = {"action_mask": masks.astype(np.int8), "_action_mask": there.copy()}
        return {**infos, **added, "shield": shield, "_shield": there.copy()}
