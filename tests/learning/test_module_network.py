"""Modules of the user's own: they learn as they would by PyTorch alone, and go on as they were."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from drlsl.errors import UserError
from drlsl.learning import RunFolder, Session, architectures, load_policy, load_state
from drlsl.learning.config import LearningConfig, NetworkConfig, TrainConfig, make_config, merged
from drlsl.learning.divergence import DivergedError
from drlsl.learning.dqn import DqnAgent
from drlsl.learning.module_network import ModuleNetwork
from drlsl.learning.network import NoisyQNetwork, QNetwork

from . import networks
from .fake import fakes
from .test_dqn import ACTIONS, SIZE, masks, random_batch
from .test_session import assert_same_outcome, train_whole

OWN = f"{networks.__name__}:"
LEARNERS: list[dict[str, Any]] = [
    {"factory": "dueling", "hidden": [8, 8]},
    {"factory": "dueling", "hidden": [8], "noisy": True, "window": 2},
    {"factory": OWN + "wide", "arguments": {"width": 12}},
    {"factory": OWN + "dropping"},
    {"factory": OWN + "Recurrent", "window": 3},
    {"factory": OWN + "Frozen"},
    {"factory": "mlp", "hidden": [8], "window": 4},
]
IDS = ["dueling", "noisy", "wide", "dropping", "recurrent", "frozen", "window"]


def agent(
    network: dict[str, Any], *, seed: int = 0, target_every: int = 3, bootstrap: str = "all"
) -> DqnAgent:
    learning = {"batch_size": 16, "learning_starts": 16, "target_every": target_every, "bootstrap": bootstrap}
    learner = DqnAgent(
        SIZE,
        ACTIONS,
        NetworkConfig.model_validate(network),
        LearningConfig.model_validate(learning),
        rng=np.random.default_rng(seed),
        generator=torch.Generator().manual_seed(seed),
        device=torch.device("cpu"),
    )
    learner.learning_rate = 0.01
    return learner


def module_of(learner: DqnAgent) -> nn.Module:
    assert isinstance(learner.network, ModuleNetwork)
    return learner.network.module


def as_plain(learner: DqnAgent) -> nn.Module:
    """The fast network of an agent as a plain module with the same parameters."""
    fast = learner.network
    assert isinstance(fast, QNetwork)
    plain = architectures.mlp(SIZE, ACTIONS, fast.sizes[1:-1], noisy=isinstance(fast, NoisyQNetwork))
    stored = list(learner.network.get_state().values())
    for mine, value in zip(in_order(plain), stored, strict=True):
        mine.data.copy_(value)
    return plain


def in_order(plain: nn.Module) -> list[nn.Parameter]:
    """The parameters of a plain network as the fast one's state has them: all means, then all spreads."""
    named = list(plain.named_parameters())
    means = [parameter for key, parameter in named if not key.endswith("_spread")]
    return means + [parameter for key, parameter in named if key.endswith("_spread")]


@given(
    hidden=st.lists(st.integers(1, 12), min_size=1, max_size=3),
    seed=st.integers(0, 1_000),
    bootstrap=st.sampled_from(["all", "safe"]),
)
@settings(max_examples=12, deadline=None)
def test_the_fast_network_learns_as_the_plain_one(hidden: list[int], seed: int, bootstrap: str) -> None:
    """Parameters after several updates, the target's copies among them, are those of autograd and Adam."""
    fast = agent({"hidden": hidden}, seed=seed, bootstrap=bootstrap)
    slow = agent({"factory": OWN + "wide"}, bootstrap=bootstrap)
    assert isinstance(slow.network, ModuleNetwork)
    for name in ("network", "target"):
        setattr(slow, name, ModuleNetwork(as_plain(fast), "plain", (SIZE,), slow.network._stream))
    slow.optimiser = slow.network.optimiser()
    slow.learning_rate = fast.learning_rate
    for step in range(7):
        batch = random_batch(seed + step)
        assert slow.update(batch) == pytest.approx(fast.update(batch), rel=1e-4, abs=1e-6)
    for mine, theirs in zip(fast.network.get_state().values(), in_order(module_of(slow)), strict=True):
        torch.testing.assert_close(mine, theirs.detach(), rtol=1e-3, atol=1e-4)


@given(seed=st.integers(0, 1_000))
@settings(max_examples=25, deadline=None)
def test_the_fast_noisy_network_has_the_gradient_of_the_plain_one(seed: int) -> None:
    fast = agent({"hidden": [7, 5], "noisy": True}, seed=seed)
    network = fast.network
    assert isinstance(network, NoisyQNetwork)
    plain = as_plain(fast)
    network.draw_noise()
    layers = [part for part in plain.modules() if isinstance(part, architectures.NoisyLinear)]
    for layer, drawn in zip(layers, network._noise_layers, strict=True):
        outputs = drawn.bias
        inputs = drawn.weight[:, 0] / outputs[0]
        layer.noise.copy_(torch.cat([inputs, outputs]))
    generator = torch.Generator().manual_seed(seed)
    observations = torch.rand(6, SIZE, generator=generator)
    slopes = torch.randn(6, ACTIONS, generator=generator)
    outputs_of = network.forward(observations)
    network.backward(observations, outputs_of, slopes)
    values = plain(observations)
    torch.autograd.backward(values, slopes)
    torch.testing.assert_close(outputs_of[-1], values.detach(), rtol=1e-3, atol=1e-4)
    mean, spread = network.gradient.chunk(2)
    network.parameters.copy_(torch.cat([mean, spread]))
    network._spread.copy_(spread)
    for mine, theirs in zip(network.get_state().values(), in_order(plain), strict=True):
        torch.testing.assert_close(mine, theirs.grad, rtol=1e-2, atol=1e-3)


def test_a_module_learns_as_by_pytorch_alone_to_the_bit() -> None:
    learner = agent({"factory": OWN + "wide"}, bootstrap="safe")
    network = copy.deepcopy(module_of(learner))
    frozen = copy.deepcopy(network)
    optimiser = torch.optim.Adam(network.parameters(), lr=0.01, fused=True)
    for step in range(7):
        batch = random_batch(step)
        next_values = frozen(batch.next_observations).detach().masked_fill(~batch.next_masks, -torch.inf)
        future = next_values.amax(dim=1).masked_fill(batch.terminated, 0.0)
        targets = torch.add(batch.rewards, future, alpha=0.95)
        loss = nn.functional.mse_loss(network(batch.observations)[torch.arange(16), batch.actions], targets)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        assert learner.update(batch) == loss.item()
        if step % 3 == 2:
            frozen = copy.deepcopy(network)
    for mine, reference in zip(module_of(learner).parameters(), network.parameters(), strict=True):
        assert torch.equal(mine, reference)


def windows(batch: Any, window: int) -> Any:
    """A minibatch whose observations are windows."""
    return batch._replace(
        observations=batch.observations.repeat(1, window),
        next_observations=batch.next_observations.repeat(1, window),
    )


@pytest.mark.parametrize("network", LEARNERS, ids=IDS)
def test_every_learner_moves_and_carries_over(network: dict[str, Any], tmp_path: Path) -> None:
    window = network.get("window", 1)
    batches = [windows(random_batch(step), window) for step in range(12)]
    observations, offered = np.full((4, window * SIZE), 0.3, np.float32), masks(4, True, True, True)
    learner, restored = agent(network, seed=1), agent(network, seed=2)
    before = learner.policy.values(observations)
    for batch in batches[:5]:
        learner.update(batch)
        learner.act(observations, offered, 0.5)
    assert before.tolist() != learner.policy.values(observations).tolist()
    learner.learning_rate = 0.02
    restored.set_state(copy.deepcopy(learner.get_state()))
    assert restored.learning_rate == 0.02
    torch.rand(7)  # What others draw meanwhile changes nothing.
    for batch in batches[5:]:
        first = learner.update(batch)
        torch.rand(3)
        assert first == restored.update(batch)
        mine, same = (one.act(observations, offered, 0.5).actions for one in (learner, restored))
        assert mine.tolist() == same.tolist()


@pytest.mark.parametrize("network", LEARNERS, ids=IDS)
def test_equal_seeds_give_equal_networks_and_leave_pytorchs_numbers(network: dict[str, Any]) -> None:
    observations = np.full((2, network.get("window", 1) * SIZE), 0.4, np.float32)
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    first, again, other = (agent(network, seed=seed).policy.values(observations) for seed in (1, 1, 2))
    assert torch.equal(torch.rand(3), expected)
    assert first.tolist() == again.tolist()
    assert first.tolist() != other.tolist()


def test_noise_is_there_in_training_and_not_in_what_is_stored() -> None:
    network = {"factory": "dueling", "hidden": [8], "noisy": True}
    learner, other = agent(network, seed=1), agent(network, seed=2)
    observations, offered = np.full((1, SIZE), 0.5, np.float32), masks(1, True, True, True)
    still = learner.policy.values(observations)
    learner.act(observations, offered, 0.0)
    one = learner.policy.values(observations)
    learner.act(observations, offered, 0.0)
    assert still.tolist() != one.tolist() != learner.policy.values(observations).tolist()
    other.network.set_state(learner.network.get_state())
    assert other.policy.values(observations).tolist() == still.tolist()


@pytest.mark.parametrize("noisy", [False, True])
def test_modes_are_those_of_training_and_of_driving(noisy: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """What has noise of its own drives in training mode too, for it explores by that."""
    learner = agent({"factory": "dueling", "hidden": [8], "noisy": noisy})
    modes: list[bool] = []
    forward = architectures.Dueling.forward

    def noted(module: architectures.Dueling, observations: torch.Tensor) -> torch.Tensor:
        modes.append(module.training)
        return forward(module, observations)

    monkeypatch.setattr(architectures.Dueling, "forward", noted)
    learner.act(np.zeros((1, SIZE), np.float32), masks(1, True, True, True), 0.0)
    learner.update(random_batch(0))
    # The target network is asked before the one that learns.
    assert modes == [noisy, noisy, True]


def test_a_gradient_that_is_not_finite_leaves_the_weights() -> None:
    learner = agent({"factory": OWN + "RootOfZero"})
    before = copy.deepcopy(module_of(learner).state_dict())
    with pytest.raises(DivergedError, match=r"the gradient is not finite: train again with a lower"):
        learner.update(random_batch(0))
    assert all(torch.equal(value, before[key]) for key, value in module_of(learner).state_dict().items())


def test_dueling_takes_advantages_about_their_mean() -> None:
    module = architectures.dueling(SIZE, ACTIONS, (6, 5))
    assert isinstance(module, architectures.Dueling)
    observations = torch.rand(7, SIZE)
    features = module.shared(observations)
    torch.testing.assert_close(module(observations).mean(dim=1, keepdim=True), module.value(features))
    assert sum(parameter.numel() for parameter in module.parameters()) == sum(
        (SIZE * 6 + 6, 6 * 5 + 5, 5 + 1, 6 * 5 + 5, 5 * ACTIONS + ACTIONS)
    )


def trained(tiny: TrainConfig, network: dict[str, Any], **more: Any) -> TrainConfig:
    values = tiny.model_dump()
    del values["network"]
    return make_config(merged(values, {"network": network, **more}), "test")


@pytest.mark.usefixtures("fake_driving")
@pytest.mark.parametrize("network", LEARNERS, ids=IDS)
@pytest.mark.parametrize("num_envs", [1, 3])
def test_a_stopped_and_resumed_run_is_bit_identical(
    tmp_path: Path, tiny_config: TrainConfig, network: dict[str, Any], num_envs: int
) -> None:
    config = trained(tiny_config, network, num_envs=num_envs)
    train_whole(tmp_path / "whole", config)
    with Session.start(tmp_path / "run", config) as session:
        for _ in session.run(lambda: session.trainer.total_steps >= 37):
            pass
    torch.rand(3)
    with Session.resume(tmp_path / "run") as resumed:
        for _ in resumed.run():
            pass
    assert_same_outcome(tmp_path / "whole", tmp_path / "run")
    made_by = load_state(tmp_path / "run" / "policy.pt", "policy")["made_by"]
    assert NetworkConfig.model_validate(made_by) == config.network
    policy = load_policy(RunFolder.open(tmp_path / "run"), fakes(2))
    assert policy.window == config.network.window
    shown = np.random.default_rng(0).random((2, 10 * policy.window), np.float32)
    again = load_policy(RunFolder.open(tmp_path / "whole"), fakes(2))
    assert policy.values(shown).tolist() == again.values(shown).tolist()


@pytest.mark.usefixtures("fake_driving")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("nn.Tanh()", "makes another network than when the weights were saved"),
        ("nn.Sequential(nn.ReLU(), nn.Linear(9, 9))", r"the weights do not fit the network: 1\.1\.bias"),
        ("nn.ReLU", "forward pass fails|cannot make"),
    ],
)
def test_code_that_was_changed_is_noticed(
    tmp_path: Path, tiny_config: TrainConfig, change: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (
        "from torch import nn\n"
        "def make(size, actions):\n"
        "    return nn.Sequential(nn.Linear(size, 9), {}, nn.Linear(9, actions))\n"
    )
    monkeypatch.chdir(tmp_path)
    Path("nets.py").write_text(text.format("nn.ReLU()"))
    train_whole(tmp_path / "run", trained(tiny_config, {"factory": "nets.py:make"}))
    Path("nets.py").write_text("# The same.\n" + text.format("nn.ReLU(inplace=True)"))
    load_policy(RunFolder.open(tmp_path / "run"), fakes(1))
    Path("nets.py").write_text(text.format(change))
    for again in (
        lambda: load_policy(RunFolder.open(tmp_path / "run"), fakes(1)),
        lambda: Session.resume(tmp_path / "run"),
    ):
        with pytest.raises(UserError, match=message) as refusal:
            again()
        assert "\n" not in str(refusal.value)
    Path("nets.py").unlink()
    with pytest.raises(UserError, match=r"network\.factory nets\.py:make: no file nets\.py in "):
        load_policy(RunFolder.open(tmp_path / "run"), fakes(1))


@pytest.mark.usefixtures("fake_driving")
def test_a_policy_of_before_is_read(tmp_path: Path, tiny_config: TrainConfig) -> None:
    """Written without word of what made it, for there was one kind of network, in the layout of today."""
    train_whole(tmp_path / "run", tiny_config)
    from drlsl.learning.checkpoint import save_state

    state = load_state(tmp_path / "run" / "policy.pt", "policy")
    kept = {key: value for key, value in state.items() if key in ("episodes", "network")}
    save_state(tmp_path / "run" / "policy.pt", "policy", kept)
    path = tmp_path / "run" / "config.yaml"
    lines = path.read_text().splitlines(keepends=True)[:-1]
    path.write_text(
        "".join(
            line for line in lines if line.split(":")[0].strip() not in ("factory", "arguments", "window")
        )
    )
    load_policy(RunFolder.open(tmp_path / "run"), fakes(1))


def test_a_window_shows_what_came_before(tiny_config: TrainConfig) -> None:
    from drlsl.learning.fleet import Fleet

    env, plain = fakes(2), fakes(2)
    fleet = Fleet(env, episodes=9, seed=3, window=3)
    single = Fleet(plain, episodes=9, seed=3)
    seen: list[list[np.ndarray]] = [[], []]
    for _ in range(120):
        over = single._over.copy()
        fleet.begin()
        single.begin()
        for row in range(2):
            if over[row]:
                seen[row] = [single.observations[row]] * 3
            np.testing.assert_array_equal(fleet.observations[row], np.concatenate(seen[row][-3:]))
        outcomes = [one.step(np.zeros(2, np.int64)) for one in (fleet, single)]
        assert outcomes[0].over.tolist() == outcomes[1].over.tolist()
        for row in range(2):
            seen[row].append(single.observations[row])
