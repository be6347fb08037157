"""What networks consist of."""

from torch import nn

from drlsl.learning.network import Network, QNetwork


def plain(network: Network) -> QNetwork:
    """The network of an agent, which is the paper's."""
    assert isinstance(network, QNetwork)
    return network


def linear_layers(network: nn.Module) -> list[nn.Linear]:
    """PyTorch's fully connected layers in a network, from the first to the last."""
    return [module for module in network.modules() if isinstance(module, nn.Linear)]
