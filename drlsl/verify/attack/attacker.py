"""Search a scene that breaks a proved property, by trying very many.

A proof is no better than the prover. So scenes are drawn by the hundred thousand within the ranges of the
property, at random and at every edge and constant, and those closest to breaking it are changed in small
steps to get closer. Nothing here uses the formulas of the solver: scenes are given to the array tier, those
that break the property there to the interpreter, and those that it confirms are judged in exact arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from fractions import Fraction
from typing import Any, Final, Literal, TypeAlias
from zlib import crc32

import numpy as np

from drlsl.driving.scene import EGO
from drlsl.logic.core import Clause, conjuncts, read_body
from drlsl.logic.terms import Atom, Struct, Term, deref
from drlsl.lowering.backends import ArrayProgram, Rows, compile_numpy
from drlsl.lowering.frontend import Lowered, Query, deep_recursion, lower
from drlsl.lowering.ir import Node, NotLowerable, Pool, reach
from drlsl.traffic import Floats, Mask
from drlsl.verify.attack.closeness import Closeness
from drlsl.verify.attack.exact import judge
from drlsl.verify.attack.sampled_facts import array_facts, exact_facts, float_facts, scene_of
from drlsl.verify.attack.sampling import Drawn, Layout, draw, joined, normalise
from drlsl.verify.attack.scene_changes import change, relevant_columns
from drlsl.verify.confirmation import Counterexample, Replay
from drlsl.verify.properties import Book, Property
from drlsl.verify.ranges import Case
from drlsl.verify.smt import NOBODY

SCENES: Final = 200_000
"""Default number of scenes with which a property is attacked."""

SEED: Final = 20_230_610
"""Default seed of the scenes."""

_BATCH: Final = 2048
_DRAWN: Final = 0.5
"""The share of scenes that are drawn anew; the others are changed from those that are close."""

_CLIMBERS: Final = 512
_MOST_TARGETS: Final = 16
_MOST_SUSPECTS: Final = 192
"""Number of scenes left undecided by the array tier that are given to the interpreter."""

_SUSPECTS_OF_A_BATCH: Final = 4
_HITS_OF_A_BATCH: Final = 3
_MOST_HITS: Final = 16
"""Number of scenes breaking the property in floats that are examined."""

_CLOSE: Final = 1e-3
"""Scenes come close if only a comparison fails, by less than this in its unit."""

_EXTRAPOLATED: Final = 0.25
"""The share of climbers that extrapolate their last step."""

_SELECTION: Final = 16
"""Number of rounds after which the worst climbers restart from the places of others."""

Kind: TypeAlias = Literal["exact", "float", "open", "tiers"]
"""The verdict on a hit: exact arithmetic confirms, refutes or cannot judge it, or the tiers disagree."""


@dataclass(frozen=True, slots=True)
class Hit:
    """A scene that breaks a property that was proved.

    `amount` is the exact distance from its limit of the comparison that floats decide differently [m, m/s, s
    or the unit that it compares]; None if exact arithmetic agrees, or cannot judge.
    """

    kind: Kind
    counterexample: Counterexample
    amount: Fraction | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the hit as `--json` prints it."""
        amount = None if self.amount is None else float(self.amount)
        return {"kind": self.kind, "amount": amount, **self.counterexample.as_json()}


@dataclass(slots=True)
class Attack:
    """The result of attacking one property.

    Of `scenes` scenes `near` reached the last goal of a clause of violates/1, and `close` would have broken
    the property but for less than `_CLOSE` in a comparison. `undecided` were left to the interpreter, which
    examined `asked` of them. `broken` broke the property in floats; `hit` is the worst of these. `reason`
    tells why it was not attacked.
    """

    scenes: int = 0
    near: int = 0
    close: int = 0
    undecided: int = 0
    asked: int = 0
    broken: int = 0
    hit: Hit | None = None
    seconds: float = 0.0
    reason: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the attack as `--json` prints it."""
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "hit"}
        return values | {"seconds": round(self.seconds, 3), "reason": self.reason or None}


@dataclass(frozen=True, slots=True)
class Orders:
    """The extent of an attack: `scenes` scenes on these roads, with up to `vehicles` other vehicles."""

    cases: Sequence[Case]
    vehicles: int
    scenes: int = SCENES
    seed: int = SEED


def attack(book: Book, prop: Property, orders: Orders, replay: Replay | None = None) -> Attack:
    """Try to break a property; the same orders always try the same scenes."""
    result = Attack()
    if not orders.cases or not orders.scenes:
        result.reason = "no scenes were requested"
        return result
    try:
        with deep_recursion():
            target = _Target(book, prop, orders)
    except NotLowerable as reason:
        result.reason = str(reason)
        return result
    _Attacker(target, replay or Replay(book.engine, prop, book.facts), result, orders).run()
    return result


class _Target:
    """A property as a program over arrays, and its layout of scenes."""

    def __init__(self, book: Book, prop: Property, orders: Orders) -> None:
        lowered = _lowered(book, prop)
        self.answer = lowered.answers[0]
        self.program: ArrayProgram = compile_numpy(lowered)
        roots = [self.answer.found, self.answer.undecided]
        constants = [node.data for node in reach(roots) if node.op == "const"]
        atoms = [one.name for one in constants if isinstance(one, Atom)]
        numbers = [float(one) for one in constants if isinstance(one, int | float) and abs(one) < 1e15]
        self.layout = Layout(
            orders.cases,
            book.ranges,
            orders.vehicles,
            unknowns=book.unknowns,
            names=[name for name in dict.fromkeys(atoms) if name not in (EGO, NOBODY)],
            constants=[one for one in _combined(numbers) if np.isfinite(one)],
            ends=("lane_end", 2) in self.program.reads,
        )
        self.relevant = relevant_columns(self.layout, self.program)
        self.parts = _parts(lowered.pool, roots)
        self.far = Closeness(self.parts, self.program.code)

    def facts(self, drawn: Drawn) -> dict[tuple[str, int], Rows]:
        """Return the facts of scenes as arrays."""
        return array_facts(self.layout, drawn, self.program.code)


def _lowered(book: Book, prop: Property) -> Lowered:
    """Return the lowered property and, if that can be lowered, whether a scene comes near to breaking it.

    It does if it reaches the last goal of a clause of violates/1; every scene reaches the only goal of one.
    """
    bodies: list[Term] = []
    for clause in book.engine.clauses("violates", 1):
        name = deref(clause.args[0])
        if isinstance(name, Atom) and name.name == prop.name:
            *goals, _ = [goal.term for goal in conjuncts(read_body(clause.body))]
            bodies.append(_conjunction(goals))
    near = Query(f"near {prop.name}", 0, "holds")
    head = Atom(near.name)
    book.engine.define(near.name, 0, [Clause(head, body) for body in bodies])
    try:
        return lower(book.engine, book.facts, [prop.query, near])
    except NotLowerable:
        return lower(book.engine, book.facts, [prop.query])


def _conjunction(goals: Sequence[Term]) -> Term:
    if not goals:
        return Atom("true")
    result = goals[-1]
    for goal in reversed(goals[:-1]):
        result = Struct(",", (goal, result))
    return result


def _combined(numbers: Sequence[float]) -> list[float]:
    """Return a program's constants, with the sums, differences, products and quotients of pairs, if few."""
    own = sorted(set(numbers))
    if len(own) > 24:
        return own
    pairs = [(one, other) for one in own for other in own]
    return [
        *own,
        *(one + other for one, other in pairs),
        *(one - other for one, other in pairs),
        *(one * other for one, other in pairs),
        *(one / other for one, other in pairs if other),
    ]


def _parts(pool: Pool, roots: Sequence[Node]) -> list[tuple[Node, ...]]:
    """Return the ways to break a property: conjunctions, one of which holds in every scene that does."""
    open_: list[tuple[Node, ...]] = [(root,) for root in roots if root is not pool.false]
    done: list[tuple[Node, ...]] = []
    while open_:
        part = open_.pop(0)
        flat = [one for node in part for one in (node.args if node.op == "and" else (node,))]
        places = [place for place, node in enumerate(flat) if node.op == "or"]
        room = _MOST_TARGETS - len(open_) - len(done)
        if not places or len(flat[places[-1]].args) > room:
            done.append(tuple(flat))
            continue
        rest = flat[: places[-1]] + flat[places[-1] + 1 :]
        open_.extend((*rest, way) for way in flat[places[-1]].args)
    return done


class _Attacker:
    """Tries scene after scene."""

    def __init__(self, target: _Target, replay: Replay, result: Attack, orders: Orders) -> None:
        self._target = target
        self._replay = replay
        self._result = result
        self._scenes = orders.scenes
        name = crc32(target.answer.query.name.encode())
        self._rng = np.random.default_rng([orders.seed, name])
        self._hits = 0

    def run(self) -> None:
        """Try all scenes, or stop at one that exact arithmetic confirms."""
        climbers = self._drawn()
        if climbers is not None and self._target.parts:
            self._climb(climbers)

    @property
    def _done(self) -> bool:
        hit = self._result.hit
        return self._result.scenes >= self._scenes or (hit is not None and hit.kind in ("exact", "tiers"))

    def _drawn(self) -> _Climbers | None:
        """Try scenes that are drawn anew; keep the closest for each way to break the property."""
        target = self._target
        climbers = _Climbers(len(target.parts)) if target.parts else None
        share = _DRAWN if target.parts else 1.0
        while self._result.scenes < share * self._scenes and not self._done:
            count = min(_BATCH, self._scenes - self._result.scenes)
            drawn = draw(target.layout, self._rng, count)
            facts = self._try(drawn)
            if climbers is not None:
                climbers.take(drawn, self._distances(facts, count))
        return climbers

    def _climb(self, climbers: _Climbers) -> None:
        """Change the closest scenes, and continue from those that are at least as close."""
        turn = 0
        while not self._done:
            turn += 1
            count = min(len(climbers), self._scenes - self._result.scenes)
            drawn = change(self._target.layout, self._rng, climbers.scenes, self._target.relevant)
            climbers.extrapolate(drawn, self._rng)
            normalise(self._target.layout, drawn)
            drawn = drawn.take(slice(0, count))
            far = self._distances(self._try(drawn), count)
            climbers.advance(drawn, far)
            if turn % _SELECTION == 0:
                climbers.select(self._rng)

    def _distances(self, facts: Mapping[tuple[str, int], Rows], count: int) -> Floats:
        """Return the distances of scenes from each way to break the property, shape (ways, N)."""
        far = self._target.far.distances(facts, count)
        self._result.close += int((far.min(axis=0) < _CLOSE).sum())
        return far

    def _try(self, drawn: Drawn) -> dict[tuple[str, int], Rows]:
        """Run the array tier on scenes, and examine those that break the property."""
        facts = self._target.facts(drawn)
        read = {key: rows for key, rows in facts.items() if key in self._target.program.reads}
        answers = self._target.program(read or {("time_step", 1): facts["time_step", 1]})
        broken: Mask = np.broadcast_to(answers.answers[0].value, len(drawn)) & ~answers.undecided
        result = self._result
        result.scenes += len(drawn)
        result.broken += int(broken.sum())
        result.undecided += int(answers.undecided.sum())
        if len(answers.answers) > 1:
            result.near += int((answers.answers[1].value & ~answers.undecided).sum())
        for place in self._suspects(answers.undecided):
            result.asked += 1
            self._look_into(drawn.take(slice(place, place + 1)), decided=False)
        for place in self._worst(facts, broken):
            self._hits += 1
            self._look_into(drawn.take(slice(place, place + 1)), decided=True)
        return facts

    def _suspects(self, undecided: Mask) -> Iterator[int]:
        """Yield some of the scenes that may raise an error."""
        places = undecided.nonzero()[0]
        few = places[:: max(1, len(places) // _SUSPECTS_OF_A_BATCH)][:_SUSPECTS_OF_A_BATCH]
        for place in few:
            if self._result.asked < _MOST_SUSPECTS and not self._is_refuted:
                yield int(place)

    def _worst(self, facts: Mapping[tuple[str, int], Rows], broken: Mask) -> Iterator[int]:
        """Yield some of the scenes that break the property: the clearest ones, and any one."""
        places = broken.nonzero()[0]
        if not len(places) or self._hits >= _MOST_HITS:
            return
        clearness = Closeness([[self._target.answer.found]], self._target.program.code, wanted=False)
        clear = clearness.distances(facts, len(broken))[0, places]
        ranked = places[np.argsort(-clear, kind="stable")]
        for place in dict.fromkeys([*ranked[: _HITS_OF_A_BATCH - 1], ranked[-1]]):
            if not self._is_refuted:
                yield int(place)

    @property
    def _is_refuted(self) -> bool:
        return self._result.hit is not None and self._result.hit.kind == "exact"

    def _look_into(self, one: Drawn, *, decided: bool) -> None:
        """Run the interpreter on one scene, and judge it exactly."""
        scene, focus, unknowns = scene_of(self._target.layout, one)
        found = self._replay.breaks(scene, focus, unknowns)
        if found is None:
            if decided:
                self._take(Hit("tiers", Counterexample(scene, focus, unknowns=unknowns)))
            return
        exact = exact_facts(self._target.layout, one)
        if exact is None:
            return  # a vehicle that is there only in floats
        answer = self._target.answer
        node = answer.undecided if found.error is not None else answer.found
        verdict = judge(node, exact, float_facts(scene, focus, unknowns))
        kind: Kind = "open" if verdict.holds is None else "exact" if verdict.holds else "float"
        self._take(Hit(kind, found, verdict.amount))

    def _take(self, hit: Hit) -> None:
        """Keep the worse of two hits."""
        known = self._result.hit
        if known is None or _badness(hit) > _badness(known):
            self._result.hit = hit


def _badness(hit: Hit) -> tuple[int, float]:
    """Return a key that is greater for worse hits; an unknown distance is the worst."""
    order: Sequence[Kind] = ("float", "open", "tiers", "exact")
    return order.index(hit.kind), math.inf if hit.amount is None else float(hit.amount)


@dataclass(slots=True)
class _Climbers:
    """The scenes closest to breaking the property, each in one of the ways to do so."""

    ways: int
    _scenes: Drawn | None = None
    _far: Floats = field(default_factory=lambda: np.empty(0))
    _way: Any = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    _step: Floats = field(default_factory=lambda: np.empty((0, 0)))
    """The last step closer, by scene, whose multiple estimates the rest of the way."""

    @property
    def scenes(self) -> Drawn:
        """The present scenes."""
        assert self._scenes is not None
        return self._scenes

    def __len__(self) -> int:
        return len(self._far)

    def take(self, drawn: Drawn, far: Floats) -> None:
        """Keep the closest scenes of a batch, equally many for each way."""
        quota = max(1, _CLIMBERS // self.ways)
        scenes, fars, ways = [], [], []
        for way in range(self.ways):
            own = self._way == way
            if self._scenes is not None and own.any():
                scenes.append(self._scenes.take(own))
                fars.append(self._far[own])
                ways.append(self._way[own])
            # not all from one batch: small steps from several scenes find more than from one
            best = np.argsort(far[way], kind="stable")[: max(1, quota // 8)]
            scenes.append(drawn.take(best))
            fars.append(far[way][best])
            ways.append(np.full(len(best), way))
        every, all_far, all_way = joined(scenes), np.concatenate(fars), np.concatenate(ways)
        kept = []
        for way in range(self.ways):
            own = (all_way == way).nonzero()[0]
            kept.append(own[np.argsort(all_far[own], kind="stable")[:quota]])
        index = np.concatenate(kept)
        self._scenes, self._far, self._way = every.take(index), all_far[index], all_way[index]
        self._step = np.zeros(self._scenes.numbers.shape)

    def extrapolate(self, drawn: Drawn, rng: np.random.Generator) -> None:
        """Move some of the scenes by a multiple of their last step."""
        rows = ((rng.random(len(drawn)) < _EXTRAPOLATED) & self._step.any(axis=1)).nonzero()[0]
        share = rng.choice([0.5, 1.0, 1.0, 1.0, 2.0], size=(len(rows), 1))
        drawn.numbers[rows] = self.scenes.numbers[rows] + share * self._step[rows]

    def advance(self, drawn: Drawn, far: Floats) -> None:
        """Continue from the changed scenes that are at least as close."""
        count = len(drawn)
        own = far[self._way[:count], np.arange(count)]
        better = (own <= self._far[:count]).nonzero()[0]
        nearer = (own < self._far[:count]).nonzero()[0]
        moved = drawn.numbers[nearer] - self.scenes.numbers[nearer]
        before, after = _gap(self._far[nearer]), _gap(own[nearer])
        sure = before - after > 1e-3 * before  # one of several comparisons may fail by more than before
        share = np.where(sure, after / np.where(sure, before - after, 1.0), 0.0)
        self._step[nearer] = moved * share[:, None]
        self.scenes.put(better, drawn.take(better))
        self._far[better] = own[better]

    def select(self, rng: np.random.Generator) -> None:
        """Restart the worst eighth of each way from others of it."""
        for way in range(self.ways):
            own = (self._way == way).nonzero()[0]
            order = own[np.argsort(self._far[own], kind="stable")]
            last = order[len(order) - len(order) // 8 :]
            if len(last):
                source = rng.choice(order[: max(1, len(order) // 2)], size=len(last))
                self.scenes.put(last, self.scenes.take(source))
                self._far[last] = self._far[source]
                self._step[last] = self._step[source]


def _gap(far: Floats) -> Floats:
    """Return the missing amount of a comparison, from its distance; a guess if several fail."""
    rest = far - np.floor(far)
    result: Floats = rest / np.maximum(1.0 - rest, 1e-9)
    return result
