"""`drlsl rules shell`: an interactive top level for querying a rule program."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from drlsl.logic import Engine, Halt, Limits, PrologError
from drlsl.logic.core import FOUND, Machine, builtin_indicators, term_variables
from drlsl.logic.loading import find_file
from drlsl.logic.syntax import ReadTerm, is_complete, read_term
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, format_term

_PROMPT = "?- "
_CONTINUE = "|  "
_SHOWN_DEPTH = 20
_HISTORY_LINES = 2000
_HELP = """\
Type a goal and a full stop, such as  member(X, [1, 2, 3]).  Then ; asks for the next solution, Enter stops.
  explain(Goal).   why the goal holds, or why it fails
  [File, ...].     load files           make.   load all files again
  listing(Name).   print the clauses    halt.   leave (or end of input)"""


def run_shell(files: Sequence[str | Path] = ()) -> int:
    """Load files and answer queries until the end of the input; return the exit status."""
    engine = Engine()
    with _line_editing(engine):
        return Shell(engine, input, _read_key).run(files)


class Shell:
    """A top level over one engine, with its sources of lines and keys."""

    def __init__(
        self,
        engine: Engine,
        read_line: Callable[[str], str],
        read_key: Callable[[], str],
    ) -> None:
        self.engine = engine
        self._read_line = read_line
        self._read_key = read_key
        self._files: list[Path] = []

    def run(self, files: Sequence[str | Path]) -> int:
        """Load files, then answer queries; return the status that halt/1 gave, else 0."""
        for file in files:
            self.load(Path(file))
        print("Type help. for help.")
        while True:
            try:
                text = self._read_goal()
            except EOFError:
                print()
                return 0
            except KeyboardInterrupt:
                print()
                continue
            try:
                self._answer(text)
            except Halt as halt:
                return halt.status
            except KeyboardInterrupt:
                print("\ninterrupted")
            except (PrologError, OSError) as error:
                print(error)

    def load(self, path: Path) -> None:
        """Load a file, or print its error."""
        warned = len(self.engine.warnings)
        try:
            self.engine.consult(path)
        except OSError as error:
            print(f"{path}: {error.strerror}")
            return
        except PrologError as error:
            print(error)
            return
        finally:
            if path not in self._files:
                self._files.append(path)
            for warning in self.engine.warnings[warned:]:
                print(f"Warning: {warning}")
        print(f"{path} loaded.")

    def _read_goal(self) -> str:
        """Read lines up to the full stop that ends a goal."""
        text = self._read_line(_PROMPT)
        while text.strip() and not is_complete(text + "\n", self.engine.flags):
            text += "\n" + self._read_line(_CONTINUE)
        return text

    def _answer(self, text: str) -> None:
        if not text.strip():
            return
        read = read_term(text, self.engine.operators, self.engine.flags, "query")
        goal = deref(read.term)
        files = _files_to_load(goal)
        if files is not None:
            for file in files:
                self.load(find_file(file, Path.cwd()))
        elif isinstance(goal, Atom) and goal.name == "make" and not self.engine.defines("make", 0):
            for path in list(self._files):
                self.load(path)
        elif isinstance(goal, Atom) and goal.name == "help":
            print(_HELP)
        elif isinstance(goal, Struct) and goal.name == "explain" and len(goal.args) == 1:
            asked = deref(goal.args[0])
            print(self.engine.explain(asked if isinstance(asked, Atom | Struct) else goal))
        else:
            self._solve(read)

    def _solve(self, read: ReadTerm) -> None:
        """Print one solution after the other, for as long as the user asks for more."""
        machine = Machine(self.engine, Limits())
        try:
            found = machine.solve(machine.call(read.term, FOUND))
            while found:
                more = len(machine.choices) > 1
                print(self._solution(read.variables), end=" " if more else ".\n", flush=True)
                if not more:
                    return
                if self._read_key() not in ";nr ":
                    print(".")
                    return
                print(";")
                found = machine.retry()
            print("false.")
        finally:
            machine.close()

    def _solution(self, variables: dict[str, Var]) -> str:
        """Return the bindings of the variables, those that share a value on one line."""
        free: dict[int, str] = {}
        for name, variable in variables.items():
            target = deref(variable)
            if isinstance(target, Var):
                free.setdefault(id(target), name)
        lines = []
        for name, variable in variables.items():
            target = deref(variable)
            if name.startswith("_") or free.get(id(target)) == name:
                continue
            lines.append(f"{name} = {self._text(target, free)}")
        return ",\n".join(lines) or "true"

    def _text(self, term: Term, free: dict[int, str]) -> str:
        names = dict(free)
        for number, variable in enumerate(term_variables(term)):
            names.setdefault(id(variable), f"_{number}")
        return format_term(
            term,
            self.engine.operators,
            quoted=True,
            numbervars=True,
            spacing=True,
            max_depth=_SHOWN_DEPTH,
            variable_names=names,
            priority=699,
        )


def _files_to_load(goal: Term) -> list[Term] | None:
    """Return the files of ``[File, ...]`` or ``consult(File)``; None for any other goal."""
    if isinstance(goal, Struct) and goal.name == "consult" and len(goal.args) == 1:
        goal = deref(goal.args[0])
        if not (isinstance(goal, Struct) and goal.name == "."):
            return [goal]
    files: list[Term] = []
    while isinstance(goal, Struct) and goal.name == "." and len(goal.args) == 2:
        files.append(goal.args[0])
        goal = deref(goal.args[1])
    return files if files and goal is NIL else None


def _read_key() -> str:
    """Read one key from a terminal, or the first character of a line from anything else."""
    if not sys.stdin.isatty():
        return sys.stdin.readline().strip()[:1] or "."
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        return os.read(descriptor, 1).decode(errors="replace")
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


@contextlib.contextmanager
def _line_editing(engine: Engine) -> Iterator[None]:
    """Provide line editing, completion of names and a persistent history, where readline is available."""
    try:
        import readline
    except ImportError:
        yield
        return
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    history = Path(state) / "drlsl" / "shell_history"
    with contextlib.suppress(OSError):
        readline.read_history_file(history)
    readline.set_completer(_completer(engine))
    readline.set_completer_delims(" \t\n,;()[]{}|.:-+*/\\<>=")
    readline.parse_and_bind("tab: complete")
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            history.parent.mkdir(parents=True, exist_ok=True)
            readline.set_history_length(_HISTORY_LINES)
            readline.write_history_file(history)


def _completer(engine: Engine) -> Callable[[str, int], str | None]:
    def complete(text: str, index: int) -> str | None:
        known = {*engine.predicates(), *builtin_indicators()}
        names = sorted({name for name, _ in known if name.startswith(text) and name.isidentifier()})
        return names[index] if index < len(names) else None

    return complete
