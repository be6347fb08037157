"""Fully connected layers as views of a vector of parameters."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch


class Layer(NamedTuple):
    """A fully connected layer, as views of a network's vector of parameters, or of several networks'."""

    weight: torch.Tensor  # Shape: (..., inputs, outputs)
    bias: torch.Tensor  # Shape: (..., outputs)

    def __call__(self, values: torch.Tensor) -> torch.Tensor:
        """Apply the layer, in the type of its weights. Shape: (B, inputs) to (B, outputs)."""
        return torch.addmm(self.bias, values.to(self.weight.dtype), self.weight)


def count_parameters(sizes: Sequence[int]) -> int:
    """Return the number of parameters of layers."""
    return sum(inputs * outputs + outputs for inputs, outputs in itertools.pairwise(sizes))


def layers_of(sizes: Sequence[int], vector: torch.Tensor) -> Iterator[Layer]:
    """Yield the layers of a vector of parameters, or of one in each row. Shape: (..., parameters)."""
    start = 0
    for inputs, outputs in itertools.pairwise(sizes):
        middle = start + inputs * outputs
        stop = middle + outputs
        # With its longer side laid out in rows, a narrow layer's gradient takes a fifth of the time.
        weight = vector[..., start:middle].unflatten(-1, (min(inputs, outputs), max(inputs, outputs)))
        yield Layer(weight if inputs < outputs else weight.mT, vector[..., middle:stop])
        start = stop
