"""Targets that are kept are those that would be computed."""

import copy
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.learning.config import LearningConfig, NetworkConfig
from drlsl.learning.dqn import DqnAgent
from drlsl.learning.replay import Replay

SIZE, ACTIONS, BATCH = 4, 3, 16


def learner(
    target_every: int, capacity: int, batches: int, *, noisy: bool = False
) -> tuple[DqnAgent, Replay]:
    learning = LearningConfig(
        batch_size=BATCH,
        learning_starts=BATCH,
        replay_capacity=capacity,
        target_every=target_every,
        bootstrap="safe",
    )
    agent = DqnAgent(
        SIZE,
        ACTIONS,
        NetworkConfig(hidden=(16, 16), noisy=noisy),
        learning,
        rng=np.random.default_rng(0),
        generator=torch.Generator().manual_seed(0),
        device=torch.device("cpu"),
    )
    agent.learning_rate = 0.01
    rng = np.random.default_rng(1)
    replay = Replay(
        capacity, SIZE, ACTIONS, rng, batch_size=BATCH, batches=batches, device=torch.device("cpu")
    )
    return agent, replay


def transitions(rng: np.random.Generator, count: int) -> dict[str, Any]:
    terminated = rng.random(count) < 0.2
    masks = rng.random((count, ACTIONS)) < 0.5
    masks[:, 0] |= ~(terminated | masks.any(axis=1))
    return {
        "observations": rng.random((count, SIZE), np.float32),
        "actions": rng.integers(ACTIONS, size=count),
        "rewards": rng.normal(size=count),
        "next_observations": rng.random((count, SIZE), np.float32),
        "terminated": terminated,
        "next_masks": masks,
    }


@given(
    target_every=st.integers(1, 40),
    capacity=st.integers(BATCH, 60),
    batches=st.integers(1, 7),
    noisy=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_learning_by_kept_targets_is_learning_by_computed_ones(
    target_every: int, capacity: int, batches: int, noisy: bool
) -> None:
    agent, replay = learner(target_every, capacity, batches, noisy=noisy)
    plain, same = learner(target_every, capacity, batches, noisy=noisy)
    rng = np.random.default_rng(2)
    for step in range(30):
        added = transitions(rng, batches if step else BATCH)
        replay.add(**added)
        same.add(**added)
        expected = [plain.update(batch) for batch in same.sample(batches).batches]
        # Equal but for the rounding of products, which some processors do by the number of rows.
        assert agent.learn(replay, batches) == pytest.approx(expected, rel=1e-4, abs=1e-6)
    assert agent.updates == plain.updates
    for name, mine in agent.network.get_state().items():
        np.testing.assert_allclose(mine, plain.network.get_state()[name], rtol=1e-3, atol=1e-4)


def test_targets_are_computed_once_for_each_target_network(monkeypatch: pytest.MonkeyPatch) -> None:
    agent, replay = learner(50, 1_000, 10)
    replay.add(**transitions(np.random.default_rng(0), 100))
    computed = []
    values = agent.target.next_values

    def counted(observations: torch.Tensor) -> torch.Tensor:
        computed.append(len(observations))
        return values(observations)

    monkeypatch.setattr(agent.target, "next_values", counted)
    agent.learn(replay, 10)
    first = sum(computed)
    for _ in range(4):
        agent.learn(replay, 10)
    # Those that are drawn for the first time later: a few in a hundred.
    assert 60 < first <= 160
    assert sum(computed) - first < 100
    computed.clear()
    agent.learn(replay, 10)
    assert sum(computed) > 60


def test_a_memory_and_its_targets_carry_over() -> None:
    agent, replay = learner(7, 80, 3)
    rng = np.random.default_rng(0)
    replay.add(**transitions(rng, 60))
    for _ in range(5):
        agent.learn(replay, 3)
    restored, memory = learner(7, 80, 3)
    restored.set_state(copy.deepcopy(agent.get_state()))
    memory.set_state(copy.deepcopy(replay.get_state()))
    for _ in range(20):
        added = transitions(rng, 3)
        replay.add(**added)
        memory.add(**added)
        assert agent.learn(replay, 3) == restored.learn(memory, 3)


def test_a_state_from_before_targets_were_kept_is_read() -> None:
    agent, replay = learner(7, 80, 3)
    replay.add(**transitions(np.random.default_rng(0), 60))
    agent.learn(replay, 3)
    state = replay.get_state()
    del state["targets"]
    _, memory = learner(7, 80, 3)
    memory.set_state(state)
    assert len(memory.targets.missing(np.arange(60), 0)) == 60
