"""Compare the speed of two versions: the same measurements of each, in turn, on one machine."""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from drlsl.benchmarks.measurements import MEASUREMENTS, Times
from drlsl.benchmarks.subjects import subject

CONFIDENCE: Final = 0.95
"""Confidence of the interval of the median ratio."""


@dataclass(frozen=True)
class Comparison:
    """The times of both versions in one respect [s]: a pair for each turn."""

    name: str
    old: tuple[float, ...]
    new: tuple[float, ...]

    @property
    def ratios(self) -> tuple[float, ...]:
        """The speed of the new version relative to the old one, turn by turn."""
        return tuple(before / after for before, after in zip(self.old, self.new, strict=True))

    @property
    def median(self) -> float:
        """The median of the ratios."""
        return statistics.median(self.ratios)

    @property
    def interval(self) -> tuple[float, float]:
        """The narrowest symmetric interval between ratios that holds the median with `CONFIDENCE`.

        With fewer than six pairs there is none, and it is their range. Source: the sign test.
        """
        ratios, count = sorted(self.ratios), len(self.ratios)
        cut = 0
        while cut + 1 <= (count - 1) // 2 and _coverage(count, cut + 1) >= CONFIDENCE:
            cut += 1
        return ratios[cut], ratios[count - 1 - cut]

    @property
    def swing(self) -> float:
        """The swing of the machine: the longest time of a version over its shortest one, the larger ratio."""
        return max(max(times) / min(times) for times in (self.old, self.new))


def _coverage(count: int, cut: int) -> float:
    """Return the confidence of the interval between two order statistics, `cut` from either end."""
    outside = sum(math.comb(count, below) for below in range(cut + 1))
    return 1 - math.ldexp(outside, 1 - count)


def compare(
    old: Path, new: Path, what: Sequence[str], pairs: int, settings: Sequence[str] = ()
) -> Iterator[Comparison]:
    """Measure both versions in turn, and yield a comparison of each time when its pairs are complete.

    Each is a checkout or a wheel. What only one of them reports is left out. `settings`: those of the new
    version's training, each KEY=VALUE, where it differs from the old one's.

    Raises:
        UserError: as `subject`, or a measurement fails.
    """
    with tempfile.TemporaryDirectory(prefix="drlsl-compare-") as work:
        versions = [
            subject(old, Path(work) / "old"),
            replace(subject(new, Path(work) / "new"), settings=tuple(settings)),
        ]
        for name in what:
            measure = MEASUREMENTS[name]
            found: list[tuple[Times, Times]] = []
            for pair in range(pairs):
                order = (0, 1) if pair % 2 == 0 else (1, 0)
                turn = {number: measure(versions[number]) for number in order}
                found.append((turn[0], turn[1]))
            for label in sorted(set(found[0][0]) & set(found[0][1])):
                before, after = (tuple(turn[which][label] for turn in found) for which in (0, 1))
                yield Comparison(f"{name}: {label}", before, after)
