from .caches import cache_folder, make_room
from .extras import needed
from .lock import FolderLock
from .parquet_table import parquet_library, read_metadata, read_table, write_table
from .plain_text import parse_json, printable, read_text, to_json
from .problems import problem_text, reason_of, section_of, setting_path
from .seal import (
    DamagedError,
    check_text,
    digest,
    digests,
    open_archive,
    open_values,
    seal_archive,
    seal_text,
    seal_values,
)
from .user_code import find_object, refuse_while_loading, users_code
from .whole_file import not_replaceable, scratch_beside, write_atomic, written_whole
from .yaml_file import Location, YamlFile, parse_yaml, read_yaml, shown, to_yaml

__all__ = [
    "DamagedError",
    "FolderLock",
    "Location",
    "YamlFile",
    "cache_folder",
    "check_text",
    "digest",
    "digests",
    "find_object",
    "make_room",
    "needed",
    "not_replaceable",
    "open_archive",
    "open_values",
    "parquet_library",
    "parse_json",
    "parse_yaml",
    "printable",
    "problem_text",
    "read_metadata",
    "read_table",
    "read_text",
    "read_yaml",
    "reason_of",
    "refuse_while_loading",
    "scratch_beside",
    "seal_archive",
    "seal_text",
    "seal_values",
    "section_of",
    "setting_path",
    "shown",
    "to_json",
    "to_yaml",
    "users_code",
    "write_atomic",
    "write_table",
    "written_whole",
]
