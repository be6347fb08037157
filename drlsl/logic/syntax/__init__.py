"""The reader: from text to terms."""

from drlsl.logic.syntax.flags import Flags
from drlsl.logic.syntax.reader import (
    Reader,
    ReadTerm,
    Source,
    is_complete,
    parse_number,
    read_term,
    read_terms,
)
from drlsl.logic.syntax.tokens import (
    FRACTION,
    INTEGER,
    LETTER_OPEN,
    PUNCTUATION,
    QUOTED_OPEN,
    SYMBOL,
    SYMBOL_OPEN,
    VARIABLE,
    WORD,
    WORD_OPEN,
    Span,
    Token,
    Tokens,
)

__all__ = [
    "FRACTION",
    "INTEGER",
    "LETTER_OPEN",
    "PUNCTUATION",
    "QUOTED_OPEN",
    "SYMBOL",
    "SYMBOL_OPEN",
    "VARIABLE",
    "WORD",
    "WORD_OPEN",
    "Flags",
    "ReadTerm",
    "Reader",
    "Source",
    "Span",
    "Token",
    "Tokens",
    "is_complete",
    "parse_number",
    "read_term",
    "read_terms",
]
