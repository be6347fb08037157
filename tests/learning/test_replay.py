from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.learning.replay import Replay

OBSERVED, ACTIONS = 3, 2


def transitions(*numbers: int) -> dict[str, Any]:
    """Transitions whose every field tells its number."""
    column = np.array(numbers)
    return {
        "observations": np.repeat(column[:, None], OBSERVED, axis=1).astype(np.float32),
        "actions": column % ACTIONS,
        "rewards": -column.astype(np.float64),
        "next_observations": np.repeat(column[:, None] + 0.5, OBSERVED, axis=1).astype(np.float32),
        "terminated": column % 3 == 0,
        "next_masks": np.stack([column >= 0, column % 2 == 0], axis=1),
    }


def empty(capacity: int, *, seed: int = 0, batch_size: int = 16, batches: int = 1) -> Replay:
    rng = np.random.default_rng(seed)
    return Replay(
        capacity, OBSERVED, ACTIONS, rng, batch_size=batch_size, batches=batches, device=torch.device("cpu")
    )


def filled(capacity: int, count: int, *, seed: int = 0, batch_size: int = 16, at_once: int = 1) -> Replay:
    replay = empty(capacity, seed=seed, batch_size=batch_size)
    for start in range(0, count, at_once):
        replay.add(**transitions(*range(start, min(start + at_once, count))))
    return replay


@given(
    capacity=st.integers(1, 12),
    count=st.integers(1, 40),
    size=st.integers(1, 20),
    at_once=st.integers(1, 20),
)
@settings(max_examples=100, deadline=None)
def test_a_batch_holds_the_latest_transitions_whole(
    capacity: int, count: int, size: int, at_once: int
) -> None:
    replay = filled(capacity, count, batch_size=size, at_once=at_once)
    kept = range(max(0, count - capacity), count)
    assert len(replay) == len(kept)
    (batch,) = replay.sample(1).batches
    assert all(field.shape[0] == size for field in batch)
    for row in range(size):
        number = int(batch.observations[row, 0])
        assert number in kept
        expected = transitions(number)
        np.testing.assert_array_equal(batch.observations[row], expected["observations"][0])
        np.testing.assert_array_equal(batch.next_observations[row], expected["next_observations"][0])
        np.testing.assert_array_equal(batch.next_masks[row], expected["next_masks"][0])
        assert batch.actions[row] == expected["actions"][0]
        assert batch.rewards[row] == expected["rewards"][0]
        assert batch.terminated[row] == expected["terminated"][0]


def test_minibatches_drawn_at_once_are_different_ones() -> None:
    replay = empty(1_000, batch_size=50, batches=3)
    replay.add(**transitions(*range(1_000)))
    numbers = [batch.observations[:, 0].tolist() for batch in replay.sample(3).batches]
    assert len({tuple(one) for one in numbers}) == 3
    again = empty(1_000, batch_size=50, batches=3)
    again.add(**transitions(*range(1_000)))
    assert [batch.observations[:, 0].tolist() for batch in again.sample(2).batches] == numbers[:2]
    with pytest.raises(ValueError, match="4 minibatches from a memory made for 3"):
        replay.sample(4)


@given(capacity=st.integers(1, 8), count=st.integers(1, 20))
@settings(max_examples=30, deadline=None)
def test_every_kept_transition_can_be_drawn(capacity: int, count: int) -> None:
    (batch,) = filled(capacity, count, batch_size=500).sample(1).batches
    drawn = {int(value) for value in batch.observations[:, 0]}
    assert drawn == set(range(max(0, count - capacity), count))


def test_minibatches_are_drawn_evenly() -> None:
    numbers = filled(10, 25, batch_size=20_000).sample(1).batches[0].observations[:, 0].numpy()
    counts = np.bincount(numbers.astype(np.int64) - 15, minlength=10)
    assert counts.min() > 1_800
    assert counts.max() < 2_200


@given(capacity=st.integers(1, 8), count=st.integers(0, 20), more=st.integers(1, 10))
@settings(max_examples=30, deadline=None)
def test_a_state_carries_over_contents_place_and_generator(capacity: int, count: int, more: int) -> None:
    replay, restored = filled(capacity, count, seed=5), filled(capacity, 0, seed=6)
    restored.set_state(replay.get_state())
    for number in range(count, count + more):
        replay.add(**transitions(number))
        restored.add(**transitions(number))
    for mine, theirs in zip(replay.sample(1).all, restored.sample(1).all, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_a_state_does_not_change_with_the_memory() -> None:
    replay = filled(2, 2)
    state = replay.get_state()
    replay.add(**transitions(7))
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
        {"rewards": np.array([0.0, np.nan])},
        {"rewards": np.array([np.inf, 0.0])},
        {"next_observations": np.array([[0, 0, 0], [0, np.nan, 0]], np.float32)},
        {"next_masks": np.array([[True, True], [False, False]])},
    ],
)
def test_broken_transitions_are_refused(broken: dict[str, Any]) -> None:
    replay = filled(4, 2)
    with pytest.raises(ValueError, match=r"not finite|no action|transition"):
        replay.add(**transitions(1, 2) | broken)
    assert len(replay) == 2


def test_a_terminal_state_may_offer_nothing() -> None:
    replay = filled(4, 0)
    replay.add(**transitions(0) | {"terminated": np.array([True]), "next_masks": np.zeros((1, 2), np.bool_)})
    assert len(replay) == 1


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_a_gpu_is_given_the_same_minibatches() -> None:
    here, there = (
        Replay(
            100,
            OBSERVED,
            ACTIONS,
            np.random.default_rng(0),
            batch_size=16,
            batches=2,
            device=torch.device(device),
        )
        for device in ("cpu", "cuda")
    )
    for replay in (here, there):
        replay.add(**transitions(*range(60)))
    for _ in range(3):
        for mine, theirs in zip(here.sample(2).batches, there.sample(2).batches, strict=True):
            assert all(torch.equal(one, other.cpu()) for one, other in zip(mine, theirs, strict=True))
