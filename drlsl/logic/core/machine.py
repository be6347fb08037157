"""The plain solver: SLD resolution over nodes, with its own continuations and choice points.

A *task* is what to do next: a tuple whose first item is a function of the machine and the task that returns
the next task, or None when the search stops at a solution or at its end. `run` is the task of the plain
solver itself, and stays in its own loop as long as what follows is its own. Apart from ``(run, node, frame)``
and ``(fail,)`` a task that continues something has its continuation, a task, as its last item.

A *choice point* is a tuple too: a function of the machine and the choice point that returns a task, the
length of the trail to undo to, and whatever the function needs. Backtracking removes a choice point before it
calls it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import repeat
from typing import TYPE_CHECKING, Any, Final, TextIO, TypeAlias

from drlsl.logic.core.body import (
    BRANCH,
    CALL,
    CONTROL,
    CUT,
    DET,
    EITHER,
    IN_PLACE,
    PROCEED,
    PROCEED_NODE,
    RAISE,
    RESUME,
    SOFT_CUT,
    BodyCompiler,
    DeepPattern,
    Local,
    Node,
    Pattern,
    build,
    compile_clause,
)
from drlsl.logic.core.body import FAIL as FAIL_OP
from drlsl.logic.core.builtin_table import QUICK
from drlsl.logic.core.goal_tree import read_body
from drlsl.logic.core.head_matching import arguments, match, match_row
from drlsl.logic.core.host import Host
from drlsl.logic.core.unification import UndoCall, compact, copy_term, excerpt, undo, unify
from drlsl.logic.errors import PrologError, representation_error, resource_error, type_error
from drlsl.logic.limits import LimitExceeded as LimitExceeded
from drlsl.logic.limits import Limits as Limits
from drlsl.logic.limits import Meter, exceeded
from drlsl.logic.terms import NIL, Atom, CyclicTerm, Struct, Term, Var

if TYPE_CHECKING:
    from drlsl.logic.core.clauses import Clause, Predicate
    from drlsl.logic.terms import Operators

Task: TypeAlias = tuple[Any, ...]
Choice: TypeAlias = tuple[Any, ...]

# The inferences that an error counts as, since the calls before it do not count.
_STEPS_OF_ERROR: Final = 200
# How many tasks the trampoline runs at most before it counts them; in a search for another one they are
# fewer, since such are short, and what is left of a turn is never counted.
_MOST_BOUNCES: Final = 251
_BOUNCES_INSIDE: Final = 8
_COMPACT_TRAIL: Final = 250
# The size of a goal's copy for its error: more than messages show.
_GOAL_CELLS: Final = 2_000


class Machine:
    """A search: its trail, its choice points and its limits.

    A search on behalf of another one, such as that of a cleanup goal, shares its `meter`.
    """

    __slots__ = (
        "_bounces",
        "_depth_at",
        "_most_bounces",
        "_slice",
        "_trail_at",
        "_unwinding",
        "choices",
        "compiled",
        "engine",
        "evaluations",
        "flags",
        "found",
        "left",
        "limits",
        "meter",
        "output",
        "program",
        "rounds",
        "trail",
    )

    output: TextIO

    def __init__(self, engine: Host, limits: Limits, meter: Meter | None = None) -> None:
        self.engine = engine
        self.program = engine.program
        self.flags = engine.flags
        self.output = engine.output
        self.meter = Meter(limits) if meter is None else meter
        self.trail: list[Any] = [self.meter]
        self.choices: list[Choice] = [(exhausted, 1)]
        self.compiled = engine.compiled
        self.found = False
        self.evaluations: Any = None  # the tables that are being filled, once there is one
        self.limits = limits
        self._most_bounces = _MOST_BOUNCES if meter is None else _BOUNCES_INSIDE
        self._depth_at = 0
        self._trail_at = _COMPACT_TRAIL
        self._unwinding = False
        self._slice = self.left = 0
        self._next_slice()

    @property
    def operators(self) -> Operators:
        """The operators of the engine."""
        return self.engine.operators

    @property
    def globals(self) -> dict[str, Term]:
        """The global variables of the engine."""
        return self.engine.globals

    @property
    def state(self) -> dict[str, Any]:
        """The state of the engine's builtins between queries."""
        return self.engine.state

    def unify(self, left: Term, right: Term) -> bool:
        """Make two terms equal, recording each binding on the trail; return True if that is possible."""
        return unify(left, right, self.trail)

    def trail_call(self, undo_call: Callable[[], None]) -> None:
        """Have `undo_call` called when execution backtracks beyond this point."""
        self.trail.append(UndoCall(undo_call))

    def undefined(self, predicate: Predicate, args: Sequence[Term], continuation: Task) -> Task:
        """Return the task for a call of an unknown predicate."""
        task: Task = self.engine.undefined(self, predicate, args, continuation)
        return task

    def solve(self, task: Task) -> bool:
        """Run a task until it finds a solution (True) or has none left (False).

        Raises:
            PrologError: An error that no catch/3 caught, with its `goal` and `clause`.
            LimitExceeded: The query went beyond its limits.
        """
        while True:
            try:
                while True:
                    for _ in repeat(None, self._bounces):
                        task = task[0](self, task)
                    self.left -= self._bounces
                    if self.left < 0:
                        self.tick(task)
            except Stop:
                return self.found
            except PrologError as error:
                add_context(error)
                task = self._handle(error)
            except RecursionError:
                task = self._handle(resource_error("recursion"))
            except CyclicTerm:
                task = self._handle(representation_error("acyclic_term"))
            except MemoryError:
                self.meter.allow_cleanup()
                raise exceeded("memory", "the memory there is") from None

    def retry(self) -> bool:
        """Search another solution after `solve` found one."""
        return self.solve(FAIL)

    def keep(self, trail: list[Any]) -> None:
        """Move the bindings of the solution to the trail of another search, and drop the choice points."""
        cut(self, 0)
        trail.extend(self.trail[1:])
        del self.trail[1:]

    def close(self) -> None:
        """End the search, run the waiting cleanup goals, and undo every binding.

        Cleanup goals for which the limits leave nothing are not started.

        Raises:
            PrologError: The first error of a cleanup goal; the others were run nevertheless.
        """
        first: PrologError | None = None
        try:
            while self.choices:
                try:
                    cut(self, 0)
                except PrologError as error:
                    first = first or error
                    if self.meter.is_spent():
                        self.choices.clear()
        finally:
            undo(self.trail, 1)
        if first is not None:
            raise first

    def call(self, goal: Term, continuation: Task) -> Task:
        """Return the task that proves a goal, opaque to cuts, and then continues with `continuation`."""
        compiler = BodyCompiler(self.engine.linker.link, None)
        node = compiler.compile(read_body(goal, meter=self.meter))
        return run, node, [len(self.choices), continuation] + [None] * compiler.frame_size()

    def _handle(self, error: PrologError) -> Task:
        """Return the task of the innermost catch/3 that catches an error; raise it again if there is none."""
        ball = error.term
        if error.catchable:
            try:
                # The calls before an error are not counted: a loop of only errors would never be.
                self.meter.spend(_STEPS_OF_ERROR)
                ball = copy_term(ball, meter=self.meter)
            except LimitExceeded as exceeded:
                error = exceeded
        if not error.catchable:
            if isinstance(error, LimitExceeded):
                self.meter.allow_cleanup()
            raise error
        self._unwinding = True
        try:
            return self._unwind(ball, error)
        finally:
            self._unwinding = False

    def _unwind(self, ball: Term, error: PrologError) -> Task:
        choices = self.choices
        while choices:
            choice = choices.pop()
            undo(self.trail, choice[1])
            if choice[0] is leave_catch and choice[2].active:
                point = choice[2]
                if unify(ball, point.catcher, self.trail):
                    return self.call(point.recovery, point.continuation)
                undo(self.trail, choice[1])
            elif choice[0] is retry_generator:
                choice[2].close()
            elif choice[0] is leave_cleanup:
                try:
                    clean_up(self, choice[2])
                except PrologError as another:
                    # The present error is the one to report.
                    if not another.catchable:
                        raise
        error.term = ball
        raise error

    def reenter(self, point: CatchPoint) -> None:
        """Activate a catch/3 again, because backtracking returns to its goal.

        An error being raised undoes the exit, too, but does not re-enter anything.
        """
        if not self._unwinding:
            point.active = True

    def tick(self, task: Task | None) -> None:
        """Account for a slice of inferences and check the limits; `task` is the next one.

        Raises:
            LimitExceeded: A limit is exceeded.
        """
        used = self._slice - self.left
        self._slice = self.left = 0
        limits = self.limits
        self.meter.count(used)
        self._depth_at -= used
        self._check_trail()
        if limits.depth is not None and self._depth_at <= 0:
            depth = _depth(task)
            if depth > limits.depth:
                raise exceeded("depth", f"{limits.depth:,} calls in depth")
            # A call deepens the search by at most one, so no limit can be exceeded before this.
            self._depth_at = max(limits.depth - depth, limits.depth // 8)
        self._next_slice()

    def rest(self, task: Task) -> Task:
        """Count the rounds of a compiled loop that has used up its share; the trampoline counts the first."""
        self.left -= self.rounds - 1
        if self.left < 0:
            self.tick(task)
        return task

    def _next_slice(self) -> None:
        pace = self.meter.pace
        turn = pace >> 1
        self._bounces = min(turn, self._most_bounces)
        most = self.meter.inferences_left()
        if most is None:
            self.rounds = turn
        else:
            # A loop in compiled code counts as one inference, so where they are limited it goes round once.
            self.rounds = 1
            pace = max(1, min(pace, most))
        depth = self.limits.depth
        if depth is not None and depth < pace:
            pace = max(1, depth)
        self._slice = self.left = pace

    def _check_trail(self) -> None:
        size = len(self.trail)
        if size > self._trail_at:
            start = self.choices[-1][1] if self.choices else 0
            compact(self.trail, start, ())
            size = len(self.trail)
            # Entries before the newest choice point were not checked, and soon may be.
            self._trail_at = size + max(_COMPACT_TRAIL, size - start)
        most = self.limits.trail
        if most is not None and size + len(self.choices) > most:
            raise exceeded("trail", f"{most:,} bindings and choice points")


def _depth(task: Task | None) -> int:
    depth = 0
    while type(task) is tuple:
        depth += 1
        task = task[2][1] if task[0] is run else task[-1]
    return depth


class Stop(BaseException):
    """The search has reached a solution or its end."""


_STOP: Final = Stop()


def fail(machine: Machine, _task: Task | None = None) -> Task:
    """Backtrack to the newest choice point, which becomes the task."""
    choice = machine.choices.pop()
    trail = machine.trail
    mark = choice[1]
    if len(trail) > mark:
        if len(trail) == mark + 1:
            trail.pop().ref = None
        else:
            undo(trail, mark)
    return choice


FAIL: Final[Task] = (fail,)


def exhausted(machine: Machine, _choice: Choice) -> Task:
    """Stop at the oldest choice point: there are no more solutions."""
    machine.found = False
    machine.choices.append((exhausted, 1))
    raise _STOP.with_traceback(None)


def found(machine: Machine, _task: Task) -> Task:
    """Stop at the last continuation: a solution."""
    machine.found = True
    raise _STOP.with_traceback(None)


FOUND: Final[Task] = (found, None)


class CatchPoint:
    """A running catch/3; not `active` after its goal was left."""

    __slots__ = ("active", "catcher", "continuation", "recovery")

    def __init__(self, catcher: Term, recovery: Term, continuation: Task) -> None:
        self.catcher = catcher
        self.recovery = recovery
        self.continuation = continuation
        self.active = True


def leave_catch(_machine: Machine, _choice: Choice) -> Task:
    """Fail at the choice point of a catch/3, whose goal has failed."""
    return FAIL


def exit_catch(machine: Machine, task: Task) -> Task:
    """Leave a catch/3 whose goal has succeeded."""
    point: CatchPoint = task[1]
    top = machine.choices[-1]
    if top[0] is leave_catch and top[2] is point:
        machine.choices.pop()
    else:
        point.active = False
        machine.trail_call(partial(machine.reenter, point))
    continuation: Task = task[2]
    return continuation


def collect(machine: Machine, task: Task) -> Task:
    """Keep a copy of a findall/3's template, and search the next solution."""
    task[2].append(copy_term(task[1], None, machine.meter))
    return FAIL


def retry_generator(machine: Machine, choice: Choice) -> Task:
    """Resume the choice point of a nondeterministic builtin: get its next solution."""
    machine.left -= 1
    if machine.left < 0:
        machine.tick(choice[3])
    return start_generator(machine, choice[2], choice[3])


def leave_cleanup(machine: Machine, choice: Choice) -> Task:
    """Clean up at the choice point of a setup_call_cleanup/3, whose goal has failed."""
    clean_up(machine, choice[2])
    return FAIL


def exit_cleanup(machine: Machine, task: Task) -> Task:
    """Leave a setup_call_cleanup/3 whose goal has succeeded; clean up if it left no choice points."""
    top = machine.choices[-1]
    if top[0] is leave_cleanup and top[2] is task[1]:
        machine.choices.pop()
        clean_up(machine, task[1])
    continuation: Task = task[2]
    return continuation


def clean_up(machine: Machine, goal: Sequence[Term]) -> None:
    """Run the cleanup goal of a setup_call_cleanup/3 once, as a search of its own whose bindings are kept.

    It is subject to the limits of the query. After one was exceeded, all cleanup goals together may use
    another tenth of the limits.
    """
    machine.engine.run_directive(goal[0], machine.output, machine.trail, machine.meter)


_OVER: Final = object()


def start_generator(machine: Machine, solutions: Iterator[bool | None], continuation: Task) -> Task:
    """Return the task of a nondeterministic builtin's next solution; one that yields True is the last."""
    mark = len(machine.trail)
    last = next(solutions, _OVER)
    if last is _OVER:
        return FAIL
    if last is not True:
        machine.choices.append((retry_generator, mark, solutions, continuation))
    return continuation


def other_branch(_machine: Machine, choice: Choice) -> Task:
    """Continue at the choice point of a disjunction or an if-then-else: with its second branch."""
    return run, choice[2], choice[3]


def dead(_machine: Machine, _choice: Choice) -> Task:
    """Fail at a choice point that a soft cut removed."""
    return FAIL


def other_clauses(machine: Machine, choice: Choice) -> Task:
    """Try the remaining clauses at the choice point of a call."""
    return try_clauses(machine, *choice[2:])


def other_rows(machine: Machine, choice: Choice) -> Task:
    """Try the remaining rows at the choice point of a call."""
    return try_rows(machine, *choice[2:])


def enter(machine: Machine, predicate: Predicate, args: Sequence[Any], continuation: Task) -> Task:
    """Call a predicate with dereferenced arguments, by its compiled code if the engine uses such."""
    if machine.compiled:
        if not predicate.cold:
            return (predicate.entry, 0, None, *args, continuation)
        predicate.cold -= 1
    return interpret(machine, predicate, args, continuation)


def interpret(machine: Machine, predicate: Predicate, args: Sequence[Any], continuation: Task) -> Task:
    """Call a predicate with dereferenced arguments, clause by clause, without compiled code."""
    task: Task = (predicate.tabled or try_all)(machine, predicate, args, continuation)
    return task


def run_clauses(machine: Machine, predicate: Predicate, args: Sequence[Any], continuation: Task) -> Task:
    """Run the clauses of a tabled predicate, by their compiled code if the engine uses such."""
    if machine.compiled:
        return (predicate.clauses_entry, 0, None, *args, continuation)
    return try_all(machine, predicate, args, continuation)


def try_all(machine: Machine, predicate: Predicate, args: Sequence[Any], continuation: Task) -> Task:
    """Try the clauses or rows of a predicate."""
    if predicate.rows is not None:
        rows = predicate.candidate_rows(args[0] if args else NIL)
        return try_rows(machine, rows, 0, args, continuation)
    candidates = predicate.stored
    start = 0
    if len(candidates) > 1:
        # `Predicate.candidates`, inlined.
        first = args[0] if args else NIL
        kind = type(first)
        if kind is Var:
            start = predicate.start
        else:
            buckets = predicate.buckets
            if buckets is None:
                buckets = predicate.make_buckets()
            if kind is Struct:
                candidates = buckets.get((first.name, len(first.args)), predicate.others)  # type: ignore[union-attr]
            elif kind is float or kind is str:
                candidates = buckets.get((kind, first), predicate.others)
            else:
                candidates = buckets.get(first, predicate.others)
    end = len(candidates)
    if not end and not predicate.defined:
        return machine.undefined(predicate, args, continuation)
    return try_clauses(machine, candidates, start, end, machine.program.generation, args, continuation)


def try_rows(
    machine: Machine, rows: list[tuple[Any, ...]], index: int, args: Sequence[Any], continuation: Task
) -> Task:
    """Continue with the first matching row from `index` on, leaving a choice point if others follow."""
    trail = machine.trail
    mark = len(trail)
    end = len(rows)
    while index < end:
        row = rows[index]
        index += 1
        if match_row(row, args, trail):
            if index < end:
                machine.choices.append((other_rows, mark, rows, index, args, continuation))
            return continuation
        if len(trail) > mark:
            undo(trail, mark)
    return FAIL


def try_clauses(
    machine: Machine,
    candidates: list[Clause],
    index: int,
    end: int,
    generation: int,
    args: Sequence[Any],
    continuation: Task,
) -> Task:
    """Continue with the first matching clause from `index` on, leaving a choice point if others follow."""
    trail = machine.trail
    choices = machine.choices
    mark = len(trail)
    height = len(choices)
    while index < end:
        clause = candidates[index]
        index += 1
        if clause.erased and clause.erased <= generation:
            continue
        code = clause.code
        if code is None:
            code = clause.code = compile_clause(clause, clause.predicate.program.link, machine.meter)
        frame = [height, continuation, *args, *code.blanks]
        for position, pattern in code.head:
            arg = args[position]
            kind = type(pattern)
            if kind is Pattern:
                if type(arg) is Var and arg.ref is None:
                    arg.ref = build(pattern, frame)
                    trail.append(arg)
                elif not match(pattern, arg, frame, trail):
                    break
            elif kind is Local:
                if not unify(frame[pattern.index], arg, trail):
                    break
            elif arg is not pattern:
                if kind is DeepPattern:
                    machine.meter.make(pattern.cells)
                    pattern = build(pattern, frame)
                if type(arg) is Var and arg.ref is None:
                    arg.ref = pattern
                    trail.append(arg)
                elif (kind is Atom and type(arg) is Atom) or not unify(pattern, arg, trail):
                    break
        else:
            if not code.guard or passes(machine, code.guard, frame):
                if index < end and not code.commits:
                    choices.append(
                        (other_clauses, mark, candidates, index, end, generation, args, continuation)
                    )
                # A fact has no body to run.
                return continuation if code.body is PROCEED_NODE else (run, code.body, frame)
        if len(trail) > mark:
            undo(trail, mark)
    return FAIL


def passes(machine: Machine, guard: Sequence[Node], frame: list[Any]) -> bool:
    """Return whether the goals at the beginning of a clause hold, all of them deterministic builtins."""
    for node in guard:
        try:
            if node.op == IN_PLACE:
                if not node.function(machine, node.args, frame):
                    return False
            elif not node.function(machine, *arguments(node.args, frame)):
                return False
        except PrologError as error:
            _add_goal(error, node, frame)
            raise
    return True


def run(machine: Machine, task: Task) -> Task:
    """Run nodes until a task comes that is not the plain solver's."""
    node: Node = task[1]
    frame: list[Any] = task[2]
    clause = node.clause
    if clause is not None:
        # A clause that compiled code returns to this often is worth compiling.
        if clause.predicate.cold:
            clause.predicate.cold -= 1
        elif clause.code is not None and clause.code.patience:
            clause.code.patience -= 1
            if not clause.code.patience and machine.compiled:
                clause.predicate.program.resume(clause)
    choices = machine.choices
    following: Task
    try:
        while True:
            op = node.op
            if op == CALL:
                machine.left -= 1
                if machine.left < 0:
                    machine.tick((run, node, frame))
                args = arguments(node.args, frame)
                continuation = frame[1] if node.next is PROCEED_NODE else (run, node.next, frame)
                predicate = node.target
                if machine.compiled:
                    if not predicate.cold:
                        return (predicate.entry, 0, None, *args, continuation)
                    predicate.cold -= 1
                following = (predicate.tabled or try_all)(machine, predicate, args, continuation)
            elif op == DET:
                if node.function(machine, *arguments(node.args, frame)):
                    node = node.next
                    continue
                following = fail(machine)
            elif op == PROCEED:
                following = frame[1]
            elif op == IN_PLACE:
                if node.function(machine, node.args, frame):
                    node = node.next
                    continue
                following = fail(machine)
            elif op == CUT:
                height = frame[node.slot] + node.target
                if len(choices) > height:
                    cut(machine, height)
                node = node.next
                continue
            elif op in _BRANCHING:
                if op == BRANCH:
                    frame[node.slot] = len(choices)
                choices.append((other_branch, len(machine.trail), node.other, frame))
                node = node.next
                continue
            elif op == FAIL_OP:
                following = fail(machine)
            elif op == SOFT_CUT:
                soft_cut(choices, frame[node.slot])
                node = node.next
                continue
            elif op == RESUME:
                machine.left -= 1
                if machine.left < 0:
                    machine.tick((run, node, frame))
                following = node.code(machine, frame)
            elif op == RAISE:
                raise type_error("callable", arguments(node.args, frame)[0])
            else:
                following = _call_builtin(machine, node, frame)
            while following[0] is not run:
                if following[0] not in _LOCAL:
                    return following
                following = following[0](machine, following)
            node = following[1]
            frame = following[2]
    except PrologError as error:
        if node.op != RESUME:
            _add_goal(error, node, frame)
        raise


def _add_goal(error: PrologError, node: Node, frame: list[Any]) -> None:
    """Record the goal in which an error arose, and its clause, unless they are known already."""
    if error.goal is None and node.name:
        args = arguments(node.args, frame)
        error.goal = told(node.name, args)
        error.clause = _place(node.clause)


def told(name: str, args: Sequence[Term]) -> Term:
    """Return a copy of a goal for its error, before backtracking undoes its bindings."""
    return excerpt(Struct(name, tuple(args)), _GOAL_CELLS) if args else Atom(name)


def _call_builtin(machine: Machine, node: Node, frame: list[Any]) -> Task:
    """Call a control construct or a nondeterministic builtin."""
    machine.left -= 1
    if machine.left < 0:
        machine.tick((run, node, frame))
    args = arguments(node.args, frame)
    continuation = frame[1] if node.next is PROCEED_NODE else (run, node.next, frame)
    if node.op == CONTROL:
        following: Task = node.function(machine, args, continuation)
        return following
    quick = QUICK.get(node.function)
    if quick is not None:
        settled = quick(machine, *args)
        if settled is not None:
            return continuation if settled else FAIL
    return start_generator(machine, node.function(machine, *args), continuation)


def _place(clause: Clause | None) -> str | None:
    return None if clause is None or clause.span is None else str(clause.span)


def cut(machine: Machine, height: int) -> None:
    """Remove every choice point from `height` on.

    Raises:
        PrologError: A cleanup goal raised an error; the older choice points still exist.
    """
    choices = machine.choices
    while len(choices) > height:
        choice = choices.pop()
        function = choice[0]
        if function is retry_generator:
            choice[2].close()
        elif function is leave_cleanup:
            clean_up(machine, choice[2])


_BRANCHING: Final = frozenset({BRANCH, EITHER})
# Functions that the loop calls itself, since they mostly return to the loop.
_LOCAL: Final = frozenset(
    {fail, other_branch, other_clauses, other_rows, retry_generator, leave_catch, exit_catch, dead}
)


def add_context(error: PrologError) -> None:
    """Find the goal and the clause of an error in compiled code, by its line."""
    traceback = error.__traceback__
    while traceback is not None and error.goal is None:
        lines = traceback.tb_frame.f_globals.get("LINES")
        about = lines and lines.get(traceback.tb_lineno)
        if about:
            goal, clause, names = about
            known = traceback.tb_frame.f_locals
            renaming = {variable: known[name] for variable, name in names.items() if name in known}
            # Twice, since backtracking will undo its bindings.
            error.goal = excerpt(excerpt(goal, _GOAL_CELLS, renaming), _GOAL_CELLS)
            error.clause = _place(clause)
        traceback = traceback.tb_next


def soft_cut(choices: list[Choice], height: int) -> None:
    """Remove only the choice point at `height`."""
    if height == len(choices) - 1:
        choices.pop()
    else:
        choices[height] = (dead, choices[height][1])
