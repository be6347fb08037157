"""The problem of the search: rows of eases, the limits to choose from, and the hardest unsafe rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drlsl.errors import UserError
from drlsl.induction.quantities import EASIEST, Quantity
from drlsl.traffic import Integers, Mask


@dataclass(frozen=True, slots=True)
class LearntClause:
    """A conjunction: the least ease that it asks of each quantity, in hundredths; None asks nothing."""

    limits: tuple[int | None, ...]

    @property
    def literals(self) -> int:
        """The number of quantities that it limits."""
        return sum(limit is not None for limit in self.limits)

    def covers(self, eases: Integers) -> Mask:
        """Return the rows of `eases`, shape (N, Q), that meet every limit, shape (N,)."""
        return np.asarray((eases >= [-EASIEST if one is None else one for one in self.limits]).all(axis=1))


def covered(clauses: Sequence[LearntClause], eases: Integers) -> Mask:
    """Return the rows of `eases`, shape (N, Q), that some clause covers, shape (N,)."""
    result = np.zeros(len(eases), dtype=np.bool_)
    for clause in clauses:
        result |= clause.covers(eases)
    return result


class SearchProblem:
    """Safe and unsafe rows, with all that an optimal choice of clauses depends on.

    A limit only serves to leave out unsafe rows, so that of each quantity only the next round number above an
    unsafe row is worth choosing. In `safe` and `hardest` a row has, for each quantity, the number of
    those limits that it meets: `limits[q][rank]` is the first that it does not. An unsafe row that is harder
    on every quantity than another is left out wherever that one is; `hardest` has the rows that remain, and
    `hardest_rows` where they stand among the unsafe ones. `safe` has each pattern once, `weights` how often;
    those that are harder on every quantity than an unsafe row cannot be covered and are `contradicted`.
    """

    def __init__(
        self,
        quantities: Sequence[Quantity],
        safe: Integers,
        unsafe: Integers,
        words: Callable[[int], str] = str,
    ) -> None:
        """Take rows of eases, shape (N, Q); `words` tells an unsafe row by its place.

        Raises:
            UserError: there is no safe or no unsafe row, no limit can leave out an unsafe row, or no safe row
                can be covered.
        """
        for rows, word, other in ((safe, "safe", "unsafe"), (unsafe, "unsafe", "safe")):
            if not len(rows):
                raise UserError(
                    f"no {word} example, only {other} ones: there is nothing to learn; label more, or "
                    "elsewhere"
                )
        self.quantities = tuple(quantities)
        above = np.full(unsafe.shape, EASIEST)
        for column, one in enumerate(quantities):
            round_limits = np.append(one.round_limits, EASIEST)
            at = np.searchsorted(round_limits[:-1], unsafe[:, column], side="right")
            above[:, column] = round_limits[at]
        self._check_limits(unsafe, above, words)
        self.limits = [np.unique(column[column < EASIEST]) for column in above.T]
        patterns, first = np.unique(self._ranks(unsafe), axis=0, return_index=True)
        kept = _easiest(patterns)
        self.hardest, self.hardest_rows = patterns[kept], first[kept]
        self.safe_count, self.unsafe_count = len(safe), len(unsafe)
        ranks, at, weights = np.unique(self._ranks(safe), axis=0, return_index=True, return_counts=True)
        blocked = np.array([int(np.argmax(found)) if found.any() else -1 for found in self._above(ranks)])
        free = blocked < 0
        self.safe, self.weights = ranks[free], weights[free]
        self.contradicted = int(weights[~free].sum())
        self.contradiction: tuple[int, int] | None = None
        """A safe row and an unsafe one that is as easy on every quantity, by their places."""
        if not free.all():
            worst = int(np.argmax(~free))
            self.contradiction = int(at[worst]), int(self.hardest_rows[blocked[worst]])

    def _check_limits(self, unsafe: Integers, above: Integers, words: Callable[[int], str]) -> None:
        """Check that some limit leaves out each unsafe row."""
        nowhere = (unsafe >= EASIEST).all(axis=1)
        if nowhere.any():
            raise UserError(
                f"{int(nowhere.sum()):,} of {len(unsafe):,} unsafe examples concern nothing that a declared "
                "quantity speaks of, so that no clause can leave them out; declare more quantities; one of "
                f"them: {words(int(nowhere.argmax()))}"
            )
        if ((above >= EASIEST) & (unsafe < EASIEST)).any():
            raise UserError("a limit of a quantity is beyond 32 bits; declare it in another unit")

    def _ranks(self, eases: Integers) -> Integers:
        """Return how many of its limits each row meets, by quantity."""
        columns = [
            np.searchsorted(limits, column, side="right")
            for limits, column in zip(self.limits, eases.T, strict=True)
        ]
        return np.stack(columns, axis=1)

    def _above(self, ranks: Integers) -> Iterator[Mask]:
        """Yield for each row the hardest unsafe rows that are at least as easy on every quantity."""
        for row in ranks:
            yield (self.hardest >= row).all(axis=1)

    def clause(self, chosen: Sequence[int]) -> LearntClause:
        """Return the clause that asks the `chosen` number of limits of each quantity; 0 asks nothing."""
        return LearntClause(
            tuple(
                int(limits[number - 1]) if number else None
                for limits, number in zip(self.limits, chosen, strict=True)
            )
        )

    def covers(self, chosen: Integers) -> Mask:
        """Return the patterns of `safe` that meet the `chosen` number of limits of each quantity."""
        return np.asarray((self.safe >= chosen).all(axis=1))


def _easiest(rows: Integers) -> list[int]:
    """Return the places of the rows, all different, than which none is at least as easy on every quantity."""
    kept: list[int] = []
    for place in np.argsort(-rows.sum(axis=1), kind="stable").tolist():
        if not (rows[kept] >= rows[place]).all(axis=1).any():
            kept.append(place)
    return sorted(kept)
