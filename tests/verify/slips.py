"""Slips in the prover, each of which has it call a false property proved.

A slip changes the text of one function, or a constant; none changes what the rules are asked for otherwise.
"""

from __future__ import annotations
import __future__

import importlib
import inspect
import sys
import textwrap
from dataclasses import dataclass
from typing import Any

import pytest

from drlsl.verify import Case

_LATER = __future__.annotations.compiler_flag  # annotations are not evaluated, as in the modules


@dataclass(frozen=True)
class Slip:
    """A change of `old` to `new` in a function of a module of drlsl.verify, and a property that it proves.

    `body` is that of ``violates(p)``; `before` are clauses of the property file before it.
    """

    place: str
    old: str
    new: str
    body: str
    before: str = ""
    vehicles: int = 1
    cases: tuple[Case, ...] = (Case(0, 2, 1, 1),)
    missed: str = ""
    """Why the attack does not find it, where it does not."""

    def properties(self) -> str:
        """The file of properties."""
        return f"{self.before}\nproperty(p, 'p').\nviolates(p) :- {self.body}.\n"

    def make(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Put the changed function in place of the function, wherever a module has it."""
        module_name, _, path = self.place.partition(":")
        module = importlib.import_module(f"drlsl.verify.{module_name}")
        *owners, name = path.split(".")
        owner: Any = module
        for part in owners:
            owner = getattr(owner, part)
        original = getattr(owner, name)
        text = textwrap.dedent(inspect.getsource(original))
        assert text.count(self.old) == 1, f"{self.place} has {text.count(self.old)} times {self.old}"
        made: dict[str, Any] = {}
        code = compile(text.replace(self.old, self.new), self.place, "exec", _LATER)
        exec(code, module.__dict__, made)  # noqa: S102  (the text is that of the module)
        if owner is not module:
            monkeypatch.setattr(owner, name, made[name])
            return
        for other in list(sys.modules.values()):
            if (
                getattr(other, "__name__", "").startswith("drlsl.verify")
                and vars(other).get(name) is original
            ):
                monkeypatch.setattr(other, name, made[name])


EGO = "vehicle(ego, _, X, Y, V, VY, L, W)"
OTHER = "vehicle(C, _, X1, Y1, V1, VY1, L1, W1), C \\== ego"
TWO = f"{OTHER}, vehicle(D, _, X2, Y2, V2, VY2, L2, W2), D \\== ego, D \\== C"

SLIPS: dict[str, Slip] = {
    "the power of a root is not looked at": Slip(
        "smt.values:Algebra._sign_of_root",
        "    if monomial != ((unknown, 1),):\n        return None\n",
        "",
        f"{EGO}, S is V * V, S > 0.0, S < 50.0, R is 1.0 / sqrt(S), R > 10.0",
    ),
    "the sign of what is under a root that is taken away": Slip(
        "smt.values:Algebra._sign_of_root",
        "self.above(ring.scale(difference, -1))",
        "self.above(difference)",
        f"{EGO}, V < 8.0, sqrt(V) < 3.0",
    ),
    "the square of a root is twice what it should be": Slip(
        "smt.values:Algebra.sqrt",
        "declare_root(known, square)",
        "declare_root(known, self.ring.scale(square, 2))",
        f"{EGO}, V > 1.0, sqrt(V) * sqrt(V) < 1.5 * V",
    ),
    "the upper bound of a root": Slip(
        "smt.values:_root_interval",
        "+ 1, _DENOMINATOR)",
        "// 2, _DENOMINATOR)",
        f"{EGO}, sqrt(V) > 5.0",
    ),
    "an even power is bounded by the upper end alone": Slip(
        "smt.polynomials:_power",
        "max(-low, high) ** power",
        "high ** power",
        f"{EGO}, VY * VY > 50.0",
        "range(lateral_speed, -10, 2).",
    ),
    "a product is bounded by two corners of four": Slip(
        "smt.polynomials:_product",
        "corners = [a * b for a in one for b in other if a is not None and b is not None]",
        "corners = [a * b for a, b in zip(one, other) if a is not None and b is not None]",
        f"{EGO}, V * VY < -100.0",
        vehicles=0,
    ),
    "a negative factor does not turn an interval round": Slip(
        "smt.polynomials:Ring.interval",
        "least, most = most, least",
        "pass",
        f"{EGO}, V >= 5.0",
        vehicles=0,
    ),
    "the wrong end of an interval decides a sign": Slip(
        "smt.values:Algebra._sign",
        "high is not None and high <= 0",
        "low is not None and low < 0",
        f"{EGO}, V > 30.0",
        vehicles=0,
    ),
    "a division by a negative number keeps the sign": Slip(
        "smt.values:Algebra._sign_without",
        "rest if power % 2 == 0 else ring.scale(rest, -1)",
        "rest",
        f"{EGO}, VY > -1.0, VY < -0.5, 1.0 / VY < -1.0",
        vehicles=0,
    ),
    "above for at least": Slip(
        "smt.values:Algebra._normal",
        '"above" if factor > 0 else "atleast"',
        '"above"',
        f"{EGO}, {OTHER}, V1 >= V, V1 =< V",
    ),
    "an equation does not hold at the end of a range": Slip(
        "smt.values:Algebra._zero",
        "low is not None and low > 0",
        "low is not None and low >= 0",
        f"{EGO}, V =:= 0.0",
        vehicles=0,
    ),
    "the least of two is the one that may be less": Slip(
        "smt.values:Algebra._never_better",
        "low >= 0",
        "(high is None or high >= 0)",
        f"{EGO}, min(V, 10.0) > 0.5",
        vehicles=0,
    ),
    "all for some": Slip(
        "smt.values:Algebra._less_structured",
        "some = one.least",
        "some = not one.least",
        f"{EGO}, V >= 1.0, min(V, VY) < -5.0",
        vehicles=0,
    ),
    "a choice is turned round": Slip(
        "smt.values:Algebra.choose",
        "self.choose(cond.args[0], els, then)",
        "self.choose(cond.args[0], then, els)",
        f"{EGO}, VY < -1.0, sign(VY) < -0.5",
        vehicles=0,
    ),
    "the factor of a divisor": Slip(
        "smt.values:Algebra.divide",
        "monomial): mpq(1, factor)}",
        "monomial): mpq(factor)}",
        f"{EGO}, V > 6.0, V < 15.0, 10.0 / (2.0 * V) < 1.0",
        vehicles=0,
    ),
    "the negative of a least is a least": Slip(
        "smt.values:Algebra.leafwise",
        "value.least is not turns",
        "value.least",
        f"{EGO}, 10.0 - min(V, 5.0) > 8.0",
        vehicles=0,
    ),
    "the lemma of a product says the opposite": Slip(
        "smt.values:Algebra._sign_beside",
        "booleans.choose(product, factor, booleans.not_(factor))",
        "booleans.choose(product, booleans.not_(factor), factor)",
        f"{EGO}, D is W * V - 10.0 * W, D > 0.0, D > 0.5",
        vehicles=0,
    ),
    "argmin for argmax": Slip(
        "smt.formula:Formula._best",
        'if node.op == "argmin"',
        'if node.op == "argmax"',
        "aggregate_all(min(S, A), (vehicle(A, _, _, _, S, _, _, _), A \\== ego), min(_, C)), "
        "vehicle(C, _, _, _, V1, _, _, _), vehicle(D, _, _, _, V2, _, _, _), D \\== ego, V2 > V1 + 1.0",
        vehicles=3,
    ),
    "the first of the others is left out": Slip(
        "smt.formula:Formula._rows_of",
        'start = int(rows.op == "others")',
        'start = 2 * int(rows.op == "others")',
        f"{OTHER}, V1 > 60.0",
    ),
    "one vehicle fewer than are enough": Slip(
        "scope:Need.__len__",
        "self.rows().total()",
        "max(0, self.rows().total() - 1)",
        f"{TWO}, V1 > 60.0, V2 < -60.0",
        vehicles=6,
    ),
    "others go the ego's way": Slip(
        "smt.symbolic:SymbolicScene._vehicle_box",
        'self._unknown("speed", f"{name}_speed")',
        'self._unknown("ego_speed", f"{name}_speed")',
        f"{EGO}, {OTHER}, V > 1.0, V1 < -10.0",
        "",
    ),
    "half of a lane": Slip(
        "smt.symbolic:SymbolicScene._in_its_lane",
        "half = ring.scale(width, _HALF)",
        "half = ring.scale(width, _HALF * _HALF)",
        f"{OTHER}, vehicle(C, K, _, _, _, _, _, _), road_lane(K, _, Y2, W2, _), abs(Y1 - Y2) > 0.4 * W2",
    ),
    "the strip between the directions is forgotten": Slip(
        "smt.symbolic:SymbolicScene._lanes",
        "is not case.direction(inner)",
        "is case.direction(inner)",
        "road_lane(1, D1, Y1, W1, _), road_lane(2, D2, Y2, W2, _), D1 \\== D2, Y2 - Y1 > (W1 + W2) / 2 + 1.0",
        vehicles=0,
        cases=(Case(1, 1, 1, 1),),
    ),
    "the end of a range is left out": Slip(
        "smt.solver:Solver._add_bounds",
        "term <= self._rational(high)",
        "term < self._rational(high)",
        f"{EGO}, V =:= 70.0",
        vehicles=0,
    ),
    "not above for below": Slip(
        "smt.solver:Solver._comparison",
        "z3.Z3_mk_gt if positive else z3.Z3_mk_le",
        "z3.Z3_mk_gt if positive else z3.Z3_mk_lt",
        f"{EGO}, {OTHER}, V1 =< V, V1 >= V, V1 - 10.0 =< 0.0, V1 - 10.0 >= 0.0",
    ),
    "the bounds of unknowns are no part of a question": Slip(
        "smt.signature:signature",
        "for number in writer.unknowns",
        "for number in ()",
        "moment(T), later(R), T + R > 300.05, 2.0 * T + R < 300.06",
        ":- dynamic(later/1). :- dynamic(moment/1). "
        ":- discontiguous(violates/1). :- discontiguous(property/2). "
        "unknown(later, 20, 1000, 'a time'). unknown(moment, -1, 1, 'a moment'). property(a, 'a'). "
        "violates(a) :- moment(T), radar_range(R), T + R > 300.05, 2.0 * T + R < 300.06.",
        vehicles=0,
    ),
    "errors are not looked for": Slip(
        "prove:Prover._look",
        "simple.possible(name, PARTS, task.time_limit)",
        "simple.possible(name, PARTS[:1], task.time_limit)",
        f"{EGO}, 1.0 / VY > 0.0, fail",
        vehicles=0,
    ),
    "a constant loses its fraction": Slip(
        "smt.values:Algebra.number",
        "decimal(value)",
        "decimal(int(value))",
        f"{EGO}, V < 0.5",
        vehicles=0,
    ),
    "a road with two directions is left out": Slip(
        "ranges:all_cases",
        "if up + down]",
        "if up + down and not (up and down)]",
        "road_lane(_, D1, _, _, _), road_lane(_, D2, _, _, _), D1 \\== D2",
        vehicles=0,
        cases=(),
        missed="it is told the same roads",
    ),
    "an image leaves one predicate as it is": Slip(
        "images:affected",
        "open_ = list(facts)",
        "open_ = list(facts)[:0]",
        f"{EGO}, Y > 1.0, in(upside_down, ego_y(Z)), Z < 0.0",
        "image(upside_down, vehicle(I, K, X, Y1, S, T, L, W), (vehicle(I, K, X, Y, S, T, L, W), Y1 is -Y)). "
        "ego_y(Z) :- vehicle(ego, _, _, Z, _, _, _, _).",
        vehicles=0,
        missed="the same file of rules is made for every tier",
    ),
}
