"""Tasks that are quick, and go wrong where a file tells them to."""

import os
import signal
import time
from collections.abc import Generator
from functools import partial
from pathlib import Path

from drlsl.workers import Function, Stop


class AwkwardError(Exception):
    """An exception that can be pickled, and not be read again."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} {two}")


def squaring(root: Path) -> Function[int, int]:
    """Return a function that squares numbers, and notes in a folder which process did which."""
    return partial(_square, root)


def _square(root: Path, number: int, stop: Stop) -> int:
    with (root / "performed.txt").open("a") as file:
        file.write(f"{number} {os.getpid()}\n")
    if (root / f"slow.{number}").exists():
        time.sleep(30.0)
    for told in sorted(root.glob(f"*.{number}.*")):
        told.unlink()
        if told.name.startswith("killed"):
            os.kill(os.getpid(), signal.SIGKILL)
        if told.name.startswith("awkward"):
            raise AwkwardError("this is", "awkward")
        raise KeyError(number)
    return number * number


def counting_up() -> Function[int, Generator[int, None, int]]:
    """Return a function that says all smaller numbers before it squares one."""
    return _count_up


def _count_up(number: int, stop: Stop) -> Generator[int, None, int]:
    yield from range(number)
    return number * number


def performed(root: Path) -> list[tuple[int, int]]:
    """Return which numbers were tried, each with its process."""
    lines = (root / "performed.txt").read_text().splitlines()
    return [(int(line.split()[0]), int(line.split()[1])) for line in lines]


def tell(root: Path, how: str, number: int, times: int = 1) -> None:
    """Have the next attempts at a number be "killed", raise "awkward" or "key"."""
    for turn in range(times):
        (root / f"{how}.{number}.{turn}").touch()
