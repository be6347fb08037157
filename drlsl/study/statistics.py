"""Statistics over seeds: interquartile mean, bootstrap intervals, convergence."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from drlsl.learning import moving_average
from drlsl.traffic import Floats

LEVEL: Final = 0.95
"""Share of the resamples that an interval holds."""

DRAWS: Final = 2_000
"""Resamples of an interval."""

BOOTSTRAP_SEED: Final = 20_211_206
"""Every interval is drawn with the same stream, so that the same results give the same report."""

WINDOW_SHARE: Final = 1 / 15
"""Episodes of the moving average that determines convergence, as a share of the training: 100 of 1,500."""

TOLERANCE: Final = 0.05
"""Largest distance of a converged training from its final level, as a share of that."""


class Estimate(NamedTuple):
    """A statistic with its interval; of a single run there is none."""

    value: float
    low: float | None
    high: float | None


def interquartile_mean(values: Floats) -> Floats:
    """Return the mean of the middle half along the last axis.

    A quarter of the values, rounded down, is cut from either end.

    Source: Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice", 2021.
    """
    cut = values.shape[-1] // 4
    middle = np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut]
    return np.asarray(middle.mean(axis=-1))


def estimate(strata: Sequence[Sequence[float]]) -> Estimate:
    """Estimate the interquartile mean over all runs of all strata, with its bootstrap interval.

    A stratum holds the runs' results in one test. The interval is a stratified percentile bootstrap: runs are
    drawn with replacement within each stratum.

    Raises:
        ValueError: there is no value, or one is not finite.

    Source: Agarwal et al., 2021, section 4.1.
    """
    arrays = [np.asarray(stratum, np.float64) for stratum in strata if len(stratum)]
    if not arrays or not all(np.isfinite(array).all() for array in arrays):
        raise ValueError(f"expected finite values in each stratum, got {strata}")
    value = float(interquartile_mean(np.concatenate(arrays)))
    if max(map(len, arrays)) < 2:
        return Estimate(value, None, None)
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    drawn = [array[rng.integers(len(array), size=(DRAWS, len(array)))] for array in arrays]
    resampled = interquartile_mean(np.concatenate(drawn, axis=1))
    low, high = np.quantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Estimate(value, float(low), float(high))


def convergence_window(episodes: int) -> int:
    """Return the number of episodes of the moving average that determines convergence."""
    return max(1, round(episodes * WINDOW_SHARE))


def convergence_episode(returns: Floats) -> int | None:
    """Return the first episode from which on the return's moving average stays near its end.

    Shape: (N,). Episodes count from 1. None if there is no such episode before the window whose mean is the
    final level.
    """
    window = convergence_window(len(returns))
    average = moving_average(returns, window)
    final = average[-1]
    outside = np.flatnonzero(np.abs(average - final) > TOLERANCE * abs(final))
    # An average over fewer episodes than the window says little: only full windows count.
    first = max(window, int(outside[-1]) + 2 if len(outside) else 1)
    return first if first <= len(returns) - window else None
