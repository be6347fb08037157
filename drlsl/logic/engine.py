"""The public interface of the logic engine: load a program, query it, change its facts."""

from __future__ import annotations

import copy
import io
import sys
import threading
from collections.abc import Generator, Iterable, Mapping
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeAlias

from drlsl.logic import builtins
from drlsl.logic.builtins import name_term
from drlsl.logic.carry import TermTable, get_clause, put_clause
from drlsl.logic.conversion import Compound, Solution, Value, to_row, to_term, to_value
from drlsl.logic.core import (
    FAIL,
    FOUND,
    Clause,
    Indicator,
    Machine,
    Predicate,
    Program,
    Task,
    builtin_indicators,
    callable_parts,
    interpret,
    run,
    term_variables,
)
from drlsl.logic.errors import ExistenceError, existence_error
from drlsl.logic.explain import MAX_DEPTH, Explanation, explain
from drlsl.logic.limits import LimitExceeded, Limits, Meter
from drlsl.logic.loading import Linker, Loader, LoadWarning, library, read_source
from drlsl.logic.syntax import Flags, ReadTerm, read_term
from drlsl.logic.terms import Atom, Operators, Struct, Term, Var, deref, format_term

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Engine", "EngineBusyError", "Query"]

Goal: TypeAlias = "str | Compound | Atom | Struct"
_UNLIMITED = Limits()


class UnknownProcedure(ExistenceError):
    """A call of an undefined predicate."""

    def __init__(self, name: str, arity: int, program: Program) -> None:
        super().__init__(existence_error("procedure", name_term(name, arity)).term)
        self._name = name
        self._arity = arity
        self._program: Program | None = program
        self._hint = ""

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the hint, but not the program."""
        make, arguments, state = super().__reduce__()
        return make, arguments, {**state, "_hint": self._meant(), "_program": None}

    def message(self) -> str:
        """Return the error, with a hint at similar predicates."""
        return super().message() + self._meant()

    def _meant(self) -> str:
        return self._hint if self._program is None else _similar(self._program, self._name, self._arity)


def _similar(program: Program, name: str, arity: int) -> str:
    """Return a hint at predicates like one that is not defined; nothing if there are none."""
    known = {key for key, predicate in program.predicates.items() if predicate.defined}
    known |= {*builtin_indicators(), *library().exports}
    arities = sorted(other for one, other in known if one == name)
    names = get_close_matches(name, {one for one, _ in known if not one.startswith("$")}, 1)
    if arities:
        return f"; there is {', '.join(f'{name}/{other}' for other in arities)}"
    if names:
        meant = sorted(other for one, other in known if one == names[0])
        return f"; did you mean {names[0]}/{arity if arity in meant else meant[0]}?"
    return ""


class EngineBusyError(RuntimeError):
    """A second thread used an engine while it was busy."""

    def __str__(self) -> str:
        return "the engine is busy in another thread; give each thread an engine of its own"


class OneThread:
    """A context manager that one thread can hold, any number of times, while others are refused."""

    __slots__ = ("_lock",)

    def __init__(self) -> None:
        self._lock = threading.RLock()

    def __enter__(self) -> None:
        if not self._lock.acquire(blocking=False):
            raise EngineBusyError

    def __exit__(self, *exception: object) -> None:
        self._lock.release()


class Engine:
    """An independent Prolog engine: clauses, operators, flags and global variables are not shared.

    It serves any one thread at a time: a call while another thread is inside raises `EngineBusyError`.

    Args:
        compiled: run predicates that are called often as generated Python code; the answers are the same.
        flags: Prolog flags by name, such as ``{"iso": "false", "unknown": "fail"}``.
        output: where the program writes; standard output if None.
    """

    def __init__(
        self,
        *,
        compiled: bool = True,
        flags: Mapping[str, str | int] | None = None,
        output: TextIO | None = None,
    ) -> None:
        self.compiled = compiled
        self.linker = Linker()
        self.program = self.linker.program
        self.operators = Operators()
        self.flags = Flags()
        for name, value in (flags or {}).items():
            self.flags.set(Atom(name), Atom(value) if isinstance(value, str) else value)
        self.globals: dict[str, Term] = {}
        self.state: dict[str, Any] = {}
        self.output: TextIO = sys.stdout if output is None else output
        self._standard_output = self.output if output is None else None
        self.warnings: list[LoadWarning] = []
        self.loaded: dict[Path, str] = {}  # the loaded files, by the names that were given
        self.loaders: list[Loader] = []  # the files being loaded, each by the one before
        self.alone = OneThread()
        """Keeps other threads out while it is held, for several calls that belong together."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the state as flat data: the present program, flags, operators, global variables.

        Compiled code is left out, to be generated again. Running queries stay with this engine; values that
        they set by b_setval/2 are included as they are now.

        Raises:
            EngineBusyError: another thread is using the engine.
        """
        with self.alone:
            table = TermTable()
            clauses = {
                key: (kept if kept is None else [put_clause(clause, table) for clause in kept], *rest)
                for key, (kept, *rest) in self.program.snapshot().items()
            }
            values = {name: table.put(value) for name, value in self.globals.items()}
            known = {name: value for name, value in self.state.items() if name not in ("line", "input")}
            stream, pending = self.state.get("line", (None, ""))
            own = {"linker", "program", "alone", "_standard_output", "globals", "state", "output"}
            return {
                "plain": {name: value for name, value in vars(self).items() if name not in own},
                "terms": table.items,
                "clauses": clauses,
                "globals": values,
                "state": known,
                "output": None if self.output is self._standard_output else self.output,
                "pending": pending if stream is self.output else "",
            }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state of `__getstate__`, with clauses of its own."""
        vars(self).update(state["plain"])
        table = TermTable(state["terms"])
        self.alone = OneThread()
        self.linker = Linker()
        self.program = self.linker.program
        for name, arity in state["clauses"]:
            self.program.get(name, arity)
        self.program.restore(
            {
                key: (kept if kept is None else [get_clause(clause, table) for clause in kept], *rest)
                for key, (kept, *rest) in state["clauses"].items()
            }
        )
        self.globals = {name: table.get(place) for name, place in state["globals"].items()}
        self.output = sys.stdout if state["output"] is None else state["output"]
        self._standard_output = self.output if state["output"] is None else None
        self.state = {**state["state"], "line": (self.output, state["pending"])}

    def __deepcopy__(self, memo: dict[int, Any]) -> Engine:
        """Return an independent engine with the same answers; an output file is shared."""
        state = self.__getstate__()
        if isinstance(self.output, io.StringIO):
            state["output"] = copy.deepcopy(self.output, memo)
        state["plain"], state["state"] = copy.deepcopy((state["plain"], state["state"]), memo)
        twin = memo[id(self)] = object.__new__(type(self))
        twin.__setstate__(state)
        return twin

    def __copy__(self) -> Engine:
        """Return a deep copy: engines share nothing."""
        return copy.deepcopy(self)

    def consult(
        self, path: str | Path, search: Sequence[Path] = (), *, limits: Limits | Meter | None = None
    ) -> None:
        """Load a file; loading it again replaces its earlier clauses.

        Files that it names are searched beside it, then in the folders of `search`, then among the programs
        that ship. `limits` bound the reading of it, its directives and the files that it loads, all together.

        Raises:
            PrologError: The file has errors, all of which the exception names; the program is as it was.
            LimitExceeded: Loading went beyond its limits; the program is as it was.
            OSError: The file cannot be read.
        """
        path = Path(path)
        self._load(read_source(path), str(path), path, search, limits)

    def consult_text(self, text: str, name: str = "text", *, limits: Limits | None = None) -> None:
        """Load a program from a string; `name` stands for a file's name in messages.

        Files that it names are searched in the working directory, then among the programs that ship.

        Raises:
            PrologError: The text has errors, all of which the exception names; the program is as it was.
            LimitExceeded: Loading went beyond its limits; the program is as it was.
        """
        self._load(text, name, None, (), limits)

    def load_files(self, files: Term, *, again: bool, meter: Meter) -> None:
        """Load the file that a term names, or each of a list, also `again` if it was loaded before.

        They are searched beside the file that is being loaded, else in the working directory, then among the
        programs that ship. `meter` is that of the query that loads them.

        Raises:
            PrologError: There is no such file, or it has errors.
            OSError: It cannot be read.
        """
        self._loader(meter).load_files(files, again=again)

    def finds(self, file: Term) -> bool:
        """Return whether a term names a file or a library that could be loaded."""
        return self._loader(Meter(_UNLIMITED)).finds(file)

    def _loader(self, meter: Meter) -> Loader:
        return self.loaders[-1] if self.loaders else Loader(self, "query", meter=meter)

    def _load(
        self,
        text: str,
        name: str,
        path: Path | None,
        search: Sequence[Path],
        limits: Limits | Meter | None,
    ) -> None:
        meter = limits if isinstance(limits, Meter) else Meter(limits or _UNLIMITED)
        with self.alone:
            self._load_inside(text, name, path, search, meter)

    def _load_inside(
        self, text: str, name: str, path: Path | None, search: Sequence[Path], meter: Meter
    ) -> None:
        before = self.program.snapshot()
        operators, flags, warned = self.operators.copy(), self.flags.copy(), len(self.warnings)
        loaded = dict(self.loaded)
        if path is not None:
            for known in {name, self.loaded.get(path.resolve(), name)}:
                self.program.remove_source(known)
            self.loaded[path.resolve()] = name
        self.loaders.append(Loader(self, name, path, search, meter=meter))
        try:
            self.loaders[-1].load(text)
        except BaseException:  # an interrupt must not leave half a program either
            self.program.restore(before)
            self.linker.relink()
            self.operators, self.flags, self.loaded = operators, flags, loaded
            del self.warnings[warned:]
            raise
        finally:
            self.loaders.pop()

    def run_directive(
        self,
        goal: Term,
        output: TextIO | None = None,
        trail: list[Any] | None = None,
        meter: Meter | None = None,
    ) -> bool:
        """Prove a goal once; return True if that succeeds. Its bindings are kept on `trail`, or undone.

        `meter` is that of the query or text of the goal.
        """
        machine = Machine(self, _UNLIMITED if meter is None else meter.limits, meter)
        machine.output = output or self.output
        with self.alone:
            try:
                is_proved = machine.solve((_prove, goal, FOUND))
                machine.tick(None)  # its last inferences count, too: many short searches are one long one
                if is_proved and trail is not None:
                    machine.keep(trail)
                return is_proved
            finally:
                machine.close()

    def replace_facts(self, name: str, arity: int, rows: Iterable[Sequence[str | float]]) -> None:
        """Replace all clauses of a predicate by the facts of these rows; it becomes dynamic.

        A row holds `arity` values: `str` for atoms, `int`, `float`. This costs microseconds per row.

        Raises:
            TypeError: A value is of another type (a bool, None …).
            ValueError: A row has another length.
        """
        ready = [to_row(row, name, arity) for row in rows]
        with self.alone:
            self.program.replace_facts(name, arity, ready)

    def defines(self, name: str, arity: int) -> bool:
        """Return whether the program has clauses for a predicate, or declares it dynamic."""
        predicate = self.program.predicates.get((name, arity))
        return predicate is not None and predicate.defined

    def similar(self, name: str, arity: int) -> str:
        """Return a hint at predicates like one that is not defined, to end a sentence; or nothing."""
        return _similar(self.program, name, arity)

    def is_dynamic(self, name: str, arity: int) -> bool:
        """Return whether the program declares a predicate dynamic, or has been told its facts."""
        predicate = self.program.predicates.get((name, arity))
        return predicate is not None and predicate.dynamic

    def predicates(self) -> list[Indicator]:
        """Return name and arity of every predicate that the program defines, in the order of definition."""
        return [key for key, predicate in self.program.predicates.items() if predicate.defined]

    def clauses(self, name: str, arity: int) -> list[Clause]:
        """Return the clauses of a predicate of the program, facts among them; none if it is not defined."""
        predicate = self.program.find(name, arity)
        return [] if predicate is None else predicate.listed()

    def define(self, name: str, arity: int, clauses: Sequence[Clause]) -> None:
        """Replace the clauses of a predicate by these."""
        with self.alone:
            self.program.get(name, arity).replace(list(clauses))

    def forget_answers(self) -> None:
        """Forget the answers of tabled predicates."""
        with self.alone:
            self.program.tables.clear()

    def read_goal(self, text: str) -> ReadTerm:
        """Read a goal with the operators and flags of the program, without running it.

        Raises:
            PrologSyntaxError: The text is not a goal.
        """
        return read_term(text, self.operators, self.flags, "goal")

    def prepare(self, goal: Goal) -> Query:
        """Return a query that is read once and can be run many times.

        Raises:
            PrologSyntaxError: The text is not a goal.
            PrologTypeError, TypeError: The value is not a goal, or not a value at all.
        """
        if isinstance(goal, str):
            read = read_term(goal, self.operators, self.flags, "query")
            return Query(self, read.term, read.variables)
        term = to_term(goal)
        return Query(self, term, {variable.name: variable for variable in term_variables(term)})

    def query(self, goal: Goal, *, limits: Limits | None = None) -> Generator[Solution, None, None]:
        """Return the solutions of a goal, each searched on demand; the iterator may be dropped early.

        Raises:
            PrologError: The goal raised an error.
            LimitExceeded: It went beyond the limits.
        """
        return self.prepare(goal).solutions(limits)

    def once(self, goal: Goal, *, limits: Limits | None = None) -> Solution | None:
        """Return the first solution of a goal, or None."""
        return self.prepare(goal).once(limits)

    def holds(self, goal: Goal, *, limits: Limits | None = None) -> bool:
        """Return whether a goal has a solution."""
        return self.prepare(goal).holds(limits)

    def explain(self, goal: Goal, *, limits: Limits | None = None, max_depth: int = MAX_DEPTH) -> Explanation:
        """Explain why a goal holds or fails: its first proof, or for each clause tried the failed goal.

        Calls of the program's predicates nested deeper than `max_depth` are not expanded.

        Raises:
            PrologError: The goal raised an error.
            LimitExceeded: It went beyond the limits, or needs too many goals to explain.
        """
        if isinstance(goal, str):
            read = read_term(goal, self.operators, self.flags, "query")
            term, variables = read.term, read.variables
        else:
            term = to_term(goal)
            variables = {variable.name: variable for variable in term_variables(term)}
        with self.alone:
            return explain(self, term, variables, limits=limits or _UNLIMITED, max_depth=max_depth)

    def format(self, value: Value) -> str:
        """Return the text of a solution's value, with the engine's operators; it can be read back."""
        variables: dict[str, Var] = {}
        term = to_term(value, variables, allow_nan=True)
        names = {id(variable): name for name, variable in variables.items()}
        return format_term(term, self.operators, quoted=True, variable_names=names)

    def undefined(self, machine: Machine, predicate: Predicate, _args: Any, _continuation: Task) -> Task:
        """Return the task for a call of an unknown predicate, by the flag `unknown`."""
        name, arity = predicate.name, predicate.arity
        if machine.flags.unknown == "error":
            raise UnknownProcedure(name, arity, self.program)
        if machine.flags.unknown == "warning":
            self.warnings.append(LoadWarning(f"unknown procedure {name}/{arity}", "query"))
        return FAIL


# The first task of a search; the search then takes care of what goes wrong with the goal.


def _ask(machine: Machine, task: Task) -> Task:
    return interpret(machine, task[1], task[2], task[3])


def _prove(machine: Machine, task: Task) -> Task:
    return machine.call(task[1], task[2])


class Query:
    """A goal of one engine, made ready to be asked."""

    __slots__ = ("_engine", "_linked", "_names", "_predicate", "_variables")

    def __init__(self, engine: Engine, goal: Term, variables: Mapping[str, Var]) -> None:
        callable_parts(goal)
        shown = {name: variable for name, variable in variables.items() if not name.startswith("_")}
        self._engine = engine
        self._names = tuple(shown)
        self._variables = tuple(shown.values())
        head: Term = Struct("$query", self._variables) if shown else Atom("$query")
        self._predicate = Predicate(engine.program, "$query", len(shown))
        self._predicate.ask(Clause(head, goal))
        self._link()

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the engine and the goal; a copy asks the engine's copy."""
        clause = self._predicate.clauses[0]
        table = TermTable()
        goal = table.put(clause.body)
        variables = {name: table.put(one) for name, one in zip(self._names, self._variables, strict=True)}
        return _query, (self._engine, table.items, goal, variables)

    def solutions(self, limits: Limits | None = None) -> Generator[Solution, None, None]:
        """Yield the solutions, one by one."""
        machine, args = self._start(limits)
        alone = self._engine.alone
        try:
            with alone:
                found = machine.solve(self._task(args))
            while found:
                yield self._solution(args, machine.meter)
                with alone:
                    found = machine.retry()
        finally:
            machine.close()

    def once(self, limits: Limits | None = None) -> Solution | None:
        """Return the first solution, or None."""
        machine, args = self._start(limits)
        with self._engine.alone:
            try:
                if machine.solve(self._task(args)):
                    return self._solution(args, machine.meter)
                return None
            finally:
                machine.close()

    def holds(self, limits: Limits | None = None) -> bool:
        """Return whether there is a solution."""
        machine, args = self._start(limits)
        with self._engine.alone:
            try:
                return machine.solve(self._task(args))
            finally:
                machine.close()

    def _start(self, limits: Limits | None) -> tuple[Machine, list[Var]]:
        return Machine(self._engine, limits or _UNLIMITED), [Var(name) for name in self._names]

    def _link(self) -> None:
        """Prepare the goal, so that running it the first time takes no longer than later."""
        self._predicate.clauses[0].code = None
        self._linked = self._engine.linker.relinked
        with suppress(LimitExceeded):  # which the first call will raise, too
            self._engine.linker.prepare([self._predicate], Meter(_UNLIMITED))

    def _task(self, args: list[Var]) -> Task:
        if self._linked != self._engine.linker.relinked:
            self._link()
        code = self._predicate.stored[0].code
        if code is None or code.guard:
            return _ask, self._predicate, args, FOUND
        # There is one clause, and its head is distinct variables: nothing to choose, nothing to unify.
        return run, code.body, [1, FOUND, *args, *code.blanks]

    def _solution(self, args: list[Var], meter: Meter) -> Solution:
        # Variables that are bound to each other get the name of the first.
        names = {deref(arg): name for arg, name in zip(reversed(args), reversed(self._names), strict=True)}
        return Solution(
            {name: to_value(arg, names, meter) for name, arg in zip(self._names, args, strict=True)}
        )


def _query(engine: Engine, terms: list[tuple[Any, ...]], goal: int, variables: Mapping[str, int]) -> Query:
    """Return the query that `Query.__reduce__` described."""
    table = TermTable(terms)
    return Query(engine, table.get(goal), {name: table.get(place) for name, place in variables.items()})


assert builtins.__all__  # importing the package fills the registry
