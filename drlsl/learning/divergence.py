"""The error of learning that diverged."""

import numpy as np
from numpy.typing import NDArray

from drlsl.errors import UserError


class DivergedError(UserError):
    """Learning produced a value that is not finite."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}: train again with a lower schedule.learning_rate_start")


def check_values(values: NDArray[np.float32]) -> None:
    """Check that Q-values are finite. Shape: (N, A).

    Raises:
        DivergedError: one is not.
    """
    if not np.isfinite(values).all():
        raise DivergedError(f"the Q-values are {values.tolist()}")
