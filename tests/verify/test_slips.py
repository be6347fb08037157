"""Slips in the prover: the solver alone falls for each, the attack finds those that not every tier shares."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from drlsl.verify import Request, Result, ranges, verify
from tests.verify.slips import SLIPS

SAMPLE = (
    "the power of a root is not looked at",
    "an equation does not hold at the end of a range",
    "one vehicle fewer than are enough",
    "errors are not looked for",
)
SCENES = 200_000


@pytest.fixture
def verified(tmp_path: Path) -> Callable[[str, int], Result]:
    """Verifies the property of a slip, attacked with so many scenes."""

    def verified(name: str, scenes: int) -> Result:
        slip = SLIPS[name]
        path = tmp_path / "p.pl"
        path.write_text(slip.properties(), encoding="utf-8")
        cases = slip.cases or tuple(ranges.all_cases())
        request = Request((), (path,), slip.vehicles, time_limit=20.0, cases=cases, attack=scenes)
        return next(result for result in verify(request).results if result.name == "p")

    return verified


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in SAMPLE else pytest.mark.slow) for name in SLIPS]
)
def test_a_slip_is_found_by_the_attack(
    name: str, verified: Callable[[str, int], Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert verified(name, 0).status == "refuted"
    SLIPS[name].make(monkeypatch)
    fooled = verified(name, 0)
    assert fooled.status == "proved", fooled.reason
    attacked = verified(name, SCENES)
    if SLIPS[name].missed:
        assert attacked.status == "proved"
        return
    assert (attacked.status, attacked.prover_error) == ("refuted", True)
    assert attacked.counterexample is not None
    assert "error of the prover" in attacked.reason


def test_few_slips_are_missed() -> None:
    missed = [name for name, slip in SLIPS.items() if slip.missed]
    assert len(SLIPS) >= 20
    assert len(missed) <= len(SLIPS) / 10, missed
