"""What the plain solver runs: a clause as patterns for its head and a graph of nodes for its body.

A frame is a list: the height of the choice points to cut back to, the continuation, the arguments of the
call, then a slot for each other variable of the clause (None until its first occurrence) and one for each
inner barrier of its control constructs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from drlsl.logic.core.clauses import Clause
from drlsl.logic.core.nesting import Deep, run_deep
from drlsl.logic.errors import PrologError, instantiation_error, resource_error, type_error
from drlsl.logic.limits import Meter
from drlsl.logic.terms import TRUE, Atom, CyclicTerm, Struct, Term, Var, deref, is_acyclic

HEIGHT: Final = 0
CONTINUATION: Final = 1
FIRST_SLOT: Final = 2

# What a node does, the most frequent first.
CALL, DET, PROCEED, IN_PLACE, CUT, FAIL, BRANCH, EITHER, SOFT_CUT, CONTROL, NONDET, RAISE = range(12)

_DEEPEST_PATTERN: Final = 60
_LARGEST_PATTERN: Final = 2_000
# A pattern that would make more cells than this, each time that its clause is used, is refused.
_MOST_CELLS: Final = 2_000_000
_STEPS_OF_SHELL: Final = 10
_OPAQUE: Final = frozenset({"call", "once", "ignore", "\\+", "not"})
_FAIL: Final = Atom("fail")
_CONNECTIVES: Final = frozenset({",", ";", "->", "*->"})
# After so many control constructs, a body is looked at, to be sure that it has an end.
_MANY: Final = 20_000
# A goal's node takes as much time and room as so many cells of a list.
_CELLS_OF_GOAL: Final = 4


class Local:
    """A variable of a clause: its slot in the frame."""

    __slots__ = ("index",)

    def __init__(self, index: int) -> None:
        self.index = index


class First(Local):
    """A variable where it occurs for the first time."""

    __slots__ = ()


class Pattern:
    """A compound term with variables of the clause in it."""

    __slots__ = ("args", "name")

    def __init__(self, name: str, args: tuple[Any, ...]) -> None:
        self.name = name
        self.args = args


class DeepPattern(Pattern):
    """A pattern too deep, or too large, to be walked by recursion; `cells` is how many it makes."""

    __slots__ = ("cells",)

    def __init__(self, name: str, args: tuple[Any, ...], cells: int) -> None:
        super().__init__(name, args)
        self.cells = cells


class Node:
    """One step of a body; `next` is what follows when it succeeds."""

    __slots__ = ("args", "clause", "function", "name", "next", "op", "other", "slot", "target")

    def __init__(self, op: int, following: Node | None = None, clause: Clause | None = None) -> None:
        self.op = op
        self.next: Any = following
        self.clause = clause
        self.name = ""
        self.args: tuple[Any, ...] = ()
        self.target: Any = None  # CALL: the predicate
        self.function: Any = None  # DET, IN_PLACE, NONDET, CONTROL: the builtin; RAISE: makes the error
        self.other: Node | None = (
            None  # BRANCH, SOFT_CUT: what to do when the condition fails; EITHER: the second branch
        )
        self.slot = 0  # BRANCH, CUT, SOFT_CUT: the frame's slot with the height to cut back to


PROCEED_NODE: Final = Node(PROCEED)
FAIL_NODE: Final = Node(FAIL)


class Code:
    """A clause made ready.

    Attributes:
        head: the patterns of the head, each with the position of its argument.
        blanks: what a frame holds behind the arguments.
        guard: the deterministic builtins that the body begins with, run before the other clauses are left
            as a choice.
        commits: whether a cut follows them.
        body: what follows.
    """

    __slots__ = ("blanks", "body", "commits", "guard", "head")

    def __init__(self, head: tuple[tuple[int, Any], ...], blanks: list[None], body: Node) -> None:
        self.head = head
        self.blanks = blanks
        guard = []
        while body.op == DET or body.op == IN_PLACE:
            guard.append(body)
            body = body.next
        self.guard = tuple(guard)
        self.commits = body.op == CUT and body.slot == HEIGHT and body.target == 0
        self.body: Node = body.next if self.commits else body


def build(pattern: Pattern, frame: list[Any]) -> Struct:
    """The term of a pattern, with fresh variables for those that occur for the first time."""
    if type(pattern) is DeepPattern:
        return _build_deep(pattern, frame)
    args: list[Any] = []
    for part in pattern.args:
        kind = type(part)
        if kind is First:
            term = frame[part.index] = Var()
            args.append(term)
        elif kind is Local:
            term = frame[part.index]
            if term is None:
                term = frame[part.index] = Var()
            args.append(term)
        elif kind is Pattern:
            args.append(build(part, frame))
        else:
            args.append(part)
    return Struct(pattern.name, tuple(args))


def _build_deep(pattern: Pattern, frame: list[Any]) -> Struct:
    root = Struct(pattern.name, ())
    todo = [(root, pattern.args)]
    while todo:
        shell, parts = todo.pop()
        args: list[Term] = []
        for part in parts:
            if isinstance(part, Pattern):
                inner = Struct(part.name, ())
                todo.append((inner, part.args))
                args.append(inner)
            elif isinstance(part, Local):
                term = frame[part.index]
                if term is None:
                    term = frame[part.index] = Var()
                args.append(term)
            else:
                args.append(part)
        shell.args = tuple(args)
    return root


class Slots:
    """Which slot of the frame each variable of a clause has.

    The arguments of a call lie in the frame's first slots, so a variable that is one needs no other.
    """

    __slots__ = ("_locals", "_reusable", "_reuser", "left", "meter", "size")

    def __init__(self, args: Sequence[Term], meter: Meter | None = None) -> None:
        self.meter = meter
        self.left = 0  # how many more compound terms a recursive walk may meet
        self.size = len(args)
        self._locals: dict[Var, Local] = {}
        self._reusable = 0
        self._reuser: Var | None = None
        for position, arg in enumerate(args):
            arg = deref(arg)
            if type(arg) is Var and arg not in self._locals:
                self._locals[arg] = Local(FIRST_SLOT + position)

    def is_argument(self, variable: Var, position: int) -> bool:
        """Whether a variable's slot is that of the argument at a position."""
        return self._locals[variable].index == FIRST_SLOT + position

    def reuse(self, position: int) -> None:
        """Let the slot of an argument go to the next variable that occurs for the first time in the head."""
        self._reusable = FIRST_SLOT + position
        self._reuser = None

    def undo_reuse(self) -> None:
        """Leave the slot to the argument after all: its pattern is not matched part by part."""
        self._reusable = 0
        if self._reuser is not None:
            del self._locals[self._reuser]

    def local(self, variable: Var) -> Local:
        """A variable where it may have occurred before."""
        local = self._locals.get(variable)
        if local is None:
            local = self._locals[variable] = Local(FIRST_SLOT + self.size)
            self.size += 1
        return local

    def first(self, variable: Var) -> Local:
        """A variable in the head; a `First` where it occurs for the first time."""
        local = self._locals.get(variable)
        if local is not None:
            return local
        if self._reusable:
            self._locals[variable] = Local(self._reusable)
            self._reusable = 0
            self._reuser = variable
        return First(self.local(variable).index)


class _TooDeep(Exception):
    """A term nests too deep, or is too large, to be walked by recursion."""


def make_pattern(term: Term, slots: Slots, local: Callable[[Var], Local] | None = None) -> Any:
    """A term as a pattern: its variables become what `local` makes of them, its ground subterms stay."""
    term = deref(term)
    if type(term) is Var:
        return slots.local(term) if local is None else local(term)
    if type(term) is not Struct:
        return term
    slots.left = _LARGEST_PATTERN
    try:
        return _compound_pattern(term, slots, local or slots.local, _DEEPEST_PATTERN)
    except _TooDeep:
        if local is not None:
            slots.undo_reuse()
        return _deep_pattern(term, slots)


def _compound_pattern(
    term: Struct, slots: Slots, local: Callable[[Var], Local], left: int
) -> Pattern | Struct:
    slots.left -= 1
    if not left or slots.left < 0:
        raise _TooDeep
    parts: list[Any] = []
    is_ground = True
    for part in term.args:
        if type(part) is Var:
            part = deref(part)
        kind = type(part)
        if kind is Var:
            parts.append(local(part))  # type: ignore[arg-type]  # kind says so
            is_ground = False
        elif kind is Struct:
            inner = _compound_pattern(part, slots, local, left - 1)  # type: ignore[arg-type]  # kind says so
            parts.append(inner)
            if type(inner) is Pattern:
                is_ground = False
        else:
            parts.append(part)
    return Struct(term.name, tuple(parts)) if is_ground else Pattern(term.name, tuple(parts))


def _deep_pattern(term: Struct, slots: Slots) -> DeepPattern | Struct:
    # Shells are filled from the top, one for a part that is shared; ground ones are turned back into terms
    # from the bottom.
    root = Pattern(term.name, ())
    order = [(root, term)]
    shells: dict[int, Pattern] = {id(term): root}
    at = 0
    while at < len(order):
        shell, source = order[at]
        at += 1
        if slots.meter is not None:
            slots.meter.spend(_STEPS_OF_SHELL)
        parts: list[Any] = []
        for arg in source.args:
            arg = deref(arg)
            if type(arg) is Var:
                parts.append(slots.local(arg))
            elif type(arg) is Struct:
                inner = shells.get(id(arg))
                if inner is None:
                    inner = shells[id(arg)] = Pattern(arg.name, ())
                    order.append((inner, arg))
                parts.append(inner)
            else:
                parts.append(arg)
        shell.args = tuple(parts)
    ground: dict[int, Struct] = {}
    cells: dict[int, int] = {}
    for shell in _inner_first(root):
        args = tuple(ground.get(id(part), part) for part in shell.args)
        if any(type(part) is Local or isinstance(part, Pattern) for part in args):
            shell.args = args
            cells[id(shell)] = 1 + sum(cells.get(id(part), 0) for part in args)
        else:
            ground[id(shell)] = Struct(shell.name, args)
    known = ground.get(id(root))
    if known is not None:
        return known
    if cells[id(root)] > _MOST_CELLS:
        raise resource_error("memory")
    return DeepPattern(root.name, root.args, cells[id(root)])


def _inner_first(root: Pattern) -> list[Pattern]:
    """The compound parts of a pattern, each once and behind those inside it."""
    order: list[Pattern] = []
    done: set[int] = set()
    todo: list[tuple[Pattern, bool]] = [(root, False)]
    while todo:
        pattern, is_left = todo.pop()
        if is_left:
            order.append(pattern)
        elif id(pattern) not in done:
            done.add(id(pattern))
            todo.append((pattern, True))
            todo.extend((part, False) for part in pattern.args if isinstance(part, Pattern))
    return order


class BodyCompiler:
    """Turns the body of one clause, or one goal to call, into nodes.

    `link` fills in the node of a goal that is no control construct: what its name and arity stand for.
    With `slots` None the goal is called as it stands: its variables are the caller's own.
    """

    def __init__(
        self,
        link: Callable[[Node, str, int], None],
        slots: Slots | None,
        clause: Clause | None = None,
        meter: Meter | None = None,
    ) -> None:
        self._link = link
        self._slots = slots
        self._clause = clause
        self._meter = meter
        self._body: Term = TRUE
        self.barriers = 0

    def compile(self, body: Term, following: Node = PROCEED_NODE) -> Node:
        """The nodes of a body that go on to `following`.

        Raises:
            PrologTypeError: The body is not callable. Source: ISO 13211-1, 7.6.2.
            CyclicTerm: The body has no end.
        """
        check_body(body)
        self._body = body
        node = self._goal(body, following, HEIGHT, 0)
        return node if type(node) is Node else run_deep(node)  # type: ignore[arg-type]

    def frame_size(self) -> int:
        """How many slots a frame needs behind the continuation; final once everything is compiled."""
        return (0 if self._slots is None else self._slots.size) + self.barriers

    def _barrier(self) -> int:
        # Barriers lie behind the variables, whose number is only known at the end: count them down from -1.
        self.barriers += 1
        if self.barriers == _MANY and not is_acyclic(self._body):
            raise CyclicTerm("the body contains itself")
        if self._meter is not None:
            self._meter.make(_CELLS_OF_GOAL)
        return -self.barriers

    def _goal(self, goal: Term, following: Node, cut: int, above: int) -> Node | Deep[Node]:
        """The nodes of one goal; a cut in it cuts back to the height in slot `cut` plus `above`.

        Those of a control construct are the result of the generator that is returned, so that constructs
        nest as deep as they will.
        """
        goal = deref(goal)
        if type(goal) is Struct:
            arity = len(goal.args)
            if arity == 2:
                if goal.name == ",":
                    return self._conjunction(goal, following, cut, above)
                if goal.name == ";":
                    return self._alternatives(goal, following, cut, above)
                if goal.name == "->":
                    return self._branch(goal.args[0], goal.args[1], FAIL_NODE, following, cut, above)
                if goal.name == "*->":
                    return self._soft(goal, following, cut, above)
            elif arity == 1 and goal.name in _OPAQUE:
                return self._opaque(goal, following, cut, above)
        elif type(goal) is Atom:
            if goal is TRUE:
                return following
            if goal.name == "!":
                node = Node(CUT, following, self._clause)
                node.slot = cut
                node.target = above
                return node
            if goal.name in ("fail", "false"):
                return FAIL_NODE
        return self._call(goal, following)

    def _soft(self, goal: Struct, following: Node, cut: int, above: int) -> Deep[Node]:
        then = self._goal(goal.args[1], following, cut, above)
        if type(then) is not Node:
            then = yield then
        node: Node = yield self._condition(goal.args[0], then)
        return node

    def _opaque(self, goal: Struct, following: Node, cut: int, above: int) -> Node | Deep[Node]:
        """A control construct that calls its argument, in place: cuts in the argument are local to it."""
        inner = deref(goal.args[0])
        if _has_variable_goal(inner):
            # What the variable is bound to by then is part of the goal, a cut included (7.6.2).
            if goal.name == "call":
                return self._call(goal, following)
            inner = Struct("call", (inner,))
        try:
            check_body(inner)
        except PrologError:
            # Only an error once it is reached.
            node = Node(RAISE, FAIL_NODE, self._clause)
            node.function = partial(type_error, "callable", inner)
            return node
        if goal.name == "call":
            return self._condition(inner, following)
        if goal.name == "once":
            return self._branch(inner, TRUE, FAIL_NODE, following, cut, above)
        if goal.name == "ignore":
            return self._branch(inner, TRUE, following, following, cut, above)
        return self._branch(inner, _FAIL, following, FAIL_NODE, cut, above)

    def _conjunction(self, goal: Struct, following: Node, cut: int, above: int) -> Deep[Node]:
        goals: list[Term] = []
        todo: list[Term] = [goal]
        while todo:
            part = deref(todo.pop())
            if type(part) is Struct and part.name == "," and len(part.args) == 2:
                todo.extend((part.args[1], part.args[0]))
            else:
                goals.append(part)
        if self._meter is not None:
            self._meter.make(_CELLS_OF_GOAL * len(goals))
        for part in reversed(goals):
            node = self._goal(part, following, cut, above)
            following = node if type(node) is Node else (yield node)
        return following

    def _alternatives(self, goal: Struct, following: Node, cut: int, above: int) -> Deep[Node]:
        node: Node
        left = deref(goal.args[0])
        other = self._goal(goal.args[1], following, cut, above)
        if type(other) is not Node:
            other = yield other
        if type(left) is Struct and len(left.args) == 2:
            if left.name == "->":
                node = yield self._branch(left.args[0], left.args[1], other, following, cut, above)
                return node
            if left.name == "*->":
                then = self._goal(left.args[1], following, cut, above)
                if type(then) is not Node:
                    then = yield then
                node = yield self._soft_branch(left.args[0], then, other)
                return node
        first = self._goal(left, following, cut, above)
        node = Node(EITHER, first if type(first) is Node else (yield first), self._clause)
        node.other = other
        return node

    def _branch(
        self, condition: Term, then: Term, other: Node, following: Node, cut: int, above: int
    ) -> Deep[Node]:
        """If-then-else, where `other` is compiled already; a cut in the condition is local to it."""
        after = self._goal(then, following, cut, above)
        if type(after) is not Node:
            after = yield after
        node: Node = yield self._test(CUT, condition, after, other)
        return node

    def _soft_branch(self, condition: Term, then: Node, other: Node) -> Deep[Node]:
        return self._test(SOFT_CUT, condition, then, other)

    def _test(self, commit_by: int, condition: Term, then: Node, other: Node) -> Deep[Node]:
        """A condition whose first solution leads to `then`, and that has `other` if there is none."""
        node = Node(BRANCH, None, self._clause)
        node.slot = self._barrier()
        node.other = other
        commit = Node(commit_by, then, self._clause)
        commit.slot = node.slot
        commit.target = 0
        if commit_by == SOFT_CUT:
            commit.other = other
        first = self._goal(condition, commit, node.slot, 1)
        node.next = first if type(first) is Node else (yield first)
        return node

    def _condition(self, goal: Term, following: Node) -> Deep[Node]:
        """A goal to whose inside cuts are local, and that leaves its choice points."""
        return self._soft_branch(goal, following, FAIL_NODE)

    def _call(self, goal: Term, following: Node) -> Node:
        if type(goal) is Var:
            goal = Struct("call", (goal,))
        node = Node(CALL, following, self._clause)
        if type(goal) is Struct:
            node.name = goal.name
            slots = self._slots
            if slots is None:
                node.args = goal.args
            else:
                node.args = tuple(make_pattern(arg, slots) for arg in goal.args)
        elif type(goal) is Atom:
            node.name = goal.name
        self._link(node, node.name, len(node.args))
        cells = sum(part.cells for part in node.args if type(part) is DeepPattern)
        if not cells:
            return node
        before = Node(DET, node, self._clause)
        before.function = partial(_make_cells, cells)
        return before


def _make_cells(cells: int, machine: Any) -> bool:
    """Account for the large terms that a goal is about to be called with."""
    machine.meter.make(cells)
    return True


def check_body(body: Term) -> None:
    """Make sure that a term can be a body: callable, and so is what its control constructs join.

    Raises:
        PrologTypeError: ``type_error(callable, Body)``. Source: ISO 13211-1, 7.6.2.
        CyclicTerm: The body has no end.
    """
    for part in _joined(body):
        if type(part) is not Atom and type(part) is not Var and type(part) is not Struct:
            raise type_error("callable", body)


def _has_variable_goal(body: Term) -> bool:
    """Whether a body has a variable where a goal belongs."""
    return any(type(part) is Var for part in _joined(body))


def _joined(body: Term) -> list[Term]:
    """What the control constructs of a body join, dereferenced."""
    joined: list[Term] = []
    todo = [body]
    met = 0
    while todo:
        term = deref(todo.pop())
        if type(term) is Struct and len(term.args) == 2 and term.name in _CONNECTIVES:
            todo.extend(term.args)
            met += 1
            if met == _MANY and not is_acyclic(body):
                raise CyclicTerm("the body contains itself")
        else:
            joined.append(term)
    return joined


def callable_parts(goal: Term) -> tuple[str, tuple[Term, ...]]:
    """The name and the arguments of a goal.

    Raises:
        InstantiationError: The goal is a variable.
        PrologTypeError: The goal is no callable term.
    """
    goal = deref(goal)
    if type(goal) is Struct:
        return goal.name, goal.args
    if type(goal) is Atom:
        return goal.name, ()
    if type(goal) is Var:
        raise instantiation_error()
    raise type_error("callable", goal)


def compile_clause(
    clause: Clause, link: Callable[[Node, str, int], None], meter: Meter | None = None
) -> Code:
    """Make a clause ready to be run."""
    args = clause.args
    slots = Slots(args, meter)
    head: list[tuple[int, Any]] = []
    for position, arg in enumerate(args):
        arg = deref(arg)
        if type(arg) is Var and slots.is_argument(arg, position):
            continue
        if type(arg) is Struct:
            slots.reuse(position)
        head.append((position, make_pattern(arg, slots, slots.first)))
    compiler = BodyCompiler(link, slots, clause)
    body = compiler.compile(clause.body)
    return Code(tuple(head), [None] * (compiler.frame_size() - len(args)), body)
