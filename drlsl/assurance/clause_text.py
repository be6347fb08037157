"""The positions of a clause's parts in its text: the head, the goals, their arguments, the operators."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from drlsl.logic import Engine, syntax
from drlsl.logic.core import GOAL_ARGUMENTS, Clause
from drlsl.logic.terms import Operators

CONTROL: Final = frozenset({",", ";", "->", "*->", "|"})
"""Separators between goals."""

_OPEN: Final = frozenset({syntax.WORD_OPEN, syntax.SYMBOL_OPEN, syntax.QUOTED_OPEN, syntax.LETTER_OPEN})


@dataclass(frozen=True)
class Range:
    """The tokens from `first` up to and without `end`."""

    first: int
    end: int

    def __len__(self) -> int:
        return self.end - self.first

    def holds(self, other: Range) -> bool:
        """Return whether it includes all tokens of another range."""
        return self.first <= other.first and other.end <= self.end


@dataclass(frozen=True)
class Call:
    """The head or a goal: its tokens, and those of each argument of its functor."""

    tokens: Range
    arguments: tuple[Range, ...] = ()


@dataclass(frozen=True, eq=False)
class ClauseText:
    """A clause of a loaded program with the text that it was read from.

    `number` counts the clauses of its predicate from 1; `start` is the offset of its text in `source`.
    """

    clause: Clause
    number: int
    source: syntax.Source
    start: int
    tokens: Sequence[syntax.Token]

    @property
    def predicate(self) -> str:
        """Name and arity."""
        name, arity = self.clause.predicate.indicator
        return f"{name}/{arity}"

    @property
    def text(self) -> str:
        """The clause, with its end token."""
        return self.source.text[self.start : self.tokens[-1][2] + 1]

    @cached_property
    def neck(self) -> int:
        """The index of ``:-``, or of the end token of a fact."""
        ends = [n for n, token in enumerate(self.tokens) if token[:2] == (syntax.SYMBOL, ":-")]
        return ends[0] if ends else len(self.tokens) - 1

    @cached_property
    def head(self) -> Call:
        """The head and its arguments."""
        return self._call(Range(0, self.neck))

    @cached_property
    def goals(self) -> tuple[Call, ...]:
        """The goals of the body, outer ones before the goals inside them."""
        end = len(self.tokens) - 1
        return tuple(self._goals(Range(min(self.neck + 1, end), end)))

    def offset(self, index: int) -> int:
        """Return the offset of a token in the source."""
        return self.tokens[index][2]

    def stretch(self, part: Range) -> tuple[int, int]:
        """Return the offsets of the start and the end of tokens in the source."""
        start = self.offset(part.first)
        return start, start + len(self.source.text[start : self.offset(part.end)].rstrip())

    def _goals(self, body: Range) -> Iterator[Call]:
        for part in self._split(body, CONTROL):
            if len(part) == 0:
                continue
            first = self.tokens[part.first]
            if first[:2] == (syntax.SYMBOL, "\\+"):
                yield Call(part)
                yield from self._goals(Range(part.first + 1, part.end))
            elif first[:2] == (syntax.PUNCTUATION, "(") and self._closing(part.first) == part.end - 1:
                yield from self._goals(Range(part.first + 1, part.end - 1))
            else:
                call = self._call(part)
                yield call
                inner = GOAL_ARGUMENTS.get((first[1], len(call.arguments)), ())
                for index in inner:
                    yield from self._goals(call.arguments[index])

    def _call(self, part: Range) -> Call:
        """Return a head or goal, with the arguments of a functor that is followed only by brackets."""
        if len(part) and self.tokens[part.first][0] in _OPEN and self._closing(part.first) == part.end - 1:
            inside = Range(part.first + 1, part.end - 1)
            return Call(part, tuple(self._split(inside, frozenset({","}))))
        return Call(part)

    def _split(self, part: Range, separators: frozenset[str]) -> Iterator[Range]:
        """Yield the ranges between separators that are outside all brackets."""
        first = index = part.first
        while index < part.end:
            kind, text, _ = self.tokens[index]
            if kind in _OPEN or (kind == syntax.PUNCTUATION and text in "([{"):
                index = self._closing(index)
            elif text in separators and kind in (syntax.PUNCTUATION, syntax.SYMBOL):
                yield Range(first, index)
                first = index + 1
            index += 1
        yield Range(first, part.end)

    def _closing(self, opening: int) -> int:
        """Return the index of the bracket that closes the opening one."""
        depth = 0
        for index in range(opening, len(self.tokens)):
            kind, text, _ = self.tokens[index]
            if kind in _OPEN or (kind == syntax.PUNCTUATION and text in "([{"):
                depth += 1
            elif kind == syntax.PUNCTUATION and text in ")]}":
                depth -= 1
                if depth == 0:
                    return index
        raise AssertionError("the reader has accepted the clause, so its brackets are closed")

    def is_infix(self, index: int) -> bool:
        """Return whether an operator has an operand on its left."""
        kind, text, _ = self.tokens[index - 1]
        operand = kind in (syntax.VARIABLE, syntax.INTEGER, syntax.FRACTION) or (
            kind == syntax.WORD and text not in _WORD_OPERATORS
        )
        return index > 0 and (operand or (kind == syntax.PUNCTUATION and text in ")]}"))


_WORD_OPERATORS: Final = frozenset({name for name in Operators().infix if name.isalpha()})


def clause_texts(engine: Engine, files: Sequence[Path] = ()) -> list[ClauseText]:
    """Return the clauses of a program that were read from a text, in the order of files and lines.

    With `files`, only the clauses of these files and those that they include, not of the rules they build on.
    """
    wanted = set(map(str, files))
    found = []
    for key in engine.predicates():
        for number, clause in enumerate(engine.clauses(*key), 1):
            if isinstance(clause.origin, syntax.ReadTerm) and (clause.source in wanted or not wanted):
                found.append(_with_text(clause, number, clause.origin))
    names = list(dict.fromkeys(each.source.name for each in found))
    return sorted(found, key=lambda each: (names.index(each.source.name), each.start))


def _with_text(clause: Clause, number: int, read: syntax.ReadTerm) -> ClauseText:
    source = read.source
    tokens = syntax.Tokens(source, syntax.Flags())
    tokens.offset = _offset(source, read.span.line, read.span.column)
    found = tokens.clause()
    return ClauseText(clause, number, source, found[0][2], found)


def _offset(source: syntax.Source, line: int, column: int) -> int:
    start = 0
    for _ in range(line - 1):
        start = source.text.index("\n", start) + 1
    return start + column - 1
