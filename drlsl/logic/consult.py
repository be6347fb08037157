"""Loading a program: clauses, grammar rules and directives, with everything that is wrong said at once.

Source: ISO 13211-1, 7.4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from drlsl.logic.body import callable_parts
from drlsl.logic.builtins.arguments import indicators
from drlsl.logic.builtins.database import name_term, split_clause
from drlsl.logic.builtins.registry import CONTROL
from drlsl.logic.dcg import translate_rule
from drlsl.logic.errors import (
    PrologError,
    PrologPermissionError,
    PrologSyntaxError,
    existence_error,
    instantiation_error,
    permission_error,
    syntax_error,
    type_error,
)
from drlsl.logic.goals import CONTROL_ARGUMENTS
from drlsl.logic.linking import builtin, library
from drlsl.logic.program import Clause, Indicator, Predicate
from drlsl.logic.reader import ReadTerm, read_terms
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

if TYPE_CHECKING:
    from drlsl.logic.engine import Engine

# What no program may define anew besides control constructs: the builtin predicates of the standard.
STANDARD: Final = frozenset(
    entry
    for line in (
        "true/0 fail/0 !/0 ,/2 ;/2 ->/2 *->/2 call/1 call/2 call/3 call/4 call/5 call/6 call/7 call/8",
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
    """A text that could not be loaded for more than one reason; `errors` has them all, in order."""

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
    """A clause with a conjunction for its head, which nobody writes on purpose."""

    def message(self) -> str:
        return f"{super().message()}; the first goal here ends with a comma: should that be a full stop?"


@dataclass(frozen=True)
class LoadWarning:
    """Something in a text that is probably not meant."""

    message: str
    place: str

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


class Loader:
    """Loads one text, and what it includes, into an engine."""

    def __init__(self, engine: Engine, name: str, search: Sequence[Path] = ()) -> None:
        self._engine = engine
        self._name = name
        self._search = search
        self._errors: list[PrologError] = []
        self._seen: set[Indicator] = set()
        self._last: Indicator | None = None
        self._goals: list[tuple[Term, ReadTerm]] = []
        self._hides = False
        self._directives: dict[Indicator, Callable[[tuple[Term, ...], ReadTerm, Path | None], None]] = {
            ("include", 1): self._include,
            ("ensure_loaded", 1): self._ensure_loaded,
            ("consult", 1): self._ensure_loaded,
            ("abolish", 1): self._abolish,
            ("initialization", 1): self._initialization,
            ("initialization", 2): self._initialization,
            ("use_module", 1): self._use_module,
            ("use_module", 2): self._use_module,
            ("module", 2): self._module,
        }

    def load(self, text: str, folder: Path | None) -> None:
        """Load a text; `folder` is where the files that it names are looked for before the search path.

        Raises:
            PrologError: What was wrong with it; a `ConsultError` if there was more than one thing.
        """
        self._text(text, self._name, folder)
        if self._hides:
            self._engine.linker.relink()
        if not self._errors:
            for goal, read in self._goals:
                self._run(goal, read)
        if self._errors:
            raise self._errors[0] if len(self._errors) == 1 else ConsultError(self._errors)

    def _text(self, text: str, name: str, folder: Path | None) -> None:
        reader = read_terms(text, self._engine.operators, self._engine.flags, name)
        while True:
            try:
                read = next(reader)
            except StopIteration:
                return
            except PrologSyntaxError as error:
                self._errors.append(error)
                continue
            try:
                self._term(read, folder)
            except PrologError as error:
                error.clause = error.clause or str(read.span)
                self._errors.append(error)

    def _term(self, read: ReadTerm, folder: Path | None) -> None:
        term = read.term
        if type(term) is Struct and term.name in (":-", "?-") and len(term.args) == 1:
            self._directive(term.args[0], read, folder)
            return
        if read.singletons:
            names = ", ".join(read.singletons)
            self._warn(f"singleton variable{'s' * (len(read.singletons) > 1)}: {names}", read)
        if type(term) is Struct and term.name == "-->" and len(term.args) == 2:
            term = translate_rule(term)
        head, body = split_clause(term)
        self._add(Clause(head, body, read.span, read.variables, self._name, read), read)

    def _add(self, clause: Clause, read: ReadTerm) -> None:
        key = _indicator(clause.head)
        if f"{key[0]}/{key[1]}" in STANDARD or key in CONTROL or key in CONTROL_ARGUMENTS:
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
        """The first clause of a predicate in this text replaces what another text said of it."""
        if predicate.dynamic or predicate.multifile or not len(predicate):
            return
        others = sorted({clause.source for clause in predicate.clauses if clause.source is not None})
        if others != [self._name]:
            name = f"{predicate.name}/{predicate.arity}"
            meant = f"if that is meant, say so before: :- abolish({name})."
            self._warn(f"{name} is defined anew; before, in {', '.join(others)}; {meant}", read)
        predicate.replace([])

    def _warn(self, message: str, read: ReadTerm) -> None:
        self._engine.warnings.append(LoadWarning(message, str(read.span)))

    # ------------------------------------------------------------------ directives

    def _directive(self, goal: Term, read: ReadTerm, folder: Path | None) -> None:
        goal = deref(goal)
        name, args = callable_parts(goal)
        special = self._directives.get((name, len(args)))
        if special is not None:
            special(args, read, folder)
        else:
            self._run(goal, read)

    def _run(self, goal: Term, read: ReadTerm) -> None:
        try:
            if not self._engine.run_directive(goal):
                self._warn("the directive failed", read)
        except PrologError as error:
            error.clause = error.clause or str(read.span)
            self._errors.append(error)

    def _include(self, args: tuple[Term, ...], _read: ReadTerm, folder: Path | None) -> None:
        path = find_file(args[0], folder, self._search)
        self._text(read_source(path), str(path), path.parent)

    def _ensure_loaded(self, args: tuple[Term, ...], read: ReadTerm, folder: Path | None) -> None:
        target = deref(args[0])
        if type(target) is Struct and target.name == "library":
            self._use_module(args, read, folder)
            return
        path = find_file(target, folder, self._search)
        if path.resolve() not in self._engine.loaded:
            self._engine.consult(path, self._search)

    def _abolish(self, args: tuple[Term, ...], read: ReadTerm, _folder: Path | None) -> None:
        """Forget static predicates that were loaded so far, so that this text may define them anew.

        The standard's abolish/1, which as a goal leaves static predicates alone, is no directive of its own.

        Raises:
            PrologError: One is not defined, or is none that a program may define.
        """
        for name, arity in indicators(args[0]):
            predicate = self._engine.program.find(name, arity)
            if predicate is None and builtin(name, arity) is None:
                raise existence_error("procedure", name_term(name, arity))
            if predicate is None or predicate.dynamic:
                self._run(Struct("abolish", (name_term(name, arity),)), read)
                continue
            predicate.replace([])
            predicate.defined = False
            self._seen.discard((name, arity))

    def _initialization(self, args: tuple[Term, ...], read: ReadTerm, _folder: Path | None) -> None:
        callable_parts(args[0])
        self._goals.append((args[0], read))

    def _use_module(self, args: tuple[Term, ...], read: ReadTerm, folder: Path | None) -> None:
        target = deref(args[0])
        if type(target) is Struct and target.name == "library" and len(target.args) == 1:
            module = deref(target.args[0])
            if type(module) is Atom and library().provides(module.name):
                return
            raise existence_error("library", target)
        self._ensure_loaded(args, read, folder)

    def _module(self, _args: tuple[Term, ...], read: ReadTerm, _folder: Path | None) -> None:
        """A module's predicates are all visible: there is one name space."""


def _indicator(head: Term) -> Indicator:
    name, args = callable_parts(head)
    return name, len(args)


def read_source(path: Path) -> str:
    """The text of a file.

    Raises:
        PrologSyntaxError: It is not encoded in UTF-8.
        OSError: It cannot be read.
    """
    data = path.read_bytes()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8")
        bad = f"byte 0x{data[error.start]:02x} is no UTF-8; save the file in that encoding"
        line = before.count("\n") + 1
        column = len(before) - before.rfind("\n")
        raise PrologSyntaxError(
            syntax_error(bad).term, file=str(path), line=line, column=column, source=before.split("\n")[-1]
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def find_file(term: Term, folder: Path | None, search: Sequence[Path] = ()) -> Path:
    """The file that an atom names, with or without ``.pl``, in a folder or else in those of a search path.

    Raises:
        ExistenceError: There is no such file.
    """
    term = deref(term)
    if type(term) is Var:
        raise instantiation_error()
    if type(term) is not Atom and type(term) is not str:
        raise type_error("atom", term)
    name = term.name if type(term) is Atom else str(term)
    for place in (folder or Path(), *search):
        for candidate in (place / name, place / f"{name}.pl"):
            if candidate.is_file():
                return candidate
    raise existence_error("source_sink", term)
