"""The target of a goal's name and arity: a predicate of the program, a builtin, or one of the library."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

from drlsl.logic.builtins import ARITHMETIC
from drlsl.logic.core import (
    CALL,
    CONTROL,
    CONTROL_BUILTINS,
    DET,
    DET_BUILTINS,
    IN_PLACE,
    NONDET,
    NONDET_BUILTINS,
    Clause,
    Indicator,
    Node,
    Predicate,
    Program,
    compile_clause,
    translate_rule,
)
from drlsl.logic.errors import PrologError
from drlsl.logic.jit import cold_entry, settle_rest
from drlsl.logic.limits import LimitExceeded, Meter
from drlsl.logic.syntax import Flags, read_terms
from drlsl.logic.terms import TRUE, CyclicTerm, Operators, Struct

_LIBRARY: Final = Path(__file__).parent / "library"
_HEADER: Final = re.compile(r":- module\((\w+), \[([^]]*)\]\)\.")
# Larger predicates are data, of which a query may need little: their clauses are linked when they are tried.
_MOST_PREPARED: Final = 200
_EXPORT: Final = re.compile(r"\(?'?([^\s,'/()]+)'?\)?/(\d+)")

# Libraries of SWI-Prolog whose predicates are builtins here, so that use_module/1 of them is no error.
_BUILT_IN: Final = frozenset(
    {"aggregate", "backcomp", "between", "error", "random", "tabling", "terms", "system", "yall"}
)


def builtin(name: str, arity: int) -> tuple[int, Any] | None:
    """Return the kind of node and the function of a builtin; None if there is none."""
    key = name, arity
    for op, table in ((DET, DET_BUILTINS), (CONTROL, CONTROL_BUILTINS), (NONDET, NONDET_BUILTINS)):
        function = table.get(key)
        if function is not None:
            return op, function
    return None


class Library:
    """The predicates written in Prolog: read when first needed, once for the process, then fixed."""

    def __init__(self) -> None:
        self.exports: dict[Indicator, Path] = {}
        self.modules: set[str] = set()
        self.program = Program(self.link, partial(cold_entry, self), lambda _: None)
        self._loaded: set[Path] = set()
        self._lock = threading.RLock()
        for path in sorted(_LIBRARY.glob("*.pl")):
            header = _HEADER.match(path.read_text(encoding="utf-8"))
            assert header is not None, path
            self.modules.add(header[1])
            for name, arity in _EXPORT.findall(header[2]):
                self.exports[name, int(arity)] = path

    def find(self, name: str, arity: int) -> Predicate | None:
        """Return the predicate that the library exports under that name and arity."""
        path = self.exports.get((name, arity))
        if path is None:
            return None
        if path not in self._loaded:
            self._load(path)
        return self.program.predicates[name, arity]

    def clauses(self, name: str, arity: int) -> list[Clause]:
        """Return the clauses of a predicate that the library exports, or that its own clauses call."""
        predicate = self.find(name, arity) or self.program.find(name, arity)
        return [] if predicate is None else list(predicate.clauses)

    def provides(self, module: str) -> bool:
        """Return whether use_module/1 of a library only needs to find it."""
        return module in self.modules or module in _BUILT_IN

    def _load(self, path: Path) -> None:
        with self._lock:
            if path in self._loaded:
                return
            terms = read_terms(
                path.read_text(encoding="utf-8"), Operators(), Flags(), f"library({path.stem})"
            )
            for read in terms:
                term = read.term
                if type(term) is Struct and term.name == "-->":
                    term = translate_rule(term)
                if type(term) is Struct and term.name == ":-":
                    if len(term.args) == 1:
                        continue
                    head, body = term.args
                else:
                    head, body = term, TRUE
                clause = Clause(head, body, read.span, read.variables)
                self.program.get(head.name, len(clause.args)).append(clause)  # type: ignore[union-attr]
            self._loaded.add(path)

    def resolve(self, name: str, arity: int) -> tuple[int, Any]:
        """Return the kind of node and the target of a goal in a library clause: no program can change it."""
        predicate = self.find(name, arity) or self.program.find(name, arity)
        if predicate is not None:
            return CALL, predicate
        return builtin(name, arity) or (CALL, self.program.get(name, arity))

    def link(self, node: Node, name: str, arity: int) -> None:
        """Set the target of a node of a library clause by its name and arity."""
        set_target(node, self.resolve(name, arity))


def set_target(node: Node, found: tuple[int, Any]) -> None:
    """Set the target of a node to a result of `resolve`."""
    node.op, target = found
    if node.op == CALL:
        node.target = target
        return
    node.function = target
    in_place = ARITHMETIC.get(target) if node.op == DET else None
    if in_place is not None:
        node.op, node.function = IN_PLACE, in_place


@cache
def library() -> Library:
    """Return the library that every engine of the process shares."""
    return Library()


class _NotYet(Exception):
    """A target that may still change until the goal is called."""


class Linker:
    """Finds the targets of goals in one program."""

    def __init__(self) -> None:
        self.program = Program(self.link, partial(cold_entry, self), partial(settle_rest, self))
        self.relinked = 0  # the number of changes of the targets of goals

    def resolve(self, name: str, arity: int) -> tuple[int, Any]:
        """Return the kind of node and the target of a goal: the program's own predicates hide all others."""
        predicate = self.program.predicates.get((name, arity))
        if predicate is not None and predicate.defined:
            return CALL, predicate
        found = builtin(name, arity)
        if found is not None:
            return found
        return CALL, library().find(name, arity) or self.program.get(name, arity)

    def link(self, node: Node, name: str, arity: int) -> None:
        """Set the target of a node by its name and arity."""
        set_target(node, self.resolve(name, arity))

    def relink(self) -> None:
        """Have every clause linked again, after a definition has begun to hide a builtin."""
        self.relinked += 1
        for predicate in self.program.predicates.values():
            if predicate.rows is None:
                for clause in predicate.clauses:
                    clause.code = None
            predicate.changed()

    def prepare(self, predicates: Iterable[Predicate], meter: Meter) -> None:
        """Prepare clauses and indexes that the first call would need, if nothing can change them.

        A faulty clause is an error only once it is reached.

        Raises:
            LimitExceeded: It goes beyond the limits of the meter.
        """
        for predicate in predicates:
            if predicate.rows is not None or len(predicate) > _MOST_PREPARED:
                continue
            for clause in predicate.clauses:
                try:
                    clause.code = clause.code or compile_clause(clause, self._link_for_good, meter)
                except LimitExceeded:
                    raise
                except (_NotYet, PrologError, CyclicTerm, RecursionError):
                    continue
            if not predicate.dynamic:
                predicate.index()

    def _link_for_good(self, node: Node, name: str, arity: int) -> None:
        if (name, arity) in library().exports:
            # A program may define a predicate of the library's name at any time before it is called.
            predicate = self.program.find(name, arity)
            if predicate is None or predicate.dynamic:
                raise _NotYet
        self.link(node, name, arity)
