import copy

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.learning import greedy_choice
from drlsl.learning.config import Bootstrap, LearningConfig, NetworkConfig, make_config
from drlsl.learning.divergence import DivergedError
from drlsl.learning.dqn import DqnAgent, td_targets
from drlsl.learning.loss import td_loss
from drlsl.learning.replay import Batch

from .layers import linear_layers, plain

SIZE, ACTIONS = 4, 3


def agent(
    *, seed: int = 0, target_every: int = 1_000, bootstrap: Bootstrap = "all", device: str = "cpu"
) -> DqnAgent:
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
        device=torch.device(device),
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
    assert loss.value.item() == pytest.approx((2.0**2 + 3.0**2) / 2)


@given(rows=st.integers(1, 20), seed=st.integers(0, 1_000))
@settings(max_examples=40, deadline=None)
def test_the_losss_slopes_are_autograds(rows: int, seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    values = torch.randn(rows, ACTIONS, generator=generator, requires_grad=True)
    actions = torch.randint(ACTIONS, (rows,), generator=generator)
    targets = torch.randn(rows, generator=generator)
    loss = td_loss(values.detach(), actions, targets)
    taken = values[torch.arange(rows), actions]
    expected = torch.nn.functional.mse_loss(taken, targets)
    expected.backward()
    torch.testing.assert_close(loss.value, expected.detach())
    torch.testing.assert_close(loss.slopes, values.grad)


@given(
    values=st.lists(st.floats(-1e6, 1e6, width=32), min_size=3, max_size=3),
    offered=st.lists(st.booleans(), min_size=3, max_size=3).filter(any),
)
def test_the_greedy_action_is_the_best_offered(values: list[float], offered: list[bool]) -> None:
    flipped = (values[::-1], offered[::-1])
    actions, preferred = greedy_choice(
        np.array([values, flipped[0]], np.float32), np.array([offered, flipped[1]])
    )
    for row, (seen, free) in enumerate([(values, offered), flipped]):
        assert free[actions[row]]
        assert seen[actions[row]] == max(value for value, is_in in zip(seen, free, strict=True) if is_in)
        assert seen[preferred[row]] == max(seen)


@given(
    offered=st.lists(st.booleans(), min_size=3, max_size=3).filter(any),
    epsilon=st.floats(0.0, 1.0),
    seed=st.integers(0, 1_000),
)
@settings(deadline=None)
def test_exploration_stays_among_the_offered(offered: list[bool], epsilon: float, seed: int) -> None:
    learner = agent(seed=seed)
    observations = np.random.default_rng(seed).random((20, SIZE), np.float32)
    assert all(offered[action] for action in learner.act(observations, masks(20, *offered), epsilon).actions)


def masks(rows: int, *offered: bool) -> np.ndarray:
    return np.tile(np.array(offered, np.bool_), (rows, 1))


@given(
    seed=st.integers(0, 1_000),
    epsilon=st.sampled_from([0.0, 0.3, 1.0]),
    offered=st.lists(
        st.lists(st.booleans(), min_size=ACTIONS, max_size=ACTIONS).filter(any), min_size=1, max_size=9
    ),
)
@settings(max_examples=60, deadline=None)
def test_exploring_actions_are_those_that_are_drawn_one_after_another(
    seed: int, epsilon: float, offered: list[list[bool]]
) -> None:
    learner, rng = agent(seed=seed), np.random.default_rng(seed)
    values, free = np.zeros((len(offered), ACTIONS), np.float32), np.array(offered)
    for _ in range(3):
        choice = learner.choose(values, free, epsilon)
        expected = free.argmax(axis=1)
        for row in np.flatnonzero(rng.random(len(free)) < epsilon):
            expected[row] = rng.choice(np.flatnonzero(free[row]))
        assert choice.actions.tolist() == expected.tolist()


def test_exploration_reaches_each_offered_action_evenly() -> None:
    taken = agent().act(np.zeros((2_000, SIZE), np.float32), masks(2_000, True, False, True), 1.0).actions
    counts = np.bincount(taken, minlength=3)
    assert counts[1] == 0
    assert abs(counts[0] - counts[2]) < 200


def test_exploration_happens_at_the_given_rate() -> None:
    learner, observations = agent(), np.zeros((3_000, SIZE), np.float32)
    offered = masks(3_000, True, True, True)
    greedy = learner.act(observations, offered, 0.0).actions
    explored = learner.act(observations, offered, 0.3)
    assert (greedy == greedy[0]).all()
    assert (explored.preferred == greedy[0]).all()
    assert (explored.actions != greedy).mean() == pytest.approx(0.3 * 2 / 3, abs=0.03)


def test_nothing_offered_is_an_error() -> None:
    offered = np.array([[True, True, True], [False, False, False]])
    with pytest.raises(ValueError, match="no action is offered"):
        greedy_choice(np.zeros((2, ACTIONS), np.float32), offered)
    with pytest.raises(ValueError, match="no action is offered"):
        agent().act(np.zeros((2, SIZE), np.float32), offered, 1.0)


@pytest.mark.parametrize("epsilon", [0.0, 1.0])
def test_an_observation_that_is_not_finite_is_an_error(epsilon: float) -> None:
    observations = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, np.nan, 0.0, 0.0]], np.float32)
    with pytest.raises(ValueError, match="not finite"):
        agent().act(observations, masks(2, True, True, True), epsilon)


def test_q_values_that_are_not_finite_are_an_error() -> None:
    learner = agent()
    plain(learner.network).parameters.fill_(torch.nan)
    with pytest.raises(DivergedError, match="Q-values"):
        learner.act(np.zeros((1, SIZE), np.float32), masks(1, True, True, True), 1.0)


def test_a_loss_that_is_not_finite_leaves_the_weights() -> None:
    learner = agent()
    before = plain(learner.network).parameters.clone()
    batch = random_batch(0)
    with pytest.raises(DivergedError, match="loss is inf at update 1"):
        learner.update(batch._replace(rewards=torch.full_like(batch.rewards, 1e30)))
    assert torch.equal(plain(learner.network).parameters, before)


def largest_change(learner: DqnAgent, batch: Batch) -> float:
    before = plain(learner.network).parameters.clone()
    learner.update(batch)
    return float((plain(learner.network).parameters - before).abs().max())


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


@pytest.mark.parametrize("bootstrap", ["all", "safe"])
def test_an_update_agrees_with_autograd_and_plain_adam(bootstrap: Bootstrap) -> None:
    learner = agent(bootstrap=bootstrap, target_every=3)
    learner.learning_rate = 0.01
    network = plain_network(learner)
    frozen = copy.deepcopy(network)
    optimiser = torch.optim.Adam(network.parameters(), lr=0.01)
    for step in range(7):
        batch = random_batch(step)
        next_values = frozen(batch.next_observations).detach()
        if bootstrap == "safe":
            next_values = next_values.where(batch.next_masks, torch.tensor(-1e9))
        future = torch.where(batch.terminated, 0.0, next_values.max(dim=1).values)
        taken = network(batch.observations)[torch.arange(16), batch.actions]
        loss = ((batch.rewards + 0.95 * future - taken) ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        assert learner.update(batch) == pytest.approx(loss.item(), rel=1e-4)
        if step % 3 == 2:
            frozen = copy.deepcopy(network)
    for mine, reference in zip(plain(learner.network).layers, linear_layers(network), strict=True):
        torch.testing.assert_close(mine.weight.t(), reference.weight.detach(), rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(mine.bias, reference.bias.detach(), rtol=1e-4, atol=1e-5)


def plain_network(learner: DqnAgent) -> torch.nn.Sequential:
    """The agent's network from PyTorch's own modules."""
    nn = torch.nn
    made = nn.Sequential(nn.Linear(SIZE, 8), nn.ReLU(), nn.Linear(8, 8), nn.ReLU(), nn.Linear(8, ACTIONS))
    for module, layer in zip(linear_layers(made), plain(learner.network).layers, strict=True):
        module.weight.data.copy_(layer.weight.t())
        module.bias.data.copy_(layer.bias)
    return made


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
    observations, offered = np.full((4, SIZE), 0.3, np.float32), masks(4, True, True, True)
    for step in range(6, 12):
        assert learner.update(random_batch(step)) == restored.update(random_batch(step))
        mine, same = (one.act(observations, offered, 0.5).actions for one in (learner, restored))
        assert mine.tolist() == same.tolist()


def test_equal_seeds_give_equal_weights() -> None:
    assert torch.equal(plain(agent(seed=3).network).parameters, plain(agent(seed=3).network).parameters)
    assert not torch.equal(plain(agent(seed=3).network).parameters, plain(agent(seed=4).network).parameters)


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
    assert plain(learner.network).sizes == (10, 256, 256, 3)
    for weight, bias in plain(learner.network).layers:
        bound = weight.shape[0] ** -0.5
        assert 0.9 * bound < weight.abs().max().item() <= bound
        assert 0.0 < bias.abs().max().item() <= bound


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_a_gpu_learns_the_same() -> None:
    here, there = (
        agent(target_every=3, bootstrap="safe"),
        agent(target_every=3, bootstrap="safe", device="cuda"),
    )
    for step in range(7):
        batch = random_batch(step)
        loss = there.update(Batch(*(field.cuda() for field in batch)))
        assert loss == pytest.approx(here.update(batch), rel=1e-3)
    observations = np.random.default_rng(0).random((5, SIZE), np.float32)
    np.testing.assert_allclose(
        there.policy.values(observations), here.policy.values(observations), rtol=1e-2, atol=1e-3
    )
    restored = agent(seed=9)
    restored.set_state(there.get_state())
    assert torch.equal(plain(restored.network).parameters, plain(there.network).parameters.cpu())
