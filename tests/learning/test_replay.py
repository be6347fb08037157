from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.learning.replay import Replay

OBSERVED, ACTIONS = 3, 2


def transition(number: int) -> dict[str, Any]:
    """A transition whose every field tells its number."""
    return {
        "observation": np.full(OBSERVED, number, np.float32),
        "action": number % ACTIONS,
        "reward": float(-number),
        "next_observation": np.full(OBSERVED, number + 0.5, np.float32),
        "terminated": number % 3 == 0,
        "next_mask": np.array([True, number % 2 == 0]),
    }


def filled(capacity: int, count: int, seed: int = 0) -> Replay:
    replay = Replay(capacity, OBSERVED, ACTIONS, np.random.default_rng(seed))
    for number in range(count):
        replay.add(**transition(number))
    return replay


@given(capacity=st.integers(1, 12), count=st.integers(1, 40), size=st.integers(1, 20))
@settings(max_examples=60, deadline=None)
def test_a_batch_holds_the_latest_transitions_whole(capacity: int, count: int, size: int) -> None:
    replay = filled(capacity, count)
    kept = range(max(0, count - capacity), count)
    assert len(replay) == len(kept)
    batch = replay.sample(size)
    for row in range(size):
        number = int(batch.observations[row, 0])
        assert number in kept
        expected = transition(number)
        np.testing.assert_array_equal(batch.observations[row], expected["observation"])
        np.testing.assert_array_equal(batch.next_observations[row], expected["next_observation"])
        np.testing.assert_array_equal(batch.next_masks[row], expected["next_mask"])
        assert batch.actions[row] == expected["action"]
        assert batch.rewards[row] == expected["reward"]
        assert batch.terminated[row] == expected["terminated"]


@given(capacity=st.integers(1, 8), count=st.integers(1, 20))
@settings(max_examples=30, deadline=None)
def test_every_kept_transition_can_be_drawn(capacity: int, count: int) -> None:
    batch = filled(capacity, count).sample(500)
    drawn = {int(value) for value in batch.observations[:, 0]}
    assert drawn == set(range(max(0, count - capacity), count))


def test_minibatches_are_drawn_evenly() -> None:
    numbers = filled(10, 25).sample(20_000).observations[:, 0].numpy()
    counts = np.bincount(numbers.astype(np.int64) - 15, minlength=10)
    assert counts.min() > 1_800
    assert counts.max() < 2_200


@given(capacity=st.integers(1, 8), count=st.integers(0, 20), more=st.integers(1, 10))
@settings(max_examples=30, deadline=None)
def test_a_state_carries_over_contents_place_and_generator(capacity: int, count: int, more: int) -> None:
    replay, restored = filled(capacity, count, seed=5), filled(capacity, 0, seed=6)
    restored.set_state(replay.get_state())
    for number in range(count, count + more):
        replay.add(**transition(number))
        restored.add(**transition(number))
    for mine, theirs in zip(replay.sample(16), restored.sample(16), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_a_state_does_not_change_with_the_memory() -> None:
    replay = filled(2, 2)
    state = replay.get_state()
    replay.add(**transition(7))
    assert state["fields"]["rewards"].tolist() == [0.0, -1.0]


def test_a_state_of_another_capacity_is_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        filled(8, 0).set_state(filled(4, 6).get_state())


def test_an_empty_memory_gives_no_batch() -> None:
    with pytest.raises(ValueError, match="empty"):
        filled(4, 0).sample(1)


@pytest.mark.parametrize(
    "broken",
    [
        {"reward": float("nan")},
        {"reward": float("inf")},
        {"next_observation": np.array([0, np.nan, 0], np.float32)},
        {"next_mask": np.array([False, False])},
    ],
)
def test_broken_transitions_are_refused(broken: dict[str, Any]) -> None:
    replay = filled(4, 2)
    with pytest.raises(ValueError, match=r"not finite|no action|transition"):
        replay.add(**transition(1) | broken)
    assert len(replay) == 2


def test_a_terminal_state_may_offer_nothing() -> None:
    replay = filled(4, 0)
    replay.add(**transition(0) | {"terminated": True, "next_mask": np.array([False, False])})
    assert len(replay) == 1
