"""Terms as text: one iterative writer behind write/1, writeq/1, write_canonical/1 and error messages."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Final

from drlsl.logic.terms.digits import Costs, decimal_digits
from drlsl.logic.terms.operators import Operators
from drlsl.logic.terms.term import NIL, Atom, CyclicTerm, Struct, Term, Var, deref, is_acyclic

# Source: ISO 13211-1 6.4.2 (name tokens); letters and symbols beyond ASCII follow SWI-Prolog.
_WORD: Final = re.compile(r"[^\W\d_]\w*")
_PLAIN_ATOM: Final = re.compile(r"[a-z]\w*|[#$&*+\-./:<=>?@^~\\]+|[^\x00-\x7f\w\s]+|\[\]|\{\}|!|;")
_SYMBOL: Final = frozenset("#$&*+-./:<=>?@^~\\")
_ESCAPES: Final = {
    "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r",
    "\a": "\\a", "\b": "\\b", "\f": "\\f", "\v": "\\v",
}  # fmt: skip
_STEPS_OF_TASK: Final = 4
_ARGUMENT: Final = 999
_ANY: Final = 1200
# The number of tasks between two reports to the meter, and that from which on a term may be cyclic.
_REPORT: Final = 1024
_LONG: Final = 100_000

_Task = str | tuple[Term, int, int]


def format_atom(name: str) -> str:
    """Return the atom's text as it can be read back: quoted if necessary."""
    if _PLAIN_ATOM.fullmatch(name) and not name.startswith("/*") and name != ".":
        return name
    if _WORD.fullmatch(name) and name.isidentifier() and not (name[0].isupper() or name[0].istitle()):
        return name
    return _quote(name, "'")


def _quote(text: str, quote: str) -> str:
    if text.isprintable() and quote not in text and "\\" not in text:
        return quote + text + quote
    pieces = [quote]
    for char in text:
        if char == quote:
            pieces.append("\\" + quote)
        elif char in _ESCAPES:
            pieces.append(_ESCAPES[char])
        elif char.isprintable():
            pieces.append(char)
        else:
            pieces.append(f"\\x{ord(char):x}\\")
    pieces.append(quote)
    return "".join(pieces)


def format_float(value: float) -> str:
    """Return the shortest text that reads back as the same float; it always holds a dot."""
    if math.isfinite(value):
        mantissa, _, exponent = repr(value).partition("e")
        if not exponent:
            return mantissa
        dot = "" if "." in mantissa else ".0"
        return f"{mantissa}{dot}e{int(exponent)}"
    if math.isnan(value):
        return "1.5NaN"
    return "1.0Inf" if value > 0 else "-1.0Inf"


def variable_name(variable: Var) -> str:
    """Return a name that no other living variable has."""
    return f"_G{id(variable) >> 4}"


def format_term(
    term: Term,
    operators: Operators,
    *,
    quoted: bool = False,
    ignore_ops: bool = False,
    numbervars: bool = False,
    max_depth: int = 0,
    variable_names: Mapping[int, str] | None = None,
    spacing: bool = False,
    priority: int = _ANY,
    meter: Costs | None = None,
    most: int = 0,
) -> str:
    """Return the text of a term.

    `max_depth` 0 means no bound; below it, subterms are written as ``...``. `variable_names` maps
    ``id(variable)`` to a name. `spacing` puts a space after the comma between arguments. A term above
    `priority` is bracketed. With `most`, a text of many more tokens ends in ``...``.

    Raises:
        CyclicTerm: The term is infinite.
        LimitExceeded: Writing it goes beyond the limits that `meter` keeps.

    Source: ISO 13211-1 7.10.5 with Cor.2.
    """
    style = _Style(operators, quoted, ignore_ops, numbervars, max_depth, variable_names or {}, spacing)
    return _Writer(style, meter, most).write(term, priority)


class _Style:
    __slots__ = ("comma", "ignore_ops", "max_depth", "names", "numbervars", "operators", "quoted")

    def __init__(
        self,
        operators: Operators,
        quoted: bool,
        ignore_ops: bool,
        numbervars: bool,
        max_depth: int,
        names: Mapping[int, str],
        spacing: bool,
    ) -> None:
        self.operators, self.quoted, self.ignore_ops = operators, quoted, ignore_ops
        self.numbervars, self.max_depth, self.names = numbervars, max_depth, names
        self.comma = ", " if spacing else ","

    def atom(self, name: str) -> str:
        return format_atom(name) if self.quoted else name


class _Writer:
    """Turns tasks (tokens to emit, terms to expand) into text, last task first; nothing here recurses."""

    def __init__(self, style: _Style, meter: Costs | None, most: int) -> None:
        self.style = style
        self.meter = meter
        self.most = most
        self.done = 0
        self.size = 0  # of the long tokens
        self.pieces: list[str] = []
        self.last = ""
        self.tasks: list[_Task] = []

    def write(self, term: Term, priority: int) -> str:
        tasks = self.tasks
        tasks.append((term, priority, 1))
        left = self.most or _REPORT
        while tasks:
            left -= 1
            if not left:
                left = _REPORT
                if self.most:
                    self.pieces.append(" ...")
                    break
                self._report(_REPORT, term)
            task = tasks.pop()
            if type(task) is str:
                self._emit(task)
            else:
                self._expand(*task)
        self._weigh(self.size)
        return "".join(self.pieces)

    def _weigh(self, size: int) -> None:
        """Check that there is memory for a text."""
        if self.meter is not None:
            self.meter.text(size)

    def _report(self, steps: int, term: Term) -> None:
        """Account for steps, and check once that a long walk is finite."""
        if self.meter is not None:
            self.meter.spend(_STEPS_OF_TASK * steps)
        before, self.done = self.done, self.done + steps
        if before < _LONG <= self.done and not is_acyclic(term):
            raise CyclicTerm("the term contains itself")

    def _emit(self, token: str) -> None:
        """Append a token, after a space if it would run into the previous one."""
        if not token:
            return
        last, first = self.last, token[0]
        if last and _run_together(last, first):
            self.pieces.append(" ")
        self.pieces.append(token)
        self.last = token[-1]
        if len(token) > _REPORT:
            self.size += len(token)
            self._weigh(len(token))

    def _expand(self, term: Term, priority: int, depth: int) -> None:
        term = deref(term)
        style = self.style
        if isinstance(term, Struct):
            if style.max_depth and depth > style.max_depth:
                self._emit("...")
            else:
                self._compound(term, priority, depth)
        elif isinstance(term, Atom):
            # A message needs only the beginning of a long name.
            self._emit(style.atom(term.name[:_LONG] if self.most else term.name))
        elif isinstance(term, Var):
            self._emit(style.names.get(id(term)) or variable_name(term))
        elif isinstance(term, int):
            if self.most and term.bit_length() > _LONG:
                self._emit(f"<an integer of {term.bit_length()} bits>")
            else:
                self._emit(decimal_digits(term, self.meter))
        elif isinstance(term, float):
            self._emit(format_float(term))
        else:
            text = term[:_LONG] if self.most else term
            self._emit(_quote(text, '"') if style.quoted else text)

    def _operand(self, term: Term, priority: int, depth: int) -> _Task:
        """Return the task of writing an operand; an operator as an atom is bracketed there (6.3.1.3)."""
        term = deref(term)
        if isinstance(term, Atom) and self.style.operators.is_operator(term.name):
            return f"({self.style.atom(term.name)})"
        return term, priority, depth + 1

    def _compound(self, term: Struct, priority: int, depth: int) -> None:
        name, args, style = term.name, term.args, self.style
        if style.numbervars and name == "$VAR" and len(args) == 1:
            number = deref(args[0])
            if isinstance(number, int) and number >= 0:
                more = decimal_digits(number // 26, self.meter) if number > 25 else ""
                self._emit(chr(65 + number % 26) + more)
                return
        if name == "." and len(args) == 2 and not style.ignore_ops:
            self._list(term, depth)
        elif style.ignore_ops or len(args) > 2:
            self._canonical(name, args, depth)
        elif name == "{}" and len(args) == 1:
            self.tasks += ("}", (args[0], _ANY, depth + 1), "{")
        elif len(args) == 2 and name in style.operators.infix:
            self._infix(name, args, priority, depth)
        elif len(args) == 1 and name in style.operators.prefix:
            self._prefix(name, args[0], priority, depth)
        elif len(args) == 1 and name in style.operators.postfix:
            self._postfix(name, args[0], priority, depth)
        else:
            self._canonical(name, args, depth)

    def _canonical(self, name: str, args: tuple[Term, ...], depth: int) -> None:
        """Write functor(argument, ...)."""
        tasks = self.tasks
        tasks.append(")")
        for index in range(len(args) - 1, 0, -1):
            tasks.append((args[index], _ARGUMENT, depth + 1))
            tasks.append(self.style.comma)
        tasks.append((args[0], _ARGUMENT, depth + 1))
        tasks.append(self.style.atom(name) + "(")

    def _list(self, cell: Struct, depth: int) -> None:
        """Write [item, ... | tail]; `max_depth` bounds the number of items, too."""
        work: list[_Task] = ["["]
        limit = self.style.max_depth
        tail: Term = cell
        while isinstance(tail, Struct) and tail.name == "." and len(tail.args) == 2:
            if limit and depth + len(work) // 2 > limit:
                work[-1] = "|"
                work.append("...")
                tail = NIL
                break
            work.append((tail.args[0], _ARGUMENT, depth + 1))
            work.append(self.style.comma)
            tail = deref(tail.args[1])
            if len(work) % _REPORT == 1:
                self._report(_REPORT, tail)
        if tail is not NIL:
            work[-1] = "|"
            work.append((tail, _ARGUMENT, depth + 1))
            work.append("]")
        elif work[-1] == "...":
            work.append("]")
        else:
            work[-1] = "]"
        self.tasks.extend(reversed(work))

    def _bracketed(self, priority: int, own: int, work: list[_Task]) -> None:
        if own > priority:
            work = ["(", *work, ")"]
        self.tasks.extend(reversed(work))

    def _infix(self, name: str, args: tuple[Term, ...], priority: int, depth: int) -> None:
        own, left, right = self.style.operators.infix[name]
        if name == ",":
            token = self.style.comma
        elif name == "|":
            token = "|"
        else:
            token = self.style.atom(name)
        left = self._limit(args[0], left, own)
        work = [self._operand(args[0], left, depth), token, self._operand(args[1], right, depth)]
        self._bracketed(priority, own, work)

    def _prefix(self, name: str, argument: Term, priority: int, depth: int) -> None:
        """Write a prefix operator; a number after a minus is bracketed, since ``- 1`` reads as a number."""
        own, maximum = self.style.operators.prefix[name]
        token = self.style.atom(name)
        argument = deref(argument)
        work: list[_Task]
        opening = self._opening(argument, maximum)
        if name == "-" and opening == "0":
            work = [token, " (", (argument, _ANY, depth + 1), ")"]
        elif opening == "(":
            work = [token, " ", self._operand(argument, maximum, depth)]
        else:
            work = [token, self._operand(argument, maximum, depth)]
        self._bracketed(priority, own, work)

    def _postfix(self, name: str, argument: Term, priority: int, depth: int) -> None:
        own, maximum = self.style.operators.postfix[name]
        maximum = self._limit(argument, maximum, own)
        self._bracketed(priority, own, [self._operand(argument, maximum, depth), self.style.atom(name)])

    def _limit(self, operand: Term, maximum: int, priority: int) -> int:
        """Return the highest priority of an operand before an operator without brackets.

        It is 0 if the operator would be read as part of the operand's last operand, as in ``(fy 1)yf``.
        """
        operators = self.style.operators
        term, own_maximum = deref(operand), maximum
        while isinstance(term, Struct) and not (term.name == "." and len(term.args) == 2):
            arity = len(term.args)
            if arity == 2 and term.name in operators.infix:
                own, _, right = operators.infix[term.name]
            elif arity == 1 and term.name in operators.prefix and term.name != "{}":
                own, right = operators.prefix[term.name]
            else:
                break
            if own > own_maximum:
                break
            if right >= priority:
                return 0
            self._report(1, operand)
            term, own_maximum = deref(term.args[-1]), right
        return maximum

    def _opening(self, term: Term, maximum: int) -> str:
        """Return the beginning of an operand's text: ``(``, ``0`` for any digit, or nothing relevant."""
        operators = self.style.operators
        whole = term
        while isinstance(term, Struct):
            self._report(1, whole)
            operand = self._left_operand(term)
            if operand is None:
                is_prefix = len(term.args) == 1 and term.name in operators.prefix and term.name != "{}"
                return "(" if is_prefix and operators.prefix[term.name][0] > maximum else ""
            own, left = (operators.infix if len(term.args) == 2 else operators.postfix)[term.name][:2]
            if own > maximum:
                return "("
            term, maximum = deref(operand), self._limit(operand, left, own)
        if isinstance(term, Atom):
            return "(" if operators.is_operator(term.name) else ""
        if isinstance(term, float):
            return "0" if math.copysign(1.0, term) > 0 else ""
        return "0" if isinstance(term, int) and term >= 0 else ""

    def _left_operand(self, term: Struct) -> Term | None:
        """Return the first operand of a compound written with an infix or postfix operator, else None."""
        style, name, arity = self.style, term.name, len(term.args)
        if style.ignore_ops or (name == "." and arity == 2) or (name == "{}" and arity == 1):
            return None
        if arity == 2 and name in style.operators.infix:
            return term.args[0]
        if arity == 1 and name not in style.operators.prefix and name in style.operators.postfix:
            return None if style.numbervars and name == "$VAR" else term.args[0]
        return None


def _run_together(last: str, first: str) -> bool:
    """Return whether two tokens, with the characters `last` and `first` between, read as one."""
    if last.isalnum() or last == "_":
        return first.isalnum() or first == "_" or (first == "'" and last.isdigit())
    if last in _SYMBOL:
        return first in _SYMBOL
    if last in "'\"":
        return first == last
    return not last.isascii() and not first.isascii() and not last.isspace() and not first.isspace()
