"""Checkpoints and weights: files that are written whole, with a checksum, and read without running code."""

import io
import logging
import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import torch

from drlsl.errors import UserError
from drlsl.files import DamagedError, open_archive, seal_archive, write_atomic

_LOG: Final = logging.getLogger(__name__)

FORMAT: Final = 3
"""Version of the checkpoint and weight files; they carry a checksum of their content."""

FORMAT_WITHOUT_CHECKSUM: Final = 2
"""The previous version, which is still read, with a warning."""

Kind = Literal["checkpoint", "policy"]

_ADVICE: Final[Mapping[Kind, str]] = {
    "checkpoint": "put back a copy of it, or start again with --force",
    "policy": "`drlsl train --resume` writes it anew from the checkpoint",
}
"""What to do about a damaged file."""

_UNREADABLE: Final = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    pickle.UnpicklingError,
)
"""Exceptions of PyTorch for files that it did not write."""


def save_state(path: Path, kind: Kind, state: Mapping[str, Any]) -> None:
    """Write plain types and tensors as a file of a kind, with a checksum of its content.

    Raises:
        UserError: the file cannot be written.
    """
    buffer = io.BytesIO()
    torch.save({"format": FORMAT, "kind": kind, **state}, buffer)
    write_atomic(path, seal_archive(buffer.getvalue()))


def load_state(path: Path, kind: Kind) -> dict[str, Any]:
    """Read a file of `save_state`, exact to the bit; nothing in the file can run code.

    Raises:
        UserError: the file is missing, damaged, of another kind or of another version.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot read the {kind}: {error.strerror or error}") from error
    try:
        sealed = open_archive(content)
        state = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except DamagedError as error:
        raise UserError(f"{path}: damaged {kind}: {error}; {_ADVICE[kind]}") from error
    except _UNREADABLE as error:
        name = type(error).__name__
        raise UserError(f"{path}: not a {kind} file, or damaged ({name}); {_ADVICE[kind]}") from error
    found: dict[str, Any] = state if isinstance(state, dict) else {}
    if found.get("kind") != kind:
        raise UserError(f"{path}: expected a {kind}, found {found.get('kind') or type(state).__name__}")
    version = found.get("format")
    if version == FORMAT and not sealed:
        raise UserError(f"{path}: damaged {kind}: its checksum is missing; {_ADVICE[kind]}")
    if version not in (FORMAT, FORMAT_WITHOUT_CHECKSUM):
        raise UserError(f"{path}: {kind} of format {version}, this version reads format {FORMAT}")
    if not sealed:
        _LOG.warning("%s: written before files had a checksum, and read as it is", path)
    return found


def as_tensors(state: Any) -> Any:
    """Return nested plain types with their arrays as tensors, for `save_state`."""
    return _mapped(state, np.ndarray, torch.tensor)


def as_arrays(state: Any) -> Any:
    """Undo `as_tensors`."""
    return _mapped(state, torch.Tensor, lambda tensor: tensor.numpy().copy())


def _mapped(state: Any, kind: type, change: Callable[[Any], Any]) -> Any:
    if isinstance(state, kind):
        return change(state)
    if isinstance(state, Mapping):
        return {key: _mapped(value, kind, change) for key, value in state.items()}
    if isinstance(state, list | tuple):
        return type(state)(_mapped(value, kind, change) for value in state)
    return state
