"""The one error class for mistakes that a user can correct."""

from collections.abc import Iterable
from typing import Self


class UserError(Exception):
    """Bad input: the message says what was wrong, where, what was expected and what to do.

    The command line prints the message on one line of stderr and exits with status 2.
    """

    @classmethod
    def no_such(cls, setting: str, name: object, known: Iterable[str]) -> Self:
        """Return the error that `name` is none that a setting, such as `mask_format`, knows."""
        kind = setting.rpartition("_")[2]
        return cls(f"{setting} {name!r}: no such {kind}; expected one of {', '.join(known)}")
