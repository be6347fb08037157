import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.learning.config import TrainConfig, make_config
from drlsl.learning.schedule import LinearSchedule, epsilon_schedule, learning_rate_schedule

VALUES = st.floats(0.0, 1.0)


@given(start=VALUES, end=VALUES, duration=st.floats(1.0, 1e4), episode=st.integers(0, 20_000))
def test_a_line_between_its_ends(start: float, end: float, duration: float, episode: int) -> None:
    schedule = LinearSchedule(start, end, duration)
    assert schedule(0) == start
    assert schedule(int(duration) + 1) == end
    expected = start + (end - start) * min(episode / duration, 1.0)
    assert schedule(episode) == pytest.approx(expected, abs=1e-12)


def config(**values: object) -> TrainConfig:
    return make_config(values, "test")


def test_the_papers_rates_span_the_training() -> None:
    rate, epsilon = learning_rate_schedule(config()), epsilon_schedule(config())
    assert (rate(0), rate(1_499)) == (0.01, 1e-4)
    assert (epsilon(0), epsilon(1_499)) == (0.1, 0.001)
    assert rate(1_498) > 1e-4
    assert epsilon(1_498) > 0.001


def test_a_fraction_ends_the_decay_early() -> None:
    rate = learning_rate_schedule(config(episodes=101, schedule={"fraction": 0.5}))
    assert rate(25) == pytest.approx((0.01 + 1e-4) / 2)
    assert rate(49) > 1e-4
    assert rate(50) == rate(100) == 1e-4


def test_a_single_episode_has_the_first_value() -> None:
    assert learning_rate_schedule(config(episodes=1))(0) == 0.01
