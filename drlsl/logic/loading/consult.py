"""Load a program: clauses, grammar rules and directives, with all errors reported at once.

Source: ISO 13211-1, 7.4.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from drlsl.logic.builtins import indicators, items, name_term, split_clause, unqualified
from drlsl.logic.core import (
    CONTROL_BUILTINS,
    Clause,
    Host,
    Indicator,
    Predicate,
    callable_parts,
    translate_rule,
)
from drlsl.logic.errors import (
    ExistenceError,
    PrologError,
    PrologPermissionError,
    PrologSyntaxError,
    existence_error,
    permission_error,
    resource_error,
    syntax_error,
)
from drlsl.logic.limits import Limits, Meter
from drlsl.logic.loading.conditions import Conditions
from drlsl.logic.loading.finding import find_file
from drlsl.logic.loading.linking import Linker, builtin, library
from drlsl.logic.syntax import ReadTerm, read_terms
from drlsl.logic.terms import NIL, Atom, Struct, Term, deref

if TYPE_CHECKING:
    pass

# Directives of other systems without effect here: modes, modules, documentation and code generation.
_SKIPPED: Final = frozenset(
    entry
    for line in (
        "mode/1 pred/1 meta_predicate/1 module_transparent/1 public/1 export/1 noprofile/1 volatile/1",
        "non_terminal/1 det/1 license/1 license/2 encoding/1 expects_dialect/1 set_module/1",
        "create_prolog_flag/3 set_stream/2 debug/1 nodebug/1 at_halt/1",
    )
    for entry in line.split()
)
# Flags of SWI-Prolog that change no answer.
_SKIPPED_FLAGS: Final = frozenset(
    entry
    for line in (
        "verbose verbose_load verbose_autoload autoload stack_limit table_space optimise optimise_unify gc",
        "generate_debug_info last_call_optimisation answer_format answer_write_options color_term history",
        "print_write_options debugger_write_options report_error warn_override_implicit_import",
        "toplevel_prompt toplevel_var_size toplevel_print_anon",
    )
    for entry in line.split()
)
LARGEST_FILE: Final = 64 * 2**20
"""Bytes of the largest file that is read as text: an endless device is refused after these."""

_USER: Final = Atom("user")
_MOST_NESTED: Final = 100  # files that name files that name files

# Predicates that no program may redefine besides control constructs: the builtins of the standard.
STANDARD: Final = frozenset(
    entry
    for line in (
        "true/0 fail/0 !/0 ,/2 ;/2 |/2 ->/2 *->/2 call/1 call/2 call/3 call/4 call/5 call/6 call/7 call/8",
        "catch/3 throw/1 =/2 \\=/2 unify_with_occurs_check/2 subsumes_term/2 var/1 nonvar/1 atom/1",
        "number/1 integer/1 float/1 atomic/1 compound/1 callable/1 ground/1 @=</2 ==/2 \\==/2 @</2 @>/2",
        "@>=/2 compare/3 functor/3 arg/3 =../2 copy_term/2 term_variables/2 is/2 =:=/2 =\\=/2 </2 =</2 >/2",
        ">=/2 clause/2 current_predicate/1 asserta/1 assertz/1 assert/1 retract/1 abolish/1 retractall/1",
        "findall/3 bagof/3 setof/3 current_input/1 current_output/1 set_input/1 set_output/1 open/3",
        "open/4 close/1 close/2 flush_output/0 flush_output/1 stream_property/2 at_end_of_stream/0",
        "at_end_of_stream/1 set_stream_position/2 get_char/1 get_char/2 peek_char/1 peek_char/2",
        "put_char/1 put_char/2 get_code/1 get_code/2 peek_code/1 peek_code/2 put_code/1 put_code/2 nl/0",
        "nl/1 get_byte/1 get_byte/2 peek_byte/1 peek_byte/2 put_byte/1 put_byte/2 read_term/2 read_term/3",
        "read/1 read/2 write_term/2 write_term/3 write/1 write/2 writeq/1 writeq/2 print/1",
        "write_canonical/1 write_canonical/2 op/3 current_op/3 char_conversion/2",
        "current_char_conversion/2 \\+/1 once/1 false/0 repeat/0 atom_length/2 atom_concat/3 sub_atom/5",
        "atom_chars/2 atom_codes/2 char_code/2 number_chars/2 number_codes/2 set_prolog_flag/2",
        "current_prolog_flag/2 halt/0 halt/1 keysort/2 sort/2",
    )
    for entry in line.split()
)


class ConsultError(PrologSyntaxError):
    """A text that could not be loaded for more than one reason; `errors` has all of them, in order."""

    def __init__(self, errors: list[PrologError]) -> None:
        first = errors[0]
        super().__init__(first.term, goal=first.goal, clause=first.clause)
        if isinstance(first, PrologSyntaxError):
            self.file, self.line, self.column = first.file, first.line, first.column
            self.source, self.width = first.source, first.width
        self.errors = errors

    def __str__(self) -> str:
        return "\n".join([*map(str, self.errors), f"{len(self.errors)} errors; nothing was loaded"])


class _CommaBefore(PrologPermissionError):
    """A clause with a conjunction as its head, which is never intended."""

    def message(self) -> str:
        return f"{super().message()}; the first goal here ends with a comma: should that be a full stop?"


class _Circle(PrologPermissionError):
    """A file that includes itself."""

    def __init__(self, operation: str, path: Path, chain: Sequence[Path]) -> None:
        super().__init__(permission_error(operation, "source_sink", Atom(str(path))).term)
        self._chain = " -> ".join(each.name for each in (*chain, path))

    def message(self) -> str:
        return f"{super().message()}, since that is a circle: {self._chain}"


class _Terminal(PrologPermissionError):
    """Clauses to be typed at the terminal."""

    def message(self) -> str:
        return f"{super().message()}: rules come from files, and the terminal is not one"


@dataclass(frozen=True)
class LoadWarning:
    """A finding in a text: something that is probably not intended."""

    message: str
    place: str

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


class LoadingEngine(Host, Protocol):
    """The engine's interface for the loader."""

    linker: Linker
    warnings: list[LoadWarning]
    loaded: dict[Path, str]
    loaders: list[Loader]

    def consult(
        self, path: str | Path, search: Sequence[Path] = (), *, limits: Limits | Meter | None = None
    ) -> None:
        """Load a file."""


class Loader:
    """Loads one text, and the files that it includes, into an engine.

    `search` are the folders in which files that it names are searched, after its own.
    """

    def __init__(
        self,
        engine: LoadingEngine,
        name: str,
        path: Path | None = None,
        search: Sequence[Path] = (),
        *,
        meter: Meter,
    ) -> None:
        self._engine = engine
        self._meter = meter
        self._name = name
        self._search = search
        # The files that are being read, each included by the one before; none for a string.
        self.reading: list[Path] = [] if path is None else [path]
        self._errors: list[PrologError] = []
        self._seen: set[Indicator] = set()
        self._last: Indicator | None = None
        self._goals: list[tuple[Term, ReadTerm]] = []
        self._hides = False
        self._directives: dict[Indicator, Callable[[tuple[Term, ...], ReadTerm], None]] = {
            ("include", 1): self._include,
            ("abolish", 1): self._abolish,
            ("initialization", 1): self._initialization,
            ("initialization", 2): self._initialization,
            ("use_module", 1): self._use_module,
            ("use_module", 2): self._use_module,
            ("reexport", 1): self._use_module,
            ("reexport", 2): self._use_module,
            ("module", 2): self._module,
            ("thread_local", 1): self._thread_local,
            ("set_prolog_flag", 2): self._set_prolog_flag,
        }

    def load(self, text: str) -> None:
        """Load a text.

        Raises:
            PrologError: The error in it; a `ConsultError` if there is more than one.
        """
        self._text(text, self._name)
        if self._hides:
            self._engine.linker.relink()
        if not self._errors:
            loaded = [self._engine.program.get(*key) for key in self._seen]
            self._engine.linker.prepare(loaded, self._meter)
            for goal, read in self._goals:
                self._run(goal, read)
        if self._errors:
            raise self._errors[0] if len(self._errors) == 1 else ConsultError(self._errors)

    def _text(self, text: str, name: str) -> None:
        reader = read_terms(text, self._engine.operators, self._engine.flags, name)
        conditions = Conditions(self._holds)
        while True:
            try:
                read = next(reader)
            except StopIteration:
                break
            except PrologSyntaxError as error:
                self._meter.count(1)
                self._meter.text(len(error.source))
                if not conditions.skipping:
                    self._errors.append(error)
                continue
            try:
                self._meter.count(1)
                if not conditions.take(read) and not conditions.skipping:
                    self._term(read)
            except RecursionError:
                self._note(resource_error("recursion"), read)
            except PrologError as error:
                self._note(error, read)
        self._errors.extend(conditions.unclosed())

    def _term(self, read: ReadTerm) -> None:
        term = read.term
        if type(term) is Struct and term.name in (":-", "?-") and len(term.args) == 1:
            self._directive(term.args[0], read)
            return
        if read.singletons:
            names = ", ".join(read.singletons)
            self._warn(f"singleton variable{'s' * (len(read.singletons) > 1)}: {names}", read)
        term = unqualified(term)
        if type(term) is Struct and term.name == "-->" and len(term.args) == 2:
            term = translate_rule(Struct("-->", (unqualified(term.args[0]), term.args[1])))
        head, body = split_clause(term)
        self._add(Clause(head, body, read.span, read.variables, self._name, read), read)

    def _add(self, clause: Clause, read: ReadTerm) -> None:
        key = _indicator(clause.head)
        if f"{key[0]}/{key[1]}" in STANDARD or key in CONTROL_BUILTINS:
            refusal = permission_error("modify", "static_procedure", name_term(*key))
            raise _CommaBefore(refusal.term) if key == (",", 2) else refusal
        predicate = self._engine.program.get(*key)
        if not predicate.defined and (builtin(*key) or library().find(*key)):
            self._hides = True
        if key not in self._seen:
            self._seen.add(key)
            self._begin(predicate, read)
        elif key != self._last and not predicate.discontiguous:
            self._warn(f"the clauses of {key[0]}/{key[1]} are not together", read)
        self._last = key
        predicate.append(clause)

    def _begin(self, predicate: Predicate, read: ReadTerm) -> None:
        """Have the first clause of a predicate in this text replace another text's clauses."""
        if predicate.dynamic or predicate.multifile or not len(predicate):
            return
        others = sorted({clause.source for clause in predicate.clauses if clause.source is not None})
        if others != [self._name]:
            name = f"{predicate.name}/{predicate.arity}"
            meant = f"if that is intended, declare it before: :- abolish({name})."
            self._warn(f"{name} is defined anew; before, in {', '.join(others)}; {meant}", read)
        predicate.replace([])

    def _warn(self, message: str, read: ReadTerm) -> None:
        self._engine.warnings.append(LoadWarning(message, str(read.span)))

    def _warn_once(self, message: str, read: ReadTerm) -> None:
        if all(warning.message != message for warning in self._engine.warnings):
            self._warn(message, read)

    def _directive(self, goal: Term, read: ReadTerm) -> None:
        goal = deref(goal)
        name, args = callable_parts(goal)
        special = self._directives.get((name, len(args)))
        indicator = f"{name}/{len(args)}"
        if special is not None:
            special(args, read)
        elif indicator in _SKIPPED and self._engine.program.find(name, len(args)) is None:
            self._warn_once(f"{indicator} has no effect here and is skipped", read)
        else:
            self._run(goal, read)

    def _run(self, goal: Term, read: ReadTerm) -> None:
        if self._succeeds(goal, read) is False:
            self._warn("the directive failed", read)

    def _succeeds(self, goal: Term, read: ReadTerm) -> bool | None:
        """Return whether a goal holds; None, with the error recorded, if it raises one."""
        try:
            return self._engine.run_directive(goal, meter=self._meter)
        except PrologError as error:
            self._note(error, read)
            return None

    def _note(self, error: PrologError, read: ReadTerm) -> None:
        """Record an error to report it with the others; one that is not catchable ends the loading."""
        error.clause = error.clause or str(read.span)
        if not error.catchable:
            raise error
        self._errors.append(error)

    def _holds(self, goal: Term, read: ReadTerm) -> bool:
        """Return whether the goal of an if/1 holds; one that raises an error does not."""
        return self._succeeds(goal, read) is True

    def _named(self, file: Term) -> Path:
        """Return the file that a term names."""
        if deref(file) is _USER:
            raise _Terminal(permission_error("load", "source_sink", _USER).term)
        return find_file(file, self.reading[-1].parent if self.reading else None, self._search)

    def _not_under_way(self, path: Path, operation: str) -> Path:
        """Return a file to be read, after checking that it does not include itself.

        Raises:
            PrologError: It does, or too many files include each other.
        """
        chain = [each for loader in self._engine.loaders for each in loader.reading]
        known = [each.resolve() for each in chain]
        if path.resolve() in known:
            raise _Circle(operation, path, chain[known.index(path.resolve()) :])
        if len(chain) > _MOST_NESTED:
            raise resource_error(f"more than {_MOST_NESTED} files that include each other")
        return path

    def _include(self, args: tuple[Term, ...], _read: ReadTerm) -> None:
        path = self._not_under_way(self._named(args[0]), "include")
        before = len(self._errors)
        self.reading.append(path)
        try:
            self._text(read_source(path), str(path))
        except PrologSyntaxError as error:
            self._errors.append(error)
        finally:
            self.reading.pop()
        if len(self._errors) > before and not _is_rule_file(path):
            self._errors[before:] = [_not_shown(path, self._errors[before])]

    def load_files(self, files: Term, *, again: bool) -> None:
        """Load the file that a term names, or each of a list, also `again` if it was loaded before.

        Raises:
            PrologError: There is no such file, or it has errors.
            OSError: It cannot be read.
        """
        files = deref(files)
        if files is NIL or (type(files) is Struct and files.name == "." and len(files.args) == 2):
            for file in items(files):
                self.load_files(file, again=again)
        elif (module := _library_name(files)) is not None:
            if not library().provides(module):
                raise existence_error("library", files)
        else:
            path = self._named(files)
            if again or path.resolve() not in self._engine.loaded:
                self._load_file(self._not_under_way(path, "load"))

    def _load_file(self, path: Path) -> None:
        try:
            self._engine.consult(path, self._search, limits=self._meter)
        except PrologError as error:
            if _is_rule_file(path):
                raise
            raise _not_shown(path, error) from None

    def finds(self, file: Term) -> bool:
        """Return whether a term names a library or a file."""
        module = _library_name(deref(file))
        if module is not None:
            return library().provides(module)
        try:
            self._named(file)
        except ExistenceError:
            return False
        return True

    def _use_module(self, args: tuple[Term, ...], _read: ReadTerm) -> None:
        self.load_files(args[0], again=False)

    def _module(self, _args: tuple[Term, ...], _read: ReadTerm) -> None:
        """Ignore the module: all predicates are visible in one name space."""

    def _thread_local(self, args: tuple[Term, ...], read: ReadTerm) -> None:
        """Declare a predicate dynamic: an engine belongs to one thread anyway."""
        self._run(Struct("dynamic", args), read)

    def _set_prolog_flag(self, args: tuple[Term, ...], read: ReadTerm) -> None:
        flag = deref(args[0])
        if type(flag) is Atom and flag.name in _SKIPPED_FLAGS:
            self._warn_once(f"the flag {flag.name} has no effect here and is skipped", read)
        else:
            self._run(Struct("set_prolog_flag", args), read)

    def _abolish(self, args: tuple[Term, ...], read: ReadTerm) -> None:
        """Forget static predicates that were loaded so far, so that this text may redefine them.

        The standard's abolish/1, a goal that leaves static predicates alone, is not a directive.

        Raises:
            PrologError: One is not defined, or is one that no program may define.
        """
        for name, arity in indicators(args[0]):
            predicate = self._engine.program.find(name, arity)
            if predicate is None and builtin(name, arity) is None:
                raise existence_error("procedure", name_term(name, arity))
            if predicate is None or predicate.dynamic:
                self._run(Struct("abolish", (name_term(name, arity),)), read)
                continue
            predicate.tabled = None
            predicate.replace([])
            predicate.defined = False
            self._hides = True  # or no longer does
            self._seen.discard((name, arity))

    def _initialization(self, args: tuple[Term, ...], read: ReadTerm) -> None:
        callable_parts(args[0])
        self._goals.append((args[0], read))


def _library_name(file: Term) -> str | None:
    """Return the name in ``library(Name)``, "" if it is not a name; None for any other term."""
    if type(file) is not Struct or file.name != "library" or len(file.args) != 1:
        return None
    name = deref(file.args[0])
    return name.name if type(name) is Atom else ""


def _indicator(head: Term) -> Indicator:
    name, args = callable_parts(head)
    return name, len(args)


def _is_rule_file(path: Path) -> bool:
    """Return whether lines of a named file may be shown: only those of rule files may."""
    return path.suffix == ".pl"


def _not_shown(path: Path, error: PrologError) -> PrologSyntaxError:
    """Return the error of a named file that may be anything, without any of its contents."""
    line = error.line if isinstance(error, PrologSyntaxError) else 0
    message = "this is not Prolog text (details are only shown for files named *.pl)"
    return PrologSyntaxError(syntax_error(message).term, file=str(path), line=line or 1, column=1)


def read_source(path: Path) -> str:
    """Return the text of a file.

    Raises:
        PrologSyntaxError: It is not encoded in UTF-8.
        OSError: It cannot be read, or is too large.
    """
    with open(path, "rb") as file:
        data = file.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise OSError(errno.EFBIG, f"it is larger than {LARGEST_FILE // 2**20} MiB", str(path))
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8")
        bad = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file in that encoding"
        line = before.count("\n") + 1
        column = len(before) - before.rfind("\n")
        raise PrologSyntaxError(
            syntax_error(bad).term, file=str(path), line=line, column=column, source=before.split("\n")[-1]
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
