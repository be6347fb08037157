"""The form of a query's answer in arrays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from drlsl.logic.terms import NIL, Atom, Struct
from drlsl.lowering.frontend.lowering import Answer, Lowered, Query
from drlsl.lowering.ir import Node, NotLowerable, Pool, Sym, reach, resolve

_MOST: Final = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Form:
    """The nodes of an answer.

    `found`: there is a solution. `values`: for `first` its numbers, for `set` and `all` for each of the
    choices whether it is a solution. `exact`: these numbers are all integers or atoms. `plain`: it is one
    number instead of several.
    """

    query: Query
    found: Node
    values: tuple[Node, ...] = ()
    exact: bool = False
    plain: bool = False

    @property
    def roots(self) -> tuple[Node, ...]:
        """The nodes to compute: for `set` and `all` the choices determine whether there is a solution."""
        return self.values if self.query.mode in ("set", "all") else (self.found, *self.values)


def array_forms(lowered: Lowered) -> tuple[Form, ...]:
    """Return the form of each answer.

    Raises:
        NotLowerable: an answer has none.
    """
    forms = tuple(_form(lowered.pool, answer) for answer in lowered.answers)
    for form, answer in zip(forms, lowered.answers, strict=True):
        for node in reach([answer.undecided, *form.roots]):
            if node.is_const and isinstance(node.data, int) and not -_MOST <= node.data <= _MOST:
                raise NotLowerable(str(form.query), None, f"{node.data} has more than 64 bits")
    return forms


def atom_codes(lowered: Lowered, roots: Iterable[Node]) -> dict[str, int]:
    """Return the integers of atoms in arrays, the same in every back end."""
    first = [relation.first for relation in lowered.schema.relations.values() if relation.first is not None]
    named = [node.data.name for node in reach(roots) if node.op == "const" and isinstance(node.data, Atom)]
    return {atom: code for code, atom in enumerate(dict.fromkeys([*first, *named]))}


def _form(pool: Pool, answer: Answer) -> Form:
    query = answer.query
    if query.mode == "holds":
        return Form(query, answer.found)
    if query.mode == "first":
        if answer.terms is None:
            raise NotLowerable(str(query), None, "its answers are of different kinds")
        nodes = tuple(_as_node(pool, query, item) for term in answer.terms for item in _items(term))
        exact = not any(node.kind in ("float", "number") for node in nodes)
        plain = len(answer.terms) == 1 and isinstance(resolve(answer.terms[0]), Node | Atom | int | float)
        return Form(query, answer.found, nodes, exact, plain)
    if answer.choices is None:
        raise NotLowerable(str(query), None, "its solutions are not among a few constants")
    return Form(query, answer.found, tuple(cond for _, cond in answer.choices))


def _items(term: Sym) -> Sequence[Sym]:
    """Return the elements of a list, or the term itself."""
    items: list[Sym] = []
    rest = resolve(term)
    while isinstance(rest, Struct) and rest.name == "." and len(rest.args) == 2:
        items.append(resolve(rest.args[0]))
        rest = resolve(rest.args[1])
    return items if items and rest is NIL else [resolve(term)]


def _as_node(pool: Pool, query: Query, term: Sym) -> Node:
    if isinstance(term, Node):
        return term
    if isinstance(term, Atom | int | float):
        return pool.const(term)
    raise NotLowerable(str(query), None, "its answer is neither a number, an atom nor a list of numbers")
