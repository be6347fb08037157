"""Prolog text as tokens: one compiled expression, and the values of quoted and numeric tokens.

Source: ISO 13211-1 6.4 (tokens) and 6.5 (processor character set).
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import cache
from typing import Final, NamedTuple, NoReturn

from drlsl.logic.errors import PrologSyntaxError
from drlsl.logic.limits import Meter
from drlsl.logic.syntax.flags import Flags
from drlsl.logic.terms import Atom, Struct, parse_digits

# The kinds of a token are the numbers of the groups of the expression below. A kind "open" is a name with the
# bracket of its arguments right after it, as in foo( .
VARIABLE, WORD, WORD_OPEN, PUNCTUATION, END, SPECIAL, FRACTION, INTEGER = range(1, 9)
SYMBOL, SYMBOL_OPEN, QUOTED, QUOTED_OPEN, STRING, BACKQUOTED, LETTER, LETTER_OPEN = range(9, 17)
EOF, ERROR = 17, 18

# Only single characters are repeated possessively: before 3.11.5, Python's re does not undo what a possessive
# group read before it failed. So the groups can be read in only one way.
_ESCAPE: Final = r"\\(?:x[0-9a-fA-F]++\\?+|[0-7]++\\?+|x(?![0-9a-fA-F])|[^x0-7])"
_LAYOUT: Final = r"(?:\s++|%[^\n]*+|/\*[^*]*+(?:\*(?!/)[^*]*+)*\*/)*"


def _expression(iso: bool) -> str:
    digits = r"[0-9]++" if iso else r"[0-9]++(?:_[0-9]++)*"
    special = "" if iso else r"|[1-9][0-9]?'[0-9a-zA-Z]++"
    floats = "" if iso else r"|[0-9]++[eE][+-]?[0-9]++"
    plain = r"\\\n\t" if iso else r"\\\n"
    return rf"""{_LAYOUT}(?:
      ([A-Z_]\w*+)
    | ([a-z]\w*+)(\()?
    | ([()\[\]{{}},|])
    | (\.)(?=\s|%|\Z)
    | (0(?:x[0-9a-fA-F]++|o[0-7]++|b[01]++
        |'(?:''|\\(?:x[0-9a-fA-F]++\\|[0-7]++\\|[^x0-7\s])|[^'\\\s]|[ ])){special})
    | ([0-9]++\.[0-9]++(?:[eE][+-]?[0-9]++|Inf\b|NaN\b)?{floats})
    | ({digits})
    | ((?!/\*)[#$&*+\-./:<=>?@^~\\]++|[!;]|[^\x00-\x7f\w\s]++)(\()?
    | '((?:[^'{plain}]++|''|{_ESCAPE})*)'(?!')(\()?
    | "((?:[^"{plain}]++|""|{_ESCAPE})*)"(?!")
    | `((?:[^`{plain}]++|``|{_ESCAPE})*)`(?!`)
    | ([^\W\d]\w*+)(\()?
    | (\Z)
    | ([\s\S])
    )"""


@cache
def token_pattern(iso: bool) -> re.Pattern[str]:
    """Return the expression that matches one token with the layout before it; group number = kind."""
    return re.compile(_expression(iso), re.VERBOSE)


# One token: its kind, its text (without quotes or bracket) and its offset.
Token = tuple[int, str, int]

# The group that holds the text of a token of each kind.
_TEXT_GROUP: Final = (0, 1, 2, 2, 4, 5, 6, 7, 8, 9, 9, 11, 11, 13, 14, 15, 15, 17, 18)
_END_TOKEN: Final = re.compile(r"\.(?=\s|%|\Z)")


class Span(NamedTuple):
    """A stretch of text: file name, first line and column, last line and column (all from 1)."""

    name: str
    line: int
    column: int
    end_line: int
    end_column: int

    def __str__(self) -> str:
        return f"{self.name}:{self.line}"


class Source:
    """A text with its name, for finding lines and columns."""

    __slots__ = ("_line_starts", "name", "text")

    def __init__(self, text: str, name: str) -> None:
        self.text = text
        self.name = name
        self._line_starts: list[int] | None = None

    def position(self, offset: int) -> tuple[int, int]:
        """Return the line and column, both from 1, of a character."""
        starts = self._line_starts
        if starts is None:
            starts = self._line_starts = [0, *(match.end() for match in re.finditer("\n", self.text))]
        line = bisect_right(starts, offset)
        return line, offset - starts[line - 1] + 1

    def span(self, start: int, end: int) -> Span:
        """Return the stretch from `start` up to but not including `end`."""
        return Span(self.name, *self.position(start), *self.position(end))

    def error(self, message: str, start: int, end: int) -> PrologSyntaxError:
        """Return a syntax error about the characters from `start` up to `end`."""
        line, column = self.position(start)
        place = Struct("file", (Atom(self.name), line, column))
        ball = Struct("error", (Struct("syntax_error", (Atom(message),)), place))
        first = start - column + 1
        line_text = self.text[first : _line_end(self.text, first)]
        width = max(1, end - start)
        return PrologSyntaxError(
            ball, file=self.name, line=line, column=column, source=line_text.rstrip("\r"), width=width
        )


_LITERAL: Final = re.compile(
    rf"0'(?:''|\\.|[^\\])|'(?:[^'\\]|''|{_ESCAPE})*'|\"(?:[^\"\\]|{_ESCAPE})*\"|`(?:[^`\\]|{_ESCAPE})*`|.",
    re.DOTALL,
)


def _convert(text: str, conversions: dict[str, str]) -> str:
    """Return the text with its unquoted characters converted, of the same length."""
    return _LITERAL.sub(lambda match: conversions.get(match[0], match[0]), text)


class Tokens:
    """The tokens of a text, one clause at a time."""

    __slots__ = ("_conversions", "_iso", "_matches", "_meter", "_text", "offset", "source")

    def __init__(self, source: Source, flags: Flags, meter: Meter | None = None) -> None:
        self.source = source
        self._meter = meter
        self.offset = 0
        self._iso = flags.iso
        self._conversions: dict[str, str] = {}
        self._text = source.text
        self._matches: Iterator[re.Match[str]] | None = None
        self.follow(flags)

    def follow(self, flags: Flags) -> None:
        """Adapt to the present flags: ISO's syntax or SWI-Prolog's, and conversions of characters."""
        if flags.iso != self._iso:
            self._iso, self._matches = flags.iso, None
        active = flags.active_conversions
        if active != self._conversions:
            self._conversions, self._matches = dict(active), None
            read, rest = self.source.text[: self.offset], self.source.text[self.offset :]
            self._text = read + _convert(rest, active)

    def clause(self) -> list[Token]:
        """Return the tokens up to and including the next end, or up to the end of the text.

        Raises:
            PrologSyntaxError: text that is not a token; the next call continues after the next end token.
        """
        if self._matches is None:
            self._matches = token_pattern(self._iso).finditer(self._text, self.offset)
        tokens: list[Token] = []
        append, group = tokens.append, _TEXT_GROUP
        for match in self._matches:
            kind = match.lastindex or EOF
            text_group = group[kind]
            append((kind, match[text_group], match.start(text_group)))
            if kind == END or kind >= EOF:
                self.offset = match.end()
                break
            if not len(tokens) % _REPORT and self._meter is not None:
                self._meter.spend(_STEPS)
        if not tokens:
            tokens.append((EOF, "", len(self.source.text)))
        if tokens[-1][0] == ERROR:
            self._fail(*tokens[-1][1:])
        return tokens

    def _fail(self, char: str, start: int) -> NoReturn:
        """Raise an error for a character that begins no token, after moving past the next end token."""
        text = self.source.text
        message, end = f"unexpected character {char!r}", start + 1
        if text.startswith("/*", start):
            message, self.offset = UNCLOSED_COMMENT, len(text)
        else:
            if char in _REASONS:
                message, end = _REASONS[char], _line_end(text, start)
                tab = text.find("\t", start, end)
                if self._iso and tab > start and char not in text[start + 1 : tab]:
                    message, start, end = "tab in quoted text: expected \\t", tab, tab + 1
            resume = _END_TOKEN.search(text, start)
            self.offset = resume.end() if resume else len(text)
        self._matches = None
        raise self.source.error(message, start, end)


# The unit of reports to the meter, in tokens and in steps of a walk.
_REPORT: Final = 1024
_STEPS: Final = 4 * _REPORT

UNCLOSED_COMMENT: Final = "end of file in a block comment: expected */"
_REASONS: Final = {
    "'": "quoted atom is not closed on its line: expected '",
    '"': 'string is not closed on its line: expected "',
    "`": "back-quoted text is not closed on its line: expected `",
}


def _line_end(text: str, start: int) -> int:
    end = text.find("\n", start)
    return len(text) if end < 0 else end


_ISO_ESCAPES: Final = {
    "a": "\a", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "v": "\v",
    "\\": "\\", "'": "'", '"': '"', "`": "`", "\n": "",
}  # fmt: skip
_SWI_ESCAPES: Final = {**_ISO_ESCAPES, "e": "\x1b", "s": " ", "0": "\0", "z": ""}
_ESCAPE_PARTS: Final = re.compile(r"\\(?:x([0-9a-fA-F]+)(\\?)|([0-7]+)(\\?)|u([0-9a-fA-F]{4})|([\s\S]))")
_MAX_CODE: Final = 0x10FFFF


def unquote(text: str, quote: str, iso: bool) -> str:
    """Return the characters of the text between two quotes.

    Raises:
        ValueError: an escape sequence that does not exist, with its reason.
    """
    if quote in text:
        text = text.replace(quote * 2, quote)
    if "\\" not in text:
        return text
    return _ESCAPE_PARTS.sub(lambda match: _escape(match, iso), text)


def _escape(match: re.Match[str], iso: bool) -> str:
    hexadecimal, hex_end, octal, octal_end, unicode, char = match.groups()
    if char is not None:
        known = (_ISO_ESCAPES if iso else _SWI_ESCAPES).get(char)
        if known is None:
            raise ValueError(f"undefined escape sequence \\{char}")
        return known
    if unicode is not None:
        if iso:
            raise ValueError("undefined escape sequence \\u")
        return chr(int(unicode, 16))
    if iso and not (hex_end or octal_end):
        raise ValueError(f"escape sequence {match[0]} is not closed: expected \\")
    code = int(hexadecimal, 16) if hexadecimal is not None else int(octal, 8)
    if code > _MAX_CODE:
        raise ValueError(f"escape sequence {match[0]}: no such character")
    return chr(code)


_RADIX: Final = {"x": 16, "o": 8, "b": 2}


def parse_float(text: str) -> float:
    """Return the value of a float's text.

    Raises:
        ValueError: the value is too large for a float.
    """
    if text.endswith(("Inf", "NaN")):
        return math.inf if text.endswith("Inf") else math.nan
    value = float(text)
    if math.isinf(value):
        raise ValueError("float is too large")
    return value


def parse_special(text: str, iso: bool) -> int:
    """Return the value of a character code (``0'a``), a number in another base (``0x1F``) or ``16'FF``.

    Raises:
        ValueError: an undefined escape sequence, or digits outside the base.
    """
    base, quote, rest = text.partition("'")
    if quote and base == "0":
        return ord("'" if rest == "''" else unquote(rest, "'", iso))
    if quote:
        return parse_digits(rest, int(base))
    return parse_digits(text[2:], _RADIX[text[1]])
