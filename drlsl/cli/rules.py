"""`drlsl rules`: check, test and verify a rule program before it drives."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from drlsl.cli import rules_learn, rules_test, verify
from drlsl.cli.options import RuleFiles, several

if TYPE_CHECKING:
    from drlsl.logic import Engine
    from drlsl.lowering import Finding, PredicateReport, Report, Schema
    from drlsl.lowering.frontend import Lowered, Query

app = typer.Typer(
    help="Check, test and verify rule programs, and show the code they become.", no_args_is_help=True
)
app.command("test")(rules_test.run_tables)
app.command("verify")(verify.verify)
app.command("learn")(rules_learn.learn)


class Tier(StrEnum):
    """The kinds of generated code."""

    SCALAR = "scalar"
    NUMPY = "numpy"
    NUMBA = "numba"


@app.command()
def check(files: RuleFiles = None) -> None:
    """Report which tiers can run each predicate, and every finding; exit status 1 if there is one."""
    from drlsl.driving.scene import SCHEMA
    from drlsl.driving.shield import ASKED, BOUNDS, NAMES, query_of, unknown_actions
    from drlsl.lowering import Finding, check_program

    engine = _load(files)
    if _offers_alone(engine):
        _check_offers(engine, files or ())
        return
    report = check_program(engine, SCHEMA, (*ASKED, query_of(NAMES), query_of(BOUNDS)))
    wrong = [*unknown_actions(engine), *_observation_slips(engine)]
    slips = [Finding(place, problem, error=True) for place, problem in wrong]
    report = replace(report, findings=(*report.findings, *slips))
    _print_report(report)
    _print_findings(report.findings)


def _offers_alone(engine: Engine) -> bool:
    """Return whether rules are for `LogicShield`: they say what is offered, and nothing that driving asks."""
    from drlsl.driving.shield import ASKED

    return engine.defines("offered", 1) and not any(engine.defines(one.name, one.arity) for one in ASKED)


def _check_offers(engine: Engine, files: Sequence[Path]) -> None:
    """Report on rules for `LogicShield`: what a table beside them tells of their facts is known of them."""
    from drlsl.assurance import load_told_rules
    from drlsl.lowering import Schema, check_program, find_mistakes
    from drlsl.lowering.frontend import lower
    from drlsl.lowering.ir import NotLowerable

    facts = [f"{name}/{arity}" for name, arity in engine.predicates() if engine.is_dynamic(name, arity)]
    print(
        "rules for LogicShield: offered/1 says which actions are offered; nothing is asked that driving asks"
    )
    print(f"facts: {', '.join(sorted(facts)) or 'none'}")
    mistakes = find_mistakes(engine, Schema(()))
    if any(finding.error for finding in mistakes):
        _print_findings(mistakes)  # a shield refuses such a program, and so does its table
        return
    told = load_told_rules(files)
    if told is None:
        print("no table of facts beside them tells the kinds of their columns: see drlsl rules test")
        _print_findings(mistakes)
    else:
        report = check_program(engine, told.schema, told.queries)
        _print_report(report)
        try:
            _source(Tier.NUMPY, lower(engine, told.schema, told.queries[:1]))
        except NotLowerable as reason:
            print(f"\nmany states are decided one at a time, not in arrays\n  {reason}")
        _print_findings(report.findings)


def _observation_slips(engine: Engine) -> Iterator[tuple[str, str]]:
    """Yield the place of what is wrong with the names, bounds or length of the observation, and what."""
    from drlsl.driving.shield import STATE, check_state, declared_observation
    from drlsl.errors import UserError

    try:
        observation = declared_observation(engine)
        if engine.defines(STATE.name, STATE.arity):
            check_state(engine, observation)
    except UserError as error:
        place, _, problem = str(error).partition(": ")
        yield place, problem


def _print_report(report: Report) -> None:
    refused = [predicate for predicate in report.predicates if predicate.refused is not None]
    lowered = [predicate for predicate in report.predicates if predicate.refused is None]
    print(f"{len(lowered)} of {len(report.predicates)} predicates run in every tier")
    _print_wrapped(predicate.indicator for predicate in lowered)
    if refused:
        print(f"\ninterpreter only: {len(refused)}")
        for predicate in refused:
            print(f"  {predicate.indicator}  {predicate.refused}")
    notes = list(_notes(lowered))
    if notes:
        print("\nrun in every tier inside other predicates, but not in every tier as a query of their own")
        print("\n".join(notes))
    if report.doubts:
        print("\nanswered by the slower interpreter if one of these happens or a fact exceeds 1e15")
        for query, doubts in report.doubts.items():
            print(f"  {query}")
            print("\n".join(f"    {doubt}" for doubt in doubts))
    if report.uncalled:
        print("\ncalled by no rule, and not asked")
        _print_wrapped(report.uncalled)


def _print_findings(findings: Sequence[Finding]) -> None:
    """Print findings; raise the exit status if there is one."""
    from drlsl.traffic import counted

    print(f"\n{counted(len(findings), 'finding') if findings else 'no findings'}")
    for finding in findings:
        print(f"  {'error' if finding.error else 'warning'}  {finding}")
    if findings:
        raise typer.Exit(1)


def _notes(predicates: Iterable[PredicateReport]) -> Iterator[str]:
    for predicate in predicates:
        if predicate.scalar_answer is not None:
            yield f"  {predicate.indicator}  scalar, numpy: {predicate.scalar_answer}"
        elif predicate.array_answer is not None:
            yield f"  {predicate.indicator}  numpy: {predicate.array_answer}"


def _print_wrapped(words: Iterable[str]) -> None:
    text = textwrap.fill(
        " ".join(words), 100, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False
    )
    print(text)


@app.command()
def show(
    files: RuleFiles = None,
    tier: Annotated[Tier, typer.Option("--tier", help="Which code to print.")] = Tier.SCALAR,
    goals: Annotated[
        list[str] | None,
        several(
            "--query", "NAME/ARITY", "What it answers, instead of what driving asks; may be given again."
        ),
    ] = None,
) -> None:
    """Print the code that a rule program is compiled to.

    The facts of rules for LogicShield are known from the tables of facts beside them (NAME.test.yaml).
    """
    from drlsl.errors import UserError
    from drlsl.lowering.frontend import lower
    from drlsl.lowering.ir import NotLowerable

    engine = _load(files)
    schema, usual = _asked_in_use(engine, files or (), tier)
    try:
        print(_source(tier, lower(engine, schema, [_query(engine, goal) for goal in goals or ()] or usual)))
    except NotLowerable as reason:
        raise UserError(f"{reason}; the interpreter runs it, see drlsl rules check") from reason


def _asked_in_use(engine: Engine, files: Sequence[Path], tier: Tier) -> tuple[Schema, Sequence[Query]]:
    """Return the form of the facts of a program, and what it is asked in use."""
    from drlsl.assurance import load_told_rules
    from drlsl.driving.scene import SCHEMA
    from drlsl.driving.shield import ASKED, ENTRY, query_of
    from drlsl.errors import UserError

    if not _offers_alone(engine):
        asked = [query for query in ASKED if query != query_of(ENTRY)]
        return SCHEMA, [query for query in asked if engine.defines(query.name, query.arity)]
    told = load_told_rules(files)
    if told is None:
        raise UserError(
            f"{files[0]}: rules for LogicShield, and no table of facts beside them tells the kinds of their "
            "columns; expected NAME.test.yaml beside NAME.pl (docs/logic-shield.md)"
        )
    offers, *reasons = told.queries
    # Reasons are looked for in one state at a time.
    return told.schema, [offers, *(reasons if tier is Tier.SCALAR else ())]


def _source(tier: Tier, lowered: Lowered) -> str:
    if tier is Tier.SCALAR:
        from drlsl.lowering.backends import scalar_source

        return scalar_source(lowered)
    if tier is Tier.NUMBA:
        from drlsl.lowering.backends import numba_source

        return numba_source(lowered)
    from drlsl.lowering.backends import numpy_source

    return numpy_source(lowered)


@app.command()
def export(
    to: Annotated[Literal["js", "c", "prolog"], typer.Option(help="The language.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="A new folder for the files.")],
    files: RuleFiles = None,
) -> None:
    """Write a rule program in another language, with a check against 1,000 decisions."""
    from drlsl.driving.export import FORMATS, export_rules

    written = export_rules(files or (), to, out)
    print(f"wrote {', '.join(path.name for path in written)} to {out}")
    print(f"check them there: {FORMATS[to].check}")


@app.command()
def shell(files: RuleFiles = None) -> None:
    """Answer queries of a rule program, explain them, and reload changed files."""
    from drlsl.cli.shell import run_shell
    from drlsl.driving.shield import default_rules
    from drlsl.shield import rule_file

    chosen = [rule_file(file) for file in files or default_rules()]
    raise typer.Exit(run_shell(chosen))


def _query(engine: Engine, goal: str) -> Query:
    from drlsl.errors import UserError
    from drlsl.lowering.frontend import Query

    name, _, arity = goal.rpartition("/")
    if not name or not arity.isdigit():
        raise UserError(f"--query {goal}: expected NAME/ARITY, such as front_is_free/0")
    if not engine.defines(name, int(arity)):
        raise UserError(f"--query {goal}: the program does not define it")
    return Query(name, int(arity), "first" if int(arity) else "holds")


def _load(files: list[Path] | None) -> Engine:
    from drlsl.driving.shield import default_rules
    from drlsl.logic import Engine
    from drlsl.shield import consult_rules

    engine = Engine()
    for path in files or default_rules():
        consult_rules(engine, path)
    return engine
