"""The work between products: machine code does what PyTorch's operations do, and what its own text says."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.learning import elementwise
from drlsl.learning.adam import take_step
from drlsl.learning.elementwise import (
    BY_PYTORCH,
    ByMachineCode,
    Elementwise,
    activate_in_halves,
    activate_in_singles,
    fastest,
    find_loss,
    rounded,
    slopes_in_halves,
    slopes_in_singles,
)
from drlsl.lowering.backends import machine_code

ACTIONS = 3
CPU = torch.device("cpu")
WAYS = [BY_PYTORCH, ByMachineCode()]
KINDS = [torch.float32, torch.bfloat16]

ODD_BITS = [0x0, 0x1, 0x7F7FFFFF, 0x7F800000, 0x7FC00000, 0x7FFFFFFF]
BITS = st.one_of(
    st.sampled_from([*ODD_BITS, *(bits | 0x80000000 for bits in ODD_BITS), 0x3F808000, 0x3F818000]),
    st.integers(0, 2**32 - 1),
)
"""Bits of numbers of float32: any, and often zeros, infinities, no numbers, the largest, ties, subnormals."""


def numbers(bits: list[int], rows: int) -> torch.Tensor:
    """Return numbers of those bits in rows."""
    return torch.from_numpy(np.resize(np.array(bits, np.uint32), (rows, len(bits))).view(np.float32).copy())


def same(left: torch.Tensor, right: torch.Tensor) -> bool:
    """Tell whether numbers are the same; none is the same as none, and -0 as 0."""
    return (
        left.dtype == right.dtype
        and torch.equal(left.nan_to_num(0.125), right.nan_to_num(0.125))
        and (torch.equal(left.isnan(), right.isnan()))
    )


@given(bits=BITS)
@settings(max_examples=300, deadline=None)
def test_a_number_is_rounded_as_by_pytorch(bits: int) -> None:
    expected = torch.from_numpy(np.array([bits], np.uint32).view(np.float32)).bfloat16()
    mine = torch.from_numpy(np.array([rounded(np.uint32(bits))])).view(torch.bfloat16)
    assert same(mine, expected)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("given_kind", KINDS)
@given(bits=st.lists(BITS, min_size=1, max_size=40), rows=st.integers(1, 3))
@settings(max_examples=80, deadline=None)
def test_relu_is_pytorchs(given_kind: torch.dtype, kind: torch.dtype, bits: list[int], rows: int) -> None:
    values = numbers(bits, rows).to(given_kind)
    mine, theirs = (way.activate(values.clone(), kind) for way in reversed(WAYS))
    assert same(mine, theirs)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("given_kind", KINDS)
@given(rows=st.integers(1, 20), width=st.integers(1, 40), seed=st.integers(0, 1_000))
@settings(max_examples=40, deadline=None)
def test_the_slopes_before_relu_are_pytorchs(
    given_kind: torch.dtype, kind: torch.dtype, rows: int, width: int, seed: int
) -> None:
    generator = torch.Generator().manual_seed(seed)
    slopes, values = torch.randn(2, rows, width, generator=generator).to(given_kind)
    activated, found = values.relu(), []
    for way in WAYS:
        bias = torch.full((width,), torch.nan, dtype=kind)
        found.append((way.slopes_before(slopes.clone(), activated, bias), bias))
    (theirs, their_bias), (mine, my_bias) = found
    assert same(mine, theirs)
    # What they add differs in its order, and PyTorch adds what it has rounded.
    near = 1e-2 if torch.bfloat16 in (kind, given_kind) else 1e-6
    torch.testing.assert_close(my_bias, their_bias, rtol=near, atol=near * rows)


@pytest.mark.parametrize("way", WAYS)
def test_the_loss_is_the_mean_squared_error_of_the_actions_taken(way: Elementwise) -> None:
    values = torch.tensor([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    loss = way.td_loss(values, torch.tensor([2, 0]), torch.tensor([1.0, 1.0]))
    assert loss.value.item() == pytest.approx((2.0**2 + 3.0**2) / 2)


@pytest.mark.parametrize("way", WAYS)
@given(rows=st.integers(1, 20), seed=st.integers(0, 1_000))
@settings(max_examples=40, deadline=None)
def test_the_losss_slopes_are_autograds(way: Elementwise, rows: int, seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    values = torch.randn(rows, ACTIONS, generator=generator, requires_grad=True)
    actions = torch.randint(ACTIONS, (rows,), generator=generator)
    targets = torch.randn(rows, generator=generator)
    loss = way.td_loss(values.detach(), actions, targets)
    taken = values[torch.arange(rows), actions]
    expected = torch.nn.functional.mse_loss(taken, targets)
    expected.backward()
    assert loss.value.item() == pytest.approx(expected.item())
    torch.testing.assert_close(loss.slopes, values.grad)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("column", [0, 2])
def test_what_is_no_number_is_seen_in_the_loss(way: Elementwise, column: int) -> None:
    values = torch.zeros(4, ACTIONS)
    values[1, column] = torch.nan
    loss = way.td_loss(values, torch.full((4,), column), torch.zeros(4))
    assert math.isnan(loss.value.item())


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("action", [-1, ACTIONS])
def test_an_action_that_is_none_is_refused(way: Elementwise, action: int) -> None:
    with pytest.raises((IndexError, RuntimeError), match=r"expected actions from 0 to 2, got|out of bounds"):
        way.td_loss(torch.zeros(2, ACTIONS), torch.tensor([0, action]), torch.zeros(2))


def example(function: Callable[..., Any], rng: np.random.Generator) -> list[Any]:
    """Return arguments of a function, the results that it writes set to something else."""
    rows, width = rng.integers(1, 6, 2)
    singles = rng.standard_normal((2, rows, width)).astype(np.float32)
    halves = singles.view(np.uint32)[..., :] >> np.uint32(16)
    left, right = halves.astype(np.uint16)
    line = np.full(width, 7, np.float32)
    if function is activate_in_halves:
        return [singles[0], right]
    if function is activate_in_singles:
        return [left, singles[1]]
    if function is slopes_in_halves:
        return [singles[0], singles[1], right, right[0].copy()]
    if function is slopes_in_singles:
        return [left, right, singles[1], line]
    if function is find_loss:
        return [singles[0], rng.integers(width, size=rows), singles[1, :, 0].copy(), line[:1], singles[1]]
    vectors = [one.ravel().copy() for one in (singles[0], singles[1], singles[0], singles[1] ** 2)]
    return [*vectors, float(rng.random()), float(rng.integers(1, 100))]


@pytest.mark.parametrize(
    "function",
    [activate_in_halves, activate_in_singles, slopes_in_halves, slopes_in_singles, find_loss, take_step],
)
def test_machine_code_gives_the_bits_of_its_text(function: Callable[..., Any]) -> None:
    compiled = machine_code(function)
    assert compiled is not function
    for seed in range(60):
        mine, theirs = (example(function, np.random.default_rng(seed)) for _ in range(2))
        assert function(*mine) == compiled(*theirs)
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)


def test_machine_code_is_for_bfloat16_on_a_processor() -> None:
    assert isinstance(fastest("bfloat16", CPU), ByMachineCode)
    assert fastest("float32", CPU) is BY_PYTORCH
    assert fastest("bfloat16", torch.device("meta")) is BY_PYTORCH


def test_without_numba_pytorch_does_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elementwise, "machine_code", lambda function: function)
    assert fastest("bfloat16", CPU) is BY_PYTORCH
