"""Mutants of a rule program: each is one clause with one slip that a rule author could make.

A mutant changes the text of a clause, so that it can be shown as a person would have typed it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, TypeAlias

from drlsl.assurance.clause_text import Call, ClauseText, Range
from drlsl.logic.core import copy_term, undo, unify
from drlsl.logic.syntax import FRACTION, INTEGER, SYMBOL, SYMBOL_OPEN, VARIABLE, WORD, WORD_OPEN

Edit: TypeAlias = tuple[int, int, str]
"""Start and end of a stretch of a source, and its replacement."""

_COMPARISONS: Final[Mapping[str, tuple[str, ...]]] = {
    "<": ("=<", ">=", ">"),
    "=<": ("<", ">", ">="),
    ">": (">=", "=<", "<"),
    ">=": (">", "<", "=<"),
    "=:=": ("=\\=",),
    "=\\=": ("=:=",),
    "==": ("\\==",),
    "\\==": ("==",),
    "=": ("\\=",),
    "\\=": ("=",),
    "@<": ("@>=",),
    "@>": ("@=<",),
    "@=<": ("@>",),
    "@>=": ("@<",),
}
"""Comparisons off by the boundary, and reversed with and without it."""

_INFIX: Final = {"+": "-", "-": "+", "*": "/", "/": "*"}
_FUNCTIONS: Final = {"min": "max", "max": "min", "abs": "", "sqrt": ""}
_OPPOSITES: Final = (("left", "right"), ("front", "back"), ("x", "y"), ("min", "max"))

SCALE: Final = 1.1
KMH_PER_MPS: Final = 3.6


@dataclass(frozen=True, eq=False)
class Mutant:
    """A clause with a slip: the kind of slip, and the edits of its source; none of them drops the clause.

    `swapped` is the clause of the same predicate that it changes places with, for slips of order.
    """

    kind: str
    clause: ClauseText
    edits: tuple[Edit, ...] = ()
    around: Range | None = None
    swapped: ClauseText | None = None

    @property
    def offset(self) -> int:
        """The offset of the slip in the source."""
        return self.edits[0][0] if self.edits else self.clause.start

    @property
    def place(self) -> str:
        """File, line and column of the slip."""
        line, column = self.clause.source.position(self.offset)
        return f"{self.clause.source.name}:{line}:{column}"

    @property
    def text(self) -> str | None:
        """The changed clause, as it would be in the file; None if there is none or none is changed."""
        if not self.edits:
            return None
        return self._edited(self.clause.start, self.clause.start + len(self.clause.text))

    @property
    def before(self) -> str:
        """The text that the slip changes: the goal or the head around it, or the whole clause."""
        return _one_line(self.clause.source.text[slice(*self._shown())])

    @property
    def after(self) -> str:
        """The text with the slip; empty if the clause is left out or moved."""
        return _one_line(self._edited(*self._shown())) if self.edits else ""

    @property
    def change(self) -> str:
        """The slip in one line."""
        if self.swapped is not None:
            return f"moved behind clause {self.swapped.number}"
        return f"{self.before} ==> {self.after}" if self.edits else "left out"

    @property
    def name(self) -> str:
        """The unique name of this mutant in the program, independent of its line numbers."""
        return f"{self.clause.predicate} clause {self.clause.number}: {self.change}"

    def _shown(self) -> tuple[int, int]:
        if self.around is not None:
            return self.clause.stretch(self.around)
        return self.clause.start, self.clause.start + len(self.clause.text)

    def _edited(self, start: int, end: int) -> str:
        parts, at = [], start
        for first, last, new in sorted(self.edits):
            parts += [self.clause.source.text[at:first], new]
            at = last
        return "".join([*parts, self.clause.source.text[at:end]])


def _one_line(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def mutants_of(clauses: Sequence[ClauseText]) -> list[Mutant]:
    """Return every mutant of these clauses, each text once, in the order of the sources."""
    words = _Words(clauses)
    seen: set[tuple[ClauseText, str]] = set()
    found = []
    for clause in clauses:
        for mutant in [*_slips(clause, words), *_whole(clause, clauses)]:
            key = (clause, mutant.text or mutant.change)
            if key not in seen and mutant.text != clause.text:
                seen.add(key)
                found.append(mutant)
    return found


class _Words:
    """The atoms that occur in each argument of each predicate, and the names of predicates."""

    def __init__(self, clauses: Sequence[ClauseText]) -> None:
        self._standing: dict[tuple[str, int, int], list[str]] = defaultdict(list)
        self._atoms: set[str] = set()
        self._predicates: set[tuple[str, int]] = set()
        for clause in clauses:
            for call in (clause.head, *clause.goals):
                name, arity = clause.tokens[call.tokens.first][1], len(call.arguments)
                self._predicates.add((name, arity))
                for place, argument in enumerate(call.arguments):
                    kind, text, _ = clause.tokens[argument.first]
                    if len(argument) == 1 and kind == WORD:
                        self._atoms.add(text)
                        if text not in self._standing[name, arity, place]:
                            self._standing[name, arity, place].append(text)

    def atoms_for(self, atom: str, name: str, arity: int, place: int) -> Iterator[str]:
        """Yield atoms that an argument could be confused with: its opposites, and another one used there."""
        yield from (word for word in opposites(atom) if word in self._atoms)
        standing = self._standing[name, arity, place]
        yield standing[(standing.index(atom) + 1) % len(standing)]

    def predicates_for(self, name: str, arity: int) -> Iterator[str]:
        """Yield the opposites of a predicate's name that the program has."""
        yield from (word for word in opposites(name) if (word, arity) in self._predicates)


def opposites(name: str) -> Iterator[str]:
    """Yield the name with left for right, front for back, and so on."""
    words = name.split("_")
    for one, other in _OPPOSITES:
        swapped = "_".join({one: other, other: one}.get(word, word) for word in words)
        if swapped != name:
            yield swapped


def _slips(clause: ClauseText, words: _Words) -> Iterator[Mutant]:
    """Yield the slips inside a clause; the innermost goal around each is shown."""
    for call in (clause.head, *clause.goals):
        inside = {
            index
            for other in clause.goals
            if other.tokens != call.tokens and call.tokens.holds(other.tokens)
            for index in range(other.tokens.first, other.tokens.end)
        }
        own = [index for index in range(call.tokens.first, call.tokens.end) if index not in inside]
        for index in own:
            yield from _token_slips(clause, call, index)
        yield from _swapped_operands(clause, call, own)
        yield from _other_variables(clause, call, own)
        yield from _argument_slips(clause, call, words)
        if call is not clause.head:
            yield from _goal_slips(clause, call, words)


def _token_slips(clause: ClauseText, call: Call, index: int) -> Iterator[Mutant]:
    """Yield mutants with another operator or another constant."""
    kind, text, start = clause.tokens[index]
    if kind in (INTEGER, FRACTION):
        yield from _constants(clause, call, index)
    elif kind == WORD_OPEN and index > call.tokens.first and text in _FUNCTIONS:
        yield Mutant("function", clause, ((start, start + len(text), _FUNCTIONS[text]),), call.tokens)
    elif kind in (SYMBOL, SYMBOL_OPEN):
        if text == "\\+":
            yield Mutant("negation", clause, ((start, clause.offset(index + 1), ""),), call.tokens)
        elif not clause.is_infix(index):
            if text == "-":
                yield Mutant("sign", clause, ((start, start + 1, ""),), call.tokens)
        elif text in _INFIX:
            yield Mutant("operator", clause, ((start, start + 1, _INFIX[text]),), call.tokens)
        else:
            for other in _COMPARISONS.get(text, ()):
                yield Mutant("comparison", clause, ((start, start + len(text), other),), call.tokens)


def _constants(clause: ClauseText, call: Call, index: int) -> Iterator[Mutant]:
    """Yield mutants with a constant that is off, has the other sign, is 0, or is in km/h."""
    kind, text, start = clause.tokens[index]
    signed = clause.tokens[index - 1][:2] == (SYMBOL, "-") and not clause.is_infix(index - 1)
    value: int | float
    others: list[int | float]
    if kind == INTEGER:
        value = int(text)
        others = [value + 1, value - 1, 0, -value]
    else:
        value = float(text)
        others = [value * SCALE, value / SCALE, value + 1.0, value - 1.0, 0.0, -value]
        others += [0.1, -0.1] if value == 0 else [value * KMH_PER_MPS, value / KMH_PER_MPS]
    for other in dict.fromkeys(others):
        if other != value and not (signed and other < 0):
            new = f"{other:.6g}" if kind == INTEGER or "." in f"{other:.6g}" else f"{other:.1f}"
            yield Mutant("constant", clause, ((start, start + len(text), new),), call.tokens)


def _swapped_operands(clause: ClauseText, call: Call, own: Sequence[int]) -> Iterator[Mutant]:
    """Yield mutants with the operands of a difference or quotient of two variables swapped."""
    for index in own:
        kind, text, _ = clause.tokens[index]
        if kind == SYMBOL and text in "-/" and clause.is_infix(index):
            yield from _swap(clause, call, Range(index - 1, index), Range(index + 1, index + 2))


def _other_variables(clause: ClauseText, call: Call, own: Sequence[int]) -> Iterator[Mutant]:
    """Yield mutants of a comparison or evaluation with one of its variables in place of another."""
    if call.arguments or call is clause.head:
        return
    places = [index for index in own if clause.tokens[index][0] == VARIABLE]
    names = list(dict.fromkeys(clause.tokens[index][1] for index in places))
    for index in places:
        _, text, start = clause.tokens[index]
        other = names[(names.index(text) + 1) % len(names)]
        if other != text:
            yield Mutant("variable", clause, ((start, start + len(text), other),), call.tokens)


def _argument_slips(clause: ClauseText, call: Call, words: _Words) -> Iterator[Mutant]:
    """Yield mutants with two adjacent variables swapped, or an atom replaced."""
    for one, other in pairwise(call.arguments):
        yield from _swap(clause, call, one, other)
    name = clause.tokens[call.tokens.first][1]
    for place, argument in enumerate(call.arguments):
        kind, text, start = clause.tokens[argument.first]
        if len(argument) == 1 and kind == WORD:
            for other_atom in words.atoms_for(text, name, len(call.arguments), place):
                yield Mutant("atom", clause, ((start, start + len(text), other_atom),), call.tokens)


def _swap(clause: ClauseText, call: Call, one: Range, other: Range) -> Iterator[Mutant]:
    texts = []
    for part in (one, other):
        kind, text, _ = clause.tokens[part.first]
        if len(part) != 1 or kind != VARIABLE or text.startswith("_"):
            return
        texts.append(text)
    edits = tuple((*clause.stretch(part), text) for part, text in zip((other, one), texts, strict=True))
    yield Mutant("swap", clause, tuple(sorted(edits)), call.tokens)


def _goal_slips(clause: ClauseText, call: Call, words: _Words) -> Iterator[Mutant]:
    """Yield mutants with a goal left out, or replaced by its opposite."""
    start, end = clause.stretch(call.tokens)
    yield Mutant("goal", clause, ((start, end, "true"),), call.tokens)
    kind, name, _ = clause.tokens[call.tokens.first]
    if kind in (WORD, WORD_OPEN):
        for other in words.predicates_for(name, len(call.arguments)):
            yield Mutant("goal", clause, ((start, start + len(name), other),), call.tokens)


def _whole(clause: ClauseText, clauses: Sequence[ClauseText]) -> Iterator[Mutant]:
    """Yield mutants with a clause left out, or moved behind the next one if that could answer too."""
    yield Mutant("clause", clause)
    for other in clauses:
        same = other.clause.predicate is clause.clause.predicate
        if same and other.number == clause.number + 1 and _may_both_answer(clause, other):
            yield Mutant("order", clause, swapped=other)


def _may_both_answer(one: ClauseText, other: ClauseText) -> bool:
    """Return whether some call matches the heads of both."""
    trail: list[Any] = []
    matches = unify(copy_term(one.clause.head), copy_term(other.clause.head), trail)
    undo(trail, 0)
    return matches
