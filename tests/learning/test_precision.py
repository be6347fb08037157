"""The precision of learning: which one auto is, and that a run keeps it."""

import copy
from typing import Any

import numpy as np
import pytest
import torch

from drlsl.learning import precision
from drlsl.learning.config import LearningConfig, NetworkConfig, Precision
from drlsl.learning.dqn import DqnAgent

from .test_dqn import ACTIONS, SIZE, random_batch

CPU = torch.device("cpu")


def machine(monkeypatch: pytest.MonkeyPatch, **seconds: float) -> None:
    """Let products of a type take so long."""

    def product_s(rows: int, inputs: int, outputs: int, kind: torch.dtype) -> float:
        return seconds[str(kind).removeprefix("torch.")]

    monkeypatch.setattr(precision, "_product_s", product_s)


def agent(wanted: str, network: dict[str, Any] | None = None) -> DqnAgent:
    made = DqnAgent(
        SIZE,
        ACTIONS,
        NetworkConfig.model_validate(network or {"hidden": (32, 32)}),
        LearningConfig.model_validate({"batch_size": 16, "learning_starts": 16, "precision": wanted}),
        rng=np.random.default_rng(0),
        generator=torch.Generator().manual_seed(0),
        device=CPU,
    )
    made.learning_rate = 0.01
    return made


@pytest.mark.parametrize(
    ("float32", "bfloat16", "expected"),
    [(3.0, 1.0, "bfloat16"), (3.0, 2.5, "float32"), (1.0, 9.0, "float32")],
)
def test_auto_is_what_multiplies_faster(
    monkeypatch: pytest.MonkeyPatch, float32: float, bfloat16: float, expected: Precision
) -> None:
    machine(monkeypatch, float32=float32, bfloat16=bfloat16)
    assert agent("auto").precision == expected


@pytest.mark.parametrize("network", [{"hidden": (32,)}, {"factory": "dueling", "hidden": (32, 32)}])
def test_auto_is_float32_where_little_is_to_be_gained(
    monkeypatch: pytest.MonkeyPatch, network: dict[str, Any]
) -> None:
    machine(monkeypatch, float32=9.0, bfloat16=1.0)
    assert agent("auto", network).precision == "float32"


def test_the_products_are_timed_on_this_machine() -> None:
    assert agent("auto").precision in ("float32", "bfloat16")


def test_a_run_keeps_the_precision_it_began_with(monkeypatch: pytest.MonkeyPatch) -> None:
    machine(monkeypatch, float32=3.0, bfloat16=1.0)
    begun = agent("auto")
    begun.update(random_batch(0))
    machine(monkeypatch, float32=1.0, bfloat16=3.0)
    resumed = agent("auto")
    before = resumed.precision
    resumed.set_state(copy.deepcopy(begun.get_state()))
    assert [before, resumed.precision] == ["float32", "bfloat16"]
    for step in range(1, 5):
        assert begun.update(random_batch(step)) == resumed.update(random_batch(step))


@pytest.mark.parametrize(
    "network",
    [{"hidden": (32, 32)}, {"hidden": (32, 32), "noisy": True}, {"factory": "dueling", "hidden": (32, 32)}],
    ids=["mlp", "noisy", "dueling"],
)
def test_bfloat16_learns_much_as_float32(network: dict[str, Any]) -> None:
    low, high = agent("bfloat16", network), agent("float32", network)
    batch = random_batch(0)
    losses = [(low.update(batch), high.update(batch)) for _ in range(150)]
    assert losses[0][0] != losses[0][1]
    assert losses[0][0] == pytest.approx(losses[0][1], rel=0.05)
    for one in zip(*losses, strict=True):
        assert np.mean(one[-20:]) < 0.5 * one[0]


def test_a_state_from_before_there_was_a_choice_is_of_float32() -> None:
    begun, resumed = agent("float32"), agent("bfloat16")
    state = begun.get_state()
    del state["precision"]
    resumed.set_state(state)
    assert resumed.precision == "float32"
    batch = random_batch(0)
    assert begun.update(batch) == resumed.update(batch)
