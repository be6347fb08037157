"""The networks of several seeds side by side: one product for each layer, on a device."""

from collections.abc import Sequence
from typing import Final, Protocol, TypeAlias

import torch

from drlsl.learning.layers import Layer, layers_of
from drlsl.learning.network import QNetwork

ALIGNED: Final = 16
"""Numbers of float32 between two places where PyTorch lets memory begin, 64 bytes."""

Values: TypeAlias = Sequence[torch.Tensor] | torch.Tensor
"""Rows of values of K networks. Shape: (K, B, values)."""


class _Products(Protocol):
    """The products of layers with values of some of the networks, those in `places`."""

    def outputs(self, places: Sequence[int], index: int, inputs: Values) -> torch.Tensor:
        """Return the outputs of a layer. Shape: (K, B, inputs) to (K, B, outputs)."""

    def at_hand(self, slopes: torch.Tensor) -> torch.Tensor:
        """Return the derivatives in the Q-values where products may take them from. Shape: (K, B, A)."""

    def slopes_before(self, places: Sequence[int], index: int, slopes: torch.Tensor) -> torch.Tensor:
        """Return the derivatives in a layer's inputs. Shape: (K, B, outputs) to (K, B, inputs)."""

    def write_gradient(self, places: Sequence[int], index: int, inputs: Values, slopes: torch.Tensor) -> None:
        """Write the gradient of a layer. Shapes: (K, B, inputs) and (K, B, outputs)."""


class _OneByOne:
    """A product for each network, by the same routines as alone, into memory that is reused.

    It lies as it does alone, too: with another alignment a product may round differently.
    """

    def __init__(self, layers: Sequence[Layer], slopes: Sequence[Layer], rows: int) -> None:
        self._layers = [_taken_apart(layer) for layer in layers]
        self._slopes = [_taken_apart(layer) for layer in slopes]
        shapes = [(len(layer.bias), rows, layer.bias.shape[1]) for layer in layers]
        self._outputs = [_aligned(*shape) for shape in shapes]
        self._slopes_in = [_aligned(*shape) for shape in shapes]

    def outputs(self, places: Sequence[int], index: int, inputs: Values) -> torch.Tensor:
        outputs = self._outputs[index][: len(places)]
        for place, given, result in zip(places, inputs, outputs, strict=True):
            layer = self._layers[index][place]
            torch.addmm(layer.bias, given, layer.weight, out=result)
        return outputs

    def at_hand(self, slopes: torch.Tensor) -> torch.Tensor:
        return self._slopes_in[-1][: len(slopes)].copy_(slopes)

    def slopes_before(self, places: Sequence[int], index: int, slopes: torch.Tensor) -> torch.Tensor:
        before = self._slopes_in[index - 1][: len(places)]
        for place, given, result in zip(places, slopes, before, strict=True):
            torch.mm(given, self._layers[index][place].weight.t(), out=result)
        return before

    def write_gradient(self, places: Sequence[int], index: int, inputs: Values, slopes: torch.Tensor) -> None:
        for place, given, slope in zip(places, inputs, slopes, strict=True):
            gradient = self._slopes[index][place]
            torch.mm(given.t(), slope, out=gradient.weight)
            torch.sum(slope, 0, out=gradient.bias)


class _Batched:
    """One product for all networks."""

    def __init__(self, layers: Sequence[Layer], slopes: Sequence[Layer]) -> None:
        self._layers, self._slopes = layers, slopes
        self._index: dict[tuple[int, ...], slice | torch.Tensor] = {
            tuple(range(len(layers[0].bias))): slice(None)
        }

    def outputs(self, places: Sequence[int], index: int, inputs: Values) -> torch.Tensor:
        at, layer = self._rows(places), self._layers[index]
        return torch.baddbmm(layer.bias[at].unsqueeze(1), _whole(inputs), layer.weight[at])

    def at_hand(self, slopes: torch.Tensor) -> torch.Tensor:
        return slopes

    def slopes_before(self, places: Sequence[int], index: int, slopes: torch.Tensor) -> torch.Tensor:
        return torch.bmm(slopes, self._layers[index].weight[self._rows(places)].mT)

    def write_gradient(self, places: Sequence[int], index: int, inputs: Values, slopes: torch.Tensor) -> None:
        at, gradient = self._rows(places), self._slopes[index]
        gradient.weight[at] = torch.bmm(_whole(inputs).mT, slopes)
        gradient.bias[at] = slopes.sum(1)

    def _rows(self, places: Sequence[int]) -> slice | torch.Tensor:
        """Return an index of the networks: with it all are a view, and some are a copy."""
        key = tuple(places)
        if key not in self._index:
            self._index[key] = torch.tensor(key, device=self._layers[0].bias.device)
        return self._index[key]


class NetworkStack:
    """Networks of one shape, their parameters in the rows of one matrix.

    Each stays a network of its own, whose parameters are its row. On a processor one product for all of them
    is no faster than one for each, and a product for each gives the bits of a network alone; a device waits
    for its calls, and there `batched` makes one product of them: docs/training.md, Speed.
    """

    def __init__(self, networks: Sequence[QNetwork], *, rows: int, batched: bool) -> None:
        """Move the networks; `rows`: those of a minibatch. Optimisers made before do not follow.

        Raises:
            TypeError: a network is of another kind, whose gradient is not that of plain layers.
        """
        if any(type(network) is not QNetwork for network in networks):
            raise TypeError("expected networks of fully connected layers without noise")
        sizes, count = networks[0].sizes, len(networks[0].parameters)
        shape = (len(networks), -(-count // ALIGNED) * ALIGNED)
        parameters = torch.zeros(shape, device=networks[0].parameters.device)
        gradient = torch.zeros_like(parameters)
        for network, mine, slopes in zip(networks, parameters, gradient, strict=True):
            network.move(mine[:count], slopes[:count])
        layers, slopes_of = tuple(layers_of(sizes, parameters)), tuple(layers_of(sizes, gradient))
        self._depth = len(layers)
        self._products: _Products = (
            _Batched(layers, slopes_of) if batched else _OneByOne(layers, slopes_of, rows)
        )

    def forward(self, places: Sequence[int], observations: Values) -> list[torch.Tensor]:
        """Return the output of each layer, hidden layers after their ReLU; the Q-values are last.

        On a processor they are valid until the next call.

        Args:
            places: the numbers of K networks, in order.
            observations: those of each of them. Shape: (K, B, S)
        """
        values, outputs = observations, []
        for index in range(self._depth):
            found = self._products.outputs(places, index, values)
            values = found.relu_() if index < self._depth - 1 else found
            outputs.append(values)
        return outputs

    def backward(
        self,
        places: Sequence[int],
        observations: Values,
        outputs: Sequence[torch.Tensor],
        slopes: torch.Tensor,
    ) -> None:
        """Write the gradient of each network's loss; see `QNetwork.backward`.

        Args:
            places: the numbers of K networks, in order.
            observations: the input of `forward`.
            outputs: its result.
            slopes: the losses' derivatives with respect to each Q-value. Shape: (K, B, A).
        """
        slopes = self._products.at_hand(slopes)
        for index in reversed(range(1, self._depth)):
            inputs = outputs[index - 1]
            self._products.write_gradient(places, index, inputs, slopes)
            slopes = self._products.slopes_before(places, index, slopes).mul_(inputs.sign())
        self._products.write_gradient(places, 0, observations, slopes)


def _aligned(networks: int, rows: int, width: int) -> torch.Tensor:
    """Return zeros in which the values of each network begin at an aligned place."""
    memory = torch.zeros(networks, -(-rows * width // ALIGNED) * ALIGNED)
    return memory[:, : rows * width].view(networks, rows, width)


def _taken_apart(layer: Layer) -> list[Layer]:
    return [Layer(*parts) for parts in zip(layer.weight, layer.bias, strict=True)]


def _whole(values: Values) -> torch.Tensor:
    return values if isinstance(values, torch.Tensor) else torch.stack(list(values))
