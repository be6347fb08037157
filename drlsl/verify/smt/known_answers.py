"""Answers of solvers, of this run and of earlier ones, so that no question is asked twice."""

from __future__ import annotations

import hashlib
import sqlite3
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Final, get_args

from drlsl.verify.smt.second import Confirmation

_TRANSLATION: Final = 1
"""Version of what a question means to a solver: raise it when formulas reach z3 or cvc5 in another way."""

_PATIENCE: Final = 10.0
"""Time to wait for other processes that write to the same file [s]."""


@dataclass(frozen=True, slots=True)
class Known:
    """The solvers that answered a question; in an earlier run, if it was not yet asked in this one."""

    opinion: Confirmation
    is_of_earlier_run: bool


class KnownAnswers:
    """The questions that were answered, each a digest of formulas and of the answer that they have.

    With a file, those of earlier runs are known, too. Each line of it carries a checksum of its own, and one
    that does not fit counts as absent. Several processes may add to it. Answers stay valid, since a solver
    answers for good; each version of a solver should have a file of its own.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._known: dict[bytes, Confirmation] = {}
        self._file = None if path is None else _opened(path)

    def get(self, question: bytes) -> Known | None:
        """Return who answered a question; None if it was never answered."""
        opinion = self._known.get(question)
        if opinion is not None:
            return Known(opinion, is_of_earlier_run=False)
        if self._file is None:
            return None
        try:
            row = self._file.execute(
                "SELECT opinion, seal FROM answers WHERE question = ?", (_place(question),)
            )
            found = row.fetchone()
        except sqlite3.Error as error:
            self._give_up(error)
            return None
        for opinion in get_args(Confirmation):
            if found == (opinion, _seal(question, opinion)):
                self._known[question] = opinion
                return Known(opinion, is_of_earlier_run=True)
        return None

    def keep(self, question: bytes, opinion: Confirmation) -> None:
        """Keep who answered a question."""
        self._known[question] = opinion
        if self._file is None:
            return
        row = (_place(question), opinion, _seal(question, opinion))
        try:
            self._file.execute("INSERT OR REPLACE INTO answers VALUES (?, ?, ?)", row)
        except sqlite3.Error as error:
            self._give_up(error)

    def _give_up(self, error: sqlite3.Error) -> None:
        _say(self._path, error)
        self._file = None


def _opened(path: Path) -> sqlite3.Connection | None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = sqlite3.connect(path, timeout=_PATIENCE, isolation_level=None)
        # what a power cut loses is asked again
        file.execute("PRAGMA synchronous = OFF")
        file.execute(
            "CREATE TABLE IF NOT EXISTS answers "
            "(question BLOB PRIMARY KEY, opinion TEXT, seal BLOB) WITHOUT ROWID"
        )
    except (OSError, sqlite3.Error) as error:
        _say(path, error)
        return None
    return file


def _say(path: Path | None, error: Exception) -> None:
    warnings.warn(
        f"{path}: answers of solvers are not kept ({error}); delete the file if it is damaged", stacklevel=4
    )


def _place(question: bytes) -> bytes:
    return hashlib.sha256(b"%d " % _TRANSLATION + question).digest()


def _seal(question: bytes, opinion: Confirmation) -> bytes:
    return hashlib.sha256(question + opinion.encode()).digest()
