"""Fixtures of the learner's tests."""

from typing import Any

import pytest
from gymnasium.vector import AutoresetMode

from drlsl import driving
from drlsl.driving import EnvConfig
from drlsl.learning.config import TrainConfig, make_config

from .fake import FakeVector, fakes


@pytest.fixture
def tiny_config() -> TrainConfig:
    """A training of a few short episodes with a small network."""
    return small_config()


def small_config() -> TrainConfig:
    """The same, for tests that cannot take a fixture."""
    return make_config(
        {
            "episodes": 6,
            "checkpoint_every": 2,
            "device": "cpu",
            "network": {"hidden": [16]},
            "learning": {"batch_size": 8, "learning_starts": 8, "target_every": 10, "replay_capacity": 100},
            "schedule": {"epsilon_start": 0.5},
            "evaluation": {"episodes": 2, "episodes_after_training": 2},
        },
        "test",
    )


@pytest.fixture
def fake_driving(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let configurations make the fake environment."""

    def make_vec(config: EnvConfig, num_envs: int, mode: AutoresetMode, **_: Any) -> FakeVector:
        assert mode is AutoresetMode.DISABLED
        return fakes(num_envs, config.track_length or 840.0)

    # Not setattr, which would first load the real environment only to remember it.
    monkeypatch.setitem(vars(driving), "make_vec", make_vec)
