"""Read columns from text files, with errors that name file, line and column."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats, Mask
from drlsl.traffic.files import ENCODING, UNREADABLE, open_text, unreadable


class Kind(Enum):
    """The type of a column's cells; the value describes it in an error."""

    NUMBER = "a finite number"
    POSITIVE = "a number above 0"
    COUNT = "a whole number from 0 to 2,147,483,647"
    TEXT = "text"

    def holds(self, values: Floats) -> Mask:
        """Return which of the values are of this kind."""
        held: Mask = np.isfinite(values)
        if self is Kind.POSITIVE:
            held &= values > 0
        elif self is Kind.COUNT:
            held &= (values >= 0) & (values < 2**31) & (values == np.floor(values))
        return held


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a file: commas below a line of names or, given `names`, words without such a line."""

    names: tuple[str, ...] | None = None


COMMAS = Layout()


def read_header(path: Path) -> tuple[str, ...]:
    """Return the names in the first line of a comma-separated file.

    Raises:
        UserError: the file cannot be read or is empty.
    """
    for _, cells in _lines(path, COMMAS):
        return tuple(cell.strip() for cell in cells)
    raise UserError(f"{path}: the file is empty")


def find_columns(path: Path, header: Sequence[str], wanted: Sequence[str]) -> dict[str, str]:
    """Return wanted name -> name in the file, ignoring case.

    Raises:
        UserError: columns are missing; the message lists them.
    """
    present = {column.lower(): column for column in header}
    missing = [name for name in wanted if name.lower() not in present]
    if missing:
        plural = "s" if len(missing) > 1 else ""
        raise UserError(f"{path}: missing column{plural} {', '.join(missing)}; found {', '.join(header)}")
    return {name: present[name.lower()] for name in wanted}


def read_columns(path: Path, wanted: Mapping[str, Kind], layout: Layout = COMMAS) -> pd.DataFrame:
    """Return the wanted columns, in float64, or as text where so wanted, under the names given here.

    Raises:
        UserError: the file is unreadable, lacks a column, or has a cell of another kind; the message names
        the
            line and column of the first.
    """
    header = layout.names or read_header(path)
    columns = find_columns(path, header, tuple(wanted))
    types = {columns[name]: "str" if kind is Kind.TEXT else "float64" for name, kind in wanted.items()}
    # A truncated line lacks its last cell, so that column must be read, too.
    types.setdefault(header[-1], "str")
    try:
        frame = pd.read_csv(
            path,
            sep="," if layout.names is None else r"\s+",
            header=None if layout.names else 0,
            names=list(header),
            usecols=list(types),
            dtype=types,
            index_col=False,
            thousands=",",
            encoding=ENCODING,
        )
    except UNREADABLE as error:
        raise unreadable(path, error) from error
    except ValueError as error:
        raise _first_fault(path, wanted, layout) or UserError(f"{path}: malformed table: {error}") from error
    cut = frame[header[-1]].isna().any()
    frame = frame.rename(columns={column: name for name, column in columns.items()})
    numbers = (name for name, kind in wanted.items() if kind is not Kind.TEXT)
    if cut or not all(wanted[name].holds(frame[name].to_numpy()).all() for name in numbers):
        fault = _first_fault(path, wanted, layout)
        if fault is not None:
            raise fault
    return frame[list(wanted)]


def _lines(path: Path, layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of every line that is not blank."""
    try:
        with open_text(path) as file:
            if layout.names is None:
                reader = csv.reader(file)
                yield from ((reader.line_num, cells) for cells in reader if cells)
            else:
                yield from ((number, line.split()) for number, line in enumerate(file, 1) if line.strip())
    except (*UNREADABLE, csv.Error) as error:
        raise unreadable(path, error) from error


def _first_fault(path: Path, wanted: Mapping[str, Kind], layout: Layout) -> UserError | None:
    """Return the error for the first faulty line, found by a slow second reading; None if there is none."""
    lines = _lines(path, layout)
    header = layout.names or [cell.strip() for cell in next(lines)[1]]
    places = {
        name: header.index(column) for name, column in find_columns(path, header, tuple(wanted)).items()
    }
    for number, cells in lines:
        if len(cells) != len(header):
            return UserError(f"{path}:{number}: {len(cells)} cells, expected {len(header)}")
        for name, kind in wanted.items():
            cell = cells[places[name]].strip()
            if kind is not Kind.TEXT and not kind.holds(np.array(_number(cell))):
                return UserError(
                    f"{path}:{number}: column {header[places[name]]}: {cell!r} is not {kind.value}"
                )
    return None


def _number(cell: str) -> float:
    """Return the number in a cell, NaN if it holds none."""
    try:
        return float(cell.replace(",", ""))
    except ValueError:
        return float("nan")
