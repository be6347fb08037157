"""The only module that uses z3: is there a scene in which a formula holds?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, Literal, Protocol, TypeAlias

import z3

from drlsl.files import cache_folder
from drlsl.verify.smt.booleans import Bool, holds, leaves
from drlsl.verify.smt.known_answers import KnownAnswers
from drlsl.verify.smt.polynomials import Interval, Monomial, Polynomial, Rational
from drlsl.verify.smt.second import MOST_SECONDS, Confirmation, Cvc5, Judges, SolverChoice, SolversDisagree
from drlsl.verify.smt.signature import signature
from drlsl.verify.smt.symbolic import Model
from drlsl.verify.smt.values import Algebra

Verdict: TypeAlias = Literal["none", "some", "unknown"]

_DIGITS: Final = 30
"""Decimals of a model's algebraic numbers."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The existence of a scene: `none`, `some` with a model, or `unknown` for a reason."""

    verdict: Verdict
    model: Model | None = None
    reason: str = ""


def answers_file(choice: SolverChoice) -> Path:
    """Return the place, in the folder of caches, of the answers that these versions of the solvers give."""
    solvers = ("z3", "cvc5") if choice == "both" else (choice,)
    packages = {"z3": "z3-solver", "cvc5": "cvc5"}
    names = [f"{solver}-{version(packages[solver])}" for solver in solvers]
    return cache_folder() / "proofs" / f"{'-'.join(names)}.sqlite"


class Scenes(Protocol):
    """The scenes of formulas, as a `SymbolicScene` describes them."""

    algebra: Algebra
    always: list[Bool]
    about: dict[str, list[Bool]]
    usual: dict[int, tuple[int, Fraction]]

    def tidy(self) -> list[Bool]:
        """Return conditions that a scene should satisfy, if possible."""


class Solver:
    """Asks z3 about the formulas of one symbolic scene.

    A `linear` one treats products as numbers of their own. One for `few` unknowns divides their space into
    cells where every polynomial has one sign, which always gives an answer, but takes long for many.
    `answers` holds what was answered before, and is added to. `judges` decides whether cvc5 proves, too, or
    alone; scenes are found by z3.
    """

    def __init__(
        self,
        scene: Scenes,
        *,
        linear: bool,
        few: bool = False,
        answers: KnownAnswers | None = None,
        judges: Judges | None = None,
    ) -> None:
        self._scene = scene
        self._answers = answers or KnownAnswers()
        self._judges = judges or Judges()
        self._second = Cvc5(scene.algebra.ring, linear=linear) if self._judges.solver != "z3" else None
        self._linear = linear
        self._few = few
        self._by_luck = not linear and not few
        self._products: dict[Monomial, Any] = {}
        self._algebra = scene.algebra
        self._rationals: dict[Rational, Any] = {}
        self._numbers: dict[int, Any] = {}
        self._flags: dict[str, Any] = {}
        self._done: dict[tuple[int, Fraction], Any] = {}

    def holds_nowhere(self, truth: Bool, seconds: float) -> Outcome:
        """Return whether no scene satisfies `truth`; an answer `some` may lie outside the possible scenes."""
        premises = self._premises([truth])
        truths = [truth, *premises]
        question = signature(truths, self._algebra.ring)
        # a scene of the relaxation need not be a scene: that answer is for linear solvers alone
        possible = question + (b" linearly possible" if self._linear else b" possible")
        recalled = self._recalled(question, "none") or self._recalled(possible, "some")
        if recalled is not None:
            return recalled
        opinion: Confirmation = "alone"
        if self._judges.solver == "cvc5":
            outcome = self._by_cvc5(truths, seconds)
        else:
            outcome = self._by_z3(truth, premises, seconds)
            if self._second is not None:
                outcome, opinion = self._compared(outcome, truths, seconds)
        self._judges.count(opinion)
        if outcome.verdict != "unknown":
            self._answers.keep(question if outcome.verdict == "none" else possible, opinion)
        return outcome

    def _recalled(self, question: bytes, verdict: Verdict) -> Outcome | None:
        """Return the verdict if the question was answered; in an earlier run, it is counted as in that."""
        known = self._answers.get(question)
        if known is None:
            return None
        if known.is_of_earlier_run:
            self._judges.count(known.opinion)
        return Outcome(verdict)

    def _by_z3(self, truth: Bool, premises: Mapping[Bool, None], seconds: float) -> Outcome:
        outcome = Outcome("unknown")
        for seed, share in _tries(seconds) if self._by_luck else [(0, seconds)]:
            solver = self._solver(share, seed)
            solver.add(self._term(truth))
            self._add_all(solver, premises)
            outcome = self._outcome(solver)
            if outcome.verdict != "unknown":
                break
        return outcome

    def _by_cvc5(self, truths: Sequence[Bool], seconds: float) -> Outcome:
        assert self._second is not None
        opinion = self._second.ask(truths, seconds).opinion
        return Outcome(opinion, reason="timeout" if opinion == "unknown" else "")

    def _compared(
        self, outcome: Outcome, truths: Sequence[Bool], seconds: float
    ) -> tuple[Outcome, Confirmation]:
        """Return the answer of both solvers; the second is used only if the first's is no relaxation's.

        Raises:
            SolversDisagree: one has a scene that the other excludes.
        """
        assert self._second is not None
        if outcome.verdict == "some" and self._linear:
            return outcome, "alone"
        second = self._second.ask(truths, min(seconds, MOST_SECONDS))
        if outcome.verdict == "none" and second.checked:
            raise SolversDisagree("z3", "cvc5")
        if second.opinion == "none" and outcome.model is not None:
            if all(holds(truth, outcome.model.numbers, outcome.model.flags) for truth in truths):
                raise SolversDisagree("cvc5", "z3")
            return outcome, "alone"
        opinions = [outcome.verdict, second.opinion]
        opinion: Confirmation = "alone"
        if "none" in opinions:
            opinion = "confirmed" if opinions == ["none", "none"] else "unanswered"
        return Outcome("none") if second.opinion == "none" else outcome, opinion

    def find(self, truth: Bool, seconds: float, *, margin: Fraction, usual: int) -> Outcome:
        """Return a scene that satisfies `truth`, each of its comparisons by a margin.

        Numbers have their usual values, if any: with `usual` 2 all, with 1 all but speeds. Vehicles are in
        lanes and do not overlap.
        """
        solver = self._solver(seconds)
        solver.add(self._strict(truth, positive=True, margin=margin))
        scene = self._scene
        premises = [*scene.always, *(one for about in scene.about.values() for one in about)]
        premises.extend(scene.tidy() if usual else ())
        for number, _ in enumerate(self._algebra.ring.unknowns):
            self._number(number)
        self._add_all(solver, dict.fromkeys([*self._premises([truth, *premises]), *premises]))
        for number, (level, value) in scene.usual.items():
            if level <= usual:
                solver.add(self._number(number) == self._rational(value))
        return self._outcome(solver)

    @cached_property
    def _context(self) -> Any:
        """The context of all terms, made when the first question has to be asked."""
        return z3.Context()

    def _solver(self, seconds: float, seed: int = 0) -> Any:
        if self._few:
            solver = z3.Tactic("qfnra-nlsat", ctx=self._context).solver()
        else:
            solver = z3.SimpleSolver(ctx=self._context)
            solver.set("random_seed", seed)
        solver.set("timeout", max(1, int(seconds * 1000)))
        return solver

    def _outcome(self, solver: Any) -> Outcome:
        answer = solver.check()
        if answer == z3.unsat:
            return Outcome("none")
        if answer == z3.sat:
            return Outcome("some", self._model(solver.model()))
        reason = str(solver.reason_unknown())
        if reason.startswith("interrupted"):
            raise KeyboardInterrupt
        return Outcome("unknown", reason=reason)

    def _add_all(self, solver: Any, premises: Iterable[Bool]) -> None:
        for premise in premises:
            solver.add(self._term(premise))
        ring = self._algebra.ring
        for number, term in self._numbers.items():
            self._add_bounds(solver, term, ring.unknowns[number].bounds)
        for monomial, term in self._products.items():
            self._add_bounds(solver, term, ring.interval(ring.make({monomial: 1})))

    def _add_bounds(self, solver: Any, term: Any, bounds: Interval) -> None:
        low, high = bounds
        if low is not None:
            solver.add(term >= self._rational(low))
        if high is not None:
            solver.add(term <= self._rational(high))

    def _premises(self, truths: Iterable[Bool]) -> dict[Bool, None]:
        """Return the definitions of the flags and unknowns in formulas."""
        found: dict[Bool, None] = {}
        open_ = list(truths)
        while open_:
            for leaf in leaves([open_.pop()]):
                for premise in self._about(leaf):
                    if premise not in found:
                        found[premise] = None
                        open_.append(premise)
        return found

    def _about(self, leaf: Bool) -> Iterator[Bool]:
        yield from self._algebra.lemmas.get(leaf, ())
        if leaf.op == "flag":
            yield from self._scene.about.get(leaf.data, ())
            return
        for unknown in leaf.data.unknowns:
            yield from self._algebra.definitions.get(unknown, ())

    def _rational(self, value: Rational) -> Any:
        if value not in self._rationals:
            self._rationals[value] = z3.RealVal(str(value), self._context)
        return self._rationals[value]

    def _number(self, unknown: int) -> Any:
        if unknown not in self._numbers:
            name = self._algebra.ring.unknowns[unknown].name
            self._numbers[unknown] = z3.Real(f"{name}#{unknown}", ctx=self._context)
        return self._numbers[unknown]

    def _polynomial(self, polynomial: Polynomial) -> Any:
        terms = []
        for monomial, factor in polynomial.terms.items():
            powers = self._powers(monomial)
            parts = [self._rational(factor), *powers] if factor != 1 or not powers else powers
            terms.append(self._joined(z3.Z3_mk_mul, z3.ArithRef, parts))
        return self._joined(z3.Z3_mk_add, z3.ArithRef, terms)

    def _powers(self, monomial: Monomial) -> list[Any]:
        """Return the factors of a product; for a linear solver, one unknown for all of it."""
        if self._linear and monomial and (len(monomial) > 1 or monomial[0][1] != 1):
            if monomial not in self._products:
                self._products[monomial] = z3.Real(f"product#{len(self._products)}", ctx=self._context)
            return [self._products[monomial]]
        if any(power < 0 for _, power in monomial):
            raise AssertionError("a division that is not cleared")
        return [self._number(unknown) for unknown, power in monomial for _ in range(power)]

    def _term(self, truth: Bool) -> Any:
        return self._strict(truth, positive=True, margin=Fraction(0))

    def _strict(self, truth: Bool, *, positive: bool, margin: Fraction) -> Any:
        """Return a formula, or its negation, with each needed comparison met by a margin."""
        place = (truth.number if positive else -truth.number - 1, margin)
        if place not in self._done:
            self._done[place] = self._make(truth, positive, margin)
        return self._done[place]

    def _make(self, truth: Bool, positive: bool, margin: Fraction) -> Any:
        if truth.op == "not":
            return self._strict(truth.args[0], positive=not positive, margin=margin)
        if truth.op in ("and", "or"):
            parts = [self._strict(arg, positive=positive, margin=margin) for arg in truth.args]
            join = z3.Z3_mk_and if (truth.op == "and") is positive else z3.Z3_mk_or
            return self._joined(join, z3.BoolRef, parts)
        if truth.op in ("true", "false"):
            return z3.BoolVal((truth.op == "true") is positive, ctx=self._context)
        if truth.op == "flag":
            if truth.data not in self._flags:
                self._flags[truth.data] = z3.Bool(truth.data, ctx=self._context)
            flag = self._flags[truth.data]
            return flag if positive else z3.Not(flag)
        return self._comparison(truth, positive, margin)

    def _joined(self, join: Callable[..., Any], kind: Callable[..., Any], parts: Sequence[Any]) -> Any:
        """Return an operation on z3's terms, without z3py's coercions, which take longer than the solver."""
        if len(parts) == 1:
            return parts[0]
        array = (z3.Ast * len(parts))(*(part.ast for part in parts))
        return kind(join(self._context.ref(), len(parts), array), self._context)

    def _compared_to_zero(self, compare: Callable[..., Any], value: Any) -> Any:
        zero = self._rational(0)
        return z3.BoolRef(compare(self._context.ref(), value.ast, zero.ast), self._context)

    def _comparison(self, truth: Bool, positive: bool, margin: Fraction) -> Any:
        value = self._polynomial(truth.data)
        if truth.op == "zero":
            if positive:
                return self._compared_to_zero(z3.Z3_mk_eq, value)
            if margin:
                return z3.Or(value >= self._rational(margin), value <= self._rational(-margin))
            return value != 0
        if margin:
            return value >= self._rational(margin) if positive else value <= self._rational(-margin)
        if truth.op == "above":
            return self._compared_to_zero(z3.Z3_mk_gt if positive else z3.Z3_mk_le, value)
        return self._compared_to_zero(z3.Z3_mk_ge if positive else z3.Z3_mk_lt, value)

    def _model(self, model: Any) -> Model:
        numbers = {
            number: _fraction(model.eval(term, model_completion=True))
            for number, term in self._numbers.items()
        }
        flags = {
            name: z3.is_true(model.eval(flag, model_completion=True)) for name, flag in self._flags.items()
        }
        return Model(numbers, flags)


def _tries(seconds: float) -> Iterator[tuple[int, float]]:
    """Yield seeds with seconds for each: with products, luck makes a proof take a second or a minute."""
    seed = 0
    while seconds > 0:
        share = min(seconds, float(2 ** (seed // 3)))
        yield seed, share
        seed, seconds = seed + 1, seconds - share


def _fraction(value: Any) -> Fraction:
    """Return a model's number; an algebraic one is rounded."""
    if z3.is_algebraic_value(value):
        value = value.approx(_DIGITS)
    return Fraction(value.numerator_as_long(), value.denominator_as_long())
