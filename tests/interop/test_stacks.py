"""Trainings in seven libraries take no action that was not offered; what bypasses their masks is known."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import drlsl  # noqa: F401  (registers the environment)
from tests.interop.taken import Taken, told

NEEDS = {
    "gymnasium": ("gymnasium",),
    "sb3": ("sb3_contrib",),
    "tianshou": ("tianshou",),
    "torchrl": ("torchrl",),
    "rllib": ("ray.rllib",),
    "agilerl": ("agilerl", "peft"),
    "pettingzoo": ("pettingzoo",),
}
"""What each needs to be installed."""

ROOT = Path(__file__).parents[2]
STEPS = 1000

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")


def stack(name: str) -> Any:
    """The module that uses a library; the test is skipped where it is not installed."""
    for needed in NEEDS[name]:
        if find_spec(needed.split(".")[0]) is None:
            pytest.skip(f"{needed} is not installed")
    return import_module(f"tests.interop.use_{name}")


def trained(used: Any, *, vector: bool, seed: int) -> Taken:
    with told() as taken:
        used.train(seed, STEPS, vector=vector)
    return taken


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
@pytest.mark.parametrize("name", NEEDS)
def test_a_training_takes_offered_actions_alone(name: str, vector: bool) -> None:
    used = stack(name)
    taken = trained(used, vector=vector, seed=1)
    assert len(taken.actions) >= 0.95 * STEPS  # a step that begins an episode takes none
    assert len(set(taken.actions)) == 3
    assert taken.refused == 0
    assert trained(used, vector=vector, seed=1).actions == taken.actions
    assert trained(used, vector=vector, seed=2).actions != taken.actions


@pytest.mark.parametrize("name", NEEDS)
def test_what_bypasses_the_mask_is_known(name: str) -> None:
    """Without a word: nothing is raised, and actions are taken that were not offered."""
    for bypass in stack(name).BYPASSES.values():
        with told() as taken:
            bypass()
        assert taken.refused > 0


@pytest.mark.parametrize("name", NEEDS)
def test_the_page_tells_versions_and_what_bypasses_masks(name: str) -> None:
    page = (ROOT / "docs" / "stacks.md").read_text(encoding="utf-8").replace("`", "")
    pinned = (ROOT / "tests" / "interop" / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    used = stack(name)
    version = next(line.partition("==")[2] for line in pinned.splitlines() if line.startswith(used.LIBRARY))
    assert f"| {version} |" in page
    for title in used.BYPASSES:
        assert f"| {name} | {title} |" in page


@pytest.mark.parametrize("name", ["torchrl", "pettingzoo"])
def test_the_library_finds_the_environment_as_it_should_be(name: str) -> None:
    used = stack(name)
    with told() as taken:
        used.check()
    assert taken.actions
