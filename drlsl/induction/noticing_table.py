"""The table beside learnt rules: rows are added to it until they notice the mutants that can be noticed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import yaml

from drlsl.assurance import Score, Verdict, load_tables, reasons_of, score
from drlsl.files import write_atomic
from drlsl.workers import ALONE, Crew

_WITNESS_ROUNDS: Final = 3
"""How often rows that notice surviving mutants are searched and added."""

ANY_ORDER: Final = "The order of the clauses makes no difference: one that holds is enough."


@dataclass(frozen=True, slots=True)
class TableDraft:
    """A table to begin with, and how rows are added to it.

    `subject` is the key of what rows belong to, `asked` the goal that they say the answer to, and
    `expecting` returns the row of a witness with that answer. `learnt` is the predicate of the clauses, such
    as opening/1, and `not_found` the reason of mutants for which no row is found.
    """

    text: str
    subject: str
    asked: str
    expecting: Callable[[str], str]
    learnt: str
    not_found: str


def write_noticing_table(rules: Path, draft: TableDraft, *, crew: Crew = ALONE) -> Score:
    """Write the table of learnt rules beside them, and the reasons of the mutants that it cannot notice.

    Rows that notice surviving mutants are added, as far as they are found.

    Raises:
        UserError: a file cannot be written.
    """
    table, reasons = rules.with_suffix(".test.yaml"), rules.with_suffix(".mutants.yaml")
    reasons.unlink(missing_ok=True)
    text = draft.text
    result: Score | None = None
    for _ in range(_WITNESS_ROUNDS):
        write_atomic(table, text.encode())
        result = score(*load_tables([rules], [table]), {}, crew=crew)
        witnesses = [one for one in result.witnesses.values() if one is not None]
        found = [one for one in witnesses if one.goal.startswith(draft.asked)]
        if not found:
            break
        rows = dict.fromkeys(f"      - {draft.expecting(one.row)}\n" for one in found)
        text += f"\n  - {draft.subject}: near the limits\n    rows:\n" + "".join(rows)
    assert result is not None
    _write_reasons(reasons, draft, result.survivors)
    return score(*load_tables([rules], [table]), reasons_of([rules]), crew=crew)


def _write_reasons(path: Path, draft: TableDraft, survivors: Sequence[Verdict]) -> None:
    why: dict[str, list[str]] = {}
    for verdict in survivors:
        moved = verdict.name.startswith(draft.learnt) and ": moved behind" in verdict.name
        why.setdefault(ANY_ORDER if moved else draft.not_found, []).append(verdict.name)
    if why:
        content = {"survivors": [{"reason": text, "mutants": names} for text, names in why.items()]}
        write_atomic(path, yaml.safe_dump(content, sort_keys=False, width=math.inf).encode())
