"""From which margin on doubles decide as a proof in real numbers says."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.driving.shield import default_rules
from drlsl.verify.margins import Floats
from drlsl.verify.prove import Prover

RULES = default_rules()[0].parent


def margins(properties: Path, rules: tuple[Path, ...] = ()) -> dict[str, Floats]:
    prover = Prover.of(rules, (properties,))
    return {name: prover.floats(name, 6) for name in prover.answers}


def of(folder: Path, clause: str, more: str = "") -> Floats:
    """The margin of one property, given by its clause."""
    path = folder / "one.pl"
    path.write_text(f"{more} property(q, 'q').\n{clause}", encoding="utf-8")
    return margins(path)["q"]


def test_a_sum_with_a_large_number_is_proved_in_real_arithmetic_only(tmp_path: Path) -> None:
    found = of(
        tmp_path,
        "violates(q) :- vehicle(ego,_,_,_,V,_,_,_), V > 1.0, X is (V+1.0e17)-1.0e17, X =< 0.5.",
    )
    assert found.margin is None
    assert found.error == pytest.approx(8.0)
    assert found.comparison is not None
    assert found.comparison.startswith("X =< 0.5 (")
    assert found.comparison.endswith("one.pl:2)")
