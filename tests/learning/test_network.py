import copy

import numpy as np
import pytest
import torch
from torch import nn

from drlsl.learning.network import Policy, QNetwork

CPU = torch.device("cpu")


def network(seed: int = 0) -> QNetwork:
    return QNetwork(10, (256, 256), 3, torch.Generator().manual_seed(seed))


def reference(source: QNetwork) -> nn.Sequential:
    """The same network from PyTorch's own modules."""
    plain = nn.Sequential(nn.Linear(10, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 3))
    for mine, theirs in zip(plain.parameters(), source.parameters(), strict=True):
        mine.data.copy_(theirs)
    return plain


def test_values_are_those_of_the_papers_layers() -> None:
    observations = torch.rand(7, 10, generator=torch.Generator().manual_seed(1))
    torch.testing.assert_close(network()(observations), reference(network())(observations))


def test_gradients_reach_every_parameter() -> None:
    mine, theirs = network(), reference(network())
    observations = torch.rand(7, 10, generator=torch.Generator().manual_seed(1))
    for model in (mine, theirs):
        model(observations).square().sum().backward()
    for one, other in zip(mine.parameters(), theirs.parameters(), strict=True):
        torch.testing.assert_close(one.grad, other.grad)


def test_a_policy_follows_its_network() -> None:
    source, other = network(0), network(1)
    policy = Policy(source, CPU)
    observation = np.random.default_rng(0).random(10, np.float32)
    before = policy.values(observation)
    source.load_state_dict(other.state_dict())
    after = policy.values(observation)
    assert before.tolist() != after.tolist()
    assert after.tolist() == Policy(other, CPU).values(observation).tolist()


def test_a_copy_does_not_share_weights() -> None:
    source = network()
    copied = copy.deepcopy(source)
    with torch.no_grad():
        for parameter in source.parameters():
            parameter.zero_()
    observation = np.ones(10, np.float32)
    assert Policy(source, CPU).values(observation).tolist() == [0.0, 0.0, 0.0]
    assert all(value != 0.0 for value in Policy(copied, CPU).values(observation))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_observation_that_is_not_finite_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        Policy(network(), CPU).values(np.array([bad] + [0.0] * 9, np.float32))
