"""Prolog text as terms: a whole text term by term, one goal, or one number.

Source: ISO 13211-1 6.2 (text).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from drlsl.logic.errors import PrologSyntaxError, resource_error, syntax_error
from drlsl.logic.limits import Meter
from drlsl.logic.syntax.flags import Flags
from drlsl.logic.syntax.parser import NUMBERS, Parser, ReadTerm
from drlsl.logic.syntax.tokens import (
    END,
    EOF,
    INTEGER,
    QUOTED,
    SYMBOL,
    UNCLOSED_COMMENT,
    Source,
    Span,
    Tokens,
)
from drlsl.logic.terms import Operators, parse_digits

__all__ = ["ReadTerm", "Reader", "Source", "Span", "is_complete", "parse_number", "read_term", "read_terms"]


BYTE_ORDER_MARK: Final = "\ufeff"
"""The byte order mark, which some editors write before the text."""


class Reader:
    """Reads a text term by term: an iterator that continues after a syntax error at the next term.

    `operators` and `flags` are read again for each term, so a directive affects the rest of the text.
    """

    __slots__ = ("_flags", "_parser", "_tokens", "source")

    def __init__(
        self, text: str, operators: Operators, flags: Flags, name: str = "user", meter: Meter | None = None
    ) -> None:
        text = text.removeprefix(BYTE_ORDER_MARK)
        self.source = Source(text, name)
        self._flags = flags
        self._parser = Parser(self.source, operators, flags, meter)
        self._tokens = Tokens(self.source, flags, meter)
        if text.startswith("#!"):
            self._tokens.offset = (text.find("\n") + 1) or len(text)

    @property
    def offset(self) -> int:
        """The offset of the next term, right after the end token of the last one."""
        return self._tokens.offset

    def __iter__(self) -> Iterator[ReadTerm]:
        return self

    def __next__(self) -> ReadTerm:
        """Return the next term.

        Raises:
            PrologSyntaxError: the text up to the next end token is not a term; the next call continues after
            it. StopIteration: there are no more terms.
        """
        self._tokens.follow(self._flags)
        tokens = self._tokens.clause()
        if tokens[-1][0] == EOF:
            if len(tokens) == 1:
                raise StopIteration
            self._parser.parse(tokens)  # which has the better message if the term is incomplete
            _, text, start = tokens[-2]
            message = "end of file: expected . at the end of the clause"
            raise self.source.error(message, start, start + len(text))
        return self._parser.parse(tokens)


def read_terms(
    text: str, operators: Operators, flags: Flags, name: str = "user", meter: Meter | None = None
) -> Reader:
    """Return the terms of a text, read lazily: directives may change `operators` and `flags`."""
    return Reader(text, operators, flags, name, meter)


def read_term(
    text: str, operators: Operators, flags: Flags, name: str = "user", meter: Meter | None = None
) -> ReadTerm:
    """Return the one term of a text, such as a goal; the end token is optional.

    Raises:
        PrologSyntaxError: the text is not exactly one term.
    """
    if meter is not None:
        meter.text(len(text))
    source = Source(text.removeprefix(BYTE_ORDER_MARK), name)
    stream = Tokens(source, flags, meter)
    tokens = stream.clause()
    kind, word, start = tokens[-1]
    if len(tokens) == 1:
        raise source.error("expected a term", start, start + len(word))
    if kind == END:
        kind, word, start = stream.clause()[0]
        if kind != EOF:
            raise source.error("text after the end of the term", start, start + len(word))
    return Parser(source, operators, flags, meter).parse(tokens)


def is_complete(text: str, flags: Flags) -> bool:
    """Return whether a text being typed holds a whole clause, or an error that more text cannot fix."""
    try:
        tokens = Tokens(Source(text, "user"), flags).clause()
    except PrologSyntaxError as error:
        return UNCLOSED_COMMENT not in error.message()
    return tokens[-1][0] == END


def parse_number(text: str, flags: Flags, meter: Meter | None = None) -> int | float:
    """Return the number of a text, with layout allowed before it but not after it.

    Raises:
        PrologSyntaxError: the text is not a number.

    Source: ISO 13211-1 8.16.7 (number_chars), 8.16.8 (number_codes).
    """
    if meter is not None:
        meter.text(len(text))
    tokens = Tokens(Source(text, "number"), flags).clause()
    negative = tokens[0][0] in (SYMBOL, QUOTED) and tokens[0][1] == "-"
    if len(tokens) != 2 + negative or tokens[-1][0] != EOF:
        raise syntax_error("illegal number")
    kind, digits, start = tokens[-2]
    if kind not in NUMBERS or start + len(digits) != len(text):
        raise syntax_error("illegal number")
    try:
        value = parse_digits(digits, meter=meter) if kind == INTEGER else NUMBERS[kind](digits, flags.iso)
    except ValueError as error:
        raise syntax_error(str(error)) from None
    except OverflowError:
        raise resource_error("memory") from None
    return -value if negative else value
