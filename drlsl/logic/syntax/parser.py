"""Parse one term from its tokens: an operator precedence parser with an explicit stack, for any depth.

Source: ISO 13211-1 6.3 (terms) with Cor.2; each method quotes its grammar rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NoReturn

from drlsl.logic.errors import resource_error
from drlsl.logic.limits import Meter
from drlsl.logic.syntax.flags import Flags
from drlsl.logic.syntax.tokens import (
    BACKQUOTED,
    END,
    EOF,
    FRACTION,
    INTEGER,
    LETTER,
    LETTER_OPEN,
    PUNCTUATION,
    QUOTED,
    QUOTED_OPEN,
    SPECIAL,
    STRING,
    SYMBOL,
    SYMBOL_OPEN,
    VARIABLE,
    WORD,
    WORD_OPEN,
    Source,
    Span,
    Token,
    parse_float,
    parse_special,
    unquote,
)
from drlsl.logic.terms import CURLY, NIL, Atom, Operators, Struct, Term, Var, make_list, parse_digits

_OPEN_KINDS: Final = frozenset({WORD_OPEN, SYMBOL_OPEN, QUOTED_OPEN, LETTER_OPEN})
_NAME_KINDS: Final = frozenset({WORD, SYMBOL, QUOTED, LETTER}) | _OPEN_KINDS
_OPERAND_KINDS: Final = _OPEN_KINDS | {VARIABLE, INTEGER, FRACTION, SPECIAL, STRING, BACKQUOTED}

# Terms whose arguments are goals: the reader keeps the offset of each argument, for explanations.
_CONTROL: Final = frozenset({":-", "-->", ",", ";", "->", "*->", "|", "\\+"})
_META: Final = frozenset(
    {"\\+", "call", "not", "once", "ignore", "forall", "findall", "bagof", "setof", "catch"}
)

# The unit of reports to the meter, in tokens and in steps of a walk.
_REPORT: Final = 1024
_STEPS: Final = 4 * _REPORT
_FEW_DIGITS: Final = 4000
_TOP_PRIORITY: Final = 1200
_ARGUMENT_PRIORITY: Final = 999
_ATOM_PRIORITY: Final = 1201
_FRAME_PRIORITY: Final = 10000


@dataclass(slots=True)
class ReadTerm:
    """A term that was read, with its variables by name (in order of appearance) and its place.

    `singletons` names the variables that appear once and do not begin with ``_``. `positions` maps the ``id``
    of a control term (``,``, ``:-``, ``->``, ``\\+``, findall ...) to the offsets where its arguments begin;
    `place` turns them into lines.
    """

    term: Term
    variables: dict[str, Var]
    singletons: list[str]
    span: Span
    source: Source
    positions: dict[int, tuple[int, ...]] = field(default_factory=dict)

    def place(self, control: Struct, index: int) -> Span | None:
        """Return the place of argument `index` of a control term of this term; None if unknown."""
        offsets = self.positions.get(id(control))
        return None if offsets is None else self.source.span(offsets[index], offsets[index])


NUMBERS: Final[dict[int, Callable[[str, bool], int | float]]] = {
    INTEGER: lambda text, iso: parse_digits(text),
    FRACTION: lambda text, iso: parse_float(text),
    SPECIAL: parse_special,
}

# A pending operator: priority, the right argument's maximum, name, arity, where its text begins. A pending
# bracket is such a tuple of arity 0: its maximum is that of the terms inside, its name the functor, if any.
_Pending = tuple[int, int, str, int, int]

_FUNCTOR, _GROUP, _LIST, _TAIL, _CURLY, _WHOLE = "f(", "(", "[", "[|", "{", ""
_OPENING: Final = {_FUNCTOR: "(", _GROUP: "(", _LIST: "[", _TAIL: "[", _CURLY: "{"}
_CLOSING: Final = {_FUNCTOR: ")", _GROUP: ")", _LIST: "]", _TAIL: "]", _CURLY: "}", _WHOLE: "."}


_Handler = Callable[[str, int], bool]


class Parser:
    """Parses the tokens of one term after the other.

    `values` holds operands, `pending` the operators and brackets around them, `inside` the open brackets
    (their kind, and the number of values below). `priority` is that of the last value. A handler takes a
    token's text and offset and returns whether an operand must come next.
    """

    def __init__(
        self, source: Source, operators: Operators, flags: Flags, meter: Meter | None = None
    ) -> None:
        self.source = source
        self.meter = meter
        self.operators = operators
        self.flags = flags
        self.operand_handlers = self._handlers(
            self._name, self._open, self._operand_punctuation, self._no_operand
        )
        self.operand_handlers[VARIABLE] = self._variable
        self.operand_handlers[INTEGER] = self._integer
        self.operand_handlers[FRACTION] = self._fraction
        self.operand_handlers[SPECIAL] = self._special
        self.operand_handlers[STRING] = self._string
        self.operand_handlers[BACKQUOTED] = self._back_quoted
        self.operator_handlers = self._handlers(
            self._infix, self._infix_open, self._operator_punctuation, self._no_operator
        )
        self.operator_handlers[END] = self.operator_handlers[EOF] = self._end

    def _handlers(
        self, name: _Handler, name_open: _Handler, punctuation: _Handler, other: _Handler
    ) -> list[_Handler]:
        """Return handlers by token kind for the kinds that operand and operator position share."""
        handlers = [other] * (EOF + 1)
        handlers[WORD] = handlers[SYMBOL] = name
        handlers[WORD_OPEN] = handlers[SYMBOL_OPEN] = name_open
        handlers[QUOTED] = self._unquoted(name)
        handlers[QUOTED_OPEN] = self._unquoted(name_open)
        handlers[LETTER] = self._letter(name, other)
        handlers[LETTER_OPEN] = self._letter(name_open, other)
        handlers[PUNCTUATION] = punctuation
        return handlers

    def _unquoted(self, handler: _Handler) -> _Handler:
        return lambda text, start: handler(self._characters(text, start, "'"), start)

    def _letter(self, handler: _Handler, other: _Handler) -> _Handler:
        """Return the handler of a word with a letter beyond ASCII first: a capital begins a variable."""
        capital = self._variable if handler == self._name else other
        return lambda text, start: (capital if text[0].isupper() or text[0].istitle() else handler)(
            text, start
        )

    def parse(self, tokens: list[Token]) -> ReadTerm:
        """Return the term of the tokens of one clause.

        term = operand { operator operand } end, with brackets and operators kept on explicit stacks.
        """
        self.tokens = tokens
        self.at = 0
        self.strict = self.flags.iso
        self.prefix, self.infix = self.operators.prefix, self.operators.infix
        self.variables: dict[str, Var] = {}
        self.once: set[str] = set()
        self.values: list[Term] = []
        self.starts: list[int] = []
        self.priority = 0
        self.pending: list[_Pending] = [(_FRAME_PRIORITY, _TOP_PRIORITY, "", 0, tokens[0][2])]
        self.inside: list[tuple[str, int]] = [(_WHOLE, 0)]
        self.positions: dict[int, tuple[int, ...]] = {}
        self.minus = -1
        self.functor = ""
        operand, operator = self.operand_handlers, self.operator_handlers
        wants_operand = True
        for kind, text, start in tokens:
            self.at += 1
            if not self.at % _REPORT and self.meter is not None:
                self.meter.spend(_STEPS)
            wants_operand = (operand if wants_operand else operator)[kind](text, start)
        single = [name for name in self.variables if name in self.once and name[0] != "_"]
        span = self.source.span(tokens[0][2], tokens[-1][2])
        return ReadTerm(self.values[0], self.variables, single, span, self.source, self.positions)

    # Operands.

    def _push(self, value: Term, start: int, priority: int = 0) -> bool:
        self.values.append(value)
        self.starts.append(start)
        self.priority = priority
        return False

    def _variable(self, text: str, start: int) -> bool:
        """Read: term = variable; each ``_`` is a variable of its own."""
        if text == "_":
            return self._push(Var(), start)
        known = self.variables.get(text)
        if known is None:
            known = self.variables[text] = Var(text)
            self.once.add(text)
        else:
            self.once.discard(text)
        return self._push(known, start)

    def _number(self, value: int | float, start: int) -> bool:
        """Read: term = number | - number."""
        if self.minus >= 0:
            value, start, self.minus = -value, self.minus, -1
        return self._push(value, start)

    def _integer(self, text: str, start: int) -> bool:
        return self._number(int(text) if len(text) < _FEW_DIGITS else self._long(text, start), start)

    def _long(self, text: str, start: int) -> int | float:
        return self._value(lambda digits: parse_digits(digits, meter=self.meter), text, start)

    def _fraction(self, text: str, start: int) -> bool:
        return self._number(self._value(parse_float, text, start), start)

    def _special(self, text: str, start: int) -> bool:
        return self._number(
            self._value(lambda digits: parse_special(digits, self.strict), text, start), start
        )

    def _value(self, convert: Callable[[str], int | float], text: str, start: int) -> int | float:
        try:
            return convert(text)
        except ValueError as error:
            self._fail(str(error), start, text)
        except OverflowError:
            raise resource_error("memory") from None

    def _characters(self, text: str, start: int, quote: str) -> str:
        try:
            return unquote(text, quote, self.strict)
        except ValueError as error:
            self._fail(str(error), start, text)

    def _string(self, text: str, start: int) -> bool:
        """Read: term = double quoted list; the flag double_quotes decides its type (6.3.7)."""
        value = self._characters(text, start, '"')
        kind = self.flags.double_quotes
        if kind == "string":
            return self._push(value, start - 1)
        if kind == "atom":
            return self._push(Atom(value), start - 1)
        return self._push(make_list(map(ord if kind == "codes" else Atom, value)), start - 1)

    def _back_quoted(self, text: str, start: int) -> bool:
        """Read a list of codes, as in SWI-Prolog; ISO leaves back-quoted text undefined."""
        if self.strict:
            self._fail("back-quoted text is undefined while the flag iso is true", start, text)
        return self._push(make_list(map(ord, self._characters(text, start, "`"))), start - 1)

    def _name(self, text: str, start: int) -> bool:
        """Read: term = atom | - number | prefix-operator term.

        An atom that is an operator has priority 1201 (6.3.1.3), so it is not an operand without brackets.
        """
        kind, following, _ = self.tokens[self.at]
        if text == "-" and kind in NUMBERS:
            self.minus = start
            return True
        entry = self.prefix.get(text)
        if entry is not None and self._begins_operand(kind, following):
            self.pending.append((entry[0], entry[1], text, 1, start))
            return True
        is_operator = entry is not None or text in self.infix or text in self.operators.postfix
        return self._push(Atom(text), start, _ATOM_PRIORITY if is_operator and self.strict else 0)

    def _begins_operand(self, kind: int, text: str) -> bool:
        """Return whether a token after a prefix operator begins its argument."""
        if kind in _OPERAND_KINDS:
            return True
        if kind == PUNCTUATION:
            return text in "([{"
        if kind not in _NAME_KINDS:
            return False
        if kind == QUOTED:
            text = self._characters(text, self.tokens[self.at][2], "'")
        return text in self.prefix or not (text in self.infix or text in self.operators.postfix)

    def _open(self, text: str, start: int) -> bool:
        """Read: term = functor ( arguments )."""
        self.pending.append((_FRAME_PRIORITY, _ARGUMENT_PRIORITY, text, 0, start))
        self.inside.append((_FUNCTOR, len(self.values)))
        return True

    def _operand_punctuation(self, text: str, start: int) -> bool:
        """Read: term = ( term ) | [ items ] | { term } | [] | {}."""
        if text == "(":
            if self.functor:
                self.functor, name = "", self.functor
                return self._open(name, start - 2)
            return self._bracket(_GROUP, _TOP_PRIORITY, start)
        if text == "[":
            return self._bracket(_LIST, _ARGUMENT_PRIORITY, start)
        if text == "{":
            return self._bracket(_CURLY, _TOP_PRIORITY, start)
        opening = {"]": "[", "}": "{"}.get(text, "")
        if not opening or self.at < 2 or self.tokens[self.at - 2][:2] != (PUNCTUATION, opening):
            self._no_operand(text, start)
        return self._empty(opening + text, start)

    def _bracket(self, kind: str, inner: int, start: int) -> bool:
        self.pending.append((_FRAME_PRIORITY, inner, "", 0, start))
        self.inside.append((kind, len(self.values)))
        return True

    def _empty(self, name: str, start: int) -> bool:
        """Read: atom = [ ] | { }, which may be a functor as well."""
        opened = self.pending.pop()[4]
        self.inside.pop()
        kind, following, at = self.tokens[self.at]
        if kind == PUNCTUATION and following == "(" and at == start + 1:
            self.functor = name
            return True
        return self._push(NIL if name == "[]" else CURLY, opened)

    # Operators.

    def _infix(self, text: str, start: int) -> bool:
        """Read: term = term infix-operator term | term postfix-operator."""
        entry = self.infix.get(text)
        if entry is None:
            return self._postfix(text, start)
        priority, left, right = entry
        if self.pending[-1][1] < priority:
            self._reduce(priority, left, start, text)
        elif self.priority > left:
            self._clash(text, left, start)
        self.pending.append((priority, right, text, 2, start))
        return True

    def _infix_open(self, text: str, start: int) -> bool:
        """Read an infix operator with a bracketed operand right after it, as in ``a-(b)``."""
        if text not in self.infix:
            self._no_operator(text, start)
        self._infix(text, start)
        return self._bracket(_GROUP, _TOP_PRIORITY, start + len(text))

    def _postfix(self, text: str, start: int) -> bool:
        entry = self.operators.postfix.get(text)
        if entry is None:
            return self._no_operator(text, start)
        priority, argument = entry
        self._reduce(priority, argument, start, text)
        self.values[-1] = Struct(text, (self.values[-1],))
        self.priority = priority
        return False

    def _reduce(self, priority: int, left: int, start: int, text: str) -> None:
        """Build the pending terms that cannot hold an operator of this priority as their right argument."""
        pending = self.pending
        while pending[-1][1] < priority:
            if pending[-1][0] > left:
                self._clash(text, left, start)
            self._build(pending.pop())
        if self.priority > left:
            self._clash(text, left, start)

    def _build(self, operator: _Pending) -> None:
        """Apply an operator to the last values."""
        priority, right, name, arity, start = operator
        if self.priority > right and (self.strict or self.priority == _ATOM_PRIORITY):
            self._clash(name, right, start)
        values, starts = self.values, self.starts
        if arity == 2:
            argument, argument_start = values.pop(), starts.pop()
            term = values[-1] = Struct(name, (values[-1], argument))
            if name in _CONTROL:
                self.positions[id(term)] = (starts[-1], argument_start)
        else:
            term = values[-1] = Struct(name, (values[-1],))
            if name in _CONTROL:
                self.positions[id(term)] = (starts[-1],)
            starts[-1] = start
        self.priority = priority

    def _close(self) -> _Pending:
        """Build all within the innermost bracket and check its contents."""
        pending = self.pending
        while pending[-1][3]:
            self._build(pending.pop())
        frame = pending[-1]
        if self.priority > frame[1] and self.priority != _ATOM_PRIORITY:
            value = self.values[-1]
            self._clash(value.name if isinstance(value, Struct) else "", frame[1], self.starts[-1])
        return frame

    def _operator_punctuation(self, text: str, start: int) -> bool:
        kind = self.inside[-1][0]
        if text == ",":
            if kind in (_FUNCTOR, _LIST):
                self._close()
                return True
            if kind == _TAIL:
                self._no_operator(text, start)
            return self._infix(text, start)
        if text == "|":
            return self._bar(kind, start)
        if text != _CLOSING[kind]:
            self._no_operator(text, start)
        if kind == _FUNCTOR:
            return self._close_functor()
        if kind == _GROUP:
            opened = self._close()[4]
            self.pending.pop()
            self.inside.pop()
            self.starts[-1] = opened
            self.priority = 0
            return False
        return self._close_list(kind) if text == "]" else self._close_curly()

    def _bar(self, kind: str, start: int) -> bool:
        """Read the bar before a list's tail, or an infix operator (Cor.2)."""
        if kind == _LIST:
            self._close()
            self.inside[-1] = (_TAIL, self.inside[-1][1])
            return True
        if kind == _TAIL or "|" not in self.infix:
            self._no_operator("|", start)
        return self._infix("|", start)

    def _close_functor(self) -> bool:
        """Read: term = functor ( argument , ... )."""
        _, _, name, _, start = self._close()
        self.pending.pop()
        base = self.inside.pop()[1]
        values, starts = self.values, self.starts
        term = Struct(name, tuple(values[base:]))
        if name in _META or name in _CONTROL:
            self.positions[id(term)] = tuple(starts[base:])
        del values[base:], starts[base:]
        return self._push(term, start)

    def _close_list(self, kind: str) -> bool:
        """Read: term = [ item , ... ] | [ item , ... | tail ]."""
        start = self._close()[4]
        self.pending.pop()
        base = self.inside.pop()[1]
        values = self.values
        result: Term = values.pop() if kind == _TAIL else NIL
        while len(values) > base:
            result = Struct(".", (values.pop(), result))
        del self.starts[base:]
        return self._push(result, start)

    def _close_curly(self) -> bool:
        """Read: term = { term }."""
        start = self._close()[4]
        self.pending.pop()
        self.inside.pop()
        self.starts.pop()
        return self._push(Struct("{}", (self.values.pop(),)), start)

    def _end(self, text: str, start: int) -> bool:
        if self.inside[-1][0] != _WHOLE:
            self._no_operator(text, start)
        self._close()
        return False

    # Errors.

    def _fail(self, message: str, start: int, text: str) -> NoReturn:
        raise self.source.error(message, start, start + max(1, len(text)))

    def _clash(self, name: str, maximum: int, start: int) -> NoReturn:
        if self.priority == _ATOM_PRIORITY:
            value = self.values[-1]
            atom = value.name if isinstance(value, Atom) else ""
            self._fail(f"operator {atom} as an operand: expected ({atom})", self.starts[-1], atom)
        if self.pending[-1][3] == 0 and self.pending[-1][1] == _ARGUMENT_PRIORITY <= maximum:
            self._fail(f"operator {name} in an argument: expected brackets around the term", start, name)
        self._fail(
            f"an operand of operator {name} binds too loosely: expected brackets around it", start, name
        )

    def _no_operand(self, text: str, start: int) -> bool:
        self._unexpected("a term", text, start)

    def _no_operator(self, text: str, start: int) -> bool:
        bracket = self.inside[-1][0]
        more = ", ',', '|' or" if bracket == _LIST else ", ',' or" if bracket == _FUNCTOR else " or"
        self._unexpected(f"an operator{more} '{_CLOSING[bracket]}'", text, start)

    def _unexpected(self, wanted: str, text: str, start: int) -> NoReturn:
        """Raise the error: the token found, what was expected, and the bracket that is still open."""
        kind = self.tokens[self.at - 1][0]
        found = {END: "end of clause", EOF: "end of text"}.get(kind, f"'{text}'")
        bracket = self.inside[-1][0]
        if bracket and (kind in (END, EOF) or text in ")]}"):
            frame = next(item for item in reversed(self.pending) if item[3] == 0)
            line, column = self.source.position(frame[4])
            wanted += f" ('{_OPENING[bracket]}' is open since line {line}, column {column})"
        self._fail(f"unexpected {found}: expected {wanted}", start, text)
