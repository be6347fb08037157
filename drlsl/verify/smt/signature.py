"""Signatures of formulas up to the names of unknowns and flags: many cases ask the same question."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

from drlsl.verify.smt.booleans import Bool
from drlsl.verify.smt.polynomials import Polynomial, Ring


def signature(truths: Iterable[Bool], ring: Ring) -> bytes:
    """Return a digest of formulas and of the bounds of their unknowns; equal ones ask the same question."""
    writer = _Writer(ring)
    roots = [writer.place(truth) for truth in truths]
    text = repr(
        (roots, writer.lines, [list(map(str, ring.unknowns[number].bounds)) for number in writer.unknowns])
    )
    return hashlib.sha256(text.encode()).digest()


class _Writer:
    """Writes formulas part by part, naming parts, unknowns and flags by the order of their occurrence."""

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self.lines: list[Any] = []
        self.unknowns: dict[int, int] = {}
        self._flags: dict[str, int] = {}
        self._places: dict[Bool, int] = {}

    def place(self, truth: Bool) -> int:
        """Return the number of a formula's line."""
        known = self._places.get(truth)
        if known is None:
            line = self._line(truth)
            known = self._places[truth] = len(self.lines)
            self.lines.append(line)
        return known

    def _line(self, truth: Bool) -> Any:
        if truth.op == "flag":
            return self._flags.setdefault(truth.data, len(self._flags))
        if truth.op in ("above", "atleast", "zero"):
            return truth.op, self._polynomial(truth.data)
        return truth.op, [self.place(arg) for arg in truth.args]

    def _polynomial(self, polynomial: Polynomial) -> Any:
        return [
            (
                str(factor),
                [
                    (self.unknowns.setdefault(unknown, len(self.unknowns)), power)
                    for unknown, power in monomial
                ],
            )
            for monomial, factor in polynomial.terms.items()
        ]
