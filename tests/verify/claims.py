"""A property of one clause or a few, proved or refuted over the scenes of one kind of road."""

from __future__ import annotations

from pathlib import Path

from drlsl.verify import Case, Request, Result, verify

TWO_LANES = Case(0, 2, 1, 1)

EGO_SPEED = "vehicle(ego, _, _, _, V, _, _, _)"
"""Binds V [m/s], from 0 to 70 on a road that runs left to right."""


def outcome(
    folder: Path,
    clauses: str,
    *,
    rules: str = ":- dynamic(vehicle/8).\n",
    vehicles: int = 0,
    time_limit: float = 10.0,
    case: Case = TWO_LANES,
) -> Result:
    """What becomes of the property ``p`` that `clauses` break, beside `rules`."""
    program, properties = folder / "rules.pl", folder / "claims.pl"
    program.write_text(rules)
    properties.write_text(
        f"property(p, 'p').\n:- discontiguous(violates/1).\n:- dynamic(focus/1).\n{clauses}\n"
    )
    request = Request((program,), (properties,), vehicles=vehicles, time_limit=time_limit, cases=(case,))
    (result,) = verify(request).results
    return result
