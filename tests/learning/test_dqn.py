import copy

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.config import Bootstrap, LearningConfig, NetworkConfig, make_config
from drlsl.learning.dqn import DivergedError, DqnAgent, greedy_choice, td_loss, td_targets
from drlsl.learning.replay import Batch

SIZE, ACTIONS = 4, 3


def agent(*, seed: int = 0, target_every: int = 1_000, bootstrap: Bootstrap = "all") -> DqnAgent:
    learning = LearningConfig(
        batch_size=16, learning_starts=16, target_every=target_every, bootstrap=bootstrap
    )
    return DqnAgent(
        SIZE,
        ACTIONS,
        NetworkConfig(hidden=(8, 8)),
        learning,
        rng=np.random.default_rng(seed),
        generator=torch.Generator().manual_seed(seed),
        device=torch.device("cpu"),
    )


def random_batch(seed: int, size: int = 16) -> Batch:
    rng = np.random.default_rng(seed)
    masks = rng.random((size, ACTIONS)) < 0.5
    masks[:, 0] |= ~masks.any(axis=1)
    terminated = rng.random(size) < 0.4
    masks[np.flatnonzero(terminated)[:1]] = False
    return Batch(
        torch.from_numpy(rng.random((size, SIZE), np.float32)),
        torch.from_numpy(rng.integers(ACTIONS, size=size)),
        torch.from_numpy(rng.normal(size=size).astype(np.float32)),
        torch.from_numpy(rng.random((size, SIZE), np.float32)),
        torch.from_numpy(terminated),
        torch.from_numpy(masks),
    )


@given(seed=st.integers(0, 10_000), discount=st.floats(0.0, 0.99), bootstrap=st.sampled_from(["all", "safe"]))
@settings(max_examples=80, deadline=None)
def test_targets_agree_with_a_loop(seed: int, discount: float, bootstrap: Bootstrap) -> None:
    batch = random_batch(seed)
    next_values = torch.randn(len(batch.rewards), ACTIONS, generator=torch.Generator().manual_seed(seed))
    expected = []
    for row in range(len(batch.rewards)):
        future = 0.0
        if not batch.terminated[row]:
            candidates = [
                float(next_values[row, action])
                for action in range(ACTIONS)
                if bootstrap == "all" or batch.next_masks[row, action]
            ]
            future = max(candidates)
        expected.append(float(batch.rewards[row]) + discount * future)
    got = td_targets(next_values, batch, discount, bootstrap)
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-5)


def test_the_loss_is_the_mean_squared_error_of_the_actions_taken() -> None:
    values = torch.tensor([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    loss = td_loss(values, torch.tensor([2, 0]), torch.tensor([1.0, 1.0]))
    assert loss.item() == pytest.approx((2.0**2 + 3.0**2) / 2)


@given(
    values=st.lists(st.floats(-1e6, 1e6, width=32), min_size=3, max_size=3),
    offered=st.lists(st.booleans(), min_size=3, max_size=3).filter(any),
)
def test_the_greedy_action_is_the_best_offered(values: list[float], offered: list[bool]) -> None:
    choice = greedy_choice(np.array(values, np.float32), np.array(offered))
    assert offered[choice.action]
    assert values[choice.action] == max(value for value, is_in in zip(values, offered, strict=True) if is_in)
    assert values[choice.preferred] == max(values)


@given(
    offered=st.lists(st.booleans(), min_size=3, max_size=3).filter(any),
    epsilon=st.floats(0.0, 1.0),
    seed=st.integers(0, 1_000),
)
@settings(deadline=None)
def test_exploration_stays_among_the_offered(offered: list[bool], epsilon: float, seed: int) -> None:
    learner = agent(seed=seed)
    observation = np.random.default_rng(seed).random(SIZE, np.float32)
    for _ in range(20):
        assert offered[learner.act(observation, np.array(offered), epsilon).action]


def test_exploration_reaches_each_offered_action_evenly() -> None:
    learner, observation = agent(), np.zeros(SIZE, np.float32)
    offered = np.array([True, False, True])
    taken = [learner.act(observation, offered, 1.0).action for _ in range(2_000)]
    counts = np.bincount(taken, minlength=3)
    assert counts[1] == 0
    assert abs(counts[0] - counts[2]) < 200


def test_exploration_happens_at_the_given_rate() -> None:
    learner, observation = agent(), np.zeros(SIZE, np.float32)
    offered = np.ones(ACTIONS, np.bool_)
    greedy = learner.act(observation, offered, 0.0).action
    others = sum(learner.act(observation, offered, 0.3).action != greedy for _ in range(3_000))
    assert others / 3_000 == pytest.approx(0.3 * 2 / 3, abs=0.03)


def test_nothing_offered_is_an_error() -> None:
    nothing = np.zeros(ACTIONS, np.bool_)
    with pytest.raises(ValueError, match="no action is offered"):
        greedy_choice(np.zeros(ACTIONS, np.float32), nothing)
    with pytest.raises(ValueError, match="no action is offered"):
        agent().act(np.zeros(SIZE, np.float32), nothing, 1.0)


@pytest.mark.parametrize("epsilon", [0.0, 1.0])
def test_an_observation_that_is_not_finite_is_an_error(epsilon: float) -> None:
    observation = np.array([0.0, np.nan, 0.0, 0.0], np.float32)
    with pytest.raises(ValueError, match="not finite"):
        agent().act(observation, np.ones(ACTIONS, np.bool_), epsilon)


def test_q_values_that_are_not_finite_are_an_error() -> None:
    learner = agent()
    with torch.no_grad():
        next(learner.network.parameters()).fill_(torch.nan)
    with pytest.raises(DivergedError, match="Q-values"):
        learner.act(np.zeros(SIZE, np.float32), np.ones(ACTIONS, np.bool_), 1.0)


def test_a_loss_that_is_not_finite_leaves_the_weights() -> None:
    learner = agent()
    before = copy.deepcopy(learner.network.state_dict())
    batch = random_batch(0)
    with pytest.raises(DivergedError, match="loss is inf at update 1"):
        learner.update(batch._replace(rewards=torch.full_like(batch.rewards, 1e30)))
    for name, value in learner.network.state_dict().items():
        assert torch.equal(value, before[name])


def largest_change(learner: DqnAgent, batch: Batch) -> float:
    before = [parameter.detach().clone() for parameter in learner.network.parameters()]
    learner.update(batch)
    return max(
        (new.detach() - old).abs().max().item()
        for new, old in zip(learner.network.parameters(), before, strict=True)
    )


@pytest.mark.parametrize("rate", [1e-2, 1e-3, 1e-4])
def test_the_learning_rate_reaches_adam(rate: float) -> None:
    learner = agent()
    learner.learning_rate = rate
    assert learner.learning_rate == rate
    # Adam's first step has the size of the rate wherever the gradient is not tiny.
    assert largest_change(learner, random_batch(1)) == pytest.approx(rate, rel=1e-2)


def test_a_later_learning_rate_reaches_adam_too() -> None:
    fast, slow = agent(), agent()
    for learner in (fast, slow):
        learner.learning_rate = 1e-3
        learner.update(random_batch(1))
    fast.learning_rate, slow.learning_rate = 1e-3, 1e-5
    ratio = largest_change(fast, random_batch(2)) / largest_change(slow, random_batch(2))
    assert ratio == pytest.approx(100.0, rel=0.02)


def test_an_update_agrees_with_plain_adam() -> None:
    learner = agent(bootstrap="safe")
    learner.learning_rate = 0.01
    network = copy.deepcopy(learner.network)
    frozen = copy.deepcopy(network)
    optimiser = torch.optim.Adam(network.parameters(), lr=0.01)
    for step in range(5):
        batch = random_batch(step)
        masked = frozen(batch.next_observations).detach().where(batch.next_masks, torch.tensor(-1e9))
        future = torch.where(batch.terminated, 0.0, masked.max(dim=1).values)
        taken = network(batch.observations)[torch.arange(16), batch.actions]
        loss = ((batch.rewards + 0.95 * future - taken) ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        assert learner.update(batch) == pytest.approx(loss.item(), rel=1e-4)
    for mine, reference in zip(learner.network.parameters(), network.parameters(), strict=True):
        torch.testing.assert_close(mine, reference, rtol=1e-4, atol=1e-5)


def test_the_target_network_is_copied_every_so_many_updates() -> None:
    learner = agent(target_every=3)
    initial = copy.deepcopy(learner.get_state()["target"])
    for update in range(1, 8):
        learner.update(random_batch(update))
        state = learner.get_state()
        fresh = all(torch.equal(state["target"][name], state["network"][name]) for name in initial)
        assert fresh == (update % 3 == 0)
        if update < 3:
            assert all(torch.equal(state["target"][name], initial[name]) for name in initial)


def test_a_state_carries_over() -> None:
    learner, restored = agent(seed=1, target_every=4), agent(seed=2, target_every=4)
    for step in range(6):
        learner.update(random_batch(step))
    restored.set_state(copy.deepcopy(learner.get_state()))
    observation, offered = np.full(SIZE, 0.3, np.float32), np.ones(ACTIONS, np.bool_)
    for step in range(6, 12):
        assert learner.update(random_batch(step)) == restored.update(random_batch(step))
        assert learner.act(observation, offered, 0.5) == restored.act(observation, offered, 0.5)


def test_equal_seeds_give_equal_weights() -> None:
    for mine, same in zip(
        agent(seed=3).network.parameters(), agent(seed=3).network.parameters(), strict=True
    ):
        assert torch.equal(mine, same)


def test_layers_are_drawn_within_pytorchs_bounds() -> None:
    config = make_config({}, "test")
    learner = DqnAgent(
        10,
        3,
        config.network,
        config.learning,
        rng=np.random.default_rng(0),
        generator=torch.Generator().manual_seed(0),
        device=torch.device("cpu"),
    )
    shapes = [tuple(parameter.shape) for parameter in learner.network.parameters()]
    assert shapes == [(256, 10), (256,), (256, 256), (256,), (3, 256), (3,)]
    for weight in learner.network.parameters():
        if weight.ndim == 2:
            bound = weight.shape[1] ** -0.5
            assert 0.9 * bound < weight.abs().max().item() <= bound
