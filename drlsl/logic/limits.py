"""The limits of a query, and the meter that counts against them.

A query has one `Meter`, shared by the searches that run for it (cleanup goals, directives of a loaded text).
The solver reports its inferences; long-running builtins report their steps as they go, and check time and
memory before they create something large. So no call exceeds a limit by much.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from drlsl.logic.errors import ResourceError, resource_error


class LimitExceeded(ResourceError):
    """A query went beyond its `Limits`. The program cannot catch it; the engine stays usable."""

    catchable = False
    bound = ""
    """The limit in words, such as 1,000 inferences."""

    def message(self) -> str:
        """Return the limit that was not enough."""
        return f"resource error: more than {self.bound}" if self.bound else super().message()


@dataclass(frozen=True)
class Limits:
    """Limits of one query; None means no limit.

    Attributes:
        inferences: calls of predicates; 64 steps of a builtin that walks or makes a large term count as one.
        seconds: wall-clock time spent searching [s], checked every hundred inferences, or five hundred where
            they are quick, and before an operation that cannot be interrupted is begun, by an estimate of how
            long that will take.
        depth: calls waiting for an inner one to end, checked every few thousand inferences.
        trail: bindings that backtracking would have to undo, and choice points, together.
        memory: by how much the process may grow while the query runs [bytes]. If the system reports the
            memory of the process (Linux), that counts, whatever allocated it, to within some 20 MB; elsewhere
            its highest value so far, or on Windows only what builtins are about to create.
    """

    inferences: int | None = None
    seconds: float | None = None
    depth: int | None = 5_000_000
    trail: int | None = 20_000_000
    memory: int | None = 768 << 20


# The number of steps between two checks of the clock and the memory, and the longest time of one [s].
_STEPS: Final = 20_000
_STEP_SECONDS: Final = 0.3e-6
# The time to create a cell, including garbage collection [s].
_CELL_SECONDS: Final = 0.8e-6
_STEPS_OF_INFERENCE: Final = 64
# The number of inferences between two checks of the memory.
_INFERENCES: Final = 8_000
# How many are made between two looks at the clock: few at first, and more while they take no longer than this
# [s] and make nothing large. The solver looks after one more, compiled code after half as many. These numbers
# are prime, so that a loop is looked at in each of its goals in turn, also in one where it has no choice
# points and what it left on the trail can be dropped.
_FEWEST: Final = 106
_MOST: Final = 502
_QUICK: Final = 0.002
# A cell of a list: the pair, its arguments and an element.
CELL_BYTES: Final = 150
# Smaller amounts are not checked.
_SMALL_BYTES: Final = 1 << 20
# After something of this size exists, few inferences may fill the memory with copies of it.
_LARGE_BYTES: Final = 1 << 16
# More than any memory, but within the range of a float.
_MOST_CELLS: Final = 1 << 50
_BYTES_OF_STEP: Final = 64
# Cleanup goals of a query that exceeded its limits share this part of them again, and at least this much.
_CLEANUP_SHARE: Final = 0.1
_CLEANUP_SECONDS: Final = 0.05
_CLEANUP_INFERENCES: Final = 1_000


def exceeded(resource: str, bound: str) -> LimitExceeded:
    """Return the error of a query that went beyond one of its limits."""
    error = LimitExceeded(resource_error(resource).term)
    error.bound = bound
    return error


class Meter:
    """The resources that one query has used so far.

    It is the first entry of the trail of each search, so that any code that binds variables can reach it.
    """

    __slots__ = (
        "_base",
        "_deadline",
        "_inferences",
        "_is_extended",
        "_left",
        "_looked",
        "_most",
        "_room",
        "_steps",
        "_unlooked",
        "inferences",
        "limits",
        "pace",
    )

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.inferences = 0
        self.pace = _FEWEST  # the number of inferences before they must be reported
        self._most = limits.inferences
        self._deadline: float | None = None
        if limits.seconds is not None:
            self._looked = time.monotonic()
            self._deadline = self._looked + limits.seconds
        self._room = limits.memory
        self._base: int | None = None
        self._is_extended = False
        self._steps = 0
        self._left = _STEPS
        self._unlooked = 0
        self._inferences = _INFERENCES

    @property
    def ref(self) -> None:
        """None: as an entry of a trail, a meter has nothing to undo."""
        return None

    @ref.setter
    def ref(self, _: None) -> None:
        pass

    def count(self, inferences: int) -> None:
        """Account for inferences.

        Raises:
            LimitExceeded: The query went beyond its limits.
        """
        self.inferences += inferences
        self._check_inferences()
        is_quick = True
        if self._deadline is not None:
            now = time.monotonic()
            if now > self._deadline:
                raise self._late()
            is_quick = now - self._looked < _QUICK
            self._looked = now
        self.pace = min(2 * self.pace, _MOST) if is_quick and self._inferences else _FEWEST
        self._unlooked += inferences
        if self._unlooked >= self._inferences:
            self._unlooked = 0
            self._check_room(0)

    def inferences_left(self) -> int | None:
        """Return the number of inferences that remain; None without a limit."""
        if self._most is None:
            return None
        return max(0, self._most - self.inferences - self._steps // _STEPS_OF_INFERENCE)

    def allow_cleanup(self) -> None:
        """Let cleanup goals run after a limit was exceeded, once, for a tenth of the limits.

        All of them share it; when it is used up, no other is started.
        """
        if self._is_extended:
            return
        self._is_extended = True
        if self._most is not None:
            used = self.inferences + self._steps // _STEPS_OF_INFERENCE
            share = max(_CLEANUP_INFERENCES, int(self._most * _CLEANUP_SHARE))
            self._most = max(self._most, used) + share
        if self._deadline is not None and self.limits.seconds is not None:
            share_s = max(_CLEANUP_SECONDS, self.limits.seconds * _CLEANUP_SHARE)
            self._deadline = time.monotonic() + share_s
        if self._room is not None:
            self._room += int(self._room * _CLEANUP_SHARE)

    def is_spent(self) -> bool:
        """Return whether the share of cleanup goals after an exceeded limit is used up as well."""
        if not self._is_extended:
            return False
        is_late = self._deadline is not None and time.monotonic() > self._deadline
        return is_late or self.inferences_left() == 0

    def spend(self, steps: int) -> None:
        """Account for steps that a builtin has made, or will make in a moment.

        Raises:
            LimitExceeded: The query went beyond its limits.
        """
        self._left -= steps
        if self._left < 0:
            self._look()

    def make(self, cells: int) -> None:
        """Account for cells of lists, or arguments of terms, that a builtin is about to create.

        Raises:
            LimitExceeded: There is no time or no memory for them.
        """
        cells = min(cells, _MOST_CELLS)
        self._left -= cells
        if self._left < 0:
            self._look()
            if cells > _STEPS:
                self._check_time(cells * _CELL_SECONDS)
                self._check_room(cells * CELL_BYTES)

    def text(self, size: int) -> None:
        """Account for a text of `size` bytes, or an integer, that a builtin is about to create.

        Raises:
            LimitExceeded: There is no memory for it.
        """
        if size >= _BYTES_OF_STEP:
            self.spend(min(size, _MOST_CELLS) // _BYTES_OF_STEP)
            if size > _LARGE_BYTES:
                self._inferences = 0
                if size > _SMALL_BYTES:
                    self._check_room(size)

    def forecast(self, seconds: float) -> None:
        """Account for an uninterruptible operation about to begin that takes `seconds` [s].

        Raises:
            LimitExceeded: It would not end in time.
        """
        self.spend(int(seconds / _STEP_SECONDS))
        self._check_time(seconds)

    def _look(self) -> None:
        self._steps += _STEPS - self._left
        self._left = _STEPS
        self._check_inferences()
        self._check_time(0.0)
        self._check_room(0)

    def _check_inferences(self) -> None:
        most = self._most
        if most is not None and self.inferences + self._steps // _STEPS_OF_INFERENCE >= most:
            raise exceeded("inferences", f"{self.limits.inferences:,} inferences")

    def _check_time(self, more: float) -> None:
        if self._deadline is not None and time.monotonic() + more > self._deadline:
            raise self._late()

    def _late(self) -> LimitExceeded:
        return exceeded("seconds", f"{self.limits.seconds} seconds")

    def _check_room(self, more: int) -> None:
        room = self._room
        if room is None:
            return
        held = resident_bytes()
        if self._base is None:
            self._base = held
        if max(0, held - self._base) + more > room:
            raise exceeded("memory", f"{self.limits.memory:,} bytes of memory")


def resident_bytes() -> int:
    """Return the memory of the process [bytes]; 0 if the system does not report it."""
    with suppress(OSError, ValueError, IndexError), open("/proc/self/statm", "rb") as file:
        return int(file.read().split()[1]) * _page_bytes()
    return _highest_resident_bytes()


def _page_bytes() -> int:
    import resource

    return resource.getpagesize()


def _highest_resident_bytes() -> int:
    try:
        import resource
    except ImportError:  # Windows
        return 0
    import sys

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
