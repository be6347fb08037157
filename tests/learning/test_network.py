import itertools
from collections.abc import Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from drlsl.learning.architectures import SPREAD
from drlsl.learning.layers import Layer
from drlsl.learning.network import NoisyQNetwork, Policy, QNetwork

from .layers import linear_layers

CPU = torch.device("cpu")


def network(seed: int = 0, sizes: Sequence[int] = (10, 256, 256, 3)) -> QNetwork:
    return QNetwork(sizes[0], sizes[1:-1], sizes[-1], torch.Generator().manual_seed(seed), CPU)


def reference(source: QNetwork) -> nn.Sequential:
    """The same network from PyTorch's own modules."""
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(source.sizes):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    plain = nn.Sequential(*layers[:-1])
    for module, stored in zip(linear_layers(plain), source.layers, strict=True):
        module.weight.data.copy_(stored.weight.t())
        module.bias.data.copy_(stored.bias)
    return plain


def layers_of(source: QNetwork, vector: torch.Tensor) -> Sequence[Layer]:
    """A vector laid out as the network's parameters, seen as layers."""
    other = QNetwork(source.sizes[0], source.sizes[1:-1], source.sizes[-1], torch.Generator(), CPU)
    other.parameters.copy_(vector)
    return other.layers


SIZES = st.lists(st.integers(1, 12), min_size=3, max_size=5)


def test_values_are_those_of_the_papers_layers() -> None:
    observations = torch.rand(7, 10, generator=torch.Generator().manual_seed(1))
    torch.testing.assert_close(network().forward(observations)[-1], reference(network())(observations))


@given(sizes=SIZES, rows=st.integers(1, 9), seed=st.integers(0, 1_000))
@settings(max_examples=60, deadline=None)
def test_the_gradient_is_autograds(sizes: list[int], rows: int, seed: int) -> None:
    source, plain = network(seed, sizes), reference(network(seed, sizes))
    generator = torch.Generator().manual_seed(seed)
    observations = torch.rand(rows, sizes[0], generator=generator)
    slopes = torch.randn(rows, sizes[-1], generator=generator)
    outputs = source.forward(observations)
    source.gradient.fill_(torch.nan)
    source.backward(observations, outputs, slopes)
    values = plain(observations)
    values.backward(slopes)
    torch.testing.assert_close(outputs[-1], values.detach())
    assert source.gradient.isfinite().all()
    for mine, module in zip(layers_of(source, source.gradient), linear_layers(plain), strict=True):
        torch.testing.assert_close(mine.weight.t(), module.weight.grad, rtol=1e-5, atol=1e-6)
        torch.testing.assert_close(mine.bias, module.bias.grad, rtol=1e-5, atol=1e-6)


def rounded(layer: nn.Linear, values: torch.Tensor) -> torch.Tensor:
    """A layer in bfloat16, as PyTorch's own casts make it."""
    low = nn.functional.linear(values.bfloat16(), layer.weight.bfloat16(), layer.bias.bfloat16())
    return low.relu().float()


@given(
    sizes=st.lists(st.integers(1, 40), min_size=4, max_size=6),
    rows=st.integers(1, 40),
    seed=st.integers(0, 99),
)
@settings(max_examples=60, deadline=None)
def test_the_gradient_in_bfloat16_is_autograds_through_the_same_roundings(
    sizes: list[int], rows: int, seed: int
) -> None:
    source, plain = network(seed, sizes), reference(network(seed, sizes))
    source.learn_in("bfloat16")
    generator = torch.Generator().manual_seed(seed)
    observations = torch.rand(rows, sizes[0], generator=generator)
    slopes = torch.randn(rows, sizes[-1], generator=generator)
    outputs = source.forward(observations)
    source.gradient.fill_(torch.nan)
    source.backward(observations, outputs, slopes)
    first, *inner, last = linear_layers(plain)
    values = first(observations).relu()
    for layer in inner:
        values = rounded(layer, values)
    values = last(values)
    values.backward(slopes)
    torch.testing.assert_close(outputs[-1], values.detach(), rtol=1e-2, atol=1e-2)
    assert source.gradient.dtype == torch.float32
    assert source.gradient.isfinite().all()
    for mine, module in zip(layers_of(source, source.gradient), linear_layers(plain), strict=True):
        scale = float(slopes.abs().sum())
        torch.testing.assert_close(mine.weight.t(), module.weight.grad, rtol=2e-2, atol=2e-3 * scale)
        torch.testing.assert_close(mine.bias, module.bias.grad, rtol=2e-2, atol=2e-3 * scale)


@given(seed=st.integers(0, 99), noisy=st.booleans())
@settings(max_examples=20, deadline=None)
def test_a_network_that_learns_in_bfloat16_acts_in_float32(seed: int, noisy: bool) -> None:
    kind = NoisyQNetwork if noisy else QNetwork
    low, high = (kind(10, (32, 32), 3, torch.Generator().manual_seed(seed), CPU) for _ in range(2))
    low.learn_in("bfloat16")
    observations = torch.rand(9, 10, generator=torch.Generator().manual_seed(seed))
    for one in (low, high):
        one.draw_noise()
    assert torch.equal(low.values(observations), high.values(observations))
    assert not torch.equal(low.next_values(observations), high.next_values(observations))
    torch.testing.assert_close(
        low.next_values(observations), high.next_values(observations), rtol=0.05, atol=0.02
    )
    low.learn_in("float32")
    assert torch.equal(low.next_values(observations), high.next_values(observations))


@given(sizes=SIZES)
@settings(max_examples=20, deadline=None)
def test_the_layers_share_the_vector_out(sizes: list[int]) -> None:
    source = network(0, sizes)
    source.parameters.copy_(torch.arange(1.0, len(source.parameters) + 1))
    seen = torch.cat([part.reshape(-1) for layer in source.layers for part in layer])
    assert sorted(seen.tolist()) == source.parameters.tolist()


@given(sizes=SIZES)
@settings(max_examples=20, deadline=None)
def test_a_state_is_that_of_pytorchs_layers(sizes: list[int]) -> None:
    source, other = network(0, sizes), network(1, sizes)
    state = source.get_state()
    plain = reference(source)
    for index, module in enumerate(linear_layers(plain)):
        torch.testing.assert_close(state[f"layers.{index}.weight"], module.weight.detach(), rtol=0, atol=0)
    other.set_state(state)
    assert torch.equal(other.parameters, source.parameters)
    source.parameters.zero_()
    assert state["layers.0.weight"].any()


def test_a_state_of_another_network_is_refused() -> None:
    with pytest.raises(ValueError, match="expected"):
        network().set_state(network(0, (10, 8, 3)).get_state())


def test_a_policy_follows_its_network() -> None:
    source, other = network(0), network(1)
    policy = Policy(source, CPU)
    observations = np.random.default_rng(0).random((2, 10), np.float32)
    before = policy.values(observations)
    source.set_state(other.get_state())
    after = policy.values(observations)
    assert before.tolist() != after.tolist()
    assert after.tolist() == Policy(other, CPU).values(observations).tolist()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_observation_that_is_not_finite_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        Policy(network(), CPU).values(np.array([[0.0] * 10, [bad] + [0.0] * 9], np.float32))


def noisy(seed: int = 0, sizes: Sequence[int] = (10, 256, 256, 3)) -> NoisyQNetwork:
    return NoisyQNetwork(sizes[0], sizes[1:-1], sizes[-1], torch.Generator().manual_seed(seed), CPU)


@given(sizes=SIZES, rows=st.integers(1, 9), seed=st.integers(0, 1_000))
@settings(max_examples=60, deadline=None)
def test_the_gradient_of_means_and_spreads_is_autograds(sizes: list[int], rows: int, seed: int) -> None:
    source = noisy(seed, sizes)
    source.draw_noise()
    generator = torch.Generator().manual_seed(seed)
    observations = torch.rand(rows, sizes[0], generator=generator)
    slopes = torch.randn(rows, sizes[-1], generator=generator)
    outputs = source.forward(observations)
    source.backward(observations, outputs, slopes)
    mean, spread = source.parameters.clone().requires_grad_().split(len(source.parameters) // 2)
    means, spreads = (layers_of(source, part.detach()) for part in (mean, spread))
    values, leaves = observations, []
    for index, (drawn, middle, width) in enumerate(zip(source.layers, means, spreads, strict=True)):
        parts = [part.clone().requires_grad_() for part in (*middle, *width)]
        noise = [(now - about) / wide for now, about, wide in zip(drawn, middle, width, strict=True)]
        weight, bias = (parts[side] + parts[side + 2] * noise[side] for side in (0, 1))
        values = torch.addmm(bias, values, weight)
        values = values.relu() if index < len(sizes) - 2 else values
        leaves.append(parts)
    values.backward(slopes)
    torch.testing.assert_close(outputs[-1], values.detach(), rtol=1e-4, atol=1e-5)
    found = [layers_of(source, half) for half in source.gradient.split(len(mean))]
    for index, parts in enumerate(leaves):
        mine = [*found[0][index], *found[1][index]]
        for ours, theirs in zip(mine, parts, strict=True):
            torch.testing.assert_close(ours, theirs.grad, rtol=1e-3, atol=1e-4)


def test_noise_is_factorised_and_spread_as_published() -> None:
    source = noisy(3, (400, 300, 3))
    means = [part.clone() for layer in source.layers for part in layer]
    source.draw_noise()
    drawn = [part.clone() for layer in source.layers for part in layer]
    weight, bias = ((now - mean) * 400**0.5 / SPREAD for now, mean in zip(drawn[:2], means[:2], strict=True))
    # Of rank one: the noise of an input times that of an output, which is that of the bias.
    torch.testing.assert_close(weight, torch.outer(weight[:, 0] / bias[0], bias), rtol=1e-2, atol=1e-3)
    # f(x) = sgn(x) sqrt|x| of a standard normal has the mean square E|x| = sqrt(2 / pi).
    assert bias.square().mean().item() == pytest.approx((2 / torch.pi) ** 0.5, abs=0.12)
    source.draw_noise()
    assert not torch.equal(source.layers[0].weight, drawn[0])


def test_a_stored_noisy_network_drives_without_noise() -> None:
    source, other = noisy(0), noisy(1)
    observations = torch.rand(4, 10)
    still = source.forward(observations)[-1]
    source.draw_noise()
    assert not torch.equal(source.forward(observations)[-1], still)
    other.draw_noise()
    other.set_state(source.get_state())
    assert torch.equal(other.forward(observations)[-1], still)
    assert torch.equal(other.parameters, source.parameters)
    with pytest.raises(ValueError, match="expected"):
        network().set_state(source.get_state())
