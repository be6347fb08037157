"""Lower a loaded program to the intermediate form: the entrance to this package."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from drlsl.logic import Engine
from drlsl.logic.core import read_body
from drlsl.logic.terms import Atom, Struct, Var
from drlsl.lowering.frontend.goals import RULES, control
from drlsl.lowering.frontend.symbols import variables_of
from drlsl.lowering.frontend.unfold import Unfolder, deep_recursion
from drlsl.lowering.ir import (
    FAIL,
    Branch,
    CannotMerge,
    Doubt,
    Each,
    Emit,
    Guard,
    Node,
    NotLowerable,
    Pool,
    Require,
    Schema,
    Seq,
    Sym,
    Tree,
    branch,
    each,
    emitted,
    guard,
    require,
    seq,
)

Mode: TypeAlias = Literal["holds", "first", "set", "all"]


@dataclass(frozen=True, slots=True)
class Query:
    """A query: whether a goal holds, its first solution, the set of its solutions in order, or all of them.

    The goal is `name` of `arity` unbound arguments.
    """

    name: str
    arity: int
    mode: Mode

    def __str__(self) -> str:
        return f"{self.name}/{self.arity}"


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer in terms of the facts.

    `undecided` holds in a scene that only the interpreter can answer; elsewhere `tree` emits the arguments of
    each solution. `found`: there is one. `terms` are the arguments of the first, None if no expressions give
    them. `choices` are the values that the only argument can have, each with the condition that it is a
    solution, None if not all are known; `in_order`: solutions come in that order.
    """

    query: Query
    tree: Tree
    found: Node
    undecided: Node
    terms: tuple[Sym, ...] | None = None
    choices: tuple[tuple[Sym, Node], ...] | None = None
    in_order: bool = False


@dataclass(frozen=True, slots=True)
class Lowered:
    """A program lowered for some queries.

    `doubts` has, for each reason why a scene may be undecided, the conditions that exclude it.
    """

    schema: Schema
    pool: Pool
    answers: tuple[Answer, ...] = field(repr=False)
    doubts: Mapping[Doubt, Sequence[Node]] = field(repr=False)


def lower(engine: Engine, schema: Schema, queries: Sequence[Query]) -> Lowered:
    """Lower an engine's present program for these queries; the facts of `schema` are left open.

    Raises:
        NotLowerable: a query reaches a rule that only the interpreter can run.
    """
    pool = Pool()
    unfolder = Unfolder(engine.program, schema, pool, RULES, control, iso=engine.flags.iso)
    with deep_recursion():
        answers = tuple(_answer(unfolder, query) for query in queries)
    return Lowered(schema, pool, answers, unfolder.doubts)


def _answer(unfolder: Unfolder, query: Query) -> Answer:
    if unfolder.program.find(query.name, query.arity) is None:
        raise NotLowerable(str(query), None, "the program does not define it")
    arguments = tuple(Var(f"Argument{n + 1}") for n in range(query.arity))
    goal = read_body(Struct(query.name, arguments) if arguments else Atom(query.name))
    every = query.mode == "all"
    tree = unfolder.tree_of([goal], arguments, counting=every)
    fold = unfolder.fold
    found = fold.exists(tree)
    undecided = fold.undecided(tree, whole=query.mode in ("set", "all"))
    if query.arity == 0:
        unfolder.pool.name(found, query.name)
    if query.mode != "holds" and any(variables_of(leaf.terms) for leaf in emitted(tree)):
        raise NotLowerable(str(query), None, "its answer holds an unbound variable")
    if query.mode == "first":
        try:
            found, terms = fold.first(tree)
        except CannotMerge:
            return Answer(query, tree, found, undecided)
        return Answer(query, tree, found, undecided, terms)
    if query.arity == 1 and query.mode in ("set", "all"):
        choices = _choices(unfolder, tree)
        return Answer(query, tree, found, undecided, None, choices, _in_order(tree))
    return Answer(query, tree, found, undecided)


def _choices(unfolder: Unfolder, tree: Tree) -> tuple[tuple[Sym, Node], ...] | None:
    """Return the constants that a tree emits, each with its condition."""
    constants: dict[Sym, None] = {}
    for leaf in emitted(tree):
        if not isinstance(leaf.terms[0], Atom | int | float):
            return None
        constants[leaf.terms[0]] = None
    return tuple((value, unfolder.fold.exists(_only(tree, value))) for value in constants)


def _only(tree: Tree, value: Sym) -> Tree:
    """Return the solutions that are this constant."""
    if isinstance(tree, Emit):
        return tree if tree.terms[0] == value else FAIL
    if isinstance(tree, Guard):
        return guard(tree.cond, _only(tree.body, value))
    if isinstance(tree, Require):
        return require(tree.cond, _only(tree.body, value))
    if isinstance(tree, Branch):
        return branch(tree.cond, _only(tree.then, value), _only(tree.els, value))
    if isinstance(tree, Seq):
        return seq(_only(part, value) for part in tree.parts)
    return each(tree.loop, _only(tree.body, value)) if isinstance(tree, Each) else tree


def _in_order(tree: Tree) -> bool:
    """Return whether each part of the tree has one value of its own."""
    parts = tree.parts if isinstance(tree, Seq) else (tree,)
    values = [{leaf.terms[0] for leaf in emitted(part)} for part in parts]
    return all(len(own) <= 1 for own in values) and len(set().union(*values)) == sum(map(len, values))
