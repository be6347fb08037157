import itertools
from collections.abc import Sequence

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from drlsl.learning.network import Policy, QNetwork

CPU = torch.device("cpu")


def network(seed: int = 0, sizes: Sequence[int] = (10, 256, 256, 3)) -> QNetwork:
    return QNetwork(sizes[0], sizes[1:-1], sizes[-1], torch.Generator().manual_seed(seed), CPU)


def reference(source: QNetwork) -> nn.Sequential:
    """The same network from PyTorch's own modules."""
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(source.sizes):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    plain = nn.Sequential(*layers[:-1])
    for module, stored in zip(plain[::2], source.layers, strict=True):
        module.weight.data.copy_(stored.weight.t())
        module.bias.data.copy_(stored.bias)
    return plain


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
    vector = torch.full_like(source.parameters, torch.nan)
    gradient = source.layers_of(vector)
    source.backward(observations, outputs, slopes, gradient)
    values = plain(observations)
    values.backward(slopes)
    torch.testing.assert_close(outputs[-1], values.detach())
    assert vector.isfinite().all()
    for mine, module in zip(gradient, plain[::2], strict=True):
        torch.testing.assert_close(mine.weight.t(), module.weight.grad, rtol=1e-5, atol=1e-6)
        torch.testing.assert_close(mine.bias, module.bias.grad, rtol=1e-5, atol=1e-6)


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
    for index, module in enumerate(plain[::2]):
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
