"""Input and output of characters and terms: the standard streams and text in memory.

An engine opens no files: its streams are ``user_output`` (the machine's output), ``user_error`` and
``user_input``. Source: ISO 13211-1 8.11 to 8.14.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TextIO

from drlsl.logic.builtins.arguments import not_negative, prefix
from drlsl.logic.builtins.text import is_character
from drlsl.logic.core import FAIL, Caller, Task, control, cut, det, evaluate, term_variables
from drlsl.logic.core import Machine as Solver
from drlsl.logic.errors import (
    domain_error,
    existence_error,
    instantiation_error,
    permission_error,
    type_error,
)
from drlsl.logic.limits import Meter
from drlsl.logic.syntax import Flags, Reader, ReadTerm, is_complete
from drlsl.logic.terms import NIL, Atom, Operators, Struct, Term, Var, deref, format_term, make_list

END_OF_FILE = Atom("end_of_file")
_OUTPUTS = frozenset({"user_output", "current_output", "user_error"})
_INPUTS = frozenset({"user_input", "current_input"})


# Output streams.


def output_stream(machine: Caller, stream: Term) -> TextIO:
    """Return the stream of an alias."""
    name = _alias(stream)
    if name in _INPUTS:
        raise permission_error("output", "stream", deref(stream))
    return sys.stderr if name == "user_error" else machine.output


def _alias(stream: Term) -> str:
    stream = deref(stream)
    if isinstance(stream, Var):
        raise instantiation_error()
    if not isinstance(stream, Atom):
        raise domain_error("stream_or_alias", stream)
    if stream.name not in _OUTPUTS | _INPUTS:
        raise existence_error("stream", stream)
    return stream.name


def emit(machine: Caller, text: str, stream: TextIO | None = None) -> bool:
    """Write text and remember its last column, from which column stops of format/2 count."""
    target = machine.output if stream is None else stream
    machine.meter.text(len(text))
    target.write(text)
    column = len(text) - text.rfind("\n") - 1
    if column == len(text):
        column += pending_column(machine, target)
    machine.state["line"] = target, column
    return True


def pending_column(machine: Caller, stream: TextIO) -> int:
    """Return the number of characters written to a stream since its last newline, if known."""
    known: tuple[TextIO, int] | None = machine.state.get("line")
    return known[1] if known is not None and known[0] is stream else 0


@det("current_output", 1)
def current_output(machine: Caller, stream: Term) -> bool:
    return _current(machine, stream, "user_output")


@det("current_input", 1)
def current_input(machine: Caller, stream: Term) -> bool:
    return _current(machine, stream, "user_input")


def _current(machine: Caller, stream: Term, name: str) -> bool:
    known = deref(stream)
    if not isinstance(known, (Var, Atom)):
        raise domain_error("stream", known)
    return machine.unify(stream, Atom(name))


@det("flush_output", 0)
def flush_output(machine: Caller) -> bool:
    machine.output.flush()
    return True


@det("flush_output", 1)
def flush_stream(machine: Caller, stream: Term) -> bool:
    output_stream(machine, stream).flush()
    return True


def writes(name: str, arity: int) -> Callable[[Callable[..., str]], Callable[..., str]]:
    """Declare a builtin that writes the text that a function makes of the machine and the arguments.

    With one more argument, the first, it is written to the stream of that alias.
    """

    def register(text: Callable[..., str]) -> Callable[..., str]:
        det(name, arity)(lambda machine, *args: emit(machine, text(machine, *args)))
        det(name, arity + 1)(
            lambda machine, stream, *args: emit(machine, text(machine, *args), output_stream(machine, stream))
        )
        return text

    return register


writes("nl", 0)(lambda _machine: "\n")


@writes("put_char", 1)
def put_char(_machine: Caller, char: Term) -> str:
    char = deref(char)
    if isinstance(char, Var):
        raise instantiation_error()
    if not is_character(char):
        raise type_error("character", char)
    return char.name if isinstance(char, Atom) else ""


@writes("tab", 1)
def tab(machine: Caller, count: Term) -> str:
    number = not_negative(evaluate(count, machine))
    machine.meter.text(number)
    return " " * number


# Output of terms.


def _declare_write(name: str, newline: bool = False, **style: Any) -> None:
    end = "\n" if newline else ""
    writes(name, 1)(
        lambda machine, term: format_term(term, machine.operators, meter=machine.meter, **style) + end
    )


_declare_write("write", numbervars=True)
_declare_write("print", quoted=True, numbervars=True)
_declare_write("writeln", newline=True, numbervars=True)
_declare_write("writeq", quoted=True, numbervars=True)


def canonical(term: Term, operators: Operators, meter: Meter | None = None) -> str:
    """Return a term as by write_canonical/1: no operators, and variables named ``_1``, ``_2`` in order."""
    names = {id(variable): f"_{number}" for number, variable in enumerate(term_variables(term, meter), 1)}
    return format_term(term, operators, quoted=True, ignore_ops=True, variable_names=names, meter=meter)


writes("write_canonical", 1)(lambda machine, term: canonical(term, machine.operators, machine.meter))


@det("write_term", 2)
def write_term(machine: Caller, term: Term, options: Term) -> bool:
    """Source: ISO 13211-1 8.14.2 with Cor.3."""
    return emit(machine, _with_options(machine, term, options))


@det("write_term", 3)
def write_term_to(machine: Caller, stream: Term, term: Term, options: Term) -> bool:
    target = output_stream(machine, stream)
    return emit(machine, _with_options(machine, term, options), target)


_WRITE_SWITCHES = frozenset({"quoted", "ignore_ops", "numbervars"})
_WRITE_ENDS = {"fullstop": ".", "nl": "\n"}
_IGNORED_SWITCHES = frozenset(
    {"portray", "portrayed", "cycles", "attributes", "character_escapes", "dotlists"}
)


def _with_options(machine: Caller, term: Term, options: Term) -> str:
    style: dict[str, Any] = {}
    ends: dict[str, str] = {}
    for option in option_list(options):
        _read_write_option(option, style, ends)
    text = format_term(term, machine.operators, meter=machine.meter, **style)
    if "fullstop" in ends:
        text += " ." if text[-1:] in "#$&*+-./:<=>?@^~\\" else "."
    return text + ends.get("nl", "")


def option_list(options: Term) -> list[Term]:
    """Return the elements of a list of options, none of them a variable."""
    elements, tail = prefix(options)
    dereferenced = [deref(element) for element in elements]
    if isinstance(tail, Var) or any(isinstance(element, Var) for element in dereferenced):
        raise instantiation_error()
    if tail is not NIL:
        raise type_error("list", deref(options))
    return dereferenced


def _read_write_option(option: Term, style: dict[str, Any], ends: dict[str, str]) -> None:
    """Put the effect of one option of write_term/2 into `style` or `ends`."""
    if not isinstance(option, Struct) or len(option.args) != 1:
        raise domain_error("write_option", option)
    name, value = option.name, deref(option.args[0])
    if isinstance(value, Var):
        raise instantiation_error()
    truth = {"true": True, "false": False}.get(value.name) if isinstance(value, Atom) else None
    if name in _WRITE_SWITCHES and truth is not None:
        style[name] = truth
    elif name in _WRITE_ENDS and truth is not None:
        if truth:
            ends[name] = _WRITE_ENDS[name]
    elif name == "variable_names":
        style["variable_names"] = _variable_names(option, value)
    elif name == "max_depth" and isinstance(value, int):
        style["max_depth"] = value
    elif name == "priority" and isinstance(value, int):
        style["priority"] = value
    elif name == "spacing" and isinstance(value, Atom) and value.name in ("standard", "next_argument"):
        style["spacing"] = value.name == "next_argument"
    elif not (name in _IGNORED_SWITCHES and truth is not None):
        raise domain_error("write_option", option)


def _variable_names(option: Term, value: Term) -> dict[int, str]:
    """Return the names of a variable_names option; the first name given to a variable counts."""
    elements, tail = prefix(value)
    if isinstance(tail, Var):
        raise instantiation_error()
    names: dict[int, str] = {}
    for element in elements:
        element = deref(element)
        if isinstance(element, Var):
            raise instantiation_error()
        if not isinstance(element, Struct) or element.name != "=" or len(element.args) != 2:
            raise domain_error("write_option", option)
        name, variable = deref(element.args[0]), deref(element.args[1])
        if isinstance(name, Var):
            raise instantiation_error()
        if not isinstance(name, Atom):
            raise domain_error("write_option", option)
        if isinstance(variable, Var):
            names.setdefault(id(variable), name.name)
    if tail is not NIL:
        raise domain_error("write_option", option)
    return names


@control("with_output_to", 2)
def with_output_to(machine: Solver, args: Sequence[Term], continuation: Task) -> Task:
    """Prove a goal once and unify the sink with its output."""
    sink, goal = deref(args[0]), args[1]
    make = sink_maker(sink)
    before, buffer = machine.output, io.StringIO()
    machine.trail_call(lambda: setattr(machine, "output", before))
    machine.output = buffer
    return machine.call(goal, (_end_output, sink, make, buffer, before, len(machine.choices), continuation))


def _end_output(machine: Solver, task: Task) -> Task:
    _, sink, make, buffer, before, height, continuation = task
    cut(machine, height)
    machine.output = before
    machine.meter.text(buffer.tell())
    if not machine.unify(sink.args[0], make(machine, buffer.getvalue())):
        return FAIL
    next_task: Task = continuation
    return next_task


def sink_maker(sink: Term) -> Any:
    """Return the function by which a sink such as ``atom(A)`` turns text into a term."""
    if isinstance(sink, Var):
        raise instantiation_error()
    if not isinstance(sink, Struct) or len(sink.args) != 1 or sink.name not in _SINKS:
        raise domain_error("output_sink", sink)
    return _SINKS[sink.name]


def _listed(machine: Caller, elements: Iterable[Term], count: int) -> Term:
    machine.meter.make(count)
    return make_list(elements)


_SINKS: dict[str, Any] = {
    "atom": lambda machine, text: Atom(text),
    "string": lambda machine, text: text,
    "codes": lambda machine, text: _listed(machine, map(ord, text), len(text)),
    "chars": lambda machine, text: _listed(machine, map(Atom, text), len(text)),
}


# Input of terms and characters.


class Input:
    """The rest of a stream that terms and characters are read from."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.rest = ""

    def peek(self) -> str:
        """Return the next character, or the empty string at the end."""
        if not self.rest:
            self.rest = self.stream.readline()
        return self.rest[:1]

    def take(self) -> str:
        """Remove and return the next character."""
        char = self.peek()
        self.rest = self.rest[1:]
        return char

    def read(self, operators: Operators, flags: Flags, meter: Meter) -> ReadTerm | None:
        """Return the next term, or None at the end of the stream."""
        while not is_complete(self.rest, flags):
            line = self.stream.readline()
            if not line:
                break
            self.rest += line
        reader = Reader(self.rest, operators, flags, "user_input", meter)
        try:
            return next(reader, None)
        finally:
            self.rest = self.rest[reader.offset :]


def _input(machine: Caller, stream: Term | None = None) -> Input:
    if stream is not None and _alias(stream) in _OUTPUTS:
        raise permission_error("input", "stream", deref(stream))
    known: Input | None = machine.state.get("input")
    if known is None:
        known = machine.state["input"] = Input(sys.stdin)
    return known


def _reads(name: str, arity: int) -> Callable[[Callable[..., bool]], Callable[..., bool]]:
    """Declare a builtin that reads from the input that its function is given behind the machine.

    With one more argument, the first, it is the stream of that alias.
    """

    def register(read: Callable[..., bool]) -> Callable[..., bool]:
        det(name, arity)(lambda machine, *args: read(machine, _input(machine), *args))
        det(name, arity + 1)(lambda machine, stream, *args: read(machine, _input(machine, stream), *args))
        return read

    return register


@_reads("read", 1)
@_reads("read_term", 2)
def read(machine: Caller, source: Input, term: Term, options: Term = NIL) -> bool:
    """Source: ISO 13211-1 8.14.1."""
    wanted = option_list(options)
    for option in wanted:
        if not isinstance(option, Struct) or len(option.args) != 1 or option.name not in _READ_OPTIONS:
            raise domain_error("read_option", option)
    found = source.read(machine.operators, machine.flags, machine.meter)
    if found is None:
        return machine.unify(term, END_OF_FILE)
    return machine.unify(term, found.term) and all(
        machine.unify(option.args[0], _READ_OPTIONS[option.name](found))
        for option in wanted
        if isinstance(option, Struct)
    )


def _named(found: ReadTerm, names: Sequence[str]) -> Term:
    return make_list([Struct("=", (Atom(name), found.variables[name])) for name in names])


_READ_OPTIONS: dict[str, Any] = {
    "variables": lambda found: make_list(term_variables(found.term)),
    "variable_names": lambda found: _named(found, list(found.variables)),
    "singletons": lambda found: _named(found, found.singletons),
}

_reads("at_end_of_stream", 0)(lambda _machine, source: not source.peek())


def _declare_character(name: str, take: bool, code: bool) -> None:
    @_reads(name, 1)
    def get(machine: Caller, source: Input, term: Term) -> bool:
        char = source.take() if take else source.peek()
        if not char:
            return machine.unify(term, -1 if code else END_OF_FILE)
        return machine.unify(term, ord(char) if code else Atom(char))


_declare_character("get_char", take=True, code=False)
_declare_character("peek_char", take=False, code=False)
_declare_character("get_code", take=True, code=True)
_declare_character("peek_code", take=False, code=True)
