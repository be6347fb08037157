"""Rates that change over a training run."""

from dataclasses import dataclass

from drlsl.learning.config import TrainConfig


@dataclass(frozen=True, slots=True)
class LinearSchedule:
    """A value that changes linearly from `start` to `end` and stays there.

    Source: paper, Algorithm 1, line 17.
    """

    start: float
    end: float
    duration: float
    """Number of episodes from the first value to the last; 0 keeps the first value."""

    def __call__(self, episode: int) -> float:
        """Return the value in an episode, counted from 0."""
        if episode >= self.duration > 0.0:
            return self.end
        progress = episode / self.duration if self.duration > 0.0 else 0.0
        return self.start + (self.end - self.start) * progress


def learning_rate_schedule(config: TrainConfig) -> LinearSchedule:
    """Return Adam's learning rate by episode."""
    schedule = config.schedule
    return LinearSchedule(schedule.learning_rate_start, schedule.learning_rate_end, _duration(config))


def epsilon_schedule(config: TrainConfig) -> LinearSchedule:
    """Return the exploration rate ε by episode; 0 if noise in the weights explores instead."""
    schedule = config.schedule
    if config.network.noisy:
        return LinearSchedule(0.0, 0.0, 0.0)
    return LinearSchedule(schedule.epsilon_start, schedule.epsilon_end, _duration(config))


def _duration(config: TrainConfig) -> float:
    """Return the episodes of decay: with fraction 1 only the last episode has the end value."""
    return config.schedule.fraction * (config.episodes - 1)
