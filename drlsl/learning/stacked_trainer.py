"""Trainings of several seeds in lockstep."""

from collections.abc import Iterator, Mapping, Sequence

from drlsl.errors import UserError
from drlsl.learning.config import TrainConfig
from drlsl.learning.stacked_learner import StackedLearner
from drlsl.learning.trainer import StepEvent, Trainer


def check_stackable(config: TrainConfig) -> None:
    """Check that trainings with a configuration can be made in lockstep.

    Raises:
        UserError: they cannot; the message names the setting.
    """
    network, learning = config.network, config.learning
    for setting, value, expected in (
        ("network.factory", network.factory, "mlp"),
        ("network.noisy", network.noisy, False),
        ("learning.precision", learning.precision, "float32"),
        ("learning.overlap", learning.overlap, False),
    ):
        if value != expected:
            shown = [str(one).lower() if isinstance(one, bool) else one for one in (value, expected)]
            raise UserError(
                f"{setting} is {shown[0]}: seeds are stacked with {shown[1]} only; train them one by one"
            )


class StackedTrainer:
    """Trains agents that differ in their seed alone, step by step together.

    Each trainer keeps its environments, its memory, its random streams and its state; a step of all of them
    is what a step of each would be. They need not have come equally far.
    """

    def __init__(self, trainers: Sequence[Trainer], config: TrainConfig) -> None:
        """Begin to train together; `config`: that of one of them.

        Raises:
            UserError: as `check_stackable`.
        """
        check_stackable(config)
        self._trainers = trainers
        self._config = config
        self._learner = StackedLearner(
            [(trainer.agent, trainer.replay) for trainer in trainers], config.learning
        )

    def run(self) -> Iterator[Mapping[int, StepEvent]]:
        """Train until all are done; yield what a step brought, by the place of each that took one.

        Raises:
            DivergedError: a Q-value or a loss is not finite.
            ValueError: an environment gave an observation that is not finite, or offered no action.
        """
        while training := self._training():
            yield self._step(training)

    def _training(self) -> dict[int, Trainer]:
        """Return those that are not done, by their places."""
        last = self._config.episodes
        return {place: one for place, one in enumerate(self._trainers) if one.finished < last}

    def _step(self, training: Mapping[int, Trainer]) -> dict[int, StepEvent]:
        sights = {place: one.look() for place, one in training.items()}
        choices = self._learner.act(sights)
        turns = {place: one.drive(sights[place], choices[place]) for place, one in training.items()}
        losses = self._learner.learn(
            {place: one.updates_due(turns[place].driven) for place, one in training.items()}
        )
        return {place: one.close(turns[place], losses[place]) for place, one in training.items()}
