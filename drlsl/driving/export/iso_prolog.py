"""A loaded rule program as the text of one file in plain ISO Prolog.

Source: ISO 13211-1 with Cor.2; what SWI-Prolog 9, GNU Prolog 1.4, Tau Prolog 0.3 and Trealla do otherwise.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final, TypeAlias

from drlsl.logic import Engine
from drlsl.logic.core import COMPARISONS, GOAL_ARGUMENTS, OPERATIONS, Clause, instantiated
from drlsl.logic.syntax import Span
from drlsl.logic.terms import TRUE, Atom, Operators, Struct, Term, Var, deref, format_term
from drlsl.lowering.ir import NotLowerable

Indicator: TypeAlias = tuple[str, int]


def _indicators(text: str) -> frozenset[Indicator]:
    return frozenset((name, int(arity)) for word in text.split() for name, _, arity in [word.rpartition("/")])


_GOALS: Final = _indicators(""",/2 ;/2 ->/2 \\+/1 call/1 once/1 findall/3 catch/3 forall/2 ignore/1""")
"""The predicates that take goals, in ISO Prolog or in the prelude."""

_BUILTINS: Final = _indicators(
    """true/0 fail/0 !/0 =/2 \\=/2 ==/2 \\==/2 @</2 @>/2 @=</2 @>=/2 is/2 =:=/2 =\\=/2 </2 >/2 =</2 >=/2
    var/1 nonvar/1 atom/1 number/1 integer/1 float/1 atomic/1 compound/1 functor/3 arg/3 =../2
    copy_term/2 throw/1"""
)
"""The builtin predicates of ISO Prolog that take no goals and answer alike."""

_PRELUDE: Final = _indicators(
    """forall/2 ignore/1 member/2 memberchk/2 append/3 length/2 between/3 sum_list/2 max_list/2 min_list/2"""
)

_EVALUABLE: Final = _indicators(
    """+/2 -/2 */2 //2 ///2 mod/2 rem/2 div/2 -/1 +/1 abs/1 sign/1 min/2 max/2 float/1 floor/1 ceiling/1
    **/2 sqrt/1 exp/1 log/1 sin/1 cos/1 tan/1 asin/1 acos/1 atan/1 pi/0 >>/2 <</2 /\\/2 \\//2 xor/2
    \\/1"""
)
"""The evaluable functors that give the same value in every system."""

_PARTS: Final = re.compile(r"\bdrlsl_\w+")


@cache
def foreign_builtins() -> frozenset[Indicator]:
    """Return the predicates that are builtin, or in a library loaded at once, in one of the systems."""
    text = (files(__package__) / "templates" / "builtins.txt").read_text(encoding="utf-8")
    found = (word.rpartition("/") for word in text.split())
    return frozenset((name, int(arity)) for name, _, arities in found for arity in arities.split(","))


def iso_text(engine: Engine) -> str:
    """Return the clauses of a program, each predicate's together, and the prelude that they need.

    A predicate whose name is a builtin's somewhere gets another name.

    Raises:
        NotLowerable: a clause calls what ISO Prolog and the prelude lack, or what systems do differently.
    """
    return _Writer(engine).text()


class _Writer:
    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._defined = frozenset(engine.predicates())
        self._names = {key: self._new_name(*key) for key in self._defined & foreign_builtins()}
        self._operators = Operators()
        self._clause: Clause | None = None
        self._predicate: Indicator = ("", 0)

    def _new_name(self, name: str, arity: int) -> str:
        new = f"rule_{name}"
        while (new, arity) in self._defined or (new, arity) in foreign_builtins():
            new = f"{new}_"
        return new

    def text(self) -> str:
        parts = list(self._predicates())
        prelude = _prelude("\n".join(parts))
        return "\n".join([*parts, *prelude])

    def _predicates(self) -> Iterator[str]:
        keys = self._engine.predicates()
        # clauses without a place were told, such as the facts of a scene
        read = {key: [clause for clause in self._engine.clauses(*key) if clause.span] for key in keys}
        dynamic = [key for key in keys if self._engine.is_dynamic(*key) or not read[key]]
        yield "".join(f":- dynamic({self._atom(name)}/{arity}).\n" for name, arity in dynamic)
        for key, clauses in read.items():
            self._predicate = key
            if clauses:
                renamed = f"% {key[0]}/{key[1]} by another name\n" if key in self._names else ""
                yield renamed + _comment(clauses[0].span) + "".join(map(self._clause_text, clauses))

    def _atom(self, name: str) -> str:
        return format_term(Atom(name), self._operators, quoted=True)

    def _clause_text(self, clause: Clause) -> str:
        self._clause = clause
        names = {id(deref(variable)): name for name, variable in clause.names.items()}
        head, body = self._renamed(deref(clause.head)), self._goal(clause.body)
        counts = Counter(map(id, _variables([head, body])))
        for number, variable in enumerate(counts.keys() - names.keys()):
            names[variable] = "_" if counts[variable] == 1 else f"_G{number}"
        if body is TRUE:
            return f"{self._written(head, names)}.\n"
        goals = ",\n    ".join(self._written(goal, names) for goal in _conjuncts(body))
        return f"{self._written(head, names)} :-\n    {goals}.\n"

    def _written(self, term: Term, names: Mapping[int, str]) -> str:
        text = format_term(
            term, self._operators, quoted=True, variable_names=names, spacing=True, priority=999
        )
        return re.sub(r"(?<![\w.])(\d+)e", r"\1.0e", text)

    def _refuse(self, reason: str) -> NotLowerable:
        span = self._clause.span if self._clause is not None else None
        name, arity = self._predicate
        return NotLowerable(f"{name}/{arity}", span, reason)

    def _renamed(self, term: Term) -> Term:
        """Return a head or a goal under the name that its predicate has in the file."""
        if isinstance(term, Atom):
            return Atom(self._names.get((term.name, 0), term.name))
        assert isinstance(term, Struct)
        return Struct(self._names.get((term.name, len(term.args)), term.name), term.args)

    def _goal(self, term: Term) -> Term:
        """Return a goal in ISO Prolog."""
        term = deref(term)
        if isinstance(term, Var):
            return Struct("call", (term,))
        if not isinstance(term, Atom | Struct):
            raise self._refuse(f"{term!r} is no goal")
        name, args = term.name, term.args if isinstance(term, Struct) else ()
        key = (name, len(args))
        if key in self._defined:
            return self._renamed(term)
        if key == ("aggregate_all", 3):
            return self._aggregate(*args)
        if key in _GOALS:
            places = GOAL_ARGUMENTS[key]
            args = tuple(self._goal(arg) if place in places else arg for place, arg in enumerate(args))
            return Struct(f"drlsl_{name}" if key in _PRELUDE else name, args)
        if key in _PRELUDE:
            return Struct(f"drlsl_{name}", args)
        if key not in _BUILTINS:
            raise self._refuse(f"{name}/{len(args)} is neither of ISO Prolog nor in the prelude")
        if name == "is":
            return Struct(name, (args[0], self._expression(args[1])))
        if key[1] == 2 and name in COMPARISONS:
            return Struct(name, tuple(map(self._expression, args)))
        return term

    def _aggregate(self, spec: Term, goal: Term, result: Term) -> Term:
        spec, result, goal = deref(spec), deref(result), self._goal(goal)
        if isinstance(spec, Atom) and spec.name == "count":
            return Struct("drlsl_count", (goal, result))
        if isinstance(spec, Struct) and spec.name in ("sum", "max", "min") and len(spec.args) == 1:
            return Struct(f"drlsl_{spec.name}", (self._expression(spec.args[0]), goal, result))
        if isinstance(spec, Struct) and spec.name == "bag" and len(spec.args) == 1:
            return Struct("findall", (spec.args[0], goal, result))
        if isinstance(spec, Struct) and spec.name in ("max", "min") and len(spec.args) == 2:
            best = (Var("Value"), Var("Witness"))
            found = Struct(f"drlsl_{spec.name}", (self._expression(spec.args[0]), spec.args[1], goal, *best))
            if isinstance(result, Struct) and (result.name, len(result.args)) == (spec.name, 2):
                return Struct(found.name, (*found.args[:3], *result.args))
            return Struct(",", (found, Struct("=", (result, Struct(spec.name, best)))))
        raise self._refuse("only count, sum, max, min and bag are aggregated in the prelude")

    def _expression(self, term: Term) -> Term:
        """Return an expression that has the same value in every system."""
        term = deref(term)
        if not isinstance(term, Atom | Struct):
            return term
        args = term.args if isinstance(term, Struct) else ()
        key = (term.name, len(args))
        row = OPERATIONS.get(key)
        if key not in _EVALUABLE and row is not None and row.defined:
            made: Term = instantiated(row.defined, args)
            return self._expression(made)
        if key not in _EVALUABLE:
            raise self._refuse(f"{term.name}/{len(args)} is not evaluated alike by all systems")
        if not args:
            return term
        parts = tuple(map(self._expression, args))
        if term.name in ("floor", "ceiling"):  # other systems take no integers
            parts = (Struct("float", parts),)
        return Struct(term.name, parts)


def _prelude(text: str) -> list[str]:
    """Return the clauses of the prelude that a text needs, and the title."""
    title, *blocks = (
        (files(__package__) / "templates" / "prelude.pl").read_text(encoding="utf-8").split("\n\n")
    )
    known: dict[str, list[str]] = {}
    for block in blocks:
        first = next(line for line in block.splitlines() if not line.startswith("%"))
        known.setdefault(_PARTS.findall(first)[0], []).append(block.strip() + "\n")
    needed: set[str] = set()
    waiting = set(_PARTS.findall(text))
    while waiting:
        name = waiting.pop()
        needed.add(name)
        waiting |= {part for block in known[name] for part in _PARTS.findall(block)} - needed
    return [f"{title}\n", *(block for name, found in known.items() if name in needed for block in found)]


def _conjuncts(body: Term) -> Iterator[Term]:
    while isinstance(body, Struct) and (body.name, len(body.args)) == (",", 2):
        yield from _conjuncts(deref(body.args[0]))
        body = deref(body.args[1])
    yield body


def _variables(terms: Iterable[Term]) -> Iterator[Var]:
    """Yield the variables in terms, each as often as it occurs."""
    waiting = list(terms)
    while waiting:
        term = deref(waiting.pop())
        if isinstance(term, Struct):
            waiting.extend(term.args)
        elif isinstance(term, Var):
            yield term


def _comment(span: Span | None) -> str:
    """Return the comment above a clause in its file; none for a clause of a text without one."""
    if span is None or not Path(span.name).is_file():
        return ""
    above = Path(span.name).read_text(encoding="utf-8-sig").splitlines()[: span.line - 1]
    found: list[str] = []
    while above and above[-1].startswith("%"):
        found.append(above.pop())
    return "".join(f"{line}\n" for line in found[::-1])
