"""The control constructs and builtin predicates that can be lowered, as trees of solutions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from drlsl.logic import core
from drlsl.logic.terms import NIL, Atom, Struct, Var
from drlsl.lowering.frontend.unfold import Continue, Rule, Unfolder
from drlsl.lowering.ir import (
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

RULES: Final[dict[tuple[str, int], Rule]] = {}


def _rule(name: str, arity: int) -> Callable[[Rule], Rule]:
    def register(function: Rule) -> Rule:
        RULES[name, arity] = function
        return function

    return register


def control(unfold: Unfolder, goal: core.Goal, then: Continue) -> Tree:
    """Return the solutions of a control construct."""
    match goal:
        case core.Truth(holds):
            return then() if holds else FAIL
        case core.Conjunction(goals):
            return unfold.conjunction(goals, then)
        case core.Disjunction(first, second):
            return seq([unfold.solve(first, then), unfold.solve(second, then)])
        case core.IfThenElse(condition, yes, no, soft):
            if soft:
                return _soft(unfold, goal, then)
            return unfold.committed(
                [condition], lambda: unfold.solve(yes, then), lambda: unfold.solve(no, then)
            )
        case core.Negation(inner):
            return _not(unfold, inner, then)
        case core.Opaque(inner):
            return unfold.body([inner], then, lambda: FAIL)
        case core.Findall(template, inner, result):
            return _findall(unfold, template, inner, result, then)
        case core.Derived(_, meaning):
            return unfold.solve(meaning, then)
        case core.NotCallable():
            return require(unfold.pool.false, FAIL)  # the interpreter reports it
        case core.Call() | core.Cut():
            raise AssertionError("calls are solved, and cuts taken out of bodies, elsewhere")


def _soft(unfold: Unfolder, goal: core.IfThenElse, then: Continue) -> Tree:
    condition, yes = goal.condition, goal.then
    yes_tree = unfold.body([condition], lambda: unfold.solve(yes, then), lambda: FAIL)
    if goal.otherwise is core.FAILURE:
        return yes_tree
    tree = unfold.tree_of([condition])
    found = unfold.fold.exists(tree)
    undecided = unfold.fold.undecided(tree, whole=False)
    no_tree = unfold.solve(goal.otherwise, then)
    return require(unfold.pool.not_(undecided), branch(found, yes_tree, no_tree))


def _not(unfold: Unfolder, goal: core.Goal, then: Continue) -> Tree:
    tree = unfold.tree_of([goal])
    undecided = unfold.fold.undecided(tree, whole=False)
    absent = unfold.pool.not_(unfold.fold.exists(tree))
    return require(
        unfold.pool.not_(undecided), guard(absent, then() if absent is not unfold.pool.false else FAIL)
    )


@_rule("otherwise", 0)
def _otherwise(_unfold: Unfolder, _args: Sequence[Sym], then: Continue) -> Tree:
    return then()


def _call(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    goal = resolve(args[0])
    if isinstance(goal, Atom):
        called: Sym = Struct(goal.name, tuple(args[1:])) if len(args) > 1 else goal
    elif isinstance(goal, Struct):
        called = Struct(goal.name, (*goal.args, *args[1:]))
    else:
        return require(unfold.pool.false, FAIL)
    return unfold.called(called, then)


RULES.update({("call", arity): _call for arity in range(1, 9)})


@_rule(":", 2)
def _qualified(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return _call(unfold, args[1:], then)


def _named(name: str, *args: Sym) -> core.Goal:
    return core.Call(name, args, Struct(name, args), None)


def _given(term: Sym) -> core.Goal:
    """Return a goal that a builtin is given; what a variable is bound to is called in the program."""
    return core.Call("call", (term,), term, None) if isinstance(term, Var) else core.read_body(term)


@_rule("=", 2)
def _unify(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.unified(args[0], args[1], then)


@_rule("\\=", 2)
def _not_unify(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    with unfold.undone():
        conds: list[Node] = []
        same = unfold.pool.and_(conds) if unfold.unify(args[0], args[1], conds) else unfold.pool.false
    return guard(unfold.pool.not_(same), then())


@_rule("==", 2)
def _identical(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(unfold.identical(args[0], args[1]), then())


@_rule("\\==", 2)
def _not_identical(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(unfold.pool.not_(unfold.identical(args[0], args[1])), then())


def _type_test(name: str, holds: Callable[[Sym], bool | Node]) -> None:
    def test(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
        result = holds(resolve(args[0]))
        return guard(result if isinstance(result, Node) else unfold.pool.const(result), then())

    RULES[name, 1] = test


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


@_rule("integer", 1)
def _integer(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(_of_kind(unfold, args[0], "int"), then())


@_rule("float", 1)
def _float(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return guard(_of_kind(unfold, args[0], "float"), then())


def _of_kind(unfold: Unfolder, term: Sym, kind: str) -> Node:
    term = resolve(term)
    if isinstance(term, Node) and term.kind == "number":
        cond, then, els = term.args
        return unfold.pool.choose(cond, _of_kind(unfold, then, kind), _of_kind(unfold, els, kind))
    return unfold.pool.const(_kind(term) == kind)


@_rule("is", 2)
def _is(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    def assign(_arithmetic: Arithmetic, value: Node) -> Tree:
        return unfold.unified(args[0], value.data if value.is_const else value, then)

    return unfold.evaluated([args[1]], assign)


def _comparison(name: str) -> None:
    def compare(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
        def test(arithmetic: Arithmetic, left: Node, right: Node) -> Tree:
            cond = arithmetic.compare(name, left, right)
            unfold.written(cond, Struct(name, tuple(args)))
            # what follows a test that fails is not unfolded: a recursion with constants ends there
            return FAIL if cond is unfold.pool.false else guard(cond, then())

        return unfold.evaluated(args, test)

    RULES[name, 2] = compare


for _name in core.COMPARISONS:
    _comparison(_name)


@_rule("between", 3)
def _between(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    low, high, value = map(resolve, args)
    if not isinstance(value, Var):
        if _kind(value) != "int" or _kind(low) != "int" or _kind(high) != "int":
            unfold.refuse("between/3 with bounds or a value that are not surely integers")
        return unfold.conjunction([_named(">=", value, low), _named("=<", value, high)], then)
    if not isinstance(low, int) or not isinstance(high, int) or high - low >= _MOST_STEPS:
        unfold.refuse(f"between/3 needs constant integer bounds, at most {_MOST_STEPS} apart")
    return seq([unfold.unified(value, step, then) for step in range(low, high + 1)])


@_rule("succ", 2)
def _succ(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    low, high = map(resolve, args)
    if _kind(low) == "int":
        return unfold.conjunction([_named(">=", low, 0), _named("is", high, Struct("+", (low, 1)))], then)
    if _kind(high) == "int" and isinstance(low, Var):
        return unfold.conjunction([_named(">", high, 0), _named("is", low, Struct("-", (high, 1)))], then)
    return require(unfold.pool.false, FAIL)


def _findall(unfold: Unfolder, template: Sym, goal: core.Goal, result: Sym, then: Continue) -> Tree:
    tree = unfold.tree_of([goal], [template], counting=True)
    undecided = unfold.fold.undecided(tree, whole=True)
    found: Sym = Bag(tree)
    if not has_each(tree):
        items = list(alternatives(unfold.pool, tree))
        if all(cond is unfold.pool.true for cond, _ in items):
            found = NIL
            for _, terms in reversed(items):
                found = Struct(".", (terms[0], found))
    return require(unfold.pool.not_(undecided), unfold.unified(result, found, then))


@_rule("aggregate_all", 3)
def _aggregate_all(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    spec, goal, result = resolve(args[0]), _given(args[1]), args[2]
    if isinstance(spec, Atom) and spec.name == "count":
        return _count(unfold, goal, result, then)
    if isinstance(spec, Struct) and spec.name == "bag" and len(spec.args) == 1:
        return _findall(unfold, spec.args[0], goal, result, then)
    if isinstance(spec, Struct) and spec.name == "count" and len(spec.args) == 1:
        return _count(unfold, goal, result, then)
    if isinstance(spec, Struct) and spec.name == "sum" and len(spec.args) == 1:
        return _sum(unfold, spec.args[0], goal, result, then)
    if isinstance(spec, Struct) and spec.name in ("min", "max") and len(spec.args) in (1, 2):
        return _extreme(unfold, spec, goal, result, then)
    if isinstance(spec, Struct) and spec.name != "set":
        return _aggregates(unfold, spec, args[1], result, then)
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


def _count(unfold: Unfolder, goal: core.Goal, result: Sym, then: Continue) -> Tree:
    tree = unfold.tree_of([goal], counting=True)
    undecided = unfold.fold.undecided(tree, whole=True)
    number = unfold.fold.count(tree)
    value = number.data if number.is_const else number
    return require(unfold.pool.not_(undecided), unfold.unified(result, value, then))


def _with_value(
    unfold: Unfolder, expression: Sym, goal: core.Goal, others: Sequence[Sym], *, counting: bool
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


def _sum(unfold: Unfolder, expression: Sym, goal: core.Goal, result: Sym, then: Continue) -> Tree:
    tree = _with_value(unfold, expression, goal, (), counting=True)
    undecided = unfold.fold.undecided(tree, whole=True)
    try:
        value = unfold.fold.total(tree)
    except CannotMerge:
        unfold.refuse("a sum of floats over more than one loop, or of integers mixed with floats")

    def bounded(_arithmetic: Arithmetic, total: Node) -> Tree:
        return unfold.unified(result, total.data if total.is_const else total, then)

    return require(unfold.pool.not_(undecided), unfold.evaluated([value], bounded))


def _extreme(unfold: Unfolder, spec: Struct, goal: core.Goal, result: Sym, then: Continue) -> Tree:
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


def _elements(unfold: Unfolder, term: Sym) -> list[Sym]:
    items: list[Sym] = []
    term = resolve(term)
    while isinstance(term, Struct) and term.name == "." and len(term.args) == 2:
        items.append(term.args[0])
        term = resolve(term.args[1])
    if term is not NIL:
        unfold.refuse("it iterates over a list that is not fully known")
    return items


@_rule("member", 2)
def _member(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    found = resolve(args[1])
    if isinstance(found, Bag):
        return unfold.splice(found.tree, [args[0]], then)
    return seq([unfold.unified(args[0], item, then) for item in _elements(unfold, found)])


@_rule("memberchk", 2)
def _memberchk(unfold: Unfolder, args: Sequence[Sym], then: Continue) -> Tree:
    return unfold.committed([_named("member", *args)], then, lambda: FAIL)


@_rule("length", 2)
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

    RULES[name, 2] = extreme


_list_extreme("min_list", "min")
_list_extreme("max_list", "max")
_list_extreme("sum_list", "sum")
_list_extreme("sumlist", "sum")
