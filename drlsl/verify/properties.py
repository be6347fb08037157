"""Rules and the properties to prove of them, as one Prolog program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from drlsl.driving.scene import SCHEMA
from drlsl.driving.shield import BOUNDS, NAMES, declared_observation, default_rules
from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.core import Clause
from drlsl.logic.loading import builtin, library
from drlsl.logic.terms import Atom, Struct, deref, make_list
from drlsl.lowering.frontend import Query
from drlsl.lowering.ir import FLOAT_BOUND, Relation, Schema
from drlsl.verify.images import expand, undefined_calls
from drlsl.verify.ranges import RANGES, Range, decimal
from drlsl.verify.sealing import consult_sealed
from drlsl.verify.smt import FOCUS
from drlsl.verify.told import Declared, declared_facts

FACTS: Final = Schema([*SCHEMA.relations.values(), FOCUS])
"""The facts of a scene, and the one vehicle that `focus/1` names."""


@dataclass(frozen=True, slots=True)
class Property:
    """A statement that holds in every scene: its name, and its text in words."""

    name: str
    text: str

    @property
    def query(self) -> Query:
        """The query whether a scene breaks it."""
        return Query(f"violates {self.name}", 0, "holds")

    @property
    def goal(self) -> str:
        """The goal of that query."""
        return f"violates({self.name})"


@dataclass(frozen=True, slots=True)
class Book:
    """A rule program with the properties to be proved of it, and their ranges.

    `missing` lists, by property, the predicates that it calls and the rules lack. `unknowns` are further
    numbers of the properties besides the scene, names with descriptions; they have ranges as well. `told` are
    the facts of another environment that the properties declare; None: they are about driving scenes.
    """

    engine: Engine
    properties: tuple[Property, ...]
    ranges: dict[str, Range]
    missing: dict[str, tuple[str, ...]]
    unknowns: dict[str, str] = field(default_factory=dict)
    told: Declared | None = None

    @property
    def facts(self) -> Schema:
        """The facts of a scene, `focus/1`, and a fact for every unknown number."""
        return _facts(self.unknowns)


def default_properties() -> Path:
    """Return the file of the properties of driving rules, beside the default rules."""
    return default_rules()[0].parent / "properties.pl"


def load(rules: Sequence[str | Path], properties: Sequence[str | Path] = ()) -> Book:
    """Load rules, by default highway.pl, and properties, by default properties.pl.

    Raises:
        UserError: a file cannot be read or has no property, or both define the same predicate.
        PrologError: a file is not a valid program.
    """
    engine = consult_sealed(rules or default_rules(), properties or (default_properties(),))
    declared = _declared(engine)
    unknowns, ranges = _unknowns(engine)
    _complete(engine)
    expand(engine)
    missing = _missing(engine, declared, _facts(unknowns))
    told = declared_facts(engine, ranges)
    return Book(engine, declared, {**_ranges(engine), **ranges}, missing, unknowns, told)


def _complete(engine: Engine) -> None:
    """Define the names and the bounds of the observation where the rules leave them to the default.

    Raises:
        UserError: those that the rules define are not usable.
    """
    space = declared_observation(engine)
    bounds = [Struct("-", pair) for pair in zip(space.low, space.high, strict=True)]
    for question, items in ((NAMES, list(map(Atom, space.names))), (BOUNDS, bounds)):
        if not engine.defines(question.name, question.arity):
            engine.define(
                question.name, 1, [Clause(Struct(question.name, (make_list(items),)), Atom("true"))]
            )


def _facts(unknowns: Iterable[str]) -> Schema:
    return Schema(
        [*FACTS.relations.values(), *(Relation(name, ("float",), single=True) for name in unknowns)]
    )


def _declared(engine: Engine) -> tuple[Property, ...]:
    """Return the properties of `property/2`, each with a predicate of its own for its violation."""
    found = [
        Property(str(solution["Name"]), str(solution["Text"]))
        for solution in engine.query("property(Name, Text)")
    ]
    if not found:
        raise UserError("no properties: a file of properties has property(Name, Text) and violates(Name)")
    twice = [name for name, times in Counter(one.name for one in found).items() if times > 1]
    if twice:
        raise UserError(f"property({twice[0]}, ...) is declared more than once")
    names = {one.name for one in found}
    broken = set()
    for clause in engine.clauses("violates", 1):
        name = deref(clause.args[0])
        if not isinstance(name, Atom):
            raise UserError(f"{clause.span}: violates/1 names no property; expected violates(Name) :- ...")
        if name.name not in names:
            raise UserError(f"{clause.span}: violates({name.name}) without property({name.name}, Text)")
        broken.add(name.name)
    for one in found:
        if one.name not in broken:
            raise UserError(f"property({one.name}, ...) without a clause of violates({one.name})")
        broken_if = Clause(Atom(one.query.name), Struct("violates", (Atom(one.name),)))
        engine.define(one.query.name, 0, [broken_if])
    return tuple(found)


def _ranges(engine: Engine) -> dict[str, Range]:
    """Return the default ranges, updated with those of the properties."""
    ranges = dict(RANGES)
    for solution in engine.query("range(Name, Low, High)"):
        name, low, high = str(solution["Name"]), solution["Low"], solution["High"]
        if name not in ranges:
            raise UserError(f"range({name}, ...): unknown; there are {', '.join(ranges)}")
        ranges[name] = _range("range", name, low, high)
    return ranges


def _range(word: str, name: str, low: object, high: object) -> Range:
    if not isinstance(low, int | float) or not isinstance(high, int | float) or not low <= high:
        raise UserError(f"{word}({name}, {low}, {high}): expected two numbers, the lower first")
    if max(abs(low), abs(high)) > FLOAT_BOUND:
        raise UserError(f"{word}({name}, {low}, {high}): expected numbers from -1e15 to 1e15")
    return decimal(low), decimal(high)


def _unknowns(engine: Engine) -> tuple[dict[str, str], dict[str, Range]]:
    """Return the numbers that `unknown/4` declares: their descriptions, and their ranges."""
    texts: dict[str, str] = {}
    ranges: dict[str, Range] = {}
    for solution in engine.query("unknown(Name, Low, High, Text)"):
        name = str(solution["Name"])
        if name in RANGES or FACTS.find(name, 1) is not None:
            raise UserError(f"unknown({name}, ...): the name is taken by a fact or a range")
        if engine.clauses(name, 1):
            raise UserError(f"unknown({name}, ...): {name}/1 has clauses; expected only :- dynamic({name}/1)")
        bounds = _range("unknown", name, solution["Low"], solution["High"])
        if ranges.setdefault(name, bounds) != bounds:
            raise UserError(f"unknown({name}, ...) is declared more than once, with different ranges")
        texts[name] = str(solution["Text"])
    return texts, ranges


def _missing(engine: Engine, properties: Iterable[Property], facts: Schema) -> dict[str, tuple[str, ...]]:
    """Return, by property, the predicates that it needs and that are not defined."""

    def is_known(name: str, arity: int) -> bool:
        return (
            facts.find(name, arity) is not None
            or builtin(name, arity) is not None
            or library().find(name, arity) is not None
        )

    clauses = engine.clauses("violates", 1)
    result = {}
    for one in properties:
        bodies = [clause.body for clause in clauses if deref(clause.args[0]) is Atom(one.name)]
        missing = undefined_calls(engine, bodies, is_known)
        if missing:
            result[one.name] = tuple(f"{name}/{arity}" for name, arity in sorted(missing))
    return result
