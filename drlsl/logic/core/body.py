"""The plain solver's code: a clause as patterns for its head and a graph of nodes for its body.

A frame is a list: the height of the choice points to cut back to, the continuation, the arguments of the
call, then a slot for each other variable of the clause (None until its first occurrence) and one for each
inner barrier of its control constructs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from drlsl.logic.core import goal_tree
from drlsl.logic.core.clauses import Clause
from drlsl.logic.errors import resource_error, type_error
from drlsl.logic.limits import Meter
from drlsl.logic.terms import TRUE, Struct, Term, Var, deref

HEIGHT: Final = 0
CONTINUATION: Final = 1
FIRST_SLOT: Final = 2

# The kinds of nodes, the most frequent first.
CALL, DET, PROCEED, IN_PLACE, CUT, FAIL, BRANCH, EITHER, SOFT_CUT, CONTROL, NONDET, RAISE, RESUME = range(13)

_DEEPEST_PATTERN: Final = 60
_LARGEST_PATTERN: Final = 2_000
# A pattern that would create more cells than this at each use of its clause is refused.
_MOST_CELLS: Final = 2_000_000
# A body with fewer returns to it is not worth measuring.
_UNMEASURED: Final = 64
_STEPS_OF_SHELL: Final = 10


class Local:
    """A variable of a clause: its slot in the frame."""

    __slots__ = ("index",)

    def __init__(self, index: int) -> None:
        self.index = index


class First(Local):
    """A variable at its first occurrence."""

    __slots__ = ()


class Pattern:
    """A compound term with variables of the clause in it."""

    __slots__ = ("args", "name")

    def __init__(self, name: str, args: tuple[Any, ...]) -> None:
        self.name = name
        self.args = args


class DeepPattern(Pattern):
    """A pattern too deep, or too large, for recursion; `cells` is the number that it creates."""

    __slots__ = ("cells",)

    def __init__(self, name: str, args: tuple[Any, ...], cells: int) -> None:
        super().__init__(name, args)
        self.cells = cells


class Node:
    """One step of a body; `next` is the step after its success."""

    __slots__ = ("args", "clause", "code", "function", "name", "next", "op", "other", "slot", "target")

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
        self.code: Any = None  # RESUME: generated code, a function of the machine and the frame
        self.slot = 0  # BRANCH, CUT, SOFT_CUT: the frame's slot with the height to cut back to


PROCEED_NODE: Final = Node(PROCEED)
FAIL_NODE: Final = Node(FAIL)


class Code:
    """The prepared form of a clause.

    Attributes:
        head: the patterns of the head, each with the position of its argument.
        blanks: the part of a frame after the arguments.
        guard: the deterministic builtins at the beginning of the body, run before a choice point for the
            other clauses is made.
        commits: whether a cut follows them.
        body: the rest.
        patience: how many returns to the body by the plain solver are left until `Program.resume`, or 0.
        measured: whether the size of the clause is part of its patience.
    """

    __slots__ = ("blanks", "body", "commits", "guard", "head", "measured", "patience")

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
        self.patience = _UNMEASURED
        self.measured = False


def build(pattern: Pattern, frame: list[Any]) -> Struct:
    """Return the term of a pattern, with fresh variables for those that occur for the first time."""
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
    """The slot of each variable of a clause in the frame.

    The arguments of a call are in the frame's first slots, so a variable that is one needs no other.
    """

    __slots__ = ("_locals", "_reusable", "_reuser", "left", "meter", "size")

    def __init__(self, args: Sequence[Term], meter: Meter | None = None) -> None:
        self.meter = meter
        self.left = 0  # the number of further compound terms for a recursive walk
        self.size = len(args)
        self._locals: dict[Var, Local] = {}
        self._reusable = 0
        self._reuser: Var | None = None
        for position, arg in enumerate(args):
            arg = deref(arg)
            if type(arg) is Var and arg not in self._locals:
                self._locals[arg] = Local(FIRST_SLOT + position)

    def places(self) -> dict[Var, int]:
        """Return the slot of each variable that has one by now."""
        return {variable: local.index for variable, local in self._locals.items()}

    def is_argument(self, variable: Var, position: int) -> bool:
        """Return whether a variable's slot is that of the argument at a position."""
        return self._locals[variable].index == FIRST_SLOT + position

    def reuse(self, position: int) -> None:
        """Let the next variable with its first occurrence in the head use the slot of an argument."""
        self._reusable = FIRST_SLOT + position
        self._reuser = None

    def undo_reuse(self) -> None:
        """Keep the slot for the argument after all: its pattern is not matched part by part."""
        self._reusable = 0
        if self._reuser is not None:
            del self._locals[self._reuser]

    def local(self, variable: Var) -> Local:
        """Return a variable that may have occurred before."""
        local = self._locals.get(variable)
        if local is None:
            local = self._locals[variable] = Local(FIRST_SLOT + self.size)
            self.size += 1
        return local

    def first(self, variable: Var) -> Local:
        """Return a variable in the head; a `First` at its first occurrence."""
        local = self._locals.get(variable)
        if local is not None:
            return local
        if self._reusable:
            self._locals[variable] = Local(self._reusable)
            self._reusable = 0
            self._reuser = variable
        return First(self.local(variable).index)


class _TooDeep(Exception):
    """A term nests too deep, or is too large, for recursion."""


def make_pattern(term: Term, slots: Slots, local: Callable[[Var], Local] | None = None) -> Any:
    """Return the pattern of a term: `local` converts its variables, ground subterms are kept."""
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
    # Shells are filled from the top, one for each shared part; ground ones are turned back into terms
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
    """Return the compound parts of a pattern, each once and after those inside it."""
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
    """Turns the goals of one clause, or one goal to call, into nodes.

    `link` sets the target of a node by name and arity, unless it is a control construct. With `slots` None
    the goal is called directly: its variables are the caller's own.
    """

    def __init__(
        self, link: Callable[[Node, str, int], None], slots: Slots | None, clause: Clause | None = None
    ) -> None:
        self._link = link
        self._slots = slots
        self._clause = clause
        self._heights: dict[goal_tree.Barrier, tuple[int, int]] = {goal_tree.CLAUSE: (HEIGHT, 0)}
        self.barriers = 0

    def compile(self, body: goal_tree.Goal) -> Node:
        """Return the nodes of a body.

        Raises:
            PrologTypeError: The body is not callable. Source: ISO 13211-1, 7.6.2.
        """
        if type(body) is goal_tree.NotCallable:
            raise type_error("callable", body.term)
        # From the last goal to the first, since a node needs the one that follows it. Each item to do is a
        # goal, or the use of the nodes of the goals after it.
        following = PROCEED_NODE
        if type(body) is goal_tree.Call:
            return self._call(body.name, body.args, following)
        todo: list[goal_tree.Goal | _Step] = [body]
        while todo:
            goal = todo.pop()
            kind = type(goal)
            if kind is goal_tree.Call:
                following = self._call(goal.name, goal.args, following)  # type: ignore[union-attr]
            elif kind is goal_tree.Conjunction:
                todo += goal.goals  # type: ignore[union-attr]
            elif kind is _Step:
                following = goal.take(following)  # type: ignore[union-attr]
            else:
                following = self._control(goal, following, todo)  # type: ignore[arg-type]
        return following

    def frame_size(self) -> int:
        """Return the number of slots of a frame after the continuation, once everything is compiled."""
        return (0 if self._slots is None else self._slots.size) + self.barriers

    def _control(self, goal: goal_tree.Goal, following: Node, todo: list[goal_tree.Goal | _Step]) -> Node:
        """Return the node that continues a control construct; the goals before it go to `todo`."""
        match goal:
            case goal_tree.Truth(holds):
                return following if holds else FAIL_NODE
            case goal_tree.Cut(barrier):
                return self._cut(CUT, barrier, following)
            case goal_tree.Disjunction(first, second):
                node = Node(EITHER, None, self._clause)
                todo += (_Step(node, None), first, _Step(node, following), second)
            case goal_tree.IfThenElse(condition, then, otherwise, soft, barrier):
                self._branch(todo, following, condition, then, otherwise, barrier, soft=soft)
            case goal_tree.Negation(inner, barrier):
                self._branch(todo, following, inner, goal_tree.FAILURE, goal_tree.SUCCEED, barrier)
            case goal_tree.Opaque(inner, barrier):
                # A soft condition leaves the choice points of the goal.
                self._branch(todo, following, inner, goal_tree.SUCCEED, goal_tree.FAILURE, barrier, soft=True)
            case goal_tree.Derived(_, meaning):
                todo.append(meaning)
            case goal_tree.Findall(_, _, _, _, term):
                return self._call("findall", term.args, following)
            case goal_tree.NotCallable(term):
                node = Node(RAISE, FAIL_NODE, self._clause)
                node.args = self._patterns((term,))
                return node
        return following

    def _branch(
        self,
        todo: list[goal_tree.Goal | _Step],
        following: Node,
        condition: goal_tree.Goal,
        then: goal_tree.Goal,
        otherwise: goal_tree.Goal,
        barrier: goal_tree.Barrier,
        *,
        soft: bool = False,
    ) -> None:
        """Add an if-then-else to `todo`; a cut in the condition is local."""
        # Barriers come after the variables, whose number is only known at the end: count them down from -1.
        self.barriers += 1
        node = Node(BRANCH, None, self._clause)
        node.slot = -self.barriers
        commit = Node(SOFT_CUT if soft else CUT, None, self._clause)
        commit.slot = node.slot
        commit.target = 0
        # A cut in the condition leaves the choice point for `otherwise`.
        self._heights[barrier] = node.slot, 1
        todo += (_Step(node, None), condition, _Step(commit, None), then, _Step(node, following), otherwise)

    def _cut(self, op: int, barrier: goal_tree.Barrier, following: Node) -> Node:
        node = Node(op, following, self._clause)
        node.slot, node.target = self._heights[barrier]
        return node

    def _patterns(self, args: tuple[Term, ...]) -> tuple[Any, ...]:
        slots = self._slots
        return args if slots is None else tuple([make_pattern(arg, slots) for arg in args])

    def _call(self, name: str, args: tuple[Term, ...], following: Node) -> Node:
        node = Node(CALL, following, self._clause)
        node.name = name
        node.args = self._patterns(args)
        self._link(node, name, len(args))
        cells = sum([part.cells for part in node.args if type(part) is DeepPattern])
        if not cells:
            return node
        before = Node(DET, node, self._clause)
        before.function = partial(_make_cells, cells)
        return before


class _Step:
    """The use of the nodes of the goals just compiled.

    With `following` they become a node's `other` way, and `following` is what comes after the next goals;
    without it they come after the node.
    """

    __slots__ = ("following", "node")

    def __init__(self, node: Node, following: Node | None) -> None:
        self.node = node
        self.following = following

    def take(self, nodes: Node) -> Node:
        """Link the nodes; return what follows the goals that are compiled next."""
        if self.following is None:
            self.node.next = nodes
            return self.node
        self.node.other = nodes
        return self.following


def _make_cells(cells: int, machine: Any) -> bool:
    """Account for the large terms that a goal is about to be called with."""
    machine.meter.make(cells)
    return True


def compile_clause(
    clause: Clause, link: Callable[[Node, str, int], None], meter: Meter | None = None
) -> Code:
    """Prepare a clause to be run."""
    return _prepare(clause, link, meter)[0]


def slots_of(clause: Clause, link: Callable[[Node, str, int], None]) -> dict[Var, int]:
    """Return the slot of each variable of a clause in the frames of its calls."""
    return _prepare(clause, link, None)[1].places()


def _prepare(
    clause: Clause, link: Callable[[Node, str, int], None], meter: Meter | None
) -> tuple[Code, Slots]:
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
    size, body = slots.size, PROCEED_NODE
    if clause.body is not TRUE:
        compiler = BodyCompiler(link, slots, clause)
        body = compiler.compile(goal_tree.read_body(clause.body, meter=meter))
        size = compiler.frame_size()
    return Code(tuple(head), [None] * (size - len(args)), body), slots
