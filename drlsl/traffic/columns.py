"""Read columns from text files, with errors that name file, line and column."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats, Mask
from drlsl.traffic.files import ENCODING, open_bytes, open_text, readable

_OTHER_SEPARATORS: Final = {";": "semicolons", "\t": "tabs", "|": "bars"}
"""What separates the cells of a file that has one cell a line if commas do."""

_GROUPED: Final = re.compile(r"[+-]?\d{1,3}(,\d{3})+(\.\d*)?")
"""A number whose thousands are separated by commas."""


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
        UserError: the file cannot be read, is empty, or has another separator.
    """
    for _, cells in _lines(path, COMMAS):
        if len(cells) == 1:
            for mark, name in _OTHER_SEPARATORS.items():
                if mark in cells[0]:
                    raise UserError(f"{path}: its cells are separated by {name}; expected commas")
        return tuple(cell.strip() for cell in cells)
    raise UserError(f"{path}: the file is empty")


def find_columns(path: Path, header: Sequence[str], wanted: Sequence[str]) -> dict[str, str]:
    """Return wanted name -> name in the file, ignoring case.

    Raises:
        UserError: columns are missing, or there are two of a name; the message lists them.
    """
    present = {column.lower(): column for column in header}
    missing = [name for name in wanted if name.lower() not in present]
    if missing:
        plural = "s" if len(missing) > 1 else ""
        raise UserError(f"{path}: missing column{plural} {', '.join(missing)}; found {', '.join(header)}")
    lower = [column.lower() for column in header]
    for name in wanted:
        if lower.count(name.lower()) > 1:
            raise UserError(f"{path}: {lower.count(name.lower())} columns {name}, expected one")
    return {name: present[name.lower()] for name in wanted}


def read_columns(path: Path, wanted: Mapping[str, Kind], layout: Layout = COMMAS) -> pd.DataFrame:
    """Return the wanted columns, in float64, or as text where so wanted, under the names given here.

    Raises:
        UserError: the file is unreadable, lacks a column, has a line with more or fewer cells than names, or
            has a cell of another kind; the message names the line and column of the first.
    """
    header = layout.names or read_header(path)
    columns = find_columns(path, header, tuple(wanted))
    _check_widths(path, len(header), layout)
    types = {columns[name]: "str" if kind is Kind.TEXT else "float64" for name, kind in wanted.items()}
    try:
        with readable(path):
            frame = _read(path, header, types, layout)
    except ValueError:
        frame = _read_with_commas(
            path, header, {columns[name]: kind for name, kind in wanted.items()}, layout
        )
    frame = frame.rename(columns={column: name for name, column in columns.items()})
    for name, kind in wanted.items():
        if kind is not Kind.TEXT and not (held := kind.holds(frame[name].to_numpy())).all():
            row = int(np.argmin(held))
            number, cells = line_of_row(path, row, layout)
            column = columns[name]
            cell = cells[header.index(column)].strip()
            raise UserError(f"{path}:{number}: column {column}: {cell!r} is not {kind.value}")
    return frame[list(wanted)]


def line_of_row(path: Path, row: int, layout: Layout = COMMAS) -> tuple[int, list[str]]:
    """Return number and cells of the line that holds a row of the table, counted from 0."""
    before = row + (layout.names is None)
    for index, line in enumerate(_lines(path, layout)):
        if index == before:
            return line
    raise UserError(f"{path}: changed while it was read")


def _read(path: Path, header: Sequence[str], types: Mapping[str, Any], layout: Layout) -> pd.DataFrame:
    return pd.read_csv(
        path,
        sep="," if layout.names is None else r"\s+",
        header=None if layout.names else 0,
        names=list(header),
        usecols=list(types),
        dtype=dict(types),
        index_col=False,
        encoding=ENCODING,
    )


def _read_with_commas(
    path: Path, header: Sequence[str], kinds: Mapping[str, Kind], layout: Layout
) -> pd.DataFrame:
    """Return the columns of a table in which cells are no plain numbers, with NaN where there is none.

    A comma in a number may separate thousands or decimals, and both are written. It is taken for one of
    thousands where nothing else is possible.
    """
    frame = _read(path, header, dict.fromkeys(kinds, "str"), layout)
    for column, kind in kinds.items():
        if kind is Kind.TEXT:
            continue
        cells = frame[column].str.strip()
        commas = cells[cells.str.contains(",", regex=False, na=False)]
        if len(commas):
            grouped = commas.map(lambda cell: _GROUPED.fullmatch(cell) is not None)
            certain = kind is Kind.COUNT or (commas.str.contains(r"[,.].*[,.]").any())
            if not (grouped.all() and certain):
                first = commas[~grouped].iloc[0] if not grouped.all() else commas.iloc[0]
                raise UserError(
                    f"{path}: column {column}: {first!r}: does its comma separate decimals or thousands? "
                    "Write a point for decimals and no commas"
                )
            cells = cells.str.replace(",", "", regex=False)
        frame[column] = pd.to_numeric(cells, errors="coerce").astype("float64")
    return frame


def _check_widths(path: Path, count: int, layout: Layout) -> None:
    """Check that every line has as many cells as there are names; pandas shifts the cells of others.

    Raises:
        UserError: a line has not, is not text, or cannot be told from the next one.
    """
    with readable(path, csv.Error), open_bytes(path) as file:
        for number, line in enumerate(file, 1):
            cells = _cells(line, layout)
            if cells == count or not line.strip():
                continue
            if b"\r" in line.rstrip(b"\r\n"):
                raise UserError(f"{path}:{number}: its lines end in carriage returns alone; use newlines")
            raise UserError(f"{path}:{number}: {cells} cells, expected {count}")


def _cells(line: bytes, layout: Layout) -> int:
    """Return the number of cells of a line."""
    if layout.names is not None:
        return len(line.split())
    if b'"' in line:
        return len(next(csv.reader([line.decode(ENCODING)])))
    return line.count(b",") + 1


def _lines(path: Path, layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of every line that is not blank."""
    with readable(path, csv.Error), open_text(path) as file:
        if layout.names is None:
            reader = csv.reader(file)
            yield from (
                (reader.line_num, cells) for cells in reader if len(cells) > 1 or "".join(cells).strip()
            )
        else:
            yield from ((number, line.split()) for number, line in enumerate(file, 1) if line.strip())
