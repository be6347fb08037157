"""The only module that uses cvc5: a second opinion on z3's questions.

It translates formulas independently, so that it detects errors of the translation, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, Literal, TypeAlias

from drlsl.errors import UserError
from drlsl.verify.smt.booleans import Bool, holds
from drlsl.verify.smt.polynomials import Interval, Monomial, Polynomial, Rational, Ring

SolverChoice: TypeAlias = Literal["z3", "cvc5", "both"]
Opinion: TypeAlias = Literal["none", "some", "unknown"]
Confirmation: TypeAlias = Literal["alone", "confirmed", "unanswered"]
"""One solver was asked; or both, who agreed; or only one of them had an answer."""

MOST_SECONDS: Final = 10.0
"""Time for one question, which z3 has answered already."""


class SolversDisagree(UserError):
    """One solver says that no scene satisfies a formula, another has one that does."""

    def __init__(self, denies: str, has: str) -> None:
        super().__init__(
            f"{denies} says that no scene satisfies a formula, but {has} has one that does: one of the two "
            "is wrong, so nothing is proved; please report it"
        )


@dataclass(slots=True)
class Judges:
    """The solvers to use, and the counts of questions that cvc5 confirmed, and did not answer."""

    solver: SolverChoice = "z3"
    confirmed: int = 0
    unanswered: int = 0

    def count(self, confirmation: Confirmation) -> None:
        """Count a question by who answered it."""
        self.confirmed += confirmation == "confirmed"
        self.unanswered += confirmation == "unanswered"


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer whether a scene satisfies formulas; `checked`: exact arithmetic confirms the scene."""

    opinion: Opinion
    checked: bool = False


class Cvc5:
    """Asks cvc5 about formulas over one ring of polynomials; `linear` as in `Solver`."""

    def __init__(self, ring: Ring, *, linear: bool) -> None:
        self._ring = ring
        self._linear = linear
        self._numbers: dict[int, Any] = {}
        self._products: dict[Monomial, Any] = {}
        self._flags: dict[str, Any] = {}
        self._done: dict[Bool, Any] = {}

    def ask(self, truths: Sequence[Bool], seconds: float) -> Answer:
        """Return whether all of the formulas can be true at once."""
        import cvc5.pythonic as api

        solver = api.SolverFor("QF_LRA" if self._linear else "QF_NRA")
        solver.setOption("tlimit-per", str(max(1, int(seconds * 1000))))
        for truth in truths:
            solver.add(self._term(api, truth))
        for number, term in self._numbers.items():
            self._bound(api, solver, term, self._ring.unknowns[number].bounds)
        for monomial, term in self._products.items():
            self._bound(api, solver, term, self._ring.interval(self._ring.make({monomial: 1})))
        result = solver.check()
        if result == api.unsat:
            return Answer("none")
        return (
            Answer("some", self._holds(api, solver.model(), truths))
            if result == api.sat
            else Answer("unknown")
        )

    def _bound(self, api: Any, solver: Any, term: Any, bounds: Interval) -> None:
        low, high = bounds
        if low is not None:
            solver.add(term >= _rational(api, low))
        if high is not None:
            solver.add(term <= _rational(api, high))

    def _term(self, api: Any, truth: Bool) -> Any:
        if truth not in self._done:
            self._done[truth] = self._make(api, truth)
        return self._done[truth]

    def _make(self, api: Any, truth: Bool) -> Any:
        if truth.op in ("true", "false"):
            return api.BoolVal(truth.op == "true")
        if truth.op == "not":
            return api.Not(self._term(api, truth.args[0]))
        if truth.op in ("and", "or"):
            parts = [self._term(api, arg) for arg in truth.args]
            return api.And(*parts) if truth.op == "and" else api.Or(*parts)
        if truth.op == "flag":
            return self._flags.setdefault(truth.data, api.Bool(truth.data))
        value = self._polynomial(api, truth.data)
        if truth.op == "zero":
            return value == 0
        return value > 0 if truth.op == "above" else value >= 0

    def _polynomial(self, api: Any, polynomial: Polynomial) -> Any:
        total = _rational(api, 0)
        for monomial, factor in polynomial.terms.items():
            term = _rational(api, factor)
            for power in self._powers(api, monomial):
                term = term * power
            total = total + term
        return total

    def _powers(self, api: Any, monomial: Monomial) -> list[Any]:
        if self._linear and monomial and (len(monomial) > 1 or monomial[0][1] != 1):
            name = f"product#{len(self._products)}"
            return [self._products.setdefault(monomial, api.Real(name))]
        if any(power < 0 for _, power in monomial):
            raise AssertionError("a division that is not cleared")
        names = [self._numbers.setdefault(unknown, api.Real(f"u#{unknown}")) for unknown, _ in monomial]
        return [name for name, (_, power) in zip(names, monomial, strict=True) for _ in range(power)]

    def _holds(self, api: Any, model: Any, truths: Iterable[Bool]) -> bool:
        """Return whether exact arithmetic confirms the numbers of a model."""
        try:
            numbers = {n: _fraction(model.eval(term)) for n, term in self._numbers.items()}
            products = {m: _fraction(model.eval(term)) for m, term in self._products.items()}
        except (AttributeError, ValueError):
            return False  # an algebraic number
        flags = {name: api.is_true(model.eval(term)) for name, term in self._flags.items()}
        return all(holds(truth, numbers, flags, products) for truth in truths)


def _rational(api: Any, value: Rational) -> Any:
    return api.Q(int(value.numerator), int(value.denominator))


def _fraction(value: Any) -> Fraction:
    return Fraction(value.as_fraction())
