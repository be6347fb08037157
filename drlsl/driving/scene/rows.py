"""Data classes whose arrays have one row for each scene; no NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from _typeshed import DataclassInstance

    Rows = TypeVar("Rows", bound=DataclassInstance)


def copied(rows: Rows) -> Rows:
    """Return the rows with copied arrays."""
    return replace(rows, **{name: array.copy() for name, array in _arrays(rows)})


def put_rows(rows: Rows, places: npt.NDArray[np.int64], other: Rows) -> None:
    """Write the rows of the arrays of `other` into `places`."""
    for name, array in _arrays(rows):
        array[places] = getattr(other, name)


def with_rows(rows: Rows, places: npt.NDArray[np.int64], other: Rows) -> Rows:
    """Return the rows with those of `other` in `places`; `other` has as many rows."""
    if not places.size:
        return rows
    result = copied(rows)
    for name, array in _arrays(result):
        array[places] = getattr(other, name)[places]
    return result


def taken_rows(rows: Rows, places: npt.NDArray[np.int64]) -> Rows:
    """Return the rows in `places`, as copies."""
    return replace(rows, **{name: array[places] for name, array in _arrays(rows)})


def _arrays(rows: DataclassInstance) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    for field in fields(rows):
        value = getattr(rows, field.name)
        if hasattr(value, "shape"):
            yield field.name, value
