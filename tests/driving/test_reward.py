"""The reward's terms."""

from __future__ import annotations

import numpy as np
import pytest

from drlsl.driving.config import RewardConfig
from drlsl.driving.simulation import TERMS
from drlsl.driving.simulation.reward import reward_terms


def terms(
    *,
    changed: bool = False,
    speed: float = 0.0,
    contact: bool = False,
    off_road: bool = False,
    progress: float = 0.0,
) -> dict[str, float]:
    found = reward_terms(
        RewardConfig(),
        changed=np.array([changed]),
        speed=np.array([speed]),
        contact=np.array([contact]),
        off_road=np.array([off_road]),
        progress=np.array([progress]),
    )
    assert tuple(found) == TERMS
    return {name: float(values[0]) for name, values in found.items()}


def test_the_papers_weights() -> None:
    assert terms(changed=True)["lane_change"] == -5.0
    assert terms(speed=30.0)["velocity"] == pytest.approx(0.3)


@pytest.mark.parametrize("term", ["collision", "off_road"])
@pytest.mark.parametrize(("progress", "expected"), [(0.0, -100.0), (0.5, -60.0), (1.0, -20.0), (1.2, -20.0)])
def test_ending_late_costs_less(term: str, progress: float, expected: float) -> None:
    found = terms(contact=term == "collision", off_road=term == "off_road", progress=progress)
    assert found[term] == pytest.approx(expected)
    assert sum(found.values()) == pytest.approx(expected)


def test_an_uneventful_step_costs_nothing() -> None:
    assert set(terms().values()) == {0.0}
