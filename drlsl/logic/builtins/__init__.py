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
    termio,
    text,
    types,
)
from drlsl.logic.builtins import tabled as tables
from drlsl.logic.builtins.arguments import indicators, items, unqualified
from drlsl.logic.builtins.control import begin_findall
from drlsl.logic.builtins.database import name_term, split_clause
from drlsl.logic.builtins.inplace import ARITHMETIC

__all__ = [
    "ARITHMETIC",
    "arith",
    "begin_findall",
    "compare",
    "control",
    "database",
    "formatting",
    "indicators",
    "items",
    "listing",
    "lists",
    "loading",
    "name_term",
    "split_clause",
    "strings",
    "syntax",
    "system",
    "tables",
    "termio",
    "text",
    "types",
    "unqualified",
]
