"""Interquartile means, bootstrap intervals and convergence, by hand and by property."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.study.statistics import (
    TOLERANCE,
    convergence_episode,
    convergence_window,
    estimate,
    interquartile_mean,
)

VALUES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30)


@pytest.mark.parametrize(
    ("values", "mean"),
    [
        ([5.0], 5.0),
        ([1.0, 2.0, 6.0], 3.0),
        ([100.0, 1.0, 2.0, -50.0], 1.5),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 700.0], 3.5),
        ([9.0, 1.0, 2.0, 3.0, 4.0], 3.0),
    ],
)
def test_interquartile_mean_by_hand(values: list[float], mean: float) -> None:
    assert interquartile_mean(np.array(values)) == pytest.approx(mean)
    assert interquartile_mean(np.array([values, values[::-1]])).tolist() == pytest.approx([mean, mean])


@given(values=VALUES)
def test_a_quarter_of_the_values_may_be_anything(values: list[float]) -> None:
    kept = sorted(values)
    wild = kept.copy()
    for place in range(len(values) // 4):
        wild[place], wild[-1 - place] = -1e300, 1e300
    assert interquartile_mean(np.array(wild)) == pytest.approx(float(interquartile_mean(np.array(kept))))
    assert kept[0] - 1e-6 <= interquartile_mean(np.array(kept)) <= kept[-1] + 1e-6


def test_one_run_has_no_interval() -> None:
    assert estimate([[3.0], [5.0]]) == (4.0, None, None)


def test_the_interval_of_two_runs_reaches_from_one_to_the_other() -> None:
    # A quarter of the resamples is (0, 0), a quarter (1, 1): both quantiles lie within them.
    assert estimate([[0.0, 1.0]]) == (0.5, 0.0, 1.0)


def test_resamples_keep_to_their_strata() -> None:
    # Drawn from one heap, a resample could be all tens; from two strata of equal runs, all are the same.
    value, low, high = estimate([[0.0, 0.0, 0.0], [10.0, 10.0, 10.0]])
    assert (value, low, high) == (5.0, 5.0, 5.0)


def test_the_interval_is_the_percentiles_of_a_normal_mean() -> None:
    runs = np.random.default_rng(0).normal(size=3_000)
    _, low, high = estimate([list(runs)])
    assert low is not None
    assert high is not None
    # The mean of the middle half of n standard normal values has a standard deviation of about 1.09 / √n.
    assert (high - low) / 2 == pytest.approx(1.96 * 1.09 / 3_000**0.5, rel=0.12)


@given(strata=st.lists(VALUES, min_size=1, max_size=4))
@settings(max_examples=40, deadline=None)
def test_an_estimate_is_repeatable_and_within_the_values(strata: list[list[float]]) -> None:
    found = estimate(strata)
    assert found == estimate(strata)
    everything = [value for stratum in strata for value in stratum]
    for number in found:
        assert number is None or min(everything) - 1e-6 <= number <= max(everything) + 1e-6


@pytest.mark.parametrize("strata", [[], [[]], [[1.0, float("nan")]]])
def test_what_cannot_be_estimated_is_refused(strata: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="expected finite values"):
        estimate(strata)


def test_convergence_of_a_step() -> None:
    # Window 10 of 150: the average is within 5% of 100 once at most half a window's episode is at 0.
    returns = np.concatenate((np.zeros(50), np.full(100, 100.0)))
    assert convergence_window(150) == 10
    assert convergence_episode(returns) == 60


def test_convergence_begins_after_the_last_excursion() -> None:
    returns = np.full(300, 100.0)
    returns[200] = -200.0
    # The window of 20 holds the excursion, worth 15 of 100, up to episode 220.
    assert convergence_episode(returns) == 221


def test_an_average_that_is_not_full_does_not_count() -> None:
    assert convergence_episode(np.full(150, -7.0)) == 10


def test_a_training_that_still_changes_in_the_end_has_not_converged() -> None:
    assert convergence_episode(np.linspace(0.0, 100.0, 150)) is None


def stays(values: np.ndarray, window: int, episode: int) -> bool:
    """Whether the average stays within the tolerance of its end from an episode on."""
    averages = np.array(
        [values[max(0, end - window) : end].mean() for end in range(episode, len(values) + 1)]
    )
    return bool((np.abs(averages - averages[-1]) <= TOLERANCE * abs(averages[-1]) + 1e-9).all())


@given(
    noise=st.lists(st.integers(-30, 30), min_size=2, max_size=200),
    rise=st.integers(-5, 5),
    level=st.integers(-300, 300),
)
@settings(max_examples=100, deadline=None)
def test_convergence_holds_its_promise(noise: list[int], rise: int, level: int) -> None:
    values = np.array(noise, np.float64) + level - rise * np.arange(len(noise))[::-1]
    found = convergence_episode(values)
    window = convergence_window(len(values))
    if found is None:
        assert len(values) < 2 * window or not stays(values, window, len(values) - window)
        return
    assert window <= found <= len(values) - window
    assert stays(values, window, found)
