"""The common base of the wrappers of one environment and of many."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from math import inf
from numbers import Real
from typing import Any, Final, Generic, TypeVar

import gymnasium
from gymnasium.utils import RecordConstructorArgs

from drlsl.errors import UserError
from drlsl.logic import Limits
from drlsl.lowering.ir import Schema
from drlsl.masks import check_mode
from drlsl.shield.action_rules import ASK, LIMITS, REASONS, ActionRules
from drlsl.shield.named_actions import NamedActions, check_facts_function
from drlsl.shield.offers import Counts
from drlsl.shield.rule_files import Rules

PENALTY: Final = 1.0
"""What an action that was not offered costs in the mode `penalise`."""

_Env = TypeVar("_Env")
_Facts = TypeVar("_Facts")


class Shielding(Generic[_Env, _Facts]):
    """A wrapper's actions, facts, rules and counts: its first base, before Gymnasium's."""

    def __init__(
        self,
        env: _Env,
        rules: Rules,
        *,
        actions: Mapping[str, int],
        facts: Callable[[Any], _Facts],
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
            env: the environment, or for `LogicVectorShield` the vector environment.
            rules: a rule file, a name such as frozen_lake.pl that ships, several files, or a program's text.
            actions: the environment's actions by the names of the rules; one without a name is never offered.
            facts: returns the facts of the present state, given the environment without its wrappers: the
                rows of every relation by name and arity. For `LogicVectorShield` the facts of all N states: a
                mapping for each, or one whose values are `Rows` of arrays (`ManyFacts`); `of_each` makes such
                a function of one for a single environment.
            fallback: the name of the action that alone is offered where the rules give no usable answer.
            ask: the goal whose solutions are the offered actions.
            reasons: the goal whose solutions say why an action is not offered; the rules need not define it.
            mode: what happens with an action that was not offered (`drlsl.masks.Mode`). In the mode
                `replace` the fallback is taken, or the first that is offered if it is not.
            tier: auto (generated code if the rules can be lowered, for many states Numba's where it is
                installed), interpreter, scalar, numpy, numba or torch.
            schema: the relations of the facts; without it those that the rules declare dynamic, and the first
                facts tell the kinds of their columns.
            limits: of one decision by the interpreter.
            penalty: the reward that an action costs that was not offered, in the mode `penalise`.
            remember: the number of states for which what the rules said is kept, and given again for the same
                facts, unless they are arrays; for slow rules and few states, if the rules go by nothing but
                the facts.

        Raises:
            UserError: the rules cannot be loaded, do not define `ask` or name an unknown action, the actions
                are not discrete, or a parameter is not usable.
        """
        given = {name: value for name, value in locals().items() if name not in ("self", "env", "__class__")}
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, **given)  # type: ignore[arg-type]
        super().__init__(env)  # type: ignore[call-arg]  # Gymnasium's base, which comes next
        self._actions = NamedActions.of(self._action_space_of(env), actions)
        self._mode = check_mode(mode)
        self._facts_of = check_facts_function(facts)
        self._penalty = _checked_penalty(penalty)
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
        self._begin()

    @staticmethod
    @abstractmethod
    def _action_space_of(env: _Env) -> gymnasium.Space[Any]:
        """Return the space of an environment's actions."""

    @abstractmethod
    def _begin(self) -> None:
        """Set what is known before the first reset."""

    @property
    def counts(self) -> Counts:
        """The counts of decisions, of those for which the rules failed, and of actions not offered."""
        return self.rules.counts


def _checked_penalty(penalty: Any) -> float:
    """Return a penalty.

    Raises:
        UserError: it is no number, or would be a reward.
    """
    if isinstance(penalty, bool) or not isinstance(penalty, Real) or not 0.0 <= float(penalty) < inf:
        raise UserError(f"penalty is {penalty!r}; expected a number from 0 on, which is taken off the reward")
    return float(penalty)
