"""format/1, 2, 3: text from a template, with columns. Source: the manual of SWI-Prolog, section 4.32.2."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable

from drlsl.logic.builtins.arguments import prefix
from drlsl.logic.builtins.strings import text
from drlsl.logic.builtins.termio import emit, output_stream, pending_column, sink_maker
from drlsl.logic.builtins.text import any_text, check_size, is_code, join
from drlsl.logic.core import Caller, det, evaluate, to_float
from drlsl.logic.errors import (
    PrologError,
    error_from_term,
    existence_error,
    instantiation_error,
    representation_error,
    resource_error,
)
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, decimal_digits, deref, format_term

_DIRECTIVE = re.compile(r"~(?:(\*)|`([\s\S])|([0-9]+))?([\s\S]?)")
_STEPS_OF_DIRECTIVE = 8
# This many bits are divided by a small number in the time of a step.
_BITS_OF_STEP = 4096
_DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"


@det("format", 1)
def format_1(machine: Caller, template: Term) -> bool:
    return format_2(machine, template, NIL)


@det("format", 2)
def format_2(machine: Caller, template: Term, arguments: Term) -> bool:
    column = pending_column(machine, machine.output)
    return emit(machine, formatted(machine, template, arguments, column))


@det("format", 3)
def format_3(machine: Caller, sink: Term, template: Term, arguments: Term) -> bool:
    target = deref(sink)
    if isinstance(target, Struct):
        make = sink_maker(target)
        return machine.unify(target.args[0], make(machine, formatted(machine, template, arguments, 0)))
    stream = output_stream(machine, target)
    return emit(machine, formatted(machine, template, arguments, pending_column(machine, stream)), stream)


def formatted(machine: Caller, template: Term, arguments: Term, column: int) -> str:
    """Return the text of a template with its arguments, for output that begins at a column."""
    elements, tail = prefix(arguments, machine)
    given = elements if tail is NIL else [arguments]
    return _Format(machine, given, column).run(text(template, machine))


def _format_error(message: str) -> PrologError:
    return PrologError(Struct("error", (Struct("format", (message,)), Var())))


@det("print_message", 2)
def print_message(machine: Caller, kind: Term, message: Term) -> bool:
    """Write a message to ``user_error``; ``silent`` ones and those of loading are dropped."""
    level, what = deref(kind), deref(message)
    if isinstance(level, Var):
        raise instantiation_error()
    prefixes = {"error": "ERROR: ", "warning": "Warning: ", "informational": "% ", "information": "% "}
    if not isinstance(level, Atom) or level.name not in (*prefixes, "help", "banner"):
        return True
    if isinstance(what, Struct) and what.name == "format" and len(what.args) == 2:
        body = formatted(machine, what.args[0], what.args[1], 0)
    elif isinstance(what, Struct) and what.name == "error" and len(what.args) == 2:
        body = str(error_from_term(what))
    else:
        body = format_term(what, machine.operators, quoted=True, numbervars=True, meter=machine.meter)
    return emit(machine, prefixes.get(level.name, "") + body + "\n", sys.stderr)


class _Format:
    """One run over a template: the text so far, and the stops and fill points of the current column."""

    def __init__(self, machine: Caller, arguments: list[Term], column: int) -> None:
        self.machine = machine
        self.arguments = arguments
        self.used = 0
        self.done: list[str] = []  # text before the current column segment
        self.segment = ""
        self.fills: list[tuple[int, str]] = []  # where in the segment to pad, and with what
        self.start = column  # the column at which the segment begins
        self.last_stop = column

    def run(self, template: str) -> str:
        end = 0
        for match in _DIRECTIVE.finditer(template):
            self.machine.meter.spend(_STEPS_OF_DIRECTIVE)
            self._put(template[end : match.start()])
            end = match.end()
            self._directive(match)
        self._put(template[end:])
        if self.used < len(self.arguments):
            raise _format_error("too many arguments")
        return join(self.machine, [*self.done, self.segment])

    def _put(self, piece: str) -> None:
        check_size(self.machine, self.segment, piece)
        if "\n" in piece:
            before, _, piece = piece.rpartition("\n")
            self.done.append(self.segment + before + "\n")
            self.segment, self.fills, self.start, self.last_stop = "", [], 0, 0
        self.segment += piece

    def _next(self) -> Term:
        if self.used >= len(self.arguments):
            raise _format_error("not enough arguments")
        self.used += 1
        return deref(self.arguments[self.used - 1])

    def _directive(self, match: re.Match[str]) -> None:
        star, fill, digits, letter = match.groups()
        count: int | None = ord(fill) if fill else int(digits) if digits else None
        if star:
            value = self._next()
            if not isinstance(value, int) or value < 0:
                raise _format_error("no or negative integer for `*' argument")
            count = value
        if count is not None and not fill:
            self.machine.meter.text(4 * count)
        if letter in "|+":
            self._stop(letter, count)
        elif letter == "t":
            self.fills.append((len(self.segment), chr(count) if count is not None else " "))
        elif letter in _PLAIN:
            self._put(_PLAIN[letter] * (1 if count is None else count))
        elif letter == "N":
            self._put("\n" * (self.start + len(self.segment) > 0))
        elif letter == "i":
            self._next()
        elif letter in _CONVERSIONS:
            self._put(_CONVERSIONS[letter](self.machine, self._next(), count))
        else:
            raise existence_error("format_character", Atom(letter))

    def _stop(self, letter: str, count: int | None) -> None:
        """Set a column stop: pad the segment before it up to the column."""
        here = self.start + len(self.segment)
        if letter == "+":
            column = self.last_stop + (8 if count is None else count)
        else:
            column = here if count is None else count
        missing = column - here
        if missing > 0:
            self.segment = _padded(self.segment, self.fills or [(len(self.segment), " ")], missing)
        self.done.append(self.segment)
        self.start = self.start + len(self.segment)
        self.last_stop = max(column, self.start) if letter == "+" else self.start
        self.segment, self.fills = "", []


_PLAIN = {"~": "~", "n": "\n"}


def _padded(segment: str, fills: list[tuple[int, str]], missing: int) -> str:
    """Return the segment with `missing` characters spread over its fill points, the rest at the last one."""
    share, rest = divmod(missing, len(fills))
    pieces: list[str] = []
    end = 0
    for number, (place, char) in enumerate(fills):
        pieces += (segment[end:place], char * (share + (rest if number == len(fills) - 1 else 0)))
        end = place
    return "".join(pieces) + segment[end:]


def _argument_error(letter: str, value: Term) -> PrologError:
    return PrologError(Struct("error", (Struct("format_argument_type", (Atom(letter), value)), Var())))


def _integer(letter: str, value: Term) -> int:
    if isinstance(value, int):
        return value
    raise _argument_error(letter, value)


def _write(machine: Caller, value: Term, _count: int | None) -> str:
    return format_term(value, machine.operators, numbervars=True, meter=machine.meter)


def _writeq(machine: Caller, value: Term, _count: int | None) -> str:
    return format_term(value, machine.operators, quoted=True, numbervars=True, meter=machine.meter)


def _atom(machine: Caller, value: Term, _count: int | None) -> str:
    if isinstance(value, (Struct, Var)):
        raise _argument_error("a", value)
    return "[]" if value is NIL else any_text(value, machine) or ""


def _string(machine: Caller, value: Term, _count: int | None) -> str:
    return text(value, machine)


def _codes(_machine: Caller, value: Term, count: int | None) -> str:
    code = _integer("c", value)
    if not is_code(code):
        raise representation_error("character_code")
    return chr(code) * (1 if count is None else count)


def _decimal(machine: Caller, value: int, places: int | None, group: str) -> str:
    digits = decimal_digits(abs(value), machine.meter)
    fraction = ""
    if places:
        digits = digits.zfill(places + 1)
        digits, fraction = digits[:-places], "." + digits[-places:]
    if group:
        first = len(digits) % 3
        threes = [digits[place : place + 3] for place in range(first, len(digits), 3)]
        digits = group.join([digits[:first], *threes] if first else threes)
    return ("-" if value < 0 else "") + digits + fraction


def _integer_digits(machine: Caller, value: Term, count: int | None) -> str:
    return _decimal(machine, _integer("d", value), count, "")


def _grouped_digits(machine: Caller, value: Term, count: int | None) -> str:
    return _decimal(machine, _integer("D", value), count, ",")


def _float(letter: str) -> Callable[[Caller, Term, int | None], str]:
    def convert(machine: Caller, term: Term, count: int | None) -> str:
        number = evaluate(term, machine)
        places = 6 if count is None else count
        if places > _MOST_PLACES:
            raise resource_error("memory")
        if isinstance(number, int) and letter == "f":
            return decimal_digits(number, machine.meter) + ("." + "0" * places if places else "")
        value = to_float(number)
        return f"{value:.{places}{letter}}" if letter != "g" else f"{value:g}"

    return convert


# Python's own limit is INT_MAX; this is more than anybody reads.
_MOST_PLACES = 1_000_000


def _radix(upper: bool) -> Callable[[Caller, Term, int | None], str]:
    def convert(machine: Caller, value: Term, count: int | None) -> str:
        number = _integer("r", value)
        if count is None or not 2 <= count <= 36:
            raise _format_error("~r needs a radix from 2 to 36")
        digits: list[str] = []
        rest = abs(number)
        steps = rest.bit_length() // _BITS_OF_STEP
        while rest or not digits:
            machine.meter.spend(1 + steps)
            rest, digit = divmod(rest, count)
            digits.append(_DIGITS[digit])
        shown = "".join(reversed(digits))
        return ("-" if number < 0 else "") + (shown.upper() if upper else shown)

    return convert


_CONVERSIONS: dict[str, Callable[[Caller, Term, int | None], str]] = {
    "w": _write,
    "p": _writeq,
    "q": _writeq,
    "a": _atom,
    "s": _string,
    "c": _codes,
    "d": _integer_digits,
    "D": _grouped_digits,
    "e": _float("e"),
    "f": _float("f"),
    "g": _float("g"),
    "r": _radix(upper=False),
    "R": _radix(upper=True),
}
