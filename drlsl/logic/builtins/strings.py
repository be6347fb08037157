"""Strings, and conversions between texts of any kind, as SWI-Prolog defines them.

A text argument is an atom, a string, a number or a list of characters or codes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final

from drlsl.logic.builtins.arguments import attempt, items, prefix
from drlsl.logic.builtins.text import (
    TRY,
    any_text,
    check_size,
    is_character,
    is_code,
    join,
    listed_text,
    number_text,
    sub_text,
)
from drlsl.logic.core import Caller, det, nondet
from drlsl.logic.errors import PrologSyntaxError, domain_error, instantiation_error, type_error
from drlsl.logic.syntax import ReadTerm, parse_number, read_term
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, format_term, make_list


def text(term: Term, machine: Caller | None = None) -> str:
    """Return the text of an argument.

    Raises:
        InstantiationError, PrologTypeError: a variable; a term that is not a text.
    """
    found = any_text(term, machine)
    if found is not None:
        return found
    term = deref(term)
    if isinstance(term, Var):
        raise instantiation_error()
    raise type_error("text", term)


def _atomic_text(term: Term, machine: Caller | None = None) -> str:
    term = deref(term)
    if isinstance(term, Var):
        raise instantiation_error()
    if isinstance(term, Struct):
        raise type_error("atomic", term)
    return "[]" if term is NIL else text(term, machine)


def _is_free(term: Term) -> bool:
    return isinstance(deref(term), Var)


@det("atom_number", 2)
def atom_number(machine: Caller, atom: Term, number: Term) -> bool:
    """Relate an atom and its number; fail if the atom is not the text of a number."""
    if not _is_free(atom):
        return _unify_number(machine, _atomic_text(atom, machine), number)
    return machine.unify(atom, Atom(number_text(_number(number), machine)))


@det("number_string", 2)
def number_string(machine: Caller, number: Term, string: Term) -> bool:
    """Relate a number and its string; fail if the string is not the text of a number."""
    if not _is_free(string):
        return _unify_number(machine, text(string, machine), number)
    return machine.unify(string, number_text(_number(number), machine))


@det("name", 2)
def name(machine: Caller, term: Term, codes: Term) -> bool:
    """Relate an atomic term and the codes of its text: a number if they can be read as one, else an atom."""
    codes = deref(codes)
    listed = codes if isinstance(codes, str) else listed_text(machine, codes, _check_either)
    if not _is_free(term):
        characters = _atomic_text(term, machine)
        machine.meter.make(len(characters))
        return machine.unify(codes, _codes(characters)) if listed is None else listed == characters
    if listed is None:
        raise instantiation_error()
    value = _number_of(machine, listed)
    return machine.unify(term, Atom(listed) if value is None else value)


def _check_either(term: Term) -> str:
    if isinstance(term, Atom) and is_character(term):
        return term.name
    if isinstance(term, int) and is_code(term):
        return chr(term)
    raise type_error("character_code", term)


def _unify_number(machine: Caller, characters: str, number: Term) -> bool:
    value = _number_of(machine, characters)
    return value is not None and machine.unify(number, value)


def _number_of(machine: Caller, characters: str) -> int | float | None:
    """Return the number of a text; None if it is not the text of a number."""
    if not characters[:1].isprintable() or characters[:1] == " " or characters[:2] in ("- ", "+-"):
        return None
    try:
        return parse_number(characters.removeprefix("+"), machine.flags, machine.meter)
    except PrologSyntaxError:
        return None


def _number(term: Term) -> int | float:
    term = deref(term)
    if isinstance(term, (int, float)):
        return term
    raise instantiation_error() if isinstance(term, Var) else type_error("number", term)


def _declare_conversion(name: str, first: Callable[[str], Term], second: Callable[[str], Term]) -> None:
    """Declare a relation of two texts with the same characters, each made by its function."""

    @det(name, 2)
    def conversion(machine: Caller, left: Term, right: Term) -> bool:
        given, make = (right, first) if _is_free(left) else (left, second)
        characters = text(given, machine)
        machine.meter.make(len(characters)) if make in (_codes, _chars) else check_size(machine, characters)
        return machine.unify(left if _is_free(left) else right, make(characters))


def _codes(characters: str) -> Term:
    return make_list([ord(char) for char in characters])


def _chars(characters: str) -> Term:
    return make_list([Atom(char) for char in characters])


def _string(characters: str) -> Term:
    return characters


_declare_conversion("atom_string", Atom, _string)
_declare_conversion("string_chars", _string, _chars)
_declare_conversion("string_codes", _string, _codes)
_declare_conversion("string_to_atom", _string, Atom)
_declare_conversion("text_to_string", _string, _string)


def _declare_change(name: str, change: Callable[[str], Term]) -> None:
    @det(name, 2)
    def changed(machine: Caller, given: Term, result: Term) -> bool:
        characters = text(given, machine)
        check_size(machine, characters)
        return machine.unify(result, change(characters))


_declare_change("string_length", len)
_declare_change("string_lower", str.lower)
_declare_change("string_upper", str.upper)
_declare_change("upcase_atom", lambda given: Atom(given.upper()))
_declare_change("downcase_atom", lambda given: Atom(given.lower()))


@det("string_code", 3)
def string_code(machine: Caller, index: Term, string: Term, code: Term) -> bool:
    """Unify with the code of the character at an index from 1; fail outside the string."""
    place = _number(index)
    characters = text(string, machine)
    if not isinstance(place, int):
        raise type_error("integer", place)
    if place < 0:
        raise domain_error("not_less_than_zero", place)
    return 1 <= place <= len(characters) and machine.unify(code, ord(characters[place - 1]))


def _concat(
    machine: Caller, first: Term, second: Term, whole: Term, make: Callable[[str], Term]
) -> Iterator[bool]:
    if not _is_free(first) and not _is_free(second):
        left, right = _atomic_text(first, machine), _atomic_text(second, machine)
        check_size(machine, left, right)
        if machine.unify(whole, make(left + right)):
            yield True
        return
    characters = _atomic_text(whole, machine)
    for cut in range(len(characters) + 1):
        machine.meter.text(TRY + 3 * len(characters))
        left, right = characters[:cut], characters[cut:]
        if not _is_free(first) and _atomic_text(first) != left:
            continue
        if not _is_free(second) and _atomic_text(second) != right:
            continue
        parts = (make(left) if _is_free(first) else first, make(right) if _is_free(second) else second)
        if attempt(machine, Struct("-", (first, second)), Struct("-", parts)):
            yield cut == len(characters)


@nondet("string_concat", 3)
def string_concat(machine: Caller, first: Term, second: Term, whole: Term) -> Iterator[bool]:
    return _concat(machine, first, second, whole, _string)


@nondet("text_concat", 3)
def text_concat(machine: Caller, first: Term, second: Term, whole: Term) -> Iterator[bool]:
    """Behave as string_concat/3, with a string as result only if one of the arguments is one."""
    string = any(isinstance(deref(part), str) for part in (first, second, whole))
    return _concat(machine, first, second, whole, _string if string else Atom)


@nondet("sub_string", 5)
def sub_string(
    machine: Caller, string: Term, before: Term, length: Term, after: Term, sub: Term
) -> Iterator[bool]:
    known: Term = sub if _is_free(sub) else text(sub, machine)
    return sub_text(machine, text(string, machine), before, length, after, known, _string)


@det("split_string", 4)
def split_string(machine: Caller, string: Term, separators: Term, pad: Term, parts: Term) -> bool:
    """Split at each separator and strip the characters of `pad` from both ends of each part.

    A run of separators that are also padding counts as one.
    """
    given, split_at, strip = text(string, machine), text(separators, machine), text(pad, machine)
    check_size(machine, given)
    rest = given.strip(strip) if strip else given
    pieces: list[Term] = []
    begin = 0
    if split_at:
        skipped = f"[{re.escape(strip)}]*" if strip else ""
        for match in re.finditer(f"[{re.escape(split_at)}]{skipped}", rest):
            machine.meter.spend(2)
            piece = rest[begin : match.start()]
            pieces.append(piece.rstrip(strip) if strip else piece)
            begin = match.end()
    pieces.append(rest[begin:])
    machine.meter.make(len(pieces))
    return machine.unify(parts, make_list(pieces))


@det("atomic_list_concat", 2)
def atomic_list_concat(machine: Caller, parts: Term, whole: Term) -> bool:
    return machine.unify(whole, Atom(_joined(machine, "", items(parts, machine))))


def _joined(machine: Caller, between: str, parts: list[Term]) -> str:
    """Return the texts of atomic terms with a text between them."""
    texts: list[str] = []
    for part in parts:
        texts.append(_atomic_text(part, machine))
        machine.meter.spend(1)
    return join(machine, texts, between)


@det("atomic_list_concat", 3)
def atomic_list_concat_separated(machine: Caller, parts: Term, separator: Term, whole: Term) -> bool:
    """Join atomic terms with a separator, or split an atom at a separator that is not empty."""
    between = _atomic_text(separator, machine)
    elements, tail = prefix(parts, machine)
    if tail is NIL and not any(_is_free(element) for element in elements):
        return machine.unify(whole, Atom(_joined(machine, between, elements)))
    if _is_free(whole):
        raise instantiation_error()
    if not between:
        raise domain_error("non_empty_atom", deref(separator))
    text = _atomic_text(whole, machine)
    machine.meter.make(2 * text.count(between))  # an atom and a cell each
    return machine.unify(parts, make_list(map(Atom, text.split(between))))


def _read(machine: Caller, characters: Term) -> ReadTerm:
    """Return the term of a text."""
    return read_term(text(characters, machine), machine.operators, machine.flags, "user", machine.meter)


def written(machine: Caller, term: Term) -> str:
    """Return a term as writeq/1 writes it."""
    return format_term(term, machine.operators, quoted=True, numbervars=True, meter=machine.meter)


def _declare_term_text(name: str, make: Callable[[str], Term]) -> None:
    @det(name, 2)
    def term_text(machine: Caller, term: Term, characters: Term) -> bool:
        if _is_free(characters):
            return machine.unify(characters, make(written(machine, term)))
        return machine.unify(term, _read(machine, characters).term)


_declare_term_text("term_to_atom", Atom)
_declare_term_text("term_string", _string)


@det("read_term_from_atom", 3)
def read_term_from_atom(machine: Caller, atom: Term, term: Term, _options: Term) -> bool:
    return machine.unify(term, _read(machine, atom).term)


@det("atom_to_term", 3)
def atom_to_term(machine: Caller, atom: Term, term: Term, bindings: Term) -> bool:
    """Unify with the term of a text, and with its variables as ``Name = Variable``."""
    read = _read(machine, atom)
    named = [Struct("=", (Atom(name), variable)) for name, variable in read.variables.items()]
    return machine.unify(term, read.term) and machine.unify(bindings, make_list(named))


@nondet("char_type", 2)
def char_type(machine: Caller, char: Term, kind: Term) -> Iterator[bool]:
    return _classify(machine, char, kind, Atom)


@nondet("code_type", 2)
def code_type(machine: Caller, code: Term, kind: Term) -> Iterator[bool]:
    return _classify(machine, code, kind, ord)


_LATIN: Final = 256  # the last character that char_type(-, +) tries
_CLASSES: Final[dict[str, Callable[[str], bool]]] = {
    "alnum": str.isalnum,
    "alpha": lambda char: char.isalnum() or char == "_",
    "csym": lambda char: char.isalnum() or char == "_",
    "csymf": lambda char: char.isalpha() or char == "_",
    "digit": lambda char: char in "0123456789",
    "graph": lambda char: char.isprintable() and not char.isspace(),
    "lower": str.islower,
    "upper": str.isupper,
    "punct": lambda char: char.isprintable() and not char.isspace() and not char.isalnum(),
    "space": str.isspace,
    "white": lambda char: char in " \t",
    "end_of_line": lambda char: char in "\n\v\f\r",
}


def _classify(machine: Caller, subject: Term, kind: Term, make: Callable[[str], Term]) -> Iterator[bool]:
    subject, kind = deref(subject), deref(kind)
    if isinstance(kind, Var):
        raise instantiation_error()
    if isinstance(subject, Var):
        for code in range(_LATIN):
            if _belongs(machine, chr(code), kind, make) and machine.unify(subject, make(chr(code))):
                yield False
        return
    char = chr(subject) if is_code(subject) and isinstance(subject, int) else text(subject)
    if len(char) != 1:
        raise type_error("character", subject)
    if _belongs(machine, char, kind, make):
        yield True


def _belongs(machine: Caller, char: str, kind: Term, make: Callable[[str], Term]) -> bool:
    if isinstance(kind, Atom) and kind.name in _CLASSES:
        return _CLASSES[kind.name](char)
    if isinstance(kind, Struct) and len(kind.args) == 1:
        return _relates(machine, char, kind, make)
    raise domain_error("char_type", kind)


def _relates(machine: Caller, char: str, kind: Struct, make: Callable[[str], Term]) -> bool:
    """Relate a character by digit(Weight), to_lower(Lower), to_upper(Upper), upper(Lower), lower(Upper)."""
    argument = kind.args[0]
    if kind.name == "digit":
        return char in "0123456789" and machine.unify(argument, int(char))
    if kind.name == "to_lower":
        return machine.unify(argument, make(char.lower()[0]))
    if kind.name == "to_upper":
        return machine.unify(argument, make(char.upper()[0]))
    if kind.name == "upper":
        return char.isupper() and machine.unify(argument, make(char.lower()[0]))
    if kind.name == "lower":
        return char.islower() and machine.unify(argument, make(char.upper()[0]))
    raise domain_error("char_type", kind)
