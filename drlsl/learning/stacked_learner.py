"""Several agents that choose and learn side by side."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from drlsl.driving.drivers import Choice
from drlsl.learning.adam import Adam
from drlsl.learning.config import LearningConfig
from drlsl.learning.dqn import DqnAgent, Lesson, Sight, td_targets
from drlsl.learning.loss import td_loss
from drlsl.learning.network import Network, QNetwork, check_finite
from drlsl.learning.network_stack import NetworkStack, Values
from drlsl.learning.replay import Batch, Replay


class StackedLearner:
    """Makes the choices and the updates of agents that are alike but for their seeds, each from its memory.

    An agent is named by its place in the stack. All that is random, and all that an agent knows, stays its
    own; what they share are calls.
    """

    def __init__(
        self,
        learners: Sequence[tuple[DqnAgent, Replay]],
        learning: LearningConfig,
        *,
        batched: bool | None = None,
    ) -> None:
        """Move the agents' networks; `batched`: as in `NetworkStack`, by default on a device only.

        Raises:
            TypeError: an agent has another network than fully connected layers without noise, or learns in
                another precision than float32.
        """
        self._agents = [agent for agent, _ in learners]
        self._replays = [replay for _, replay in learners]
        self._learning = learning
        if any(agent.precision != "float32" for agent in self._agents):
            raise TypeError("expected agents that learn in float32")
        networks, targets = (
            [_plain(network) for network in alike]
            for alike in (
                [agent.network for agent in self._agents],
                [agent.target for agent in self._agents],
            )
        )
        self._device = networks[0].parameters.device
        self._batched = self._device.type != "cpu" if batched is None else batched
        rows = learning.batch_size
        self._networks = NetworkStack(networks, rows=rows, batched=self._batched)
        self._targets = NetworkStack(targets, rows=rows, batched=self._batched)
        for agent in self._agents:
            agent.renew_optimiser()

    @torch.inference_mode()
    def act(self, sights: Mapping[int, Sight]) -> dict[int, Choice]:
        """Choose as `DqnAgent.act` does, each agent by what it sees.

        Raises:
            ValueError: an observation is not finite, or no action is offered.
            DivergedError: a Q-value is not finite.
        """
        if not self._batched:
            return {place: self._agents[place].act(*sight) for place, sight in sights.items()}
        observations = np.stack([sight.observations for sight in sights.values()])
        check_finite(observations)
        seen = torch.from_numpy(observations).to(self._device)
        values = self._networks.forward(list(sights), seen)[-1].cpu().numpy()
        return {
            place: self._agents[place].choose(mine, sight.offered, sight.epsilon)
            for (place, sight), mine in zip(sights.items(), values, strict=True)
        }

    def learn(self, due: Mapping[int, int]) -> dict[int, list[float]]:
        """Make the updates that are due, each agent's on minibatches of its own; return their losses.

        Raises:
            DivergedError: a loss is not finite; the weights of all are those of the update before.
        """
        lessons = {
            place: self._agents[place].lessons(self._replays[place], updates)
            for place, updates in due.items()
        }
        losses: dict[int, list[float]] = {place: [] for place in due}
        for number in range(max(due.values(), default=0)):
            now = {place: next(lessons[place]) for place, updates in due.items() if updates > number}
            for place, loss in zip(now, self._update(now), strict=True):
                losses[place].append(loss)
        return losses

    @torch.inference_mode()
    def _update(self, lessons: Mapping[int, Lesson]) -> list[float]:
        """Take a step of Adam with each agent that has a lesson; return the losses."""
        places, agents = list(lessons), [self._agents[place] for place in lessons]
        batches = [lesson.batch for lesson in lessons.values()]
        targets = self._targets_of(places, list(lessons.values()))
        seen = [batch.observations for batch in batches]
        observations: Values = torch.stack(seen) if self._batched else seen
        outputs = self._networks.forward(places, observations)
        loss = td_loss(outputs[-1], torch.stack([batch.actions for batch in batches]), targets)
        losses = [agent.checked(one) for agent, one in zip(agents, loss.value.tolist(), strict=True)]
        self._networks.backward(places, observations, outputs, loss.slopes)
        Adam.step_all([agent.optimiser for agent in agents if isinstance(agent.optimiser, Adam)])
        for agent in agents:
            agent.count_update()
        return losses

    def _targets_of(self, places: Sequence[int], lessons: Sequence[Lesson]) -> torch.Tensor:
        """Return the targets of the lessons. Shape: (K, B)."""
        known = [lesson.targets for lesson in lessons if lesson.targets is not None]
        if len(known) == len(lessons):
            return torch.stack(known)
        fields = zip(*(lesson.batch for lesson in lessons), strict=True)
        batch = Batch(*(torch.stack(field) for field in fields))
        next_values = self._targets.forward(places, batch.next_observations)[-1]
        return td_targets(next_values, batch, self._learning.discount, self._learning.bootstrap)


def _plain(network: Network) -> QNetwork:
    if not isinstance(network, QNetwork):
        raise TypeError("expected networks of fully connected layers")
    return network
