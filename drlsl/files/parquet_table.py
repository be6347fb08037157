"""Tables as Parquet files (extra `parquet`); pyarrow is loaded when one is read or written."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from drlsl.errors import UserError
from drlsl.files.extras import needed
from drlsl.files.whole_file import written_whole


def parquet_library() -> tuple[ModuleType, ModuleType]:
    """Return pyarrow and pyarrow.parquet.

    Raises:
        UserError: the extra is not installed.
    """
    with needed("Parquet files", "pyarrow", "parquet"):
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    return arrow, parquet


def read_table(path: Path) -> Any:
    """Return the table of a Parquet file.

    Raises:
        UserError: the extra is not installed, or the file cannot be read.
    """
    with _readable(path) as parquet:
        return parquet.read_table(path)


def read_metadata(path: Path) -> Mapping[bytes, bytes]:
    """Return the metadata of the schema of a Parquet file.

    Raises:
        UserError: the extra is not installed, or the file cannot be read.
    """
    with _readable(path) as parquet:
        found: Mapping[bytes, bytes] | None = parquet.read_schema(path).metadata
    return found or {}


@contextmanager
def _readable(path: Path) -> Iterator[Any]:
    """Yield the library of Parquet, and turn its errors about a file into a `UserError`."""
    arrow, parquet = parquet_library()
    try:
        yield parquet
    except (OSError, arrow.ArrowException) as error:
        raise UserError(f"{path}: cannot be read: {str(error).splitlines()[0]}") from error


def write_table(path: Path, columns: Mapping[str, Any], key: bytes, facts: Mapping[str, Any]) -> None:
    """Write columns, and `facts` as JSON under a `key` of the schema's metadata, whole or not at all.

    Raises:
        UserError: the extra is not installed, or the file cannot be written.
    """
    arrow, parquet = parquet_library()
    table = arrow.table(dict(columns)).replace_schema_metadata({key: json.dumps(facts).encode()})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as file:
            parquet.write_table(table, file, compression="zstd")
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror or error}") from error
