"""The control constructs and builtin predicates that can be lowered, as trees of solutions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from drlsl.logic.terms import NIL, Atom, Struct, Var
from drlsl.lowering.frontend.unfold import Continue, Goal, Unfolder
from drlsl.lowering.ir import (
    COMPARISONS,
    FAIL,
    Arithmetic,
    Bag,
    CannotMerge,
    Emit,
    Node,
    Sym,
    Tree,
    alternatives,
    branch,
    guard,
    has_each,
    require,
    resolve,
    seq,
)

_MOST_STEPS: Final = 64

GOALS: Final[dict[tuple[str, int], Goal]] = {}


def _goal(name: str, arity: int) -> Callable[[Goal], Goal]:
    def register(function: Goal) -> Goal:
        GOALS[name, arity] = function
        return function

    return register


# ---------------------------------------------------------------- control


@_goal("true", 0)
@_goal("otherwise", 0)
def _true(_unfold: Unfolder, _args: Sequence[Sym], then: Continue) -> Tree:
    return then()


@_goal("fail", 0)
@_goal("false", 0)
def _fail(_unfold: Unfolder, _args: Sequence[Sym], _then: Continue) -> Tree:
    return FAIL


@_goal(",", 2)
def _and(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.solve(args[0], lambda: unfold.solve(args[1], then))


@_goal(";", 2)
@_goal("|", 2)
def _or(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    left = args[0]
    if isinstance(left, Struct) and len(left.args) == 2 and left.name == "->":
        cond, yes = left.args
        return unfold.committed([cond], lambda: unfold.solve(yes, then), lambda: unfold.solve(args[1], then))
    if isinstance(left, Struct) and len(left.args) == 2 and left.name == "*->":
        cond, yes = left.args
        tree = unfold.tree_of([cond])
        found = unfold.fold.exists(tree)
        undecided = unfold.fold.undecided(tree, whole=False)
        yes_tree = unfold.solve(cond, lambda: unfold.solve(yes, then))
        return require(unfold.pool.not_(undecided), branch(found, yes_tree, unfold.solve(args[1], then)))
    return seq([unfold.solve(args[0], then), unfold.solve(args[1], then)])


@_goal("->", 2)
def _if_then(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.committed([args[0]], lambda: unfold.solve(args[1], then), lambda: FAIL)


@_goal("*->", 2)
def _soft_if_then(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.solve(args[0], lambda: unfold.solve(args[1], then))


@_goal("once", 1)
def _once(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.committed([args[0]], then, lambda: FAIL)


@_goal("ignore", 1)
def _ignore(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.committed([args[0]], then, then)


@_goal("\\+", 1)
@_goal("not", 1)
def _not(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    tree = unfold.tree_of([args[0]])
    undecided = unfold.fold.undecided(tree, whole=False)
    absent = unfold.pool.not_(unfold.fold.exists(tree))
    return require(
        unfold.pool.not_(undecided), guard(absent, then() if absent is not unfold.pool.false else FAIL)
    )


@_goal("forall", 2)
def _forall(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    counterexample = Struct(",", (args[0], Struct("\\+", (args[1],))))
    return _not(unfold, [counterexample], then)


def _call(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    goal = resolve(args[0])
    if isinstance(goal, Atom):
        called: Sym = Struct(goal.name, tuple(args[1:])) if len(args) > 1 else goal
    elif isinstance(goal, Struct):
        called = Struct(goal.name, (*goal.args, *args[1:]))
    else:
        return require(unfold.pool.false, FAIL)
    return unfold.called(called, then)


GOALS.update({("call", arity): _call for arity in range(1, 9)})


@_goal(":", 2)
def _qualified(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return _call(unfold, args[1:], then)


# ---------------------------------------------------------------- unification and comparison of terms


@_goal("=", 2)
def _unify(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.unified(args[0], args[1], then)


@_goal("\\=", 2)
def _not_unify(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    with unfold.undone():
        conds: list[Node] = []
        same = unfold.pool.and_(conds) if unfold.unify(args[0], args[1], conds) else unfold.pool.false
    return guard(unfold.pool.not_(same), then())


@_goal("==", 2)
def _identical(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(unfold.identical(args[0], args[1]), then())


@_goal("\\==", 2)
def _not_identical(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(unfold.pool.not_(unfold.identical(args[0], args[1])), then())


def _type_test(name: str, holds: Callable[[Sym], bool | Node]) -> None:
    def test(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
        result = holds(resolve(args[0]))
        return guard(result if isinstance(result, Node) else unfold.pool.const(result), then())

    GOALS[name, 1] = test


def _kind(term: Sym) -> str:
    if isinstance(term, Node):
        return term.kind
    names = {
        Atom: "atom",
        int: "int",
        float: "float",
        Var: "var",
        str: "string",
        Struct: "compound",
        Bag: "list",
    }
    return names[type(term)]


def _is_list(term: Sym) -> bool:
    while isinstance(term, Struct) and term.name == "." and len(term.args) == 2:
        term = resolve(term.args[1])
    return isinstance(term, Bag) or term is NIL


_type_test("var", lambda term: isinstance(term, Var))
_type_test("nonvar", lambda term: not isinstance(term, Var))
_type_test("atom", lambda term: _kind(term) == "atom")
_type_test("number", lambda term: _kind(term) in ("int", "float", "number"))
_type_test("atomic", lambda term: _kind(term) in ("int", "float", "number", "atom", "string"))
_type_test("compound", lambda term: _kind(term) == "compound")
_type_test("callable", lambda term: _kind(term) in ("atom", "compound"))
_type_test("is_list", _is_list)


@_goal("integer", 1)
def _integer(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(_of_kind(unfold, args[0], "int"), then())


@_goal("float", 1)
def _float(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(_of_kind(unfold, args[0], "float"), then())


def _of_kind(unfold: Unfolder, term: Sym, kind: str) -> Node:
    term = resolve(term)
    if isinstance(term, Node) and term.kind == "number":
        cond, then, els = term.args
        return unfold.pool.choose(cond, _of_kind(unfold, then, kind), _of_kind(unfold, els, kind))
    return unfold.pool.const(_kind(term) == kind)


# ---------------------------------------------------------------- arithmetic


@_goal("is", 2)
def _is(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    def assign(_arithmetic: Arithmetic, value: Node) -> Tree:
        return unfold.unified(args[0], value.data if value.is_const else value, then)

    return unfold.evaluated([args[1]], assign)


def _comparison(name: str) -> None:
    def compare(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
        def test(arithmetic: Arithmetic, left: Node, right: Node) -> Tree:
            cond = arithmetic.compare(name, left, right)
            unfold.written(cond, Struct(name, tuple(args)))
            return guard(cond, then())

        return unfold.evaluated(args, test)

    GOALS[name, 2] = compare


for _name in COMPARISONS:
    _comparison(_name)


@_goal("between", 3)
def _between(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    low, high, value = map(resolve, args)
    if not isinstance(value, Var):
        if _kind(value) != "int" or _kind(low) != "int" or _kind(high) != "int":
            unfold.refuse("between/3 with bounds or a value that are not surely integers")
        order = Struct(",", (Struct(">=", (value, low)), Struct("=<", (value, high))))
        return unfold.solve(order, then)
    if not isinstance(low, int) or not isinstance(high, int) or high - low >= _MOST_STEPS:
        unfold.refuse(f"between/3 needs constant integer bounds, at most {_MOST_STEPS} apart")
    return seq([unfold.unified(value, step, then) for step in range(low, high + 1)])


@_goal("succ", 2)
def _succ(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    low, high = map(resolve, args)
    if _kind(low) == "int":
        return unfold.solve(
            Struct(",", (Struct(">=", (low, 0)), Struct("is", (high, Struct("+", (low, 1)))))), then
        )
    if _kind(high) == "int" and isinstance(low, Var):
        return unfold.solve(
            Struct(",", (Struct(">", (high, 0)), Struct("is", (low, Struct("-", (high, 1)))))), then
        )
    return require(unfold.pool.false, FAIL)


# ---------------------------------------------------------------- all solutions


@_goal("findall", 3)
def _findall(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    tree = unfold.tree_of([args[1]], [args[0]], counting=True)
    undecided = unfold.fold.undecided(tree, whole=True)
    found: Sym = Bag(tree)
    if not has_each(tree):
        items = list(alternatives(unfold.pool, tree))
        if all(cond is unfold.pool.true for cond, _ in items):
            found = NIL
            for _, terms in reversed(items):
                found = Struct(".", (terms[0], found))
    return require(unfold.pool.not_(undecided), unfold.unified(args[2], found, then))


@_goal("aggregate_all", 3)
def _aggregate_all(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    spec = resolve(args[0])
    if isinstance(spec, Atom) and spec.name == "count":
        return _count(unfold, args[1], args[2], then)
    if isinstance(spec, Struct) and spec.name == "bag" and len(spec.args) == 1:
        return _findall(unfold, [spec.args[0], args[1], args[2]], then)
    if isinstance(spec, Struct) and spec.name == "count" and len(spec.args) == 1:
        return _count(unfold, args[1], args[2], then)
    if isinstance(spec, Struct) and spec.name == "sum" and len(spec.args) == 1:
        return _sum(unfold, spec.args[0], args[1], args[2], then)
    if isinstance(spec, Struct) and spec.name in ("min", "max") and len(spec.args) in (1, 2):
        return _extreme(unfold, spec, args[1], args[2], then)
    if isinstance(spec, Struct) and spec.name != "set":
        return _aggregates(unfold, spec, args[1], args[2], then)
    return unfold.refuse("aggregate_all/3 of anything but count, sum, min, max, bag and terms of these")


def _aggregates(unfold: Unfolder, spec: Struct, goal: Sym, result: Sym, then: Continue) -> Tree:
    """Return the tree of a term whose arguments are aggregates, each computed separately."""
    parts = [resolve(part) for part in spec.args]
    if not all(
        isinstance(part, Atom | Struct) and (part.name, _arity(part)) in _AGGREGATES for part in parts
    ):
        unfold.refuse(
            f"aggregate_all/3 of {spec.name}/{len(parts)} with an argument that is not an aggregate, or set/1"
        )
    values = [Var(f"Aggregate{number}") for number in range(1, len(parts) + 1)]

    def from_part(number: int) -> Tree:
        if number == len(parts):
            return unfold.unified(result, Struct(spec.name, tuple(values)), then)
        return _aggregate_all(unfold, [parts[number], goal, values[number]], lambda: from_part(number + 1))

    return from_part(0)


def _arity(term: Sym) -> int:
    return len(term.args) if isinstance(term, Struct) else 0


_AGGREGATES: Final = frozenset(
    {("count", 0), ("count", 1), ("sum", 1), ("bag", 1), ("max", 1), ("min", 1), ("max", 2), ("min", 2)}
)


def _count(unfold: Unfolder, goal: Sym, result: Sym, then: Continue) -> Tree:
    tree = unfold.tree_of([goal], counting=True)
    undecided = unfold.fold.undecided(tree, whole=True)
    number = unfold.fold.count(tree)
    value = number.data if number.is_const else number
    return require(unfold.pool.not_(undecided), unfold.unified(result, value, then))


def _with_value(
    unfold: Unfolder, expression: Sym, goal: Sym, others: Sequence[Sym], *, counting: bool
) -> Tree:
    """Return the solutions of a goal as the value of an expression and other terms."""
    before, unfold.counting = unfold.counting, counting

    def emit(_arithmetic: Arithmetic, value: Node) -> Tree:
        rest = unfold.emit(others)
        assert isinstance(rest, Emit)
        return Emit((value, *rest.terms))

    try:
        return unfold.body([goal], lambda: unfold.evaluated([expression], emit), lambda: FAIL)
    finally:
        unfold.counting = before


def _sum(unfold: Unfolder, expression: Sym, goal: Sym, result: Sym, then: Continue) -> Tree:
    tree = _with_value(unfold, expression, goal, (), counting=True)
    undecided = unfold.fold.undecided(tree, whole=True)
    try:
        value = unfold.fold.total(tree)
    except CannotMerge:
        unfold.refuse("a sum of floats over more than one loop, or of integers mixed with floats")

    def bounded(_arithmetic: Arithmetic, total: Node) -> Tree:
        return unfold.unified(result, total.data if total.is_const else total, then)

    return require(unfold.pool.not_(undecided), unfold.evaluated([value], bounded))


def _extreme(unfold: Unfolder, spec: Struct, goal: Sym, result: Sym, then: Continue) -> Tree:
    tree = _with_value(unfold, spec.args[0], goal, spec.args[1:], counting=False)
    undecided = unfold.fold.undecided(tree, whole=True)
    try:
        found, value, witness = unfold.fold.extreme(tree, spec.name == "min")
    except CannotMerge:
        unfold.refuse(f"a {spec.name} over values of different kinds")
    if found is unfold.pool.false:
        return require(unfold.pool.not_(undecided), FAIL)
    best: Sym = value.data if value.is_const else value
    answer = Struct(spec.name, (best, *witness)) if witness else best
    return require(unfold.pool.not_(undecided), guard(found, unfold.unified(result, answer, then)))


# ---------------------------------------------------------------- lists


def _elements(unfold: Unfolder, term: Sym) -> list[Sym]:
    items: list[Sym] = []
    term = resolve(term)
    while isinstance(term, Struct) and term.name == "." and len(term.args) == 2:
        items.append(term.args[0])
        term = resolve(term.args[1])
    if term is not NIL:
        unfold.refuse("it iterates over a list that is not fully known")
    return items


@_goal("member", 2)
def _member(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    found = resolve(args[1])
    if isinstance(found, Bag):
        return unfold.splice(found.tree, [args[0]], then)
    return seq([unfold.unified(args[0], item, then) for item in _elements(unfold, found)])


@_goal("memberchk", 2)
def _memberchk(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.committed([Struct("member", tuple(args))], then, lambda: FAIL)


@_goal("length", 2)
def _length(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    found = resolve(args[0])
    if isinstance(found, Bag):
        number = unfold.fold.count(found.tree)
        return unfold.unified(args[1], number.data if number.is_const else number, then)
    return unfold.unified(args[1], len(_elements(unfold, found)), then)


def _list_extreme(name: str, spec: str) -> None:
    def extreme(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
        item = Var("Item")
        return _aggregate_all(
            unfold, [Struct(spec, (item,)), Struct("member", (item, args[0])), args[1]], then
        )

    GOALS[name, 2] = extreme


_list_extreme("min_list", "min")
_list_extreme("max_list", "max")
_list_extreme("sum_list", "sum")
_list_extreme("sumlist", "sum")
