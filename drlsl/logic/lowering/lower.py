"""From a loaded program to the intermediate form: the entrance to this package."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from drlsl.logic.lowering.errors import NotLowerable
from drlsl.logic.lowering.ir import Node, Pool
from drlsl.logic.lowering.schema import Schema
from drlsl.logic.lowering.trees import CannotMerge, Sym, Tree, alternatives, has_each
from drlsl.logic.lowering.unfold import Unfolder, deep_recursion, variables_of
from drlsl.logic.program import Program
from drlsl.logic.terms import Atom, Struct, Var

Mode: TypeAlias = Literal["holds", "first", "all"]


@dataclass(frozen=True, slots=True)
class Query:
    """A question: whether a goal holds, its first solution, or all of them in order.

    The goal is `name` of `arity` unbound arguments.
    """

    name: str
    arity: int
    mode: Mode

    def __str__(self) -> str:
        return f"{self.name}/{self.arity}"


@dataclass(frozen=True, slots=True)
class Answer:
    """What is known about a query before the facts are.

    `undecided` holds in a scene that only the interpreter can answer; elsewhere `tree` emits the arguments of
    each solution. `found` says whether there is one. `terms` are the arguments of the first, None where no
    expressions give them.
    """

    query: Query
    tree: Tree
    found: Node
    undecided: Node
    terms: tuple[Sym, ...] | None

    def alternatives(self, pool: Pool) -> list[tuple[Node, tuple[Sym, ...]]] | None:
        """Every solution with its condition, in order; None where there is one for each row of a relation."""
        return None if has_each(self.tree) else list(alternatives(pool, self.tree))


@dataclass(frozen=True, slots=True)
class Lowered:
    """A program lowered for some queries."""

    schema: Schema
    pool: Pool
    answers: tuple[Answer, ...] = field(repr=False)


def lower(program: Program, schema: Schema, queries: Sequence[Query]) -> Lowered:
    """Lower a program as it is now for these queries; the facts of `schema` are left open.

    Raises:
        NotLowerable: a query reaches a rule that only the interpreter can run.
    """
    pool = Pool()
    unfolder = Unfolder(program, schema, pool)
    with deep_recursion():
        return Lowered(schema, pool, tuple(_answer(unfolder, query) for query in queries))


def _answer(unfolder: Unfolder, query: Query) -> Answer:
    arguments = tuple(Var(f"Argument{n + 1}") for n in range(query.arity))
    goal = Struct(query.name, arguments) if arguments else Atom(query.name)
    every = query.mode == "all"
    tree = unfolder.tree_of([goal], arguments, counting=every)
    fold = unfolder.fold
    terms: tuple[Sym, ...] | None = None
    found = fold.exists(tree)
    if query.mode == "first":
        try:
            found, terms = fold.first(tree)
        except CannotMerge:
            terms = None
        if terms is not None and variables_of(terms):
            raise NotLowerable(str(query), None, "its answer holds an unbound variable")
    if query.arity == 0:
        unfolder.pool.name(found, query.name)
    return Answer(query, tree, found, fold.undecided(tree, whole=every), terms)
