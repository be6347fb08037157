"""The errors of rules that give no usable answer, as commands report them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def failures_as_errors(*, what: str = "") -> Iterator[None]:
    """Turn an error of rules without a usable answer into a `UserError` of one line."""
    from drlsl.driving.shield import RuleFailure
    from drlsl.errors import UserError
    from drlsl.logic import LimitExceeded

    try:
        yield
    except RuleFailure as failure:
        raise UserError(f"{failure}; on the road the ego would keep its lane and brake") from failure
    except LimitExceeded as error:
        raise UserError(f"gave up{what}: it went beyond {error.bound}") from error
