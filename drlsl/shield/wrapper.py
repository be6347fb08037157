"""A wrapper that shields any environment with discrete actions by rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils import RecordConstructorArgs

from drlsl.logic import Limits
from drlsl.lowering.ir import Schema
from drlsl.masks import check_mode, settle
from drlsl.shield.action_rules import ASK, LIMITS, REASONS, ActionRules
from drlsl.shield.fact_forms import Facts
from drlsl.shield.named_actions import NamedActions, check_facts_function, told_facts
from drlsl.shield.offers import NOT_OFFERED, Counts, Offer
from drlsl.shield.rule_files import Rules

PENALTY: Final = 1.0
"""What an action that was not offered costs in the mode `penalise`."""


class LogicShield(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """An environment with discrete actions, of which rules say which are offered.

    `info` of reset and step holds `action_mask` int8 (A,), of the actions that are offered now, and `shield`:
    `offered`, their names; `fail_safe`, whether that is the fallback alone because the rules gave no usable
    answer, and `fail_safe_reason`; and of the step, empty in reset, `asked`, `taken`, the names of the action
    asked for and of the one taken, `replaced`, whether they differ, and `reason`, why the first was not
    offered. `action_masks()` is the mask as MaskablePPO asks for it, `FormatMask` has other libraries'.

    The rules are not asked about a state in which an episode has terminated.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        rules: Rules,
        *,
        actions: Mapping[str, int],
        facts: Callable[[Any], Facts],
        fallback: str,
        ask: str = ASK,
        reasons: str = REASONS,
        mode: str = "mask",
        tier: str = "auto",
        schema: Schema | None = None,
        limits: Limits = LIMITS,
        penalty: float = PENALTY,
        remember: int = 0,
    ) -> None:
        """Wrap `env`.

        Args:
            env: the environment.
            rules: a rule file, a name such as frozen_lake.pl that ships, several files, or a program's text.
            actions: the environment's actions by the names of the rules; one without a name is never offered.
            facts: returns the facts of the present state, given the environment without its wrappers: the
                rows of every relation by name and arity.
            fallback: the name of the action that alone is offered where the rules give no usable answer.
            ask: the goal whose solutions are the offered actions.
            reasons: the goal whose solutions say why an action is not offered; the rules need not define it.
            mode: what happens with an action that was not offered (`drlsl.masks.Mode`). In the mode
                `replace` the fallback is taken, or the first that is offered if it is not.
            tier: auto (generated code if the rules can be lowered), interpreter, scalar, numpy, numba, torch.
            schema: the relations of the facts; without it those that the rules declare dynamic, and the first
                facts tell the kinds of their columns.
            limits: of one decision by the interpreter.
            penalty: the reward that an action costs that was not offered, in the mode `penalise`.
            remember: the number of states for which what the rules said is kept, and given again for the same
                facts; for slow rules and few states, if the rules go by nothing but the facts.

        Raises:
            UserError: the rules cannot be loaded, do not define `ask` or name an unknown action, the actions
                are not discrete, or a parameter is not usable.
        """
        RecordConstructorArgs.__init__(
            self,
            _disable_deepcopy=True,
            **{name: value for name, value in locals().items() if name not in ("self", "env", "__class__")},
        )
        super().__init__(env)
        self._actions = NamedActions.of(env.action_space, actions)
        self._mode = check_mode(mode)
        self._facts_of = check_facts_function(facts)
        self._penalty = float(penalty)
        self.rules: Final = ActionRules(
            rules,
            self._actions.names,
            fallback=fallback,
            ask=ask,
            reasons=reasons,
            tier=tier,
            schema=schema,
            limits=limits,
            remember=remember,
        )
        """The rules, which can be asked about any facts."""
        self._place_of = dict(zip(self._actions.names, self._actions.places, strict=True))
        self._facts: Facts = {}
        self._offer: Offer | None = None

    @property
    def counts(self) -> Counts:
        """The counts of decisions, of those for which the rules failed, and of actions not offered."""
        return self.rules.counts

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
            raise RuntimeError("reset the environment before asking for its action mask")
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
