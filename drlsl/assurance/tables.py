"""The tables of rule programs, of whatever kind: where they are, and what they test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from drlsl.assurance.checks import Case
from drlsl.assurance.driving_rules import DrivingRules
from drlsl.assurance.driving_table import scene_cases
from drlsl.assurance.tested_rules import TestedRules
from drlsl.assurance.told_rules import ToldRules
from drlsl.assurance.told_table import is_told, told_cases
from drlsl.errors import UserError
from drlsl.files import read_yaml
from drlsl.shield import rule_file

SUFFIX: Final = ".test.yaml"


def tables_of(rules: Sequence[Path]) -> list[Path]:
    """Return the tables beside rule files: `highway.test.yaml` and `highway.*.test.yaml` for highway.pl."""
    return [
        table
        for rule in rules
        for table in sorted(rule.parent.glob(f"{rule.stem}*{SUFFIX}"))
        if table.name[len(rule.stem)] == "."
    ]


def load_tables(rules: Sequence[Path], tables: Sequence[Path]) -> tuple[TestedRules, list[Case]]:
    """Return the program of rule files as tables ask it, and their cases.

    Raises:
        UserError: a file cannot be read, or a table is not of a kind that is known.
        PrologError: a rule file is not a valid program.
    """
    files = [read_yaml(table, example="scenes:") for table in tables]
    told = [is_told(file) for file in files]
    if all(told):
        return told_cases(rules, files)
    if any(told):
        facts, scenes = files[told.index(True)].name, files[told.index(False)].name
        raise UserError(f"{facts} is a table of facts and {scenes} one of scenes; test them one at a time")
    tested = DrivingRules.of(rules)
    names = tested.shield.observation.names
    return tested, [case for file in files for case in scene_cases(file, names)]


def load_told_rules(rules: Sequence[Path]) -> ToldRules | None:
    """Return the program of rule files as the tables of facts beside them ask it; None without such a table.

    Raises:
        UserError: a table cannot be read, or does not describe facts.
        PrologError: a rule file is not a valid program.
    """
    found = [rule_file(rule) for rule in rules]
    tables = [read_yaml(table, example="states:") for table in tables_of(found)]
    tables = [table for table in tables if is_told(table)]
    return told_cases(found, tables)[0] if tables else None
