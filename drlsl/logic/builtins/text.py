"""Atoms and numbers as text. Source: ISO 13211-1 8.16 with Cor.2.

While the flag ``iso`` is false, a number stands for its text wherever an atom is expected, as in SWI-Prolog.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from sys import getsizeof

from drlsl.logic.builtins.arguments import attempt, prefix
from drlsl.logic.core import Caller, det, nondet
from drlsl.logic.errors import domain_error, instantiation_error, representation_error, type_error
from drlsl.logic.syntax import parse_number
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, decimal_digits, deref, format_float, make_list

MAX_CODE = 0x10FFFF
# Trying one more way to split a text takes as long as this many of its characters.
TRY = 512


def number_text(number: int | float, machine: Caller | None = None) -> str:
    """Return the text of a number."""
    meter = None if machine is None else machine.meter
    return decimal_digits(number, meter) if isinstance(number, int) else format_float(number)


def text_of(machine: Caller, term: Term) -> str:
    """Return the text of an argument that must be an atom (or a string, or a number unless ``iso``)."""
    term = deref(term)
    if isinstance(term, Atom):
        return term.name
    if isinstance(term, str):
        return term
    if isinstance(term, Var):
        raise instantiation_error()
    if isinstance(term, (int, float)) and not machine.flags.iso:
        return number_text(term, machine)
    raise type_error("atom", term)


def optional_text(machine: Caller, term: Term) -> str | None:
    """Return the text of an argument that must be an atom or a variable; None for a variable."""
    return None if isinstance(deref(term), Var) else text_of(machine, term)


def _size(term: Term) -> int | None:
    """Return an argument that must be a variable or an integer of 0 or more."""
    term = deref(term)
    if isinstance(term, Var):
        return None
    if not isinstance(term, int):
        raise type_error("integer", term)
    return term


def _not_negative(*sizes: int | None) -> None:
    for size in sizes:
        if size is not None and size < 0:
            raise domain_error("not_less_than_zero", size)


@det("atom_length", 2)
def atom_length(machine: Caller, atom: Term, length: Term) -> bool:
    """Source: ISO 13211-1 8.16.1."""
    text = text_of(machine, atom)
    _not_negative(_size(length))
    return machine.unify(length, len(text))


def check_size(machine: Caller, *parts: str) -> None:
    """Check that there is memory for a text of these parts.

    Raises:
        LimitExceeded: There is not.
    """
    machine.meter.text(sum(map(getsizeof, parts)))


def join(machine: Caller, parts: Sequence[str], between: str = "") -> str:
    """Return texts with a text between them.

    Raises:
        LimitExceeded: There is no memory for it.
    """
    machine.meter.text(sum(map(getsizeof, parts)) + getsizeof(between) * len(parts))
    return between.join(parts)


def concat(
    machine: Caller, first: Term, second: Term, whole: Term, make: Callable[[str], Term]
) -> Iterator[bool]:
    """Join two texts, or split one in every way, for atom_concat/3 and string_concat/3."""
    parts = deref(first), deref(second)
    if isinstance(deref(whole), Var) and (isinstance(parts[0], Var) or isinstance(parts[1], Var)):
        raise instantiation_error()
    left, right, text = (optional_text(machine, part) for part in (first, second, whole))
    if left is not None and right is not None:
        check_size(machine, left, right)
        if machine.unify(whole, make(left + right)) if text is None else left + right == text:
            yield True
        return
    assert text is not None
    if left is not None or right is not None:
        check_size(machine, text)
    if left is not None:
        if text.startswith(left) and machine.unify(second, make(text[len(left) :])):
            yield True
    elif right is not None:
        if text.endswith(right) and machine.unify(first, make(text[: len(text) - len(right)])):
            yield True
    else:
        both = Struct("-", (first, second))
        for cut in range(len(text) + 1):
            machine.meter.text(TRY + 2 * len(text))
            if attempt(machine, both, Struct("-", (make(text[:cut]), make(text[cut:])))):
                yield cut == len(text)


@nondet("atom_concat", 3)
def atom_concat(machine: Caller, first: Term, second: Term, whole: Term) -> Iterator[bool]:
    """Source: ISO 13211-1 8.16.2."""
    return concat(machine, first, second, whole, Atom)


def sub_text(
    machine: Caller,
    text: str,
    before: Term,
    length: Term,
    after: Term,
    sub: Term,
    make: Callable[[str], Term],
) -> Iterator[bool]:
    """Yield for each part of a text the text before and after it, for sub_atom/5 and sub_string/5."""
    known = optional_text(machine, sub)
    sizes = _size(before), _size(length), _size(after)
    _not_negative(*sizes)
    pattern = Struct("sub", (before, length, after, sub))
    places = _places(machine, text, known, *sizes)
    place = next(places, None)
    while place is not None:
        start, end = place
        place = next(places, None)
        machine.meter.text(TRY + end - start)
        part = sub if known is not None else make(text[start:end])
        if attempt(machine, pattern, Struct("sub", (start, end - start, len(text) - end, part))):
            yield place is None


def _places(
    machine: Caller, text: str, known: str | None, before: int | None, length: int | None, after: int | None
) -> Iterator[tuple[int, int]]:
    """Yield start and end of each part that fits the known arguments, in order."""
    total = len(text)
    if known is not None:
        if before is not None:
            if text.startswith(known, before):
                yield before, before + len(known)
            return
        start = _found(machine, text, known, 0)
        while start >= 0:
            yield start, start + len(known)
            start = _found(machine, text, known, start + 1)
        return
    if before is not None and length is None and after is not None:
        length = total - before - after
    elif before is None and length is not None and after is not None:
        before = total - length - after
    if (length is not None and length < 0) or (before is not None and before < 0):
        return
    for start in range(total + 1) if before is None else (before,):
        if length is not None:
            ends: Iterator[int] | tuple[int] = (start + length,)
        elif after is not None:
            ends = (total - after,)
        else:
            ends = iter(range(start, total + 1))
        machine.meter.spend(1)
        for end in ends:
            if start <= end <= total:
                yield start, end


def _found(machine: Caller, text: str, part: str, start: int) -> int:
    """Return the start of a part in a text, from a place on; -1 if it does not occur."""
    place = text.find(part, start)
    machine.meter.spend(((len(text) if place < 0 else place) - start) // TRY)
    return place


@nondet("sub_atom", 5)
def sub_atom(
    machine: Caller, atom: Term, before: Term, length: Term, after: Term, sub: Term
) -> Iterator[bool]:
    """Source: ISO 13211-1 8.16.3."""
    return sub_text(machine, text_of(machine, atom), before, length, after, sub, Atom)


def is_character(term: Term) -> bool:
    """Return whether a dereferenced term is a one-char atom."""
    return isinstance(term, Atom) and len(term.name) == 1


def is_code(term: Term) -> bool:
    """Return whether a dereferenced term is a character code."""
    return isinstance(term, int) and 0 <= term <= MAX_CODE


def _check_character(term: Term) -> str:
    if isinstance(term, Atom) and len(term.name) == 1:
        return term.name
    raise type_error("character", term)


def _check_code(term: Term) -> str:
    if isinstance(term, int) and 0 <= term <= MAX_CODE:
        return chr(term)
    raise representation_error("character_code")


def listed_text(machine: Caller, term: Term, check: Callable[[Term], str]) -> str | None:
    """Return the text of a list of characters or codes; None if the list or an element is unbound.

    Raises:
        PrologTypeError: an element of the wrong kind, then a term that is not a list.
    """
    elements, tail = prefix(term, machine)
    partial = False
    chars: list[str] = []
    for element in elements:
        element = deref(element)
        if isinstance(element, Var):
            partial = True
        else:
            chars.append(check(element))
    if isinstance(tail, Var):
        return None
    if tail is not NIL:
        raise type_error("list", deref(term))
    return None if partial else "".join(chars)


def _declare_atom_list(name: str, check: Callable[[Term], str], item: Callable[[str], Term]) -> None:
    @det(name, 2)
    def atom_list(machine: Caller, atom: Term, elements: Term) -> bool:
        if not isinstance(deref(atom), Var):
            text = text_of(machine, atom)
            listed_text(machine, elements, check)
            machine.meter.make(len(text))
            return machine.unify(elements, make_list([item(char) for char in text]))
        listed = listed_text(machine, elements, check)
        if listed is None:
            raise instantiation_error()
        return machine.unify(atom, Atom(listed))


_declare_atom_list("atom_chars", _check_character, Atom)
_declare_atom_list("atom_codes", _check_code, ord)


@det("char_code", 2)
def char_code(machine: Caller, char: Term, code: Term) -> bool:
    """Source: ISO 13211-1 8.16.6."""
    char, code = deref(char), deref(code)
    if isinstance(char, Var):
        if isinstance(code, Var):
            raise instantiation_error()
        if not isinstance(code, int):
            raise type_error("integer", code)
        return machine.unify(char, Atom(_check_code(code)))
    known = _check_character(char)
    if not isinstance(code, (Var, int)):
        raise type_error("integer", code)
    if isinstance(code, int):
        _check_code(code)
    return machine.unify(code, ord(known))


def _declare_number_list(name: str, check: Callable[[Term], str], item: Callable[[str], Term]) -> None:
    @det(name, 2)
    def number_list(machine: Caller, number: Term, elements: Term) -> bool:
        listed = listed_text(machine, elements, check)
        number = deref(number)
        if isinstance(number, Var) and listed is None:
            raise instantiation_error()
        if not isinstance(number, (Var, int, float)):
            raise type_error("number", number)
        if listed is not None:
            return machine.unify(number, parse_number(listed, machine.flags, machine.meter))
        assert isinstance(number, (int, float))
        digits = number_text(number, machine)
        machine.meter.make(len(digits))
        return machine.unify(elements, make_list([item(char) for char in digits]))


_declare_number_list("number_chars", _check_character, Atom)
_declare_number_list("number_codes", _check_code, ord)


def any_text(term: Term, machine: Caller | None = None) -> str | None:
    """Return the text of an atomic term or of a list of characters or codes; None for any other term."""
    term = deref(term)
    if isinstance(term, str):
        return term
    if isinstance(term, (int, float)):
        return number_text(term, machine)
    if isinstance(term, Atom) and term is not NIL:
        return term.name
    if isinstance(term, (Atom, Struct)):
        elements, tail = prefix(term, machine)
        dereferenced = [deref(element) for element in elements]
        if tail is NIL and all(map(is_code, dereferenced)):
            return "".join(chr(code) for code in dereferenced if isinstance(code, int))
        if tail is NIL and all(map(is_character, dereferenced)):
            return "".join(char.name for char in dereferenced if isinstance(char, Atom))
    return None
