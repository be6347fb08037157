"""Loading rule files into a program: directives, the library, and the targets of goals."""

from drlsl.logic.loading.consult import (
    LARGEST_FILE,
    ConsultError,
    Loader,
    LoadWarning,
    read_source,
)
from drlsl.logic.loading.finding import find_file, similar_file
from drlsl.logic.loading.linking import Linker, builtin, library
from drlsl.logic.loading.shipped import shipped_folder

__all__ = [
    "LARGEST_FILE",
    "ConsultError",
    "Linker",
    "LoadWarning",
    "Loader",
    "builtin",
    "find_file",
    "library",
    "read_source",
    "shipped_folder",
    "similar_file",
]
