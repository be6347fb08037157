"""A wrapper that shields any environment with discrete actions by rules."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils import RecordConstructorArgs

from drlsl.masks import settle
from drlsl.shield.fact_forms import Facts
from drlsl.shield.named_actions import told_facts
from drlsl.shield.offers import NOT_OFFERED, Offer
from drlsl.shield.shielding import Shielding


class LogicShield(
    Shielding[gymnasium.Env[Any, Any], Facts],
    gymnasium.Wrapper[Any, Any, Any, Any],
    RecordConstructorArgs,
):
    """An environment with discrete actions, of which rules say which are offered.

    `info` of reset and step holds `action_mask` int8 (A,), of the actions that are offered now, and `shield`:
    `offered`, their names; `fail_safe`, whether that is the fallback alone because the rules gave no usable
    answer, and `fail_safe_reason`; and of the step, empty in reset, `asked`, `taken`, the names of the action
    asked for and of the one taken, `replaced`, whether they differ, and `reason`, why the first was not
    offered. `action_masks()` is the mask as MaskablePPO asks for it, `FormatMask` has other libraries'.

    The rules are not asked about a state in which an episode has terminated.
    """

    @staticmethod
    def _action_space_of(env: gymnasium.Env[Any, Any]) -> gymnasium.Space[Any]:
        return env.action_space

    def _begin(self) -> None:
        self._facts: Facts = {}
        self._offer: Offer | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and ask the rules about its first state.

        Raises:
            UserError: `facts` raised an error, or the facts are not as declared.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self._ask()
        return observation, self._told(info, asked="", taken="", reason="", penalty=0.0)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take an action, by the mode if it was not offered, and ask the rules about the next state.

        Raises:
            ActionNotOffered: it was not, in the mode `raise`; nothing is done.
            TypeError, ValueError: it is not an action of the environment; nothing is done.
            UserError: `facts` raised an error, or the facts are not as declared.
        """
        labels, asked = self._actions.labels, self._actions.place(action)
        settled = settle(
            np.array([asked]),
            self.action_masks()[None],
            self._mode,
            fallback=self._place_of[self.rules.fallback],
            names=labels,
        )
        taken = int(settled.taken[0])
        reason = "" if settled.offered[0] else self._reason(labels[asked], replaced=taken != asked)
        given = action if taken == asked else self._actions.start + taken
        observation, reward, terminated, truncated, info = self.env.step(given)
        penalty = self._penalty if self._mode == "penalise" and not settled.offered[0] else 0.0
        if penalty:
            reward = float(reward) - penalty
        if terminated:
            self._offer = Offer((self.rules.fallback,))
        else:
            self._ask()
        told = self._told(info, asked=labels[asked], taken=labels[taken], reason=reason, penalty=penalty)
        return observation, reward, terminated, truncated, told

    def action_masks(self) -> npt.NDArray[np.bool_]:
        """Return the mask of the actions that are offered now, shape (A,)."""
        if self._offer is None:
            raise RuntimeError("reset the environment first: no action is offered yet")
        mask = np.zeros(len(self._actions.labels), dtype=np.bool_)
        mask[[self._place_of[name] for name in self._offer.actions]] = True
        return mask

    def _ask(self) -> None:
        self._facts = told_facts(self._facts_of, self.env.unwrapped)
        self._offer = self.rules.offer(self._facts)

    def _reason(self, action: str, *, replaced: bool) -> str:
        """Return why an action is not offered, and count it."""
        self.counts.not_offered += 1
        self.counts.replaced += replaced
        assert self._offer is not None
        if self._offer.failure:
            return self._offer.failure
        if action not in self.rules.actions:  # it has no name
            return NOT_OFFERED
        return "; ".join(self.rules.objections(self._facts, action)) or NOT_OFFERED

    def _told(
        self, info: dict[str, Any], *, asked: str, taken: str, reason: str, penalty: float
    ) -> dict[str, Any]:
        assert self._offer is not None
        shield = {
            "offered": self._offer.actions,
            "asked": asked,
            "taken": taken,
            "replaced": asked != taken,
            "reason": reason,
            "penalty": penalty,
            "fail_safe": bool(self._offer.failure),
            "fail_safe_reason": self._offer.failure,
        }
        return {**info, "action_mask": self.action_masks().astype(np.int8), "shield": shield}
