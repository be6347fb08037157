"""`drlsl rules test`: run tables of scenes or facts, measure what they cover, and test them with mutants."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drlsl.cli.options import AsJson, Jobs, Ray, RuleFiles, crew_of, several

if TYPE_CHECKING:
    from drlsl.assurance import Coverage, Outcome, Score, Verdict, Witness


class ArrayTier(StrEnum):
    """The tiers that answer for many scenes, or sets of facts, at once."""

    NUMPY = "numpy"
    NUMBA = "numba"
    TORCH = "torch"


Tables = Annotated[
    list[Path] | None,
    several(
        "--tables",
        "FILE",
        "A table, instead of NAME.test.yaml and NAME.*.test.yaml beside NAME.pl; repeatable.",
    ),
]
Tiers = Annotated[
    list[ArrayTier] | None,
    typer.Option(
        "--tier",
        help="A tier that answers for many at once, to run besides others; default: numpy; repeatable.",
    ),
]
WithCoverage = Annotated[
    bool, typer.Option("--coverage", help="Say which clauses and branches the tables do not reach.")
]
WithMutants = Annotated[
    bool, typer.Option("--mutate", help="Put slips into the rules and say which go unnoticed.")
]


def run_tables(
    files: RuleFiles = None,
    tables: Tables = None,
    tiers: Tiers = None,
    coverage: WithCoverage = False,
    mutate: WithMutants = False,
    jobs: Jobs = None,
    ray: Ray = None,
    as_json: AsJson = False,
) -> None:
    """Run tables of scenes, or of facts, with expected answers on the interpreter and the compiled tiers.

    --coverage and --mutate examine the given files and those they include, but not the rules they build on.
    --jobs and --ray say who tests the mutants.
    The exit status is 1 if an answer is wrong, a clause is not reached (--coverage), or a mutant survives
    without a reason in NAME.mutants.yaml (--mutate).
    """
    from rich.console import Console

    from drlsl.assurance import load_tables, measure, reasons_of, run_cases, score
    from drlsl.driving.shield import default_rules
    from drlsl.errors import UserError
    from drlsl.shield import rule_file

    crew = crew_of(jobs, ray)
    if ray is not None and not mutate:
        raise UserError("--ray: only the mutants of --mutate are shared; leave it out, or add --mutate")
    rules = [rule_file(file) for file in files or default_rules()]
    tested, cases = load_tables(rules, tables or _tables_beside(rules))
    outcome = run_cases(tested, cases, tiers or [ArrayTier.NUMPY])
    reached = measure(tested, cases)[0] if coverage else None
    mutants = None
    if mutate and not outcome.failures:
        with Console(stderr=True).status("testing mutants, which takes about a minute for highway.pl"):
            mutants = score(tested, cases, reasons_of(rules), crew=crew)
    if as_json:
        print(json.dumps({tested.states: outcome.cases, **_as_json(outcome, reached, mutants)}, indent=2))
    else:
        skipped = mutate and mutants is None
        print("\n".join(_report(tested.states, outcome, reached, mutants, skipped=skipped)))
    if outcome.failures or (reached and _missed_clauses(reached)) or (mutants and mutants.unexplained):
        raise typer.Exit(1)


def _tables_beside(rules: list[Path]) -> list[Path]:
    """Return the tables of some rules.

    Raises:
        UserError: there are none.
    """
    from drlsl.assurance import tables_of
    from drlsl.errors import UserError
    from drlsl.logic import Engine
    from drlsl.shield import consult_rules

    found = tables_of(rules)
    if not found:
        for rule in rules:
            consult_rules(Engine(), rule)  # what is wrong with it comes first
        wanted = " or ".join(f"{rule.with_suffix('')}.test.yaml" for rule in rules)
        raise UserError(f"no table: expected {_near(wanted)}, or name one with --tables")
    return found


def _missed_clauses(reached: Coverage) -> bool:
    return any(point.is_clause for point in reached.missed)


def _report(
    states: str, outcome: Outcome, reached: Coverage | None, mutants: Score | None, *, skipped: bool
) -> Iterator[str]:
    for failure in outcome.failures:
        yield f"{_near(failure.place)}: {failure.case}"
        yield f"  {failure.what}: {failure.problem}  [{', '.join(failure.tiers)}]"
    asked = ", ".join(f"{tier} {count:,}" for tier, count in outcome.answers.items())
    yield f"{outcome.cases:,} {states}, {len(outcome.failures)} wrong; answers checked: {asked}"
    yield from outcome.notes
    if reached is not None:
        yield from _coverage_report(reached)
    if mutants is not None:
        yield from _mutation_report(mutants)
    if skipped:
        yield "no mutants: the program must pass its tables first"


def _coverage_report(reached: Coverage) -> Iterator[str]:
    for word, clauses in (("clauses", True), ("branches", False)):
        hit, total = reached.share(clauses=clauses)
        yield f"{word:<9} {hit} of {total} reached{f', {hit / total:.1%}' if total else ''}"
    yield from (f"  {_near(point)}" for point in reached.missed)


def _mutation_report(mutants: Score) -> Iterator[str]:
    explained = len(mutants.survivors) - len(mutants.unexplained)
    yield (
        f"mutants   {mutants.killed:,} of {len(mutants.verdicts):,} noticed, {mutants.share:.1%}; "
        f"survivors: {explained} with a reason, {len(mutants.unexplained)} without"
    )
    for verdict in mutants.unexplained:
        yield f"{_near(verdict.place)}: survives: {verdict.name}"
        if verdict.name in mutants.witnesses:
            yield from _witness_lines(mutants.witnesses[verdict.name])
    by_reason: dict[str, list[Verdict]] = {}
    for verdict in mutants.survivors:
        if verdict.name in mutants.reasons:
            by_reason.setdefault(mutants.reasons[verdict.name], []).append(verdict)
    for reason, verdicts in by_reason.items():
        yield reason
        yield from (f"  {_near(verdict.place)}: {verdict.name}" for verdict in verdicts)


def _witness_lines(witness: Witness | None) -> Iterator[str]:
    if witness is None:
        yield "  nothing was found in which it differs from the rules"
    else:
        yield f"  this row would notice it: {witness.row}"
        yield f"  {witness.goal}: {witness.rules}; with the slip {witness.mutant}"


def _as_json(outcome: Outcome, reached: Coverage | None, mutants: Score | None) -> dict[str, Any]:
    result: dict[str, Any] = {
        "answers": outcome.answers,
        "failures": [asdict(failure) for failure in outcome.failures],
        "notes": outcome.notes,
    }
    if reached is not None:
        result["coverage"] = {
            "clauses": dict(zip(("reached", "total"), reached.share(clauses=True), strict=True)),
            "branches": dict(zip(("reached", "total"), reached.share(clauses=False), strict=True)),
            "missed": [asdict(point) for point in reached.missed],
        }
    if mutants is not None:
        result["mutation"] = {
            "mutants": len(mutants.verdicts),
            "noticed": mutants.killed,
            "score": mutants.share,
            "survivors": [_survivor_as_json(mutants, verdict) for verdict in mutants.survivors],
        }
    return result


def _survivor_as_json(mutants: Score, verdict: Verdict) -> dict[str, Any]:
    witness = mutants.witnesses.get(verdict.name)
    reason = mutants.reasons.get(verdict.name)
    return {**asdict(verdict), "reason": reason, "witness": asdict(witness) if witness else None}


def _near(place: object) -> str:
    """Return a place with its path relative to the working folder, if it lies below it."""
    return str(place).replace(f"{Path.cwd()}/", "")
