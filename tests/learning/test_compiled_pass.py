"""Machine code between the products: it does what PyTorch's operations do, and what its own text says."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.learning import compiled_pass
from drlsl.learning.adam import Adam, CompiledAdam, take_step
from drlsl.learning.compiled_pass import (
    CompiledPass,
    activate_in_halves,
    activate_in_singles,
    array_of,
    can_compile,
    go_back_to_halves,
    go_back_to_singles,
    rounded,
)
from drlsl.learning.layers import Layer, layers_of
from drlsl.learning.loss import find_gradient, td_loss
from drlsl.learning.network import QNetwork
from drlsl.lowering.backends import machine_code

CPU = torch.device("cpu")
ODD_BITS = [0x0, 0x1, 0x7F7FFFFF, 0x7F800000, 0x7FC00000, 0x7FFFFFFF]
BITS = st.one_of(
    st.sampled_from([*ODD_BITS, *(bits | 0x80000000 for bits in ODD_BITS), 0x3F808000, 0x3F818000]),
    st.integers(0, 2**32 - 1),
)
"""Bits of numbers of float32: any, and often zeros, infinities, no numbers, the largest, ties, subnormals."""


def numbers(bits: Sequence[int]) -> torch.Tensor:
    """Return a row of the numbers of those bits."""
    return torch.from_numpy(np.array([bits], np.uint32).view(np.float32))


def same(left: torch.Tensor, right: torch.Tensor) -> bool:
    """Tell whether numbers are the same; none is the same as none, and -0 as 0."""
    return (
        left.dtype == right.dtype
        and torch.equal(left.isnan(), right.isnan())
        and (torch.equal(left.nan_to_num(0.125), right.nan_to_num(0.125)))
    )


@given(bits=BITS)
@settings(max_examples=300, deadline=None)
def test_a_number_is_rounded_as_by_pytorch(bits: int) -> None:
    mine = torch.from_numpy(np.array([[rounded(np.uint32(bits))]])).view(torch.bfloat16)
    assert same(mine, numbers([bits]).bfloat16())


@pytest.mark.parametrize(
    ("function", "given_kind", "kind"),
    [
        (activate_in_halves, torch.float32, torch.bfloat16),
        (activate_in_singles, torch.bfloat16, torch.float32),
    ],
)
@given(bits=st.lists(BITS, min_size=1, max_size=40))
@settings(max_examples=80, deadline=None)
def test_relu_is_pytorchs(
    function: Callable[..., Any], given_kind: torch.dtype, kind: torch.dtype, bits: list[int]
) -> None:
    values = numbers(bits).to(given_kind)
    mine = torch.full_like(values, 7.0, dtype=kind)
    machine_code(function)(array_of(values), array_of(mine))
    assert same(mine, values.relu().to(kind))


def network(sizes: Sequence[int], seed: int = 0) -> QNetwork:
    """Return a network that learns in bfloat16."""
    generator = torch.Generator().manual_seed(seed)
    made = QNetwork(sizes[0], sizes[1:-1], sizes[-1], generator, CPU)
    made.learn_in("bfloat16")
    return made


def minibatch(source: QNetwork, rows: int, seed: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    observations = torch.rand(rows, source.sizes[0], generator=generator)
    actions = torch.randint(source.sizes[-1], (rows,), generator=generator)
    return observations, actions, torch.randn(rows, generator=generator)


def by_layer(source: QNetwork) -> list[Layer]:
    return list(layers_of(source.sizes, source.gradient.clone()))


@given(
    hidden=st.lists(st.integers(3, 40), min_size=2, max_size=5),
    actions=st.integers(1, 3),
    rows=st.integers(1, 40),
    seed=st.integers(0, 99),
)
@settings(max_examples=80, deadline=None)
def test_loss_and_gradient_are_pytorchs_but_for_rounding(
    hidden: list[int], actions: int, rows: int, seed: int
) -> None:
    source = network([10, *hidden, actions], seed)
    given = minibatch(source, rows, seed)
    expected = find_gradient(source, *given)
    scale = float(td_loss(source.forward(given[0])[-1], *given[1:]).slopes.abs().sum())
    wanted = by_layer(source)
    source.gradient.fill_(torch.nan)
    assert source.find_gradient(*given) == pytest.approx(expected, rel=2e-2, abs=1e-6)
    for mine, theirs in zip(by_layer(source), wanted, strict=True):
        for one, other in zip(mine, theirs, strict=True):
            torch.testing.assert_close(one, other, rtol=2e-2, atol=2e-3 * scale)


def test_minibatches_of_other_sizes_follow_one_another() -> None:
    source = network([10, 32, 32, 3])
    losses: dict[tuple[int, int], tuple[float, torch.Tensor]] = {}
    for rows, seed in [(16, 1), (5, 2), (16, 3), (16, 1), (5, 2)]:
        given = minibatch(source, rows, seed)
        loss = source.find_gradient(*given)
        assert losses.setdefault((rows, seed), (loss, source.gradient.clone()))[0] == loss
        assert torch.equal(losses[rows, seed][1], source.gradient)


@pytest.mark.parametrize("layer", [0, 1, 2])
def test_a_weight_that_is_no_number_is_seen_in_the_loss(layer: int) -> None:
    source = network([10, 32, 32, 3])
    source.layers[layer].weight.fill_(torch.nan)
    assert np.isnan(source.find_gradient(*minibatch(source, 8, 0)))


@pytest.mark.parametrize("action", [-1, 3])
def test_an_action_that_is_none_is_refused(action: int) -> None:
    source = network([10, 32, 32, 3])
    observations, actions, targets = minibatch(source, 8, 0)
    actions[5] = action
    with pytest.raises(IndexError, match=r"expected actions from 0 to 2, got \[.*" + str(action)):
        source.find_gradient(observations, actions, targets)


def example(function: Callable[..., Any], rng: np.random.Generator) -> list[Any]:
    """Return arguments of a function, what it writes set to something else."""
    rows, width, actions = (int(one) for one in rng.integers(1, 6, 3))
    singles = rng.standard_normal((2, rows, width)).astype(np.float32)
    left, right = (singles.view(np.uint32) >> np.uint32(16)).astype(np.uint16)
    line = np.full(width, 7, np.float32)
    if function is activate_in_halves:
        return [singles[0], right]
    if function is activate_in_singles:
        return [left, singles[1]]
    if function is go_back_to_singles:
        return [left, right, singles[1], line]
    if function is go_back_to_halves:
        weights, slopes = rng.standard_normal((2, actions, width)).astype(np.float32)
        values = rng.standard_normal((rows, actions)).astype(np.float32)
        taken = rng.integers(actions, size=rows)
        bias_slopes, loss = np.full(actions, 7, np.float32), np.full(1, 7, np.float32)
        targets = singles[1, :, 0].copy()
        learnt = [weights, slopes, bias_slopes, left, right[0].copy()]
        return [values, taken, targets, singles[0], *learnt, np.full((2, width), 7, np.float32), loss]
    vectors = [one.ravel().copy() for one in (singles[0], singles[1], singles[0], singles[1] ** 2)]
    return [*vectors, float(rng.random()), float(rng.integers(1, 100))]


@pytest.mark.parametrize(
    "function", [activate_in_halves, activate_in_singles, go_back_to_halves, go_back_to_singles, take_step]
)
def test_machine_code_gives_the_bits_of_its_text(function: Callable[..., Any]) -> None:
    compiled = machine_code(function)
    assert compiled is not function
    for seed in range(60):
        mine, theirs = (example(function, np.random.default_rng(seed)) for _ in range(2))
        assert function(*mine) == compiled(*theirs)
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)


def test_what_cannot_be_compiled_is_left_to_pytorch(monkeypatch: pytest.MonkeyPatch) -> None:
    def used(sizes: Sequence[int], device: str = "cpu") -> list[Layer]:
        count = sum((inputs + 1) * outputs for inputs, outputs in itertools.pairwise(sizes))
        return list(layers_of(sizes, torch.zeros(count, device=device)))

    assert can_compile(used([10, 8, 8, 3]))
    assert not can_compile(used([10, 8, 8, 3], device="meta"))
    assert not can_compile(used([10, 2, 2, 3]))
    monkeypatch.setattr(compiled_pass, "machine_code", lambda function: function)
    assert not can_compile(used([10, 8, 8, 3]))


def test_adam_is_compiled_with_the_pass() -> None:
    source = network([10, 32, 32, 3])
    assert type(source.optimiser()) is CompiledAdam
    source.learn_in("float32")
    assert type(source.optimiser()) is Adam


def test_more_actions_than_the_last_hidden_layer_has_units_are_learnt_from(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(CompiledPass, "find_gradient", None)
    source = network([10, 8, 2, 3])
    assert source.find_gradient(*minibatch(source, 8, 0)) > 0.0
