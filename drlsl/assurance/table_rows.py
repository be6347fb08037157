"""The rows of a table file: what the head, a scene and a row say, laid over each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeAlias

from pydantic import Field

from drlsl.assurance.case_rows import Row
from drlsl.assurance.checked_values import checked
from drlsl.assurance.checks import Check, Holds, Opposed, Solves
from drlsl.assurance.reason_patterns import ReasonPattern
from drlsl.assurance.tested_rules import Question
from drlsl.errors import UserError
from drlsl.files import Location, YamlFile

Bindings: TypeAlias = dict[str, Any]

TOLERANCE: Final = 0.001

ASKED_BASE: Final = ("tolerance",)
"""The keys of every kind of table that say how to ask, not what is expected."""


class AskedRow(Row):
    """One state with its answers: the keys of the file, of the state and of the row, merged."""

    row: str | None = None
    tolerance: Annotated[float, Field(ge=0)] = TOLERANCE
    goals: dict[str, bool | Bindings | list[Bindings]] | None = None
    fails: str | None = None


@dataclass(frozen=True)
class TableForm:
    """A kind of table: the key of its list, that of a subject in it, and the keys that the head may have.

    `head` are those that only the head has, `base` those that a subject and a row override. Of the keys
    `apart` of one value, each excludes the others.
    """

    listed: str
    subject: str
    base: tuple[str, ...]
    head: tuple[str, ...] = ()
    apart: Collection[str] = ()


@dataclass(frozen=True)
class TableRow:
    """The keys of one row, laid over those of its subject and of the head, and their places in the file."""

    values: dict[str, Any]
    subject: Location
    own: Location

    def error(self, file: YamlFile, keys: Location, message: str) -> UserError:
        """Return an error about what the row, its subject or the head says under some keys."""
        given = [place for place in (self.own, self.subject, []) if file.holds([*place, *keys])]
        return file.error([*(given[0] if given else self.own), *keys], message)

    def checked(self, file: YamlFile, model: type[AskedRow]) -> Any:
        """Return the row as a model.

        Raises:
            UserError: it does not fit the model; the message names file, line and key.
        """
        _refuse_cut_goals(file, self.values.get("goals"), self.own)
        return checked(file, model, self.values, [], self.subject, self.own)


def table_rows(file: YamlFile, form: TableForm) -> Iterator[TableRow]:
    """Yield the rows of a table.

    Raises:
        UserError: it is not of the form; the message names file and line.
    """
    known = (*form.head, *form.base)
    for key in file.values:
        if key not in (*known, form.listed):
            expected = f"expected {form.listed}, {', '.join(known)}"
            raise file.error([key], f"{key} is not a key of a table; {expected}")
    subjects = file.values.get(form.listed)
    if not isinstance(subjects, list) or not subjects:
        raise file.error([form.listed], f"{form.listed}: expected a list of {form.listed}")
    base = {key: value for key, value in file.values.items() if key in form.base}
    for index, subject in enumerate(subjects):
        yield from _rows_of(file, form, base, [form.listed, index], subject)


def _rows_of(
    file: YamlFile, form: TableForm, base: Mapping[str, Any], place: Location, subject: object
) -> Iterator[TableRow]:
    if not isinstance(subject, dict):
        keys = ", ".join((form.subject, *form.base[:2], "actions"))
        raise file.error(place, f"expected a {form.subject}: keys such as {keys}")
    rows = subject.get("rows")
    own = {key: value for key, value in subject.items() if key != "rows"}
    below = laid_over(base, own, form.apart)
    if rows is None:
        yield TableRow(below, place, place)
        return
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise file.error([*place, "rows"], f"rows: expected a list of overrides of this {form.subject}")
    for number, row in enumerate(rows):
        yield TableRow(laid_over(below, row, form.apart), place, [*place, "rows", number])


def laid_over(
    base: Mapping[str, Any], over: Mapping[str, Any], apart: Collection[str] = ()
) -> dict[str, Any]:
    """Return the nested values of `base` updated by `over`; of the keys `apart` only one is kept."""
    result = dict(base)
    for key, value in over.items():
        below = result.get(key)
        if not isinstance(below, dict) or not isinstance(value, dict) or key == "goals":
            result[key] = {**below, **value} if key == "goals" and isinstance(below, dict) else value
            continue
        if value.keys() & set(apart):
            below = {name: item for name, item in below.items() if name not in apart}
        result[key] = laid_over(below, value, apart)
    return result


def goal_checks(row: AskedRow) -> Iterator[Check]:
    """Yield the checks of the goals of a row."""
    for goal, expected in (row.goals or {}).items():
        if isinstance(expected, bool):
            yield Holds(goal, Question(goal, "holds"), expected)
        else:
            rows = [expected] if isinstance(expected, dict) else expected
            yield Solves(goal, Question(goal, "all"), tuple(rows), row.tolerance)


def opposed(what: str, question: Question, reasons: Sequence[str], tolerance: float) -> Opposed:
    """Return the check of the reasons against an action.

    Raises:
        ValueError: a reason cannot be read.
    """
    patterns = tuple(ReasonPattern(text, tolerance) for text in reasons)
    for pattern in patterns:
        pattern.check()
    return Opposed(what, question, patterns)


def _refuse_cut_goals(file: YamlFile, goals: object, place: Location) -> None:
    """Refuse a goal that YAML cut at a comma because it had no quotes."""
    for goal, answer in goals.items() if isinstance(goals, dict) else ():
        if answer is None:
            hint = "; between braces a goal with a comma needs quotes" if "(" in str(goal) else ""
            raise file.error([*place, "goals", goal], f"goals: {goal} has no answer{hint}")
