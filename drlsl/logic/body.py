"""What the plain solver runs: a clause as patterns for its head and a graph of nodes for its body.

A frame is a list: the height of the choice points to cut back to, the continuation, the arguments of the
call, then a slot for each other variable of the clause (None until its first occurrence) and one for each
inner barrier of its control constructs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from drlsl.logic.errors import PrologError, instantiation_error, type_error
from drlsl.logic.program import Clause
from drlsl.logic.terms import TRUE, Atom, Struct, Term, Var, deref

HEIGHT: Final = 0
CONTINUATION: Final = 1
FIRST_SLOT: Final = 2

# What a node does, the most frequent first.
CALL, DET, PROCEED, IN_PLACE, CUT, FAIL, BRANCH, EITHER, SOFT_CUT, CONTROL, NONDET, RAISE = range(12)

_DEEPEST_PATTERN: Final = 60
_OPAQUE: Final = frozenset({"call", "once", "ignore", "\\+", "not"})
_FAIL: Final = Atom("fail")


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
    """A pattern too deep to be walked by recursion."""

    __slots__ = ()


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

    __slots__ = ("_locals", "_reusable", "_reuser", "size")

    def __init__(self, args: Sequence[Term]) -> None:
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
    """A term nests too deep to be walked by recursion."""


def make_pattern(term: Term, slots: Slots, local: Callable[[Var], Local] | None = None) -> Any:
    """A term as a pattern: its variables become what `local` makes of them, its ground subterms stay."""
    term = deref(term)
    if type(term) is Var:
        return slots.local(term) if local is None else local(term)
    if type(term) is not Struct:
        return term
    try:
        return _compound_pattern(term, local or slots.local, _DEEPEST_PATTERN)
    except _TooDeep:
        if local is not None:
            slots.undo_reuse()
        return _deep_pattern(term, slots)


def _compound_pattern(term: Struct, local: Callable[[Var], Local], left: int) -> Pattern | Struct:
    if not left:
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
            inner = _compound_pattern(part, local, left - 1)  # type: ignore[arg-type]  # kind says so
            parts.append(inner)
            if type(inner) is Pattern:
                is_ground = False
        else:
            parts.append(part)
    return Struct(term.name, tuple(parts)) if is_ground else Pattern(term.name, tuple(parts))


def _deep_pattern(term: Struct, slots: Slots) -> DeepPattern | Struct:
    # Shells are filled from the top; ground ones are turned back into terms from the bottom.
    root = Pattern(term.name, ())
    order = [(root, term)]
    at = 0
    while at < len(order):
        shell, source = order[at]
        at += 1
        parts: list[Any] = []
        for arg in source.args:
            arg = deref(arg)
            if type(arg) is Var:
                parts.append(slots.local(arg))
            elif type(arg) is Struct:
                inner = Pattern(arg.name, ())
                order.append((inner, arg))
                parts.append(inner)
            else:
                parts.append(arg)
        shell.args = tuple(parts)
    ground: dict[int, Struct] = {}
    for shell, _source in reversed(order):
        args = tuple(ground.get(id(part), part) for part in shell.args)
        if any(type(part) is Local or isinstance(part, Pattern) for part in args):
            shell.args = args
        else:
            ground[id(shell)] = Struct(shell.name, args)
    return ground.get(id(root)) or DeepPattern(root.name, root.args)


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
    ) -> None:
        self._link = link
        self._slots = slots
        self._clause = clause
        self.barriers = 0
        self._pending: list[tuple[Node, str]] = []

    def compile(self, body: Term, following: Node = PROCEED_NODE) -> Node:
        """The nodes of a body that go on to `following`.

        Raises:
            PrologTypeError: The body is not callable. Source: ISO 13211-1, 7.6.2.
        """
        check_body(body)
        return self._goal(body, following, HEIGHT, 0)

    def frame_size(self) -> int:
        """How many slots a frame needs behind the continuation; final once everything is compiled."""
        return (0 if self._slots is None else self._slots.size) + self.barriers

    def _barrier(self) -> int:
        # Barriers lie behind the variables, whose number is only known at the end: count them down from -1.
        self.barriers += 1
        return -self.barriers

    def _goal(self, goal: Term, following: Node, cut: int, above: int) -> Node:
        """The nodes of one goal; a cut in it cuts back to the height in slot `cut` plus `above`."""
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
                    then = self._goal(goal.args[1], following, cut, above)
                    return self._condition(goal.args[0], then)
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

    def _opaque(self, goal: Struct, following: Node, cut: int, above: int) -> Node:
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

    def _conjunction(self, goal: Struct, following: Node, cut: int, above: int) -> Node:
        goals: list[Term] = []
        todo: list[Term] = [goal]
        while todo:
            part = deref(todo.pop())
            if type(part) is Struct and part.name == "," and len(part.args) == 2:
                todo.extend((part.args[1], part.args[0]))
            else:
                goals.append(part)
        for part in reversed(goals):
            following = self._goal(part, following, cut, above)
        return following

    def _alternatives(self, goal: Struct, following: Node, cut: int, above: int) -> Node:
        left = deref(goal.args[0])
        if type(left) is Struct and len(left.args) == 2:
            if left.name == "->":
                other = self._goal(goal.args[1], following, cut, above)
                return self._branch(left.args[0], left.args[1], other, following, cut, above)
            if left.name == "*->":
                other = self._goal(goal.args[1], following, cut, above)
                then = self._goal(left.args[1], following, cut, above)
                return self._soft_branch(left.args[0], then, other)
        node = Node(EITHER, self._goal(left, following, cut, above), self._clause)
        node.other = self._goal(goal.args[1], following, cut, above)
        return node

    def _branch(
        self, condition: Term, then: Term, other: Node, following: Node, cut: int, above: int
    ) -> Node:
        """If-then-else, where `other` is compiled already; a cut in the condition is local to it."""
        after = self._goal(then, following, cut, above)
        node = Node(BRANCH, None, self._clause)
        node.slot = self._barrier()
        node.other = other
        commit = Node(CUT, after, self._clause)
        commit.slot = node.slot
        commit.target = 0
        node.next = self._goal(condition, commit, node.slot, 1)
        return node

    def _soft_branch(self, condition: Term, then: Node, other: Node) -> Node:
        node = Node(BRANCH, None, self._clause)
        node.slot = self._barrier()
        node.other = other
        commit = Node(SOFT_CUT, then, self._clause)
        commit.slot = node.slot
        commit.other = other
        node.next = self._goal(condition, commit, node.slot, 1)
        return node

    def _condition(self, goal: Term, following: Node) -> Node:
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
        return node


def check_body(body: Term) -> None:
    """Make sure that a term can be a body: callable, and so is what its control constructs join.

    Raises:
        PrologTypeError: ``type_error(callable, Body)``. Source: ISO 13211-1, 7.6.2.
    """
    todo = [body]
    while todo:
        term = deref(todo.pop())
        if type(term) is Struct:
            if len(term.args) == 2 and term.name in (",", ";", "->", "*->"):
                todo.extend(term.args)
        elif type(term) is not Atom and type(term) is not Var:
            raise type_error("callable", body)


def _has_variable_goal(body: Term) -> bool:
    """Whether a body has a variable where a goal belongs."""
    todo = [body]
    while todo:
        term = deref(todo.pop())
        if type(term) is Var:
            return True
        if type(term) is Struct and len(term.args) == 2 and term.name in (",", ";", "->", "*->"):
            todo.extend(term.args)
    return False


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


def compile_clause(clause: Clause, link: Callable[[Node, str, int], None]) -> Code:
    """Make a clause ready to be run."""
    args = clause.args
    slots = Slots(args)
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
