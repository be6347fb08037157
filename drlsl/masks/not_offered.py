"""Actions that were not offered: driven, replaced or refused, and always told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError

Mode: TypeAlias = Literal["mask", "replace", "penalise", "raise"]
"""What happens with an action that was not offered.

`mask`: it is taken as it is; `replace`: the fallback is taken in its place; `penalise`: it is taken, at a
price; `raise`: `ActionNotOffered`, and nothing is taken.
"""

MODES: Final[tuple[Mode, ...]] = get_args(Mode)


class ActionNotOffered(ValueError):
    """An action that was not offered, in the mode `raise`; nothing was done."""


class Settled(NamedTuple):
    """The actions to take and whether those asked for were `offered`. Shapes: (N,)."""

    taken: npt.NDArray[np.int64]
    offered: npt.NDArray[np.bool_]


def check_mode(mode: str, known: Sequence[Mode] = MODES) -> Mode:
    """Return a mode of that name.

    Raises:
        UserError: there is none.
    """
    for one in known:
        if mode == one:
            return one
    raise UserError.no_such("mode", mode, known)


def settle(
    asked: npt.NDArray[np.integer[Any]],
    masks: npt.NDArray[Any],
    mode: Mode,
    *,
    fallback: int,
    names: Sequence[str],
    free: npt.NDArray[np.bool_] | None = None,
) -> Settled:
    """Return what to take of the actions `asked` for (N,), of which `masks` (N, A) are offered.

    In the mode `replace` the `fallback` is taken, or the first action that is offered if it is not. The
    `names` of the actions are for errors. Environments that are `free` (N,) take no action: any will do.

    Raises:
        ActionNotOffered: in the mode `raise`, if one is not.
    """
    offered = masks[np.arange(len(asked)), asked].astype(np.bool_)
    if free is not None:
        offered |= free
    taken = asked.astype(np.int64)
    if mode in ("mask", "penalise") or offered.all():
        return Settled(taken, offered)
    if mode == "raise":
        raise ActionNotOffered(_refusal(taken, masks, offered, names))
    stand_in = np.where(masks[:, fallback].astype(np.bool_), fallback, masks.argmax(axis=1))
    return Settled(np.where(offered, taken, stand_in), offered)


def _refusal(
    asked: npt.NDArray[np.int64],
    masks: npt.NDArray[Any],
    offered: npt.NDArray[np.bool_],
    names: Sequence[str],
) -> str:
    """Return the message about the first action that was not offered."""
    where = int(np.flatnonzero(~offered)[0])
    allowed = ", ".join(f"{number} {names[number]}" for number in np.flatnonzero(masks[where]).tolist())
    place = f" in environment {where}" if len(asked) > 1 else ""
    action = int(asked[where])
    return f"the action {action} {names[action]} was not offered{place}; offered: {allowed or 'none'}"
