"""The engine's interface for the machine, the loader and proofs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TextIO

from drlsl.logic.core.body import Node
from drlsl.logic.core.clauses import Predicate, Program
from drlsl.logic.limits import Meter
from drlsl.logic.syntax import Flags
from drlsl.logic.terms import Operators, Term


class Resolver(Protocol):
    """Finds the targets of goals in one program."""

    program: Program

    def resolve(self, name: str, arity: int) -> tuple[int, Any]:
        """Return the kind of node and the target of a goal."""

    def link(self, node: Node, name: str, arity: int) -> None:
        """Set the target of a node by its name and arity."""


class Host(Protocol):
    """An engine, for the code that runs its program."""

    program: Program
    flags: Flags
    operators: Operators
    globals: dict[str, Term]
    state: dict[str, Any]
    output: TextIO
    compiled: bool

    @property
    def linker(self) -> Resolver:
        """The resolver of the targets of goals."""

    def undefined(self, machine: Any, predicate: Predicate, args: Sequence[Term], continuation: Any) -> Any:
        """Return the task for a call of an unknown predicate."""

    def run_directive(
        self,
        goal: Term,
        output: TextIO | None = None,
        trail: list[Any] | None = None,
        meter: Meter | None = None,
    ) -> bool:
        """Prove a goal once."""

    def load_files(self, files: Term, *, again: bool, meter: Meter) -> None:
        """Load the file that a term names, or each of a list."""

    def finds(self, file: Term) -> bool:
        """Return whether a term names a file or a library that could be loaded."""
