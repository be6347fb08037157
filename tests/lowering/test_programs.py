"""Programs that nobody would write: the tiers agree on them as well."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from drlsl.logic import Engine
from drlsl.lowering.frontend import Query
from drlsl.lowering.ir import NotLowerable
from tests.lowering import programs
from tests.lowering.tiers import Tiers


def check(text: str, predicates: list[tuple[str, int]], scenes: list[Any]) -> None:
    engine = Engine()
    engine.consult_text(text)
    for name, arity in predicates:
        for mode in ("holds",) if arity == 0 else ("first", "all"):
            try:
                tiers = Tiers(engine, programs.SCHEMA, Query(name, arity, mode))  # type: ignore[arg-type]  # mypy: str
            except NotLowerable as refusal:
                event(f"refused: {refusal.reason}")
                continue
            answered = tiers.check(scenes)
            event("answered" if answered else "undecided")
            event("arrays" if tiers.arrays else "no arrays")


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(program=programs.programs(), scenes=st.lists(programs.facts(), min_size=1, max_size=4))
def test_the_tiers_agree(program: tuple[str, list[tuple[str, int]]], scenes: list[Any]) -> None:
    check(*program, scenes)


@pytest.mark.slow
@settings(deadline=None, max_examples=3000, suppress_health_check=[HealthCheck.too_slow])
@given(program=programs.programs(), scenes=st.lists(programs.facts(), min_size=1, max_size=4))
def test_the_tiers_agree_on_many(program: tuple[str, list[tuple[str, int]]], scenes: list[Any]) -> None:
    check(*program, scenes)
