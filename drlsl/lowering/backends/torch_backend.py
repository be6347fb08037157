"""Lowered programs on Torch tensors: scenes on a device are answered there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from drlsl.lowering.backends.batch_program import Kind, Layout, Precision, Rows, Table, TextProgram
from drlsl.lowering.backends.numpy_backend import is_of
from drlsl.lowering.backends.torch_ops import Constants, Ops
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import INT_BOUND

CHUNK: Final = 2048
"""Number of scenes that a processor answers together: more do not fit its cache."""

DEVICE_CHUNK: Final = 1 << 18
"""The same for any other device, limited by its memory."""

_PRECISIONS: Final[Mapping[Precision, torch.dtype]] = {"float64": torch.float64, "float32": torch.float32}
_INTEGERS: Final = frozenset({torch.int64, torch.int32, torch.int16, torch.int8, torch.uint8, torch.bool})


def compile_torch(
    lowered: Lowered, dtype: Precision = "float64", device: str | torch.device = "cpu"
) -> TorchProgram:
    """Return the program that answers all queries for many scenes, on `device`.

    Facts may be NumPy arrays or tensors on any device; tensors that are on `device` already, and of the
    right type, are not copied. The answers are tensors on `device`. With float64 on the processor they equal
    the interpreter's; docs/lowering.md describes other cases.

    Raises:
        NotLowerable: a query's answer has no form as an array.
        ValueError: there is no such device.
    """
    wanted = torch.device(device)
    if wanted.type == "cuda" and not torch.cuda.is_available():
        raise ValueError(f"device {wanted}: Torch finds no CUDA device; use cpu")
    return TorchProgram(lowered, dtype, wanted)


class TorchProgram(TextProgram[Tensor]):
    """A lowered program, ready for Torch tensors."""

    def __init__(self, lowered: Lowered, dtype: Precision, device: torch.device) -> None:
        super().__init__(lowered, dtype, _kinds)
        self.device: Final = device
        self._constants: Final[Constants] = {}

    def _table(self, layout: Layout, rows: Rows) -> TorchTable:
        return TorchTable(layout, rows, self.device)

    def _ops(self, scenes: int) -> Ops:
        return Ops(self._kinds["float"], self.device, scenes, self._constants)

    def _most_scenes(self, scenes: int) -> int:
        return CHUNK if self.device.type == "cpu" else DEVICE_CHUNK

    def _empty(self, shape: tuple[int, ...], kind: Kind) -> Tensor:
        return torch.empty(shape, dtype=self._kinds[kind], device=self.device)

    def _joined(self, parts: Sequence[Tensor]) -> Tensor:
        return torch.cat(list(parts))


def _kinds(dtype: Precision) -> Mapping[Kind, torch.dtype]:
    return {"bool": torch.bool, "int": torch.int64, "float": _PRECISIONS[dtype]}


class TorchTable(Table):
    """The columns of one relation that are read, as tensors."""

    __slots__ = ("_device",)

    def __init__(self, layout: Layout, rows: Rows, device: torch.device) -> None:
        self._device = device
        super().__init__(layout, rows)
        if device.type == "cpu":  # this would wait for any other device
            self.look()

    def _is_of(self, column: Tensor | np.ndarray[Any, Any], kind: Kind) -> bool:
        if not isinstance(column, Tensor):
            return is_of(column.dtype, kind)
        if kind == "float" and column.is_floating_point():
            return True
        return column.dtype in _INTEGERS and (kind == "int" or column.dtype != torch.bool)

    def _converted(self, column: Tensor | np.ndarray[Any, Any], kind: Kind) -> Tensor:
        if not isinstance(column, Tensor):
            array = np.ascontiguousarray(column)
            column = torch.from_numpy(array if array.flags.writeable else array.copy())
        return column.detach().to(self._device, self._kinds[kind])

    def _placed(self, index: Tensor | np.ndarray[Any, Any]) -> Tensor:
        return self._converted(index, "int")

    def _all_there(self, height: int) -> Tensor:
        return torch.ones((height, 1), dtype=torch.bool, device=self._device)

    def _with_rows(self, column: Tensor, missing: int) -> Tensor:
        return torch.cat([column, column.new_zeros((missing, column.shape[1]))])

    def _within(self, column: Tensor, kind: Kind) -> bool:
        bound = self._bound if kind == "float" else INT_BOUND
        low, high = column.aminmax()
        return bool(-bound <= low.item() <= high.item() <= bound)

    def _repeats(self, keys: Tensor) -> Tensor:
        places = torch.arange(keys.shape[0], device=keys.device)[:, None]
        # missing rows get keys that no row has
        apart = torch.where(self.valid, keys, torch.iinfo(torch.int64).min + places)
        ordered = apart.sort(dim=0).values
        return (ordered[1:] == ordered[:-1]).any(dim=0)
