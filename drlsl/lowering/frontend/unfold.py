"""Run a rule program on unknown facts: each goal becomes a tree of its solutions.

Clauses are tried in the interpreter's order. A value that depends on facts becomes a node; a test of such a
value becomes a guard in the tree; a call is replaced by the tree of the called predicate. What the rules
determine alone, such as a table of constants, leaves no trace in the result.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, NoReturn, TypeAlias

from drlsl.logic.core import (
    Call,
    Clause,
    Cut,
    Disjunction,
    Goal,
    IfThenElse,
    Predicate,
    Program,
    cuts,
    read_body,
    steps,
)
from drlsl.logic.loading import builtin, library
from drlsl.logic.terms import Atom, Struct, Var
from drlsl.lowering.frontend.symbols import (
    call_key,
    is_ground,
    renamed,
    variables_of,
)
from drlsl.lowering.ir import (
    FAIL,
    NO_VALUE,
    Arithmetic,
    Bag,
    Branch,
    CannotMerge,
    Doubt,
    Each,
    Emit,
    Fail,
    Folder,
    Guard,
    Node,
    NotCovered,
    NotLowerable,
    NoValue,
    Pool,
    Relation,
    Require,
    Schema,
    Seq,
    Sym,
    Tree,
    branch,
    each,
    guard,
    has_each,
    leaves,
    map_terms,
    rename_loop,
    require,
    resolve,
    seq,
)

Continue = Callable[[], Tree]

_MOST_LEAVES: Final = 2000
_LEAVES_OF_A_CLAUSE: Final = 20
"""Alternatives by which each clause of the program raises the limit of `_MOST_LEAVES`."""
_MOST_CALLS: Final = 60
_DEEP: Final = 20_000


@dataclass(frozen=True, slots=True)
class Source:
    """The source of a condition: the clause, and the goal or expression in it, its variables unbound."""

    clause: Clause | None
    term: Sym


@contextmanager
def deep_recursion() -> Iterator[None]:
    """Allow goals that nest deeper than Python's usual limit."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, _DEEP))
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)


Rule: TypeAlias = Callable[["Unfolder", Sequence[Sym], Continue], Tree]
"""Turns a builtin into a tree of solutions."""

Control: TypeAlias = Callable[["Unfolder", Goal, Continue], Tree]
"""Turns a control construct into one."""


class Unfolder:
    """Unfolds the goals of one program."""

    def __init__(
        self,
        program: Program,
        schema: Schema,
        pool: Pool,
        rules: Mapping[tuple[str, int], Rule],
        control: Control,
        *,
        iso: bool,
    ) -> None:
        """Prepare unfolding; `rules` has the lowerable builtins, `control` lowers control constructs."""
        self.program = program
        self.iso = iso
        self.schema = schema
        self.pool = pool
        self.fold = Folder(pool)
        self.doubts: dict[Doubt, list[Node]] = {}
        self.counting = False  # whether the number of a goal's solutions matters
        self._rules = rules
        self._control = control
        self._trail: list[Var] = []
        self._calls: list[tuple[str, int]] = []
        self._clauses: list[Clause | None] = [None]
        self._known: dict[Any, Tree] = {}
        self._under_way: list[Any] = []
        self._leaves = 0
        clauses = sum(len(predicate.clauses) for predicate in program.predicates.values())
        self._most_leaves = _MOST_LEAVES + _LEAVES_OF_A_CLAUSE * clauses
        self._in_library = False  # whether the current goal is in a clause of the library

    def refuse(self, reason: str) -> NoReturn:
        """Raise the error that only the interpreter can run the current clause."""
        clause = self._clauses[-1]
        name, arity = self._calls[-1] if self._calls else ("call", 1)
        raise NotLowerable(f"{name}/{arity}", clause.span if clause is not None else None, reason)

    def written(self, cond: Node, term: Sym) -> None:
        """Remember the current clause, and the goal or expression in it, as the source of a condition."""
        self.pool.come_from(cond, Source(self._clauses[-1], term))

    def bind(self, variable: Var, term: Sym) -> None:
        """Bind a variable until `undone` is left."""
        if isinstance(term, Node):
            self.pool.name(term, variable.name)
        variable.ref = term
        self._trail.append(variable)

    @contextmanager
    def undone(self) -> Iterator[None]:
        """Undo the bindings made inside the context."""
        mark = len(self._trail)
        try:
            yield
        finally:
            while len(self._trail) > mark:
                self._trail.pop().ref = None

    def unify(self, left: Sym, right: Sym, conds: list[Node]) -> bool:
        """Make two terms equal if `conds`, which this extends, hold; False if they never are."""
        left, right = resolve(left), resolve(right)
        if left is right:
            return True
        if isinstance(left, Var):
            self.bind(left, right)
            return True
        if isinstance(right, Var):
            self.bind(right, left)
            return True
        if isinstance(left, Struct) and isinstance(right, Struct):
            if left.name != right.name or len(left.args) != len(right.args):
                return False
            return all(
                self.unify(one, other, conds) for one, other in zip(left.args, right.args, strict=True)
            )
        if isinstance(left, Bag) or isinstance(right, Bag):
            return self._unify_bag(left, right, conds)
        cond = self.same(left, right)
        if cond is not self.pool.true:
            conds.append(cond)
        return cond is not self.pool.false

    def _unify_bag(self, left: Sym, right: Sym, conds: list[Node]) -> bool:
        bag, other = (left, right) if isinstance(left, Bag) else (right, left)
        if not (isinstance(other, Atom) and other.name == "[]"):
            self.refuse("a list found by findall/3 is compared with anything but []")
        conds.append(self.pool.not_(self.fold.exists(bag.tree)))
        return conds[-1] is not self.pool.false

    def same(self, left: Sym, right: Sym) -> Node:
        """Return the condition that two atomic terms are the same."""
        one, other = self.fold.as_node(left), self.fold.as_node(right)
        if one is None or other is None:
            return self.pool.const(isinstance(left, str) and isinstance(right, str) and left == right)
        for number, value, swap in ((one, other, False), (other, one, True)):
            if number.kind == "number":
                cond, then, els = number.args
                sides = [self.same(value, side) if swap else self.same(side, value) for side in (then, els)]
                return self.pool.choose(cond, *sides)
        if one.kind != other.kind:
            return self.pool.false
        return self.pool.equal(one, other)

    def identical(self, left: Sym, right: Sym) -> Node:
        """Return the condition that two terms are the same without any binding."""
        left, right = resolve(left), resolve(right)
        if left is right:
            return self.pool.true
        if isinstance(left, Struct) and isinstance(right, Struct):
            if left.name != right.name or len(left.args) != len(right.args):
                return self.pool.false
            return self.pool.and_(self.identical(a, b) for a, b in zip(left.args, right.args, strict=True))
        if isinstance(left, Var | Struct) or isinstance(right, Var | Struct):
            return self.pool.false
        conds: list[Node] = []
        return self.pool.and_(conds) if self.unify(left, right, conds) else self.pool.false

    def unified(self, left: Sym, right: Sym, then: Continue) -> Tree:
        """Return the tree of `then` if the two terms are equal."""
        with self.undone():
            conds: list[Node] = []
            if not self.unify(left, right, conds):
                return FAIL
            return guard(self.pool.and_(conds), then())

    def evaluated(self, expressions: Sequence[Sym], then: Callable[..., Tree]) -> Tree:
        """Return the tree of `then`, given the values of expressions and their arithmetic."""
        arithmetic = Arithmetic(self.pool, iso=self.iso)
        try:
            values = [arithmetic.evaluate(expression) for expression in expressions]
            result = then(arithmetic, *values)
        except NoValue:
            self._doubt(self.pool.false, NO_VALUE)
            return require(self.pool.false, FAIL)
        except NotCovered as reason:
            self.refuse(str(reason))
        for cond, otherwise in arithmetic.needed:
            self._doubt(cond, otherwise)
            self.written(cond, expressions[0])
        return require(self.pool.and_(cond for cond, _ in arithmetic.needed), result)

    def _doubt(self, cond: Node, otherwise: str) -> None:
        """Record the reason why a scene is undecided if `cond` does not hold."""
        clause = self._clauses[-1]
        self.doubts.setdefault(Doubt(clause.span if clause is not None else None, otherwise), []).append(cond)

    def tree_of(self, goals: Sequence[Goal], emit: Sequence[Sym] = (), *, counting: bool = False) -> Tree:
        """Return the solutions of a separate conjunction, each as the terms of `emit`."""
        before, self.counting = self.counting, counting
        try:
            return self.body(goals, lambda: self.emit(emit), lambda: FAIL)
        finally:
            self.counting = before

    def emit(self, terms: Sequence[Sym]) -> Tree:
        """Return one solution."""
        return Emit(tuple(map_terms(lambda part: part, term) for term in terms))

    def body(self, goals: Sequence[Goal], then: Continue, rest: Continue) -> Tree:
        """Return `then` for each solution of a clause's goals, then `rest` unless a cut was passed."""
        goals = [part for goal in goals for part in steps(goal)]
        place = next((n for n, goal in enumerate(goals) if cuts(goal)), None)
        if place is None:
            return seq([self.conjunction(goals, then), rest()])
        prefix, goal, tail = goals[:place], goals[place], goals[place + 1 :]
        if isinstance(goal, Cut):
            if not prefix:
                return self.body(tail, then, lambda: FAIL)
            return self.committed(prefix, lambda: self.body(tail, then, lambda: FAIL), rest)
        if prefix:
            with self.undone():
                if not self.fold.single(self.tree_of(prefix, _variables(prefix))):
                    self.refuse("a cut inside a disjunction, after goals with several solutions")
            return self.committed(prefix, lambda: self.body([goal, *tail], then, rest), rest)
        assert isinstance(goal, Disjunction | IfThenElse)
        return self._control_with_cut(goal, tail, then, rest)

    def _control_with_cut(
        self, goal: Disjunction | IfThenElse, tail: list[Goal], then: Continue, rest: Continue
    ) -> Tree:
        """Return a disjunction or if-then-else that cuts the clause."""
        if isinstance(goal, Disjunction):
            other = goal.second
            return self.body([goal.first, *tail], then, lambda: self.body([other, *tail], then, rest))
        if goal.soft:
            self.refuse("a cut inside *->")
        yes, no = goal.then, goal.otherwise
        return self.committed(
            [goal.condition],
            lambda: self.body([yes, *tail], then, rest),
            lambda: self.body([no, *tail], then, rest),
        )

    def conjunction(self, goals: Sequence[Goal], then: Continue) -> Tree:
        """Return the tree of `then` for each solution of goals without a cut."""
        if not goals:
            return then()
        return self.solve(goals[0], lambda: self.conjunction(goals[1:], then))

    def committed(self, goals: Sequence[Goal], then: Continue, els: Continue) -> Tree:
        """Return the tree of `then` for the first solution of `goals`, or of `els` if there is none."""
        variables = _variables(goals)
        tree = self.tree_of(goals, variables)
        if isinstance(tree, Emit):
            return self._bound(variables, tree.terms, then)
        if isinstance(tree, Fail):
            return els()
        try:
            found, terms = self.fold.first(tree)
        except CannotMerge:
            return self._graft(tree, lambda terms: self._bound(variables, terms, then), els)
        undecided = self.fold.undecided(tree, whole=False)
        yes = self._bound(variables, terms, then) if found is not self.pool.false else FAIL
        return require(
            self.pool.not_(undecided), branch(found, yes, els() if found is not self.pool.true else FAIL)
        )

    def _bound(self, variables: Sequence[Var], terms: Sequence[Sym], then: Continue) -> Tree:
        with self.undone():
            conds: list[Node] = []
            for variable, term in zip(variables, terms, strict=True):
                self.unify(variable, term, conds)
            return guard(self.pool.and_(conds), then())

    def _graft(self, tree: Tree, then: Callable[[tuple[Sym, ...]], Tree], els: Continue) -> Tree:
        """Return the tree with `then` in place of the first solution, or `els`."""
        if isinstance(tree, Emit):
            return then(tree.terms)
        if isinstance(tree, Guard):
            return branch(tree.cond, self._graft(tree.body, then, els), els())
        if isinstance(tree, Require):
            return require(tree.cond, self._graft(tree.body, then, els))
        if isinstance(tree, Branch):
            return branch(tree.cond, self._graft(tree.then, then, els), self._graft(tree.els, then, els))
        if isinstance(tree, Seq):
            rest = seq(tree.parts[1:])
            return self._graft(tree.parts[0], then, lambda: self._graft(rest, then, els))
        if isinstance(tree, Each):
            found = self.fold.exists(tree.body)
            index = self.pool.first(tree.loop, found)
            undecided = self.pool.exists(tree.loop, self.fold.undecided(tree.body, whole=False))
            there = self._graft(rename_loop(self.pool, tree, index), then, els)
            return require(
                self.pool.not_(undecided), branch(self.pool.exists(tree.loop, found), there, els())
            )
        return els()

    def solve(self, goal: Goal, then: Continue) -> Tree:
        """Return the tree of `then` for each solution of a goal."""
        if isinstance(goal, Call):
            return self._named(goal.name, goal.args, then)
        return self._control(self, goal, then)

    def _named(self, name: str, args: Sequence[Sym], then: Continue) -> Tree:
        """Return the solutions of a fact relation, a builtin or a predicate."""
        relation = None if self._in_library else self.schema.find(name, len(args))
        if relation is not None:
            return self.facts(relation, args, then)
        predicate = None if self._in_library else self.program.find(name, len(args))
        lowered = self._rules.get((name, len(args)))
        if lowered is not None and predicate is None:
            return lowered(self, args, then)
        if predicate is None:
            predicate = library().find(name, len(args))
        if predicate is None and self._in_library:
            predicate = library().program.find(name, len(args))
        if predicate is None:
            return self.undefined(name, len(args))
        if predicate.tabled is not None:
            span = predicate.clauses[0].span if predicate.clauses else None
            raise NotLowerable(f"{name}/{len(args)}", span, "it is tabled")
        if predicate.dynamic:
            self.refuse(f"{name}/{len(args)} is dynamic, and the schema does not declare its facts")
        return self.call(predicate, args, then)

    def called(self, goal: Sym, then: Continue) -> Tree:
        """Return the tree of a called goal, as `solve`, but with the program's predicates; cuts are local.

        Goals of the library's own use the library's predicates, even if a program hides them.
        """
        before = self._in_library
        goal = map_terms(lambda part: part, goal)  # the bindings of its variables are part of it

        def resumed() -> Tree:
            inside, self._in_library = self._in_library, before
            try:
                return then()
            finally:
                self._in_library = inside

        self._in_library = False
        try:
            return self.body([read_body(goal)], resumed, lambda: FAIL)
        finally:
            self._in_library = before

    def undefined(self, name: str, arity: int) -> Tree:
        """Return the tree of a goal without a rule or a builtin that can be lowered."""
        if builtin(name, arity) is not None:
            self.refuse(f"it calls {name}/{arity}")
        return require(self.pool.false, FAIL)  # the interpreter reports an unknown procedure

    def facts(self, relation: Relation, args: Sequence[Sym], then: Continue) -> Tree:
        """Return the solutions of a fact relation, in the order of its rows."""
        key = resolve(args[relation.key]) if relation.key is not None else None
        if relation.single:
            return self._row(relation, self.pool.row(relation), args, then)
        if relation.key is not None and not isinstance(key, Var):
            return self._row_of_key(relation, key, args, then)
        loop = self.pool.fresh_loop(self.pool.rows(relation))
        rest = each(loop, self._row(relation, loop, args, then))
        if relation.first is None:
            return rest
        return seq([self._row(relation, self.pool.row(relation), args, then), rest])

    def _row_of_key(self, relation: Relation, key: Sym, args: Sequence[Sym], then: Continue) -> Tree:
        assert relation.key is not None
        value = self.fold.as_node(key)
        if value is None or value.kind != relation.columns[relation.key]:
            if value is not None and value.kind == "number" and relation.columns[relation.key] == "int":
                self.refuse(f"{relation.name}/{relation.arity} is looked up by a number that may be a float")
            return FAIL
        known = self.index_of(relation, value)
        if known is not None:
            return self._row(relation, known, args, then, known_key=True)
        loop = self.pool.fresh_loop(self.pool.rows(relation))
        cond = self.pool.equal(self.pool.column(loop, relation, relation.key), value)
        found, index = self.pool.exists(loop, cond), self.pool.first(loop, cond)
        if relation.first is not None:
            at_first = self.pool.equal(value, self.pool.const(Atom(relation.first)))
            found = self.pool.or_([at_first, found])
            index = self.pool.choose(at_first, self.pool.row(relation), index)
        return guard(found, self._row(relation, index, args, then, known_key=True))

    def index_of(self, relation: Relation, value: Node) -> Node | None:
        """Return the row whose key is `value`, if its node determines that row."""
        if value.op == "col":
            return value.args[0] if value.data == (relation, relation.key) else None
        if value.is_const:
            return (
                self.pool.row(relation)
                if relation.first == getattr(value.data, "name", None) is not None
                else None
            )
        if value.op == "select":
            then, els = (self.index_of(relation, arg) for arg in value.args[1:])
            if then is not None and els is not None:
                return self.pool.choose(value.args[0], then, els)
        return None

    def _row(
        self, relation: Relation, index: Node, args: Sequence[Sym], then: Continue, *, known_key: bool = False
    ) -> Tree:
        with self.undone():
            conds: list[Node] = []
            for column, arg in enumerate(args):
                if known_key and column == relation.key:
                    continue
                value = self.pool.column(index, relation, column)
                if not self.unify(arg, value.data if value.is_const else value, conds):
                    return FAIL
            return guard(self.pool.and_(conds), then())

    def call(self, predicate: Predicate, args: Sequence[Sym], then: Continue) -> Tree:
        """Return the solutions of a predicate of the program."""
        tree = self._callee(predicate, args)
        if isinstance(tree, Fail):
            return FAIL
        if leaves(tree) == 1 and not has_each(tree):
            return self.splice(tree, args, then)
        ground = all(is_ground(arg) for arg in args)
        if (ground and not self.counting) or self.fold.single(tree):
            try:
                found, terms = self.fold.first(tree)
            except CannotMerge:
                return self.splice(tree, args, then)
            # if a later goal fails, the interpreter backtracks into this one
            undecided = self.fold.undecided(tree, whole=True)
            if not args:
                self.pool.name(found, predicate.name)
            solved = FAIL if found is self.pool.false else self.splice(Emit(terms), args, then)
            return require(self.pool.not_(undecided), guard(found, solved))
        return self.splice(tree, args, then)

    def _callee(self, predicate: Predicate, args: Sequence[Sym]) -> Tree:
        """Return the tree of a call, which emits the arguments; equal calls share it."""
        own: dict[Sym, Sym] = {}

        def copied(part: Sym) -> Sym:
            return own.setdefault(part, Var(part.name)) if isinstance(part, Var) else part

        given = [map_terms(copied, arg) for arg in args]
        numbers = {variable: number for number, variable in enumerate(own.values())}
        key = (predicate, self.counting, tuple(call_key(arg, numbers) for arg in given))
        known = self._known.get(key)
        if known is None:
            if key in self._under_way or len(self._under_way) >= _MOST_CALLS:
                self.refuse(f"it calls {predicate.name}/{predicate.arity} recursively")
            before, self._in_library = self._in_library, predicate.program is library().program
            self._calls.append(predicate.indicator)
            self._under_way.append(key)
            try:
                known = self._alternatives(list(predicate.clauses), given)
            finally:
                self._under_way.pop()
                self._calls.pop()
                self._in_library = before
            self._known[key] = known
        return known

    def _alternatives(self, clauses: Sequence[Clause], args: Sequence[Sym]) -> Tree:
        """Return the tree of the clauses in order."""
        tree: Tree = FAIL
        for clause in reversed(clauses):
            self._clauses.append(clause)
            try:
                tree = self._clause(clause, args, tree)
            finally:
                self._clauses.pop()
        return tree

    def _clause(self, clause: Clause, args: Sequence[Sym], rest: Tree) -> Tree:
        """Return the tree of one clause, and after it the `rest` unless it cuts."""
        head, body = renamed(clause)
        with self.undone():
            conds: list[Node] = []
            if not all(self.unify(arg, given, conds) for arg, given in zip(head, args, strict=True)):
                return rest
            test = self.pool.and_(conds)
            cut = cuts(body)
            tree = self.body([body], lambda: self.emit(args), lambda: rest if cut else FAIL)
        return branch(test, tree, rest) if cut else seq([guard(test, tree), rest])

    def splice(self, tree: Tree, args: Sequence[Sym], then: Continue) -> Tree:
        """Return the tree with that of `then` in place of each solution."""
        if isinstance(tree, Emit):
            self._leaves += 1
            if self._leaves > self._most_leaves:
                self.refuse(f"with it the program has more than {self._most_leaves} alternatives")
            return self._bound_terms(args, tree.terms, then)
        if isinstance(tree, Guard):
            return guard(tree.cond, self.splice(tree.body, args, then))
        if isinstance(tree, Require):
            return require(tree.cond, self.splice(tree.body, args, then))
        if isinstance(tree, Branch):
            return branch(tree.cond, self.splice(tree.then, args, then), self.splice(tree.els, args, then))
        if isinstance(tree, Seq):
            return seq([self.splice(part, args, then) for part in tree.parts])
        if isinstance(tree, Each):
            loop = self.pool.fresh_loop(tree.loop.args[0])
            return each(loop, self.splice(rename_loop(self.pool, tree, loop), args, then))
        return FAIL

    def _bound_terms(self, args: Sequence[Sym], terms: Sequence[Sym], then: Continue) -> Tree:
        with self.undone():
            fresh: dict[Sym, Sym] = {}  # the tree may be spliced in twice: no variable is shared

            def freshened(part: Sym) -> Sym:
                return fresh.setdefault(part, Var(part.name)) if isinstance(part, Var) else part

            conds: list[Node] = []
            for arg, term in zip(args, terms, strict=True):
                if not self.unify(arg, map_terms(freshened, term), conds):
                    return FAIL
            return guard(self.pool.and_(conds), then())


def _variables(goals: Sequence[Goal]) -> list[Var]:
    return variables_of([goal.term for goal in goals])
