"""Terms, and writing them."""

from drlsl.logic.terms.digits import MOST_BITS, decimal_digits, parse_digits, product_seconds
from drlsl.logic.terms.operators import SPECIFIERS, Operators
from drlsl.logic.terms.term import (
    CURLY,
    NIL,
    TRUE,
    Atom,
    CyclicTerm,
    Struct,
    Term,
    Var,
    deref,
    is_acyclic,
    make_list,
    names,
    parts,
)
from drlsl.logic.terms.term_writer import format_atom, format_float, format_term, variable_name

__all__ = [
    "CURLY",
    "MOST_BITS",
    "NIL",
    "SPECIFIERS",
    "TRUE",
    "Atom",
    "CyclicTerm",
    "Operators",
    "Struct",
    "Term",
    "Var",
    "decimal_digits",
    "deref",
    "format_atom",
    "format_float",
    "format_term",
    "is_acyclic",
    "make_list",
    "names",
    "parse_digits",
    "parts",
    "product_seconds",
    "variable_name",
]
