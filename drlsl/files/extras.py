"""Libraries that an extra of this package installs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from drlsl.errors import UserError


@contextmanager
def needed(what: str, library: str, extra: str) -> Iterator[None]:
    """Import within what some files need; `what` names them, in the plural.

    Raises:
        UserError: the extra is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise UserError(
            f"{what} need {error.name or library}; install it with: pip install 'drlsl[{extra}]'"
        ) from error
