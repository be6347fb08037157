"""Episodes as Parquet (extra `parquet`): a row for each frame, and the header in the schema's metadata.

Columns are the arrays of `episode_arrays` with a value for each frame; `offered`, `preferences` and
`observation` are lists. `vehicles`, and `seen` if sensing had faults, are lists of structures, the ego first:
name, lane, x, y, vx, vy, length and width. `reasons` are lists of structures, too: action, clause (an index
of the header's `clauses`, -1 if unknown), reason, and arguments, each a number or a name.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.episodes.episode_arrays import FRAMES, Header, read_header
from drlsl.driving.scene import ATOMS
from drlsl.errors import UserError
from drlsl.files import parquet_library, read_metadata, read_table, write_table
from drlsl.traffic import NUMBERS

KEY: Final = b"drlsl episode"
"""Key of the schema's metadata under which the header stands."""

Arrays = Mapping[str, npt.NDArray[Any]]


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Write the arrays of an episode, whole or not at all.

    Raises:
        UserError: the extra is not installed, or the file cannot be written.
    """
    arrow, _ = parquet_library()
    text = str(arrays["header"])
    header = read_header(text, path)
    columns = {name: _column(arrow, arrays[name]) for name in FRAMES}
    columns["vehicles"] = _vehicles(arrow, "vehicle", arrays, header)
    if "seen_begin" in arrays:
        columns["seen"] = _vehicles(arrow, "seen", arrays, header)
    columns["reasons"] = _reasons(arrow, arrays, header)
    write_table(path, columns, KEY, json.loads(text))


def _column(arrow: Any, values: npt.NDArray[Any]) -> Any:
    if values.ndim == 1:
        return arrow.array(values)
    return _lists(arrow, np.arange(len(values) + 1) * values.shape[1], arrow.array(values.reshape(-1)))


def _lists(arrow: Any, begin: npt.NDArray[Any], values: Any) -> Any:
    return arrow.ListArray.from_arrays(arrow.array(begin.astype(np.int32)), values)


def _texts(arrow: Any, texts: Sequence[str], indices: npt.NDArray[Any]) -> Any:
    return arrow.array([texts[index] for index in indices.tolist()], type=arrow.string())


def _vehicles(arrow: Any, group: str, arrays: Arrays, header: Header) -> Any:
    fields = {
        "name": _texts(arrow, header.names, arrays[f"{group}_name"]),
        "lane": arrow.array(arrays[f"{group}_lane"]),
        **{
            name: arrow.array(column)
            for name, column in zip(NUMBERS, arrays[f"{group}_numbers"].T, strict=True)
        },
    }
    rows = arrow.StructArray.from_arrays(list(fields.values()), names=list(fields))
    return _lists(arrow, arrays[f"{group}_begin"], rows)


def _reasons(arrow: Any, arrays: Arrays, header: Header) -> Any:
    numbers: list[float | None] = []
    names: list[str | None] = []
    begin = [0]
    for kind, row in zip(arrays["reason_kind"].tolist(), arrays["reason_arguments"].tolist(), strict=True):
        for letter, value in zip(header.reason_kinds[kind].letters, row, strict=False):
            numbers.append(value if letter == "n" else None)
            names.append(header.atoms[int(value)] if letter == "a" else None)
        begin.append(len(numbers))
    arguments = arrow.StructArray.from_arrays(
        [arrow.array(numbers, type=arrow.float64()), arrow.array(names, type=arrow.string())],
        names=["number", "name"],
    )
    fields = {
        "action": _texts(arrow, ATOMS, arrays["reason_action"]),
        "clause": arrow.array(arrays["reason_clause"]),
        "reason": _texts(arrow, [kind.reason for kind in header.reason_kinds], arrays["reason_kind"]),
        "arguments": _lists(arrow, np.array(begin), arguments),
    }
    rows = arrow.StructArray.from_arrays(list(fields.values()), names=list(fields))
    return _lists(arrow, arrays["reason_begin"], rows)


def has_header(path: Path) -> bool:
    """Return whether a Parquet file has the header of an episode.

    Raises:
        UserError: the extra is not installed, or the file cannot be read.
    """
    return KEY in read_metadata(path)


def read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays that `write_arrays` wrote.

    Raises:
        UserError: the extra is not installed, or the file is none of an episode.
    """
    if not path.is_file():
        raise UserError(f"cannot read the episode {path}: no such file")
    table = read_table(path)
    text = (table.schema.metadata or {}).get(KEY)
    if text is None:
        raise UserError(
            f"{path}: not an episode: a Parquet file without the header of one; drlsl data convert writes "
            "episodes as Parquet"
        )
    arrow, _ = parquet_library()
    header = read_header(text.decode(errors="replace"), path)
    try:
        return _arrays(table, header, text.decode())
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, arrow.ArrowException) as error:
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise UserError(f"{path}: a damaged episode: {why}") from error


def _arrays(table: Any, header: Header, text: str) -> dict[str, npt.NDArray[Any]]:
    columns = {name: table.column(name).combine_chunks() for name in table.column_names}
    arrays = {"header": np.array(text)}
    for name in FRAMES:
        column = columns[name]
        begin, values = _opened(column) if hasattr(column, "value_lengths") else (None, column)
        flat = _numbers(values, name)
        arrays[name] = flat if begin is None else _rectangle(flat, begin, name)
    groups = {"vehicle": "vehicles", **({"seen": "seen"} if "seen" in columns else {})}
    for group, name in groups.items():
        begin, rows = _opened(columns[name])
        arrays |= {f"{group}_begin": begin, f"{group}_lane": _numbers(rows.field("lane"), "lane")}
        arrays[f"{group}_name"] = _places(rows.field("name"), header.names, "name")
        arrays[f"{group}_numbers"] = np.stack([_numbers(rows.field(one), one) for one in NUMBERS], axis=1)
    return arrays | _reason_arrays(columns["reasons"], header)


def _reason_arrays(column: Any, header: Header) -> dict[str, npt.NDArray[Any]]:
    begin, rows = _opened(column)
    first, arguments = _opened(rows.field("arguments"))
    numbers, names = arguments.field("number").to_pylist(), arguments.field("name").to_pylist()
    kinds = {(kind.reason, kind.letters): place for place, kind in enumerate(header.reason_kinds)}
    atoms = {atom: place for place, atom in enumerate(header.atoms)}
    values = [
        number if name is None else float(atoms[name]) for number, name in zip(numbers, names, strict=True)
    ]
    letters = "".join("n" if name is None else "a" for name in names)
    spans = list(zip(first[:-1].tolist(), first[1:].tolist(), strict=True))
    padded = np.full((len(spans), max([0, *np.diff(first).tolist()])), np.nan)
    for row, (start, end) in enumerate(spans):
        padded[row, : end - start] = values[start:end]
    reasons = rows.field("reason").to_pylist()
    found = [kinds[reason, letters[start:end]] for reason, (start, end) in zip(reasons, spans, strict=True)]
    return {
        "reason_begin": begin,
        "reason_action": _places(rows.field("action"), ATOMS, "action"),
        "reason_clause": _numbers(rows.field("clause"), "clause"),
        "reason_kind": np.array(found, dtype=np.int64),
        "reason_arguments": padded,
    }


def _opened(column: Any) -> tuple[npt.NDArray[np.int64], Any]:
    """Return where the lists of a column begin in their values, and the values."""
    lengths = _numbers(column.value_lengths(), "the length of a list")
    return np.cumsum([0, *lengths.tolist()], dtype=np.int64), column.flatten()


def _numbers(column: Any, name: str) -> npt.NDArray[Any]:
    if column.null_count:
        raise ValueError(f"{name} is missing in {column.null_count} rows")
    values: npt.NDArray[Any] = column.to_numpy(zero_copy_only=False)
    return values.copy()


def _rectangle(flat: npt.NDArray[Any], begin: npt.NDArray[np.int64], name: str) -> npt.NDArray[Any]:
    widths = np.diff(begin)
    if len(widths) and (widths != widths[0]).any():
        raise ValueError(f"the lists of {name} differ in length")
    return flat.reshape(len(widths), int(widths[0]) if len(widths) else 0)


def _places(column: Any, texts: Sequence[str], name: str) -> npt.NDArray[np.int64]:
    known = {text: place for place, text in enumerate(texts)}
    found = column.to_pylist()
    if unknown := [one for one in found if one not in known]:
        raise ValueError(f"{name} {unknown[0]!r} is not in the header")
    return np.array([known[one] for one in found], dtype=np.int64)
