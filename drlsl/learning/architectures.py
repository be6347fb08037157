"""Q-networks as plain PyTorch modules: fully connected or dueling, with noise in their weights if wanted."""

import itertools
from collections.abc import Sequence
from typing import Final

import torch
from torch import nn

PAPER: Final = (256, 256)
"""Widths of the hidden layers. Source: paper, Network and Hyperparameters."""

SPREAD: Final = 0.5
"""A weight's spread to begin with, times the root of its layer's inputs. Source: Fortunato et al., 2018."""


class NoisyLinear(nn.Linear):
    """A linear layer with noisy weights: mean + spread · noise in training mode, the means in evaluation.

    The noise of a weight is that of its input times that of its output; `reset_noise` draws it anew.

    Source: Fortunato et al., "Noisy networks for exploration", 2018, factorised noise.
    """

    noise: torch.Tensor
    """That of the inputs, then that of the outputs. Shape: (inputs + outputs,)."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs)
        spread = SPREAD * inputs**-0.5
        self.weight_spread = nn.Parameter(torch.full((outputs, inputs), spread))
        self.bias_spread = nn.Parameter(torch.full((outputs,), spread))
        self.register_buffer("noise", torch.zeros(inputs + outputs))

    def reset_noise(self) -> None:
        """Draw the noise anew."""
        drawn = torch.randn_like(self.noise)
        # Source: Fortunato et al., f(x) = sgn(x) √|x|.
        self.noise.copy_(drawn.sign() * drawn.abs().sqrt())

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Apply the layer. Shape: (B, inputs) to (B, outputs)."""
        if not self.training:
            return super().forward(values)
        inputs, outputs = self.noise[: self.in_features], self.noise[self.in_features :]
        weight = self.weight + self.weight_spread * torch.outer(outputs, inputs)
        return nn.functional.linear(values, weight, self.bias + self.bias_spread * outputs)


class Dueling(nn.Module):
    """The value of a state and the advantages of its actions, from two separate streams.

    Source: Wang et al., "Dueling network architectures for deep reinforcement learning", 2016, Eq. 9.
    """

    def __init__(self, shared: nn.Module, value: nn.Module, advantage: nn.Module) -> None:
        super().__init__()
        self.shared, self.value, self.advantage = shared, value, advantage

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values. Shape: (B, S) to (B, A)."""
        features = self.shared(observations)
        advantage: torch.Tensor = self.advantage(features)
        value: torch.Tensor = self.value(features)
        return value + advantage - advantage.mean(dim=1, keepdim=True)


def mlp(
    observation_size: int, actions: int, hidden: Sequence[int] = PAPER, *, noisy: bool = False
) -> nn.Module:
    """Make fully connected layers with ReLU between them: the paper's network, as a plain module."""
    return nn.Sequential(*_layers((observation_size, *hidden), noisy), _linear(noisy)(hidden[-1], actions))


def dueling(
    observation_size: int, actions: int, hidden: Sequence[int] = PAPER, *, noisy: bool = False
) -> nn.Module:
    """Make a dueling network: both streams share all hidden layers but the last."""
    features, linear = (observation_size, *hidden)[-2], _linear(noisy)

    def stream(outputs: int) -> nn.Module:
        return nn.Sequential(*_layers((features, hidden[-1]), noisy), linear(hidden[-1], outputs))

    shared = nn.Sequential(*_layers((observation_size, *hidden[:-1]), noisy))
    return Dueling(shared, stream(1), stream(actions))


def _linear(noisy: bool) -> type[nn.Linear]:
    return NoisyLinear if noisy else nn.Linear


def _layers(sizes: Sequence[int], noisy: bool) -> list[nn.Module]:
    """Return linear layers of these sizes, each followed by a ReLU."""
    pairs = itertools.pairwise(sizes)
    return [part for inputs, outputs in pairs for part in (_linear(noisy)(inputs, outputs), nn.ReLU())]
