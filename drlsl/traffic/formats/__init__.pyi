from .parquet import write_parquet
from .registry import FORMATS, Format, Start, find_format, part_names, read

__all__ = ["FORMATS", "Format", "Start", "find_format", "part_names", "read", "write_parquet"]
