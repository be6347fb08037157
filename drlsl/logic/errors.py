"""Errors of Prolog as Python exceptions, one class for each kind of error term.

Source: ISO 13211-1 7.12.2 (error classification).
"""

from __future__ import annotations

from typing import Any, ClassVar, Final, Self

from drlsl.logic.terms import Atom, CyclicTerm, Operators, Struct, Term, Var, deref, format_term

_OPERATORS: Final = Operators()
_SHOWN_DEPTH: Final = 12
_SHOWN_NAMES: Final = 100
_SHOWN_TOKENS: Final = 2_000
_SHOWN_CHARACTERS: Final = 10_000

# The classes by the names of their error terms.
_CLASSES: Final[dict[str, type[PrologError]]] = {}


def _show(term: Term) -> str:
    """Return a term as text, its variables by their names in the program."""
    names: dict[int, str] = {}
    todo = [deref(term)]
    left = _SHOWN_TOKENS
    while todo and len(names) < _SHOWN_NAMES and left:
        left -= 1
        part = todo.pop()
        if isinstance(part, Var):
            names[id(part)] = part.name
        elif isinstance(part, Struct):
            todo.extend(map(deref, part.args[:_SHOWN_NAMES]))
    try:
        text = format_term(
            term,
            _OPERATORS,
            quoted=True,
            numbervars=True,
            max_depth=_SHOWN_DEPTH,
            variable_names=names,
            most=_SHOWN_TOKENS,
        )
    except CyclicTerm:
        return "a cyclic term"
    return text if len(text) <= _SHOWN_CHARACTERS else text[:_SHOWN_CHARACTERS] + " ..."


def _printable(text: str) -> str:
    """Return a text with its control characters as escapes, so that no terminal executes them."""
    return "".join(char if char.isprintable() else f"\\x{ord(char):x}\\" for char in text)


def _remade(kind: type[PrologError], args: tuple[Any, ...]) -> PrologError:
    """Return an error of a kind; its attributes are restored afterwards."""
    return kind.__new__(kind, *args)


class PrologError(Exception):
    """An uncaught ball.

    `term` is the ball, `goal` the goal that raised it and `clause` the place (``file:line``) of the clause
    whose body called it; the solver sets the last two if it knows them. An error that is not `catchable` ends
    the query, regardless of catch/3.
    """

    catchable: ClassVar[bool] = True
    functor: ClassVar[str] = ""
    """The name of the error term of this kind; none: any ball."""
    words: ClassVar[str] = ""
    """What went wrong, with the arguments of the error term by their places; none: the ball says it."""

    def __init_subclass__(cls, *, functor: str = "", words: str = "") -> None:
        if functor:
            cls.functor, cls.words = functor, words
            _CLASSES[functor] = cls

    def __init__(self, term: Term, *, goal: Term | None = None, clause: str | None = None) -> None:
        super().__init__(term)
        self.term = term
        self.goal = goal
        self.clause = clause

    @classmethod
    def of(cls, *args: Term) -> Self:
        """Return the error of this kind with these arguments: ``error(functor(args), _)``."""
        formal = Struct(cls.functor, args) if args else Atom(cls.functor)
        return cls(Struct("error", (formal, Var())))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the error with all its attributes, whatever its constructor."""
        return _remade, (type(self), self.args), vars(self)

    @property
    def formal(self) -> Term:
        """The first argument of ``error/2``; the ball itself if it is another term."""
        ball = deref(self.term)
        return deref(ball.args[0]) if isinstance(ball, Struct) and ball.name == "error" else ball

    def message(self) -> str:
        """Return the error without its place."""
        if self.words:
            return self.words.format(*map(self._part, range(3)))
        return f"uncaught exception: {_show(self.term)}"

    def __str__(self) -> str:
        where = f", in {_show(self.goal)}" if self.goal is not None else ""
        source = f" ({self.clause})" if self.clause else ""
        return f"{self.message()}{where}{source}"

    def _part(self, index: int) -> str:
        formal = self.formal
        if isinstance(formal, Struct) and index < len(formal.args):
            return _show(formal.args[index])
        return "?"


class InstantiationError(
    PrologError,
    functor="instantiation_error",
    words="instantiation error: an argument is not sufficiently instantiated",
):
    """An argument is a variable, or holds one, where a bound term is needed."""


class PrologTypeError(PrologError, functor="type_error", words="type error: expected {0}, found {1}"):
    """An argument is of the wrong type."""


class DomainError(PrologError, functor="domain_error", words="domain error: expected {0}, found {1}"):
    """An argument is of the right type but outside the domain."""


class ExistenceError(PrologError, functor="existence_error", words="existence error: {0} {1} does not exist"):
    """An object that an operation needs does not exist."""


class PrologPermissionError(
    PrologError, functor="permission_error", words="permission error: no permission to {0} {1} {2}"
):
    """An operation is not permitted on its object."""


class RepresentationError(PrologError, functor="representation_error", words="representation error: {0}"):
    """An implementation limit prevents the representation of the term."""


class EvaluationError(PrologError, functor="evaluation_error", words="evaluation error: {0}"):
    """An arithmetic operation is undefined."""


class ResourceError(PrologError, functor="resource_error", words="resource error: {0}"):
    """A limit on time, steps, depth or memory is exhausted."""


class Halt(PrologError):
    """The program called halt/1 with this exit status. Source: ISO 13211-1, 8.17.3."""

    catchable = False

    def __init__(self, status: int) -> None:
        super().__init__(Struct("unwind", (Struct("halt", (status,)),)))
        self.status = status

    def message(self) -> str:
        return f"the program asked to end (halt, status {self.status})"


class PrologSyntaxError(PrologError, functor="syntax_error"):
    """Text is not a term.

    `file`, `line` and `column` (both from 1) are the place, `source` is that line and `width` the number of
    faulty characters; they are None, 0 and empty if the text has no place (``atom_to_term/3``).
    """

    def __init__(
        self,
        term: Term,
        *,
        goal: Term | None = None,
        clause: str | None = None,
        file: str | None = None,
        line: int = 0,
        column: int = 0,
        source: str = "",
        width: int = 1,
    ) -> None:
        super().__init__(term, goal=goal, clause=clause)
        self.file, self.line, self.column = file, line, column
        self.source, self.width = source, width

    def message(self) -> str:
        formal = self.formal
        what = deref(formal.args[0]) if isinstance(formal, Struct) else formal
        text = what.name if isinstance(what, Atom) else _show(what)
        return f"syntax error: {_printable(text)}"

    def __str__(self) -> str:
        if not self.line:
            return super().__str__()
        place = f"{self.file}:{self.line}:{self.column}: {self.message()}"
        if not self.source:
            return place
        shown = "".join(char if char.isprintable() else " " for char in self.source)
        marks = max(1, min(self.width, len(shown) - self.column + 1))
        pointer = " " * (self.column - 1) + "~" * (marks - 1) + "^"
        return f"{place}\n{shown}\n{pointer}"


def error_from_term(ball: Term) -> PrologError:
    """Return the exception for a ball: a subclass for an ISO error term, else a plain PrologError."""
    term = deref(ball)
    if isinstance(term, Struct) and term.name == "error" and len(term.args) == 2:
        formal = deref(term.args[0])
        if isinstance(formal, (Struct, Atom)):
            return _CLASSES.get(formal.name, PrologError)(ball)
    return PrologError(ball)


def instantiation_error() -> InstantiationError:
    """Return error(instantiation_error, _)."""
    return InstantiationError.of()


def type_error(expected: str, culprit: Term) -> PrologTypeError:
    """Return error(type_error(expected, culprit), _)."""
    return PrologTypeError.of(Atom(expected), culprit)


def domain_error(domain: str, culprit: Term) -> DomainError:
    """Return error(domain_error(domain, culprit), _)."""
    return DomainError.of(Atom(domain), culprit)


def existence_error(kind: str, culprit: Term) -> ExistenceError:
    """Return error(existence_error(kind, culprit), _)."""
    return ExistenceError.of(Atom(kind), culprit)


def permission_error(operation: str, kind: str, culprit: Term) -> PrologPermissionError:
    """Return error(permission_error(operation, kind, culprit), _)."""
    return PrologPermissionError.of(Atom(operation), Atom(kind), culprit)


def representation_error(limit: str) -> RepresentationError:
    """Return error(representation_error(limit), _)."""
    return RepresentationError.of(Atom(limit))


def evaluation_error(what: str) -> EvaluationError:
    """Return error(evaluation_error(what), _)."""
    return EvaluationError.of(Atom(what))


def resource_error(resource: str) -> ResourceError:
    """Return error(resource_error(resource), _)."""
    return ResourceError.of(Atom(resource))


def syntax_error(message: str) -> PrologSyntaxError:
    """Return error(syntax_error(message), _), for text without a place in a file."""
    return PrologSyntaxError.of(Atom(message))
