"""The built-in predicates, one module for each family; importing this package fills the registry."""

from drlsl.logic.builtins import (
    arith,
    compare,
    control,
    database,
    formatting,
    listing,
    lists,
    loading,
    strings,
    syntax,
    system,
    tables,
    termio,
    text,
    types,
)

__all__ = [
    "arith",
    "compare",
    "control",
    "database",
    "formatting",
    "listing",
    "lists",
    "loading",
    "strings",
    "syntax",
    "system",
    "tables",
    "termio",
    "text",
    "types",
]
