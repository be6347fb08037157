"""Labelled actions as the examples of a search, with the facts that each was tried in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drlsl.induction.environments.plain_facts import PlainFacts
from drlsl.induction.environments.state_bias import StateBias
from drlsl.induction.examples import Examples


class ActionExamples(Examples):
    """N actions; `facts` has those of the state in which each was tried."""

    def __init__(
        self,
        bias: StateBias,
        facts: Sequence[PlainFacts],
        actions: Sequence[str],
        unsafe: Sequence[bool],
        origin: Sequence[str],
    ) -> None:
        """Find the values of the quantities.

        Raises:
            UserError: the facts are not as declared, or the program raises an error.
        """
        choice = np.array([bias.choices.index(name) for name in actions], dtype=np.int64)
        values = np.array([bias.values(one)[place] for one, place in zip(facts, choice, strict=True)])
        super().__init__(bias, values, choice, np.array(unsafe, dtype=np.bool_), origin)
        self.facts = facts
        self.state_bias = bias
