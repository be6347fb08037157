"""Seeds that are trained together: the same as each alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.learning import StackedTrainer, StepEvent, Trainer, check_stackable
from drlsl.learning.adam import Adam
from drlsl.learning.config import TrainConfig, make_config, merged
from drlsl.learning.divergence import DivergedError
from drlsl.learning.network import QNetwork
from drlsl.learning.network_stack import NetworkStack
from drlsl.learning.stacked_learner import StackedLearner

from .conftest import small_config
from .fake import fakes
from .layers import plain
from .test_trainer import comparable

CPU = torch.device("cpu")


def configs(count: int, **values: Any) -> list[TrainConfig]:
    base = merged(small_config().model_dump(), values)
    return [make_config(merged(base, {"seed": seed}), "test") for seed in range(count)]


def trainers(of: Sequence[TrainConfig]) -> list[Trainer]:
    return [Trainer(fakes(config.num_envs), config) for config in of]


def weights(trainer: Trainer) -> torch.Tensor:
    return plain(trainer.agent.network).parameters


def plain_values(event: StepEvent) -> tuple[Any, ...]:
    """All of an event but wall times."""
    return event.total_steps, list(event.losses), [comparable(episode) for episode in event.ended]


@given(
    seeds=st.integers(1, 4),
    num_envs=st.integers(1, 4),
    hidden=st.lists(st.integers(1, 40), min_size=1, max_size=3),
    batch=st.integers(1, 16),
    every=st.integers(1, 12),
)
@settings(max_examples=12, deadline=None)
def test_each_seed_learns_as_it_does_alone(
    seeds: int, num_envs: int, hidden: list[int], batch: int, every: int
) -> None:
    learning = {"batch_size": batch, "learning_starts": batch, "target_every": every}
    of = configs(seeds, episodes=4, num_envs=num_envs, network={"hidden": hidden}, learning=learning)
    alone, together = trainers(of), trainers(of)
    expected = [[plain_values(event) for event in one.run()] for one in alone]
    found: list[list[tuple[Any, ...]]] = [[] for _ in of]
    for step in StackedTrainer(together, of[0]).run():
        for place, event in step.items():
            found[place].append(plain_values(event))
    assert found == expected
    for mine, theirs in zip(together, alone, strict=True):
        assert torch.equal(weights(mine), weights(theirs))
        assert mine.agent.updates == theirs.agent.updates > 0


@pytest.mark.parametrize("stop_after", [0, 7, 40])
def test_seeds_that_have_come_unequally_far_go_on_bit_for_bit(stop_after: int) -> None:
    of = configs(3, num_envs=2)
    alone, together = trainers(of), trainers(of)
    for one in alone:
        list(one.run())
    ahead = together[1].run()
    for _ in range(stop_after):
        next(ahead)
    list(StackedTrainer(together, of[0]).run())
    assert [weights(one).tolist() for one in together] == [weights(one).tolist() for one in alone]


def learners(count: int, *, kept: bool = True) -> list[Trainer]:
    """Trainers with a few transitions in their memories."""
    found = trainers(configs(count, episodes=60, num_envs=2, learning={"target_every": 3}))
    for one in found:
        one.agent.keeps_targets = kept
        steps = one.run()
        while one.total_steps < 20:
            next(steps)
    return found


@pytest.mark.parametrize("kept", [True, False], ids=["kept targets", "computed targets"])
def test_products_of_all_seeds_at_once_are_those_of_each(kept: bool) -> None:
    alone, together = learners(4, kept=kept), learners(4, kept=kept)
    learning = small_config().learning
    stack = StackedLearner([(one.agent, one.replay) for one in together], learning, batched=True)
    for due in ({0: 2, 1: 2, 2: 2, 3: 2}, {0: 2, 2: 1, 3: 2}, {1: 1}):
        rates = {place: 0.001 * (1 + place % 2) for place in due}
        for place, updates in due.items():
            alone[place].agent.learning_rate = together[place].agent.learning_rate = rates[place]
            expected = alone[place].agent.learn(alone[place].replay, updates)
            due_losses = stack.learn({place: updates}) if len(due) == 1 else None
            if due_losses is not None:
                assert due_losses[place] == pytest.approx(expected, rel=1e-5)
        if len(due) > 1:
            stack.learn(due)
        for mine, theirs in zip(together, alone, strict=True):
            torch.testing.assert_close(weights(mine), weights(theirs), rtol=1e-4, atol=1e-6)
            assert mine.agent.updates == theirs.agent.updates


def test_choices_of_all_seeds_at_once_are_those_of_each() -> None:
    alone, together = learners(3), learners(3)
    stack = StackedLearner(
        [(one.agent, one.replay) for one in together], small_config().learning, batched=True
    )
    places = (0, 2)
    sights = {place: together[place].look() for place in places}
    choices = stack.act(sights)
    for place in places:
        expected = alone[place].agent.act(*alone[place].look())
        np.testing.assert_array_equal(choices[place].actions, expected.actions)
    blind = {0: sights[0]._replace(observations=sights[0].observations * np.float32(np.nan))}
    with pytest.raises(ValueError, match="not finite"):
        stack.act(blind)


@pytest.mark.parametrize("batched", [True, False])
def test_a_stack_changes_no_gradient_but_those_asked_for(batched: bool) -> None:
    networks = [QNetwork(5, (7, 6), 3, torch.Generator().manual_seed(seed), CPU) for seed in range(3)]
    single = [QNetwork(5, (7, 6), 3, torch.Generator().manual_seed(seed), CPU) for seed in range(3)]
    stack = NetworkStack(networks, rows=4, batched=batched)
    places, observations = [0, 2], torch.rand(2, 4, 5, generator=torch.Generator().manual_seed(9))
    slopes = torch.rand(2, 4, 3, generator=torch.Generator().manual_seed(8))
    outputs = stack.forward(places, observations)
    stack.backward(places, observations, outputs, slopes)
    assert not networks[1].gradient.any()
    for number, place in enumerate(places):
        alone = single[place].forward(observations[number])
        torch.testing.assert_close(outputs[-1][number], alone[-1])
        single[place].backward(observations[number], alone, slopes[number])
        torch.testing.assert_close(networks[place].gradient, single[place].gradient)


def test_steps_at_once_are_those_of_each_optimiser() -> None:
    def made() -> list[Adam]:
        numbers = torch.Generator().manual_seed(3)
        found = [Adam(*torch.randn(2, 37, generator=numbers)) for _ in range(4)]
        for one, rate in zip(found, (0.1, 0.2, 0.1, 0.3), strict=True):
            one.learning_rate = rate
        return found

    alone, together = made(), made()
    for _ in range(3):
        for one in alone:
            one.step()
        Adam.step_all(together)
    for one, other in zip(alone, together, strict=True):
        assert torch.equal(one._parameters, other._parameters)
        assert one.get_state()["steps"] == other.get_state()["steps"] == 3


def test_a_loss_that_is_not_finite_leaves_the_weights_of_all() -> None:
    together = learners(2)
    weights(together[1]).fill_(torch.inf)
    stack = StackedLearner([(one.agent, one.replay) for one in together], small_config().learning)
    before = weights(together[0]).clone()
    with pytest.raises(DivergedError, match="the loss is"):
        stack.learn({0: 1, 1: 1})
    assert torch.equal(weights(together[0]), before)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"learning": {"overlap": True}}, "learning.overlap is true: seeds are stacked with false only"),
        ({"learning": {"precision": "auto"}}, "learning.precision is auto"),
        ({"network": {"noisy": True}}, "network.noisy is true"),
        ({"network": {"factory": "dueling"}}, "network.factory is dueling: seeds are stacked with mlp only"),
    ],
)
def test_what_cannot_be_stacked_is_refused(values: dict[str, Any], told: str) -> None:
    (config,) = configs(1, **values)
    with pytest.raises(UserError, match=told):
        check_stackable(config)


def test_networks_of_another_kind_are_refused() -> None:
    for values in ({"network": {"noisy": True}}, {"network": {"factory": "dueling"}}):
        (one,) = trainers(configs(1, **values))
        with pytest.raises(TypeError, match="fully connected"):
            StackedLearner([(one.agent, one.replay)], small_config().learning)
