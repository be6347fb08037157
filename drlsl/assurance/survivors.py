"""Reasons why some mutants cannot be noticed, kept beside the rules and checked in every mutation run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from drlsl.assurance.case_rows import Row
from drlsl.assurance.checked_values import checked
from drlsl.files import read_yaml

SUFFIX: Final = ".mutants.yaml"


class ReasonRow(Row):
    """A reason, and the names of its mutants."""

    reason: Annotated[str, Field(min_length=1)]
    mutants: Annotated[list[str], Field(min_length=1)]


class ReasonsFile(Row):
    """The file beside the rules."""

    survivors: list[ReasonRow]


def reasons_of(rules: Sequence[Path]) -> dict[str, str]:
    """Return the reasons beside rule files, by mutant: `highway.mutants.yaml` for highway.pl.

    Raises:
        UserError: a file cannot be read, has another form, or names a mutant twice.
    """
    reasons: dict[str, str] = {}
    for rule in rules:
        path = rule.parent / f"{rule.stem}{SUFFIX}"
        if not path.is_file():
            continue
        file = read_yaml(path)
        for index, row in enumerate(checked(file, ReasonsFile, file.values, []).survivors):
            for place, name in enumerate(row.mutants):
                if name in reasons:
                    raise file.error(["survivors", index, "mutants", place], f"{name!r} is named twice")
                reasons[name] = row.reason
    return reasons
