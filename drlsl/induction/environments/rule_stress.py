"""Episodes behind learnt rules: what fails in them, and which offered actions it comes from."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.induction.environments.futures import Episode, Way
from drlsl.induction.environments.labelled_actions import lookahead_in
from drlsl.induction.environments.learning_domain import NamedDomain
from drlsl.induction.environments.lookahead import Verdict
from drlsl.induction.environments.plain_facts import PlainFacts, as_facts
from drlsl.induction.environments.state_bias import StateBias
from drlsl.induction.environments.stress_outcome import BadAction, RuleStress
from drlsl.induction.search_problem import LearntClause, covered
from drlsl.shield import ActionRules
from drlsl.workers import Crew, Function, Stop, in_order

BLOCK: Final = 20
"""Episodes of stress after which one looks whether a bad action was found: one alone is worth no round."""

_REMEMBERED: Final = 10_000
"""States of which what the rules said is kept."""


class _Driver:
    """Draws among the actions that a rule file offers."""

    def __init__(self, name: str, way: Way, rules: Path, clauses: Sequence[LearntClause]) -> None:
        self._way, self._clauses, self._bias = way, clauses, StateBias.of(name)
        self._named = self._bias.named
        self._rules = learnt_rules(self._named, rules)

    def learnt(self, facts: PlainFacts) -> set[str]:
        """Return the actions that the clauses find safe."""
        places = list(self._bias.available(facts))
        eases = self._bias.eases(self._bias.values(facts))[places]
        return {
            self._bias.choices[place]
            for place, met in zip(places, covered(self._clauses, eases), strict=True)
            if met
        }

    def episode(self, seed: int) -> RuleStress:
        """Drive an episode, and look back from a failure for the actions that it came from."""
        named, result = self._named, RuleStress()
        episode = Episode(named, seed)
        futures, lookahead = lookahead_in(episode, self._way)
        rng = np.random.default_rng([seed, 2])
        last: deque[tuple[Any, PlainFacts, str, bool]] = deque(maxlen=named.domain.horizon)
        end, fail_safes = "goes_on", self._rules.counts.fail_safes
        while end == "goes_on":
            facts = episode.facts()
            offered, learnt = self._rules.offer(as_facts(facts)).actions, self.learnt(facts)
            if learnt and learnt != set(offered):
                raise RuntimeError(f"the rules offer {offered}, and the learnt clauses {sorted(learnt)}")
            action = offered[int(rng.integers(len(offered)))]
            last.append((futures.here(), facts, action, bool(learnt)))
            result.counts.decisions += 1
            result.counts.not_learnt += not learnt
            end = episode.step(named.domain.actions[action])
        result.counts.episodes = 1
        result.counts.fail_safes = self._rules.counts.fail_safes - fail_safes
        if end == "failed":
            result.counts.failures = 1
            first = len(episode.taken) - len(last) + 1
            for number, (state, facts, action, is_learnt) in reversed(list(enumerate(last, start=first))):
                if lookahead.verdict(state, named.domain.actions[action]) != Verdict.UNSAFE:
                    break
                if is_learnt:
                    result.bad.append(BadAction(facts, action, f"stress, seed {seed}, decision {number}"))
            result.counts.unexplained = int(not result.bad)
        return result


def rule_stress(
    name: str,
    way: Way,
    rules: Path,
    clauses: Sequence[LearntClause],
    *,
    episodes: int,
    seed: int,
    crew: Crew,
    progress: Callable[[int], None] = lambda _: None,
) -> RuleStress:
    """Return what happens in episodes from `seed` on, in blocks until a bad action is found.

    `progress` is called with the number of episodes.

    Raises:
        UserError: the environment, or a function of the domain, raised an error.
    """
    blocks = (range(seed + first, seed + min(episodes, first + BLOCK)) for first in range(0, episodes, BLOCK))
    total = RuleStress()
    drive = partial(_stressing, name, way, rules, clauses)
    files = [*StateBias.of(name).own_files, rules]
    for part in in_order(crew.perform(drive, blocks, files=files)):
        total.add(part)
        progress(total.counts.episodes)
        if total.bad:
            break
    return total


def _stressing(
    name: str, way: Way, rules: Path, clauses: Sequence[LearntClause]
) -> Function[Sequence[int], RuleStress]:
    """Return the function that drives episodes behind the rules of a file."""
    driver = _Driver(name, way, rules, clauses)

    def drive(seeds: Sequence[int], _stop: Stop) -> RuleStress:
        total = RuleStress()
        for seed in seeds:
            total.add(driver.episode(seed))
        return total

    return drive


def learnt_rules(named: NamedDomain, rules: Path) -> ActionRules:
    """Return the rules of a file.

    Raises:
        UserError: the file cannot be used.
    """
    domain = named.domain
    return ActionRules(
        [rules],
        list(domain.actions),
        fallback=domain.fallback,
        tier=domain.tier,
        schema=domain.schema,
        remember=_REMEMBERED,
    )
