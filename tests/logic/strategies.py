"""Hypothesis strategies for terms and operator tables."""

from __future__ import annotations

from hypothesis import strategies as st

from drlsl.logic.terms import NIL, SPECIFIERS, Atom, Operators, Struct, Term, Var, make_list

_PLAIN = "a b foo [] {} ; ! , | . - + * \\ \\+ :- ?- --> = is mod rem dynamic A aB é É /* */ //* @ 0 1 e $VAR"
_STRANGE = [
    "",
    " ",
    "\n",
    "a b",
    "\x00",
    "\x7f",
    "\\n",
    "'",
    "`",
    '"',
    "^`",
    "{",
    "[",
    "(",
    "日本",
    "→",
    ";;",
]
_TRICKY = _PLAIN.split() + _STRANGE

characters = st.characters(exclude_categories=["Cs"])
names = st.sampled_from(_TRICKY) | st.text(characters, max_size=4)
numbers = st.integers() | st.floats(allow_nan=False) | st.sampled_from([0, 1, -1, 0.0, -0.0, 1e22, 5e-324])


_OPERATORS = [
    "-",
    "+",
    "\\",
    "\\+",
    "*",
    "^",
    "**",
    ":-",
    ",",
    "=",
    "->",
    "|",
    "mod",
    "is",
    "dynamic",
    "--",
    "f",
    "y",
]
_MORE = [
    (200, "fy", "--"),
    (200, "xfy", "--"),
    (9, "fy", "f"),
    (9, "yf", "y"),
    (9, "yfx", "f"),
    (9, "xfy", "p"),
]


def terms(variables: list[Var]) -> st.SearchStrategy[Term]:
    """Terms over these variables."""
    operators = st.sampled_from(_OPERATORS).map(Atom)
    leaves = operators | names.map(Atom) | numbers | st.sampled_from([0, 1]) | st.sampled_from(variables)

    def compounds(inner: st.SearchStrategy[Term]) -> st.SearchStrategy[Term]:
        one, two = st.tuples(inner), st.tuples(inner, inner)
        return (
            st.builds(Struct, st.sampled_from(_OPERATORS), one)
            | st.builds(Struct, st.sampled_from(_OPERATORS), two)
            | st.builds(Struct, names, st.lists(inner, min_size=1, max_size=3).map(tuple))
            | st.builds(make_list, st.lists(inner, max_size=3), st.just(NIL) | inner)
            | inner.map(lambda term: Struct("{}", (term,)))
        )

    return st.recursive(leaves, compounds, max_leaves=12)


@st.composite
def operator_tables(draw: st.DrawFn) -> Operators:
    """The default table with some more operators, as op/3 would let a program define them."""
    operators = Operators()
    wanted = st.tuples(st.integers(1, 1200), st.sampled_from(sorted(SPECIFIERS)), names)
    more = st.lists(wanted | st.sampled_from(_MORE), max_size=4)
    for priority, specifier, name in draw(more):
        infix, postfix = len(specifier) == 3, specifier in ("xf", "yf")
        clash = (infix and name in operators.postfix) or (postfix and name in operators.infix)
        if name not in (",", "|", "[]", "{}") and not clash:
            operators.add(priority, specifier, name)
    return operators
