"""The precision in which a network multiplies while it learns."""

from time import perf_counter
from typing import Final

import torch

from drlsl.learning.config import NetworkConfig, Precision

TYPES: Final[dict[Precision, torch.dtype]] = {"float32": torch.float32, "bfloat16": torch.bfloat16}

GAIN: Final = 1.5
"""How many times as fast a product must be in bfloat16 to make up for the conversions around it."""

TRIES: Final = 20
"""Products of each type that are timed; the fastest counts."""


def faster_precision(network: NetworkConfig, batch_size: int, device: torch.device) -> Precision:
    """Return the precision in which a network learns faster on this machine, by timing its largest product.

    It is float32 on a GPU, where a network of this size waits for its calls and not for its products, and for
    modules, of which nothing is known.
    """
    inner = list(zip(network.hidden, network.hidden[1:], strict=False))
    if device.type != "cpu" or network.factory != "mlp" or not inner:
        return "float32"
    inputs, outputs = max(inner, key=lambda sizes: sizes[0] * sizes[1])
    exact, rounded = (_product_s(batch_size, inputs, outputs, kind) for kind in TYPES.values())
    return "bfloat16" if exact > GAIN * rounded else "float32"


def _product_s(rows: int, inputs: int, outputs: int, kind: torch.dtype) -> float:
    """Return the seconds of a product, the shortest of a few."""
    left, right = torch.ones(rows, inputs, dtype=kind), torch.ones(inputs, outputs, dtype=kind)
    out, times = torch.zeros(rows, outputs, dtype=kind), []
    for _ in range(TRIES):
        started = perf_counter()
        torch.mm(left, right, out=out)
        times.append(perf_counter() - started)
    return min(times)
