"""Words of memory fetched ahead of their use."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def prefetch(words: npt.NDArray[np.int32], begin: int, end: int) -> None:
    """Have the processor fetch a part of an array that is read soon; in Python, do nothing.

    Rows that lie far apart in a large file would else be waited for, one after the other.
    """
