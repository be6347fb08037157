"""The report of rules learnt in an environment: held-out episodes without rules, and behind them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from drlsl.assurance import Score
from drlsl.files import users_code, write_atomic
from drlsl.induction.domain import Tell
from drlsl.induction.environments.action_examples import ActionExamples
from drlsl.induction.environments.environment_domain import HELD_OUT_SEEDS
from drlsl.induction.environments.labelled_actions import BLOCK
from drlsl.induction.environments.learning_domain import Make, NamedDomain
from drlsl.induction.environments.rule_stress import learnt_rules
from drlsl.induction.environments.state_bias import StateBias
from drlsl.induction.learning_rounds import Learnt
from drlsl.shield import ActionRules, told_facts
from drlsl.workers import Crew, Function, Stop, in_order

Behind: TypeAlias = Literal["no rules", "known rules", "learnt rules"]

REPORT: Final = ".report"
"""The folder of the report is called like the rule file, with this in place of its suffix."""

_OTHER_SEEDS: Final = "other seeds"
"""The name of held-out episodes where a domain names none."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Held-out episodes: how many failed, their decisions, and the sum of rewards.

    `fail_safes`: decisions in which the rules gave no usable answer.
    """

    episodes: int
    failures: int
    decisions: int
    total: float
    fail_safes: int

    def with_other(self, other: Trial) -> Trial:
        """Return what happened in these and other episodes."""
        return Trial(*(getattr(self, name) + getattr(other, name) for name in self.__slots__))


def write_environment_report(
    rules: Path,
    learnt: Learnt[ActionExamples],
    mutants: Score,
    name: str,
    trials: int | None,
    *,
    crew: Crew,
    tell: Tell,
) -> tuple[Path, list[str]]:
    """Drive held-out episodes, and write the report; return its file, and its table.

    `mutants` are those of its table, `name` is that of the domain, `trials` the episodes of each kind, as
    many as it says by default.

    Raises:
        UserError: an environment or a function of the domain raised an error, or a file cannot be written.
    """
    named = StateBias.of(name).named
    count = named.domain.trials if trials is None else trials
    table = list(_table(rules, named, count, crew, tell))
    last = learnt.rounds[-1]
    literals = sum(clause.literals for clause in last.clauses)
    lines = [
        f"# {rules.name}",
        "",
        f"Learnt in {name} by `drlsl rules learn`: {len(learnt.examples.unsafe):,} examples, "
        f"{len(learnt.rounds)} rounds, {len(last.clauses)} clauses, {literals} literals.",
        "",
        *(f"- {line}" for line in learnt.lines()),
        f"- the table notices {mutants.killed:,} of {len(mutants.verdicts):,} mutants; "
        f"{len(mutants.survivors):,} have a reason",
        "",
        "| round | clauses | safe examples offered | failures | unavoidable | new unsafe examples |",
        "|---|---|---|---|---|---|",
        *(
            f"| {one.number} | {len(one.clauses)} | {one.safe:,} | {counts['failures']:,} in "
            f"{counts['episodes']:,} | {counts['unexplained']:,} | {len(one.bad)} |"
            for one in learnt.rounds
            for counts in one.stress.values()
        ),
        "",
        f"{count:,} held-out episodes of a policy that draws among what is offered:",
        "",
        *table,
    ]
    folder = rules.with_suffix(REPORT)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "report.md"
    write_atomic(path, ("\n".join(lines) + "\n").encode())
    return path, table


def _table(rules: Path, named: NamedDomain, count: int, crew: Crew, tell: Tell) -> Iterator[str]:
    yield "| episodes | behind | failures | decisions | mean return | fail-safe |"
    yield "|---|---|--:|--:|--:|--:|"
    kinds: list[Behind] = ["no rules", "known rules", "learnt rules"]
    if named.domain.shield is None:
        kinds.remove("known rules")
    for place in named.domain.held_out or [_OTHER_SEEDS]:
        for behind in kinds:
            tell(f"report: {place}, behind {behind}")
            one = _trial(rules, named.name, place, behind, count, crew)
            share = f"{one.total / one.episodes:.2f}"
            yield (
                f"| {place} | {behind} | {one.failures} of {one.episodes} | {one.decisions:,} | {share} | "
                f"{one.fail_safes} |"
            )


def _trial(rules: Path, name: str, place: str, behind: Behind, count: int, crew: Crew) -> Trial:
    """Return what happens in held-out episodes, driven in some processes."""
    parts = (range(first, min(count, first + BLOCK)) for first in range(0, count, BLOCK))
    drive = partial(_trying, rules, name, place, behind)
    total = Trial(0, 0, 0, 0.0, 0)
    for part in in_order(crew.perform(drive, parts, files=[*StateBias.of(name).own_files, rules])):
        total = total.with_other(part)
    return total


def _trying(rules: Path, name: str, place: str, behind: Behind) -> Function[Sequence[int], Trial]:
    """Return the function that drives some held-out episodes."""
    named = StateBias.of(name).named
    make = named.domain.held_out.get(place, named.domain.make)
    asked = _rules(rules, named, make, behind)

    def drive(episodes: Sequence[int], _stop: Stop) -> Trial:
        before = 0 if asked is None else asked.counts.fail_safes
        total = Trial(0, 0, 0, 0.0, 0)
        for episode in episodes:
            total = total.with_other(_episode(named, make, asked, HELD_OUT_SEEDS + episode))
        after = 0 if asked is None else asked.counts.fail_safes
        return replace(total, fail_safes=after - before)

    return drive


def _episode(named: NamedDomain, make: Make, asked: ActionRules | None, seed: int) -> Trial:
    """Return what happens in an episode in which one draws among what is offered."""
    domain, rng = named.domain, np.random.default_rng([seed, 3])
    env = named.environment(seed, make)
    env.reset(seed=seed)
    decisions, total = 0, 0.0
    while True:
        names = domain.preferred
        if asked is not None:
            names = asked.offer(told_facts(domain.facts, env.unwrapped)).actions
        step = env.step(domain.actions[names[int(rng.integers(len(names)))]])
        failed = named.failed(env, step)
        decisions, total = decisions + 1, total + float(step[1])
        if step[2] or step[3] or failed:
            return Trial(1, int(failed), decisions, total, 0)


def _rules(rules: Path, named: NamedDomain, make: Make, behind: Behind) -> ActionRules | None:
    """Return the rules that say what is offered, if any."""
    if behind == "learnt rules":
        return learnt_rules(named, rules)
    if behind == "known rules":
        assert named.domain.shield is not None
        with users_code(f"--domain {named.name}: shield"):
            return named.domain.shield(named.environment(HELD_OUT_SEEDS, make)).rules
    return None
