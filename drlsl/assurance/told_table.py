"""Tables of facts, with the actions that rules of any environment should offer, and why not the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field

from drlsl.assurance.case_rows import Row
from drlsl.assurance.checked_values import checked
from drlsl.assurance.checks import Case, Check, Offered
from drlsl.assurance.table_rows import (
    ASKED_BASE,
    AskedRow,
    TableForm,
    TableRow,
    goal_checks,
    opposed,
    table_rows,
)
from drlsl.assurance.told_facts import FactProblem, ToldFacts, ToldState
from drlsl.assurance.told_rules import ToldRules
from drlsl.errors import UserError
from drlsl.files import YamlFile
from drlsl.logic import Engine
from drlsl.shield import ASK, REASONS, ActionRules, consult_rules

_FORM: Final = TableForm("states", "state", ("facts", *ASKED_BASE), head=("shield", "columns"))


class ShieldRow(Row):
    """The parameters of a `LogicShield`: the names of the actions, and the goals that it asks."""

    actions: Annotated[list[str], Field(min_length=1)]
    fallback: str
    ask: str = ASK
    reasons: str = REASONS


class HeadRow(Row):
    """The keys that only the head of a file has."""

    shield: ShieldRow
    columns: dict[str, dict[str, str | int | float | None]] = Field({})


class StateRow(AskedRow):
    """One state with its answers."""

    state: str
    facts: dict[str, Any] = Field({})
    actions: list[str] | None = None
    objections: dict[str, list[str]] | None = None


def is_told(file: YamlFile) -> bool:
    """Return whether a table tells facts."""
    return any(key in file.values for key in (_FORM.listed, *_FORM.head))


def told_cases(rules: Sequence[Path], files: Sequence[YamlFile]) -> tuple[ToldRules, list[Case]]:
    """Return the program of rule files as tables of facts ask it, and their cases.

    Raises:
        UserError: a file cannot be read, or a table does not describe facts; the message names file and line.
        PrologError: a rule file is not a valid program.
    """
    engine = Engine()
    for rule in rules:
        consult_rules(engine, rule)
    heads = [_head(file) for file in files]
    shield = heads[0].shield
    for file, head in zip(files, heads, strict=True):
        if head.shield != shield:
            raise file.error(["shield"], f"shield: it is another one than in {files[0].name}")
    try:
        told = ToldFacts(engine)
    except ValueError as error:
        raise UserError(str(error)) from error
    rows = []
    for file, head in zip(files, heads, strict=True):
        try:
            told.declare(head.columns)
        except FactProblem as problem:
            raise file.error(["columns", *problem.keys], f"columns: {problem}") from problem
    for file in files:
        rows += [(file, row, *_read(file, row, told, shield)) for row in table_rows(file, _FORM)]
    schema = told.complete([facts for *_, facts in rows])
    try:
        asked = ActionRules(
            list(rules),
            shield.actions,
            fallback=shield.fallback,
            ask=shield.ask,
            reasons=shield.reasons,
            tier="interpreter",
            schema=schema,
        )
    except UserError as error:
        raise UserError(f"{files[0].name}: shield: {error}") from error
    tested = ToldRules(asked, schema, shield.ask, shield.reasons, rules)
    return tested, [_case(tested, told, *row) for row in rows]


def _head(file: YamlFile) -> HeadRow:
    values = {key: file.values[key] for key in _FORM.head if key in file.values}
    if "shield" not in values:
        raise file.error([], "shield is missing; expected shield: {actions: [...], fallback: ...}")
    return checked(file, HeadRow, values, [])


def _read(
    file: YamlFile, row: TableRow, told: ToldFacts, shield: ShieldRow
) -> tuple[StateRow, dict[Any, list[Any]]]:
    """Return a row and its facts."""
    read: StateRow = row.checked(file, StateRow)
    if not read.model_fields_set - {"state", "row", *_FORM.base}:
        raise file.error(row.own, f"{read.state}: expects nothing; give actions, objections, goals or fails")
    for key, named in (("actions", read.actions or ()), ("objections", read.objections or ())):
        for name in named:
            if name not in shield.actions:
                known = ", ".join(shield.actions)
                raise row.error(file, [key], f"{key}: there is no action {name}; the shield has {known}")
    try:
        return read, told.facts(read.facts)
    except FactProblem as problem:
        raise row.error(file, ["facts", *problem.keys], f"facts: {problem}") from problem


def _case(
    rules: ToldRules, told: ToldFacts, file: YamlFile, row: TableRow, read: StateRow, facts: Any
) -> Case:
    try:
        checks = tuple(_checks(rules, read))
    except ValueError as error:
        raise row.error(file, ["objections"], f"objections: {error}") from error
    name = " / ".join(filter(None, (read.state, read.row)))
    place = f"{file.name}:{file.line(row.own)}"
    return Case(place, name, facts, checks, read.fails, ToldState(facts, told))


def _checks(rules: ToldRules, row: StateRow) -> Iterator[Check]:
    if row.actions is not None:
        yield Offered("actions", rules.offered, tuple(row.actions))
    for action, reasons in (row.objections or {}).items():
        question = rules.reasons_against(action)
        yield opposed(f"objections {action}", question, reasons, row.tolerance)
    yield from goal_checks(row)
