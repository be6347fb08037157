"""Signals that ask a command to end: to save what it has, or to delete what it has begun."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType


class Stop:
    """The signal, if any, that has requested the end."""

    def __init__(self) -> None:
        self.signal: int | None = None

    def requested(self) -> bool:
        """Return whether a signal has requested the end."""
        return self.signal is not None

    @property
    def status(self) -> int:
        """The exit status of a command that a signal ended."""
        return 128 + (self.signal or signal.SIGINT)


@contextlib.contextmanager
def stop_on_signal(say: Callable[[str], object]) -> Iterator[Stop]:
    """Note the first SIGINT or SIGTERM, so that the work is saved; a second one stops at once."""
    stop = Stop()

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.requested():
            raise KeyboardInterrupt
        stop.signal = number
        say("saving; once more stops at once")

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def cleaned_up_on_signal() -> Iterator[None]:
    """Have SIGTERM end what runs within as Ctrl-C does, so that what is half-written is deleted.

    In another thread than the main one, which alone may handle signals, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
