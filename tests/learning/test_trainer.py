from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
import torch

from drlsl.config import TrainConfig, make_config, merged
from drlsl.errors import UserError
from drlsl.learning.episode import EpisodeSummary
from drlsl.learning.trainer import EpisodeEvent, StepEvent, Trainer, make_learner, resolve_device

from .fake import LANES, FakeHighway


def changed(config: TrainConfig, **values: object) -> TrainConfig:
    return make_config(merged(config.model_dump(), values), "test")


def episodes(trainer: Trainer) -> Iterator[EpisodeEvent]:
    return (event for event in trainer.run() if isinstance(event, EpisodeEvent))


def comparable(event: EpisodeEvent) -> tuple[object, ...]:
    """All of an episode but its wall time."""
    return (event.episode, event.total_steps, event.summary, event.epsilon, event.learning_rate, event.loss)


class Recorder(gymnasium.Wrapper):  # type: ignore[type-arg]  # its four parameters say nothing here
    """Notes each action with the mask it was chosen under, and each seed."""

    def __init__(self, env: FakeHighway) -> None:
        super().__init__(env)
        self.choices: list[tuple[int, np.ndarray]] = []
        self.seeds: list[int] = []

    def reset(self, *, seed=None, options=None):  # type: ignore[no-untyped-def]
        observation, info = self.env.reset(seed=seed, options=options)
        self.mask = info["action_mask"]
        self.seeds.append(seed)
        return observation, info

    def step(self, action):  # type: ignore[no-untyped-def]
        self.choices.append((action, self.mask))
        result = self.env.step(action)
        self.mask = result[4]["action_mask"]
        return result


def test_the_shield_keeps_to_the_mask(tiny_config: TrainConfig) -> None:
    env = Recorder(FakeHighway())
    summaries = [event.summary for event in episodes(Trainer(env, tiny_config))]
    assert all(mask[action] for action, mask in env.choices)
    assert not any(summary.off_road for summary in summaries)
    assert all(1.0 <= summary.mask_size <= LANES for summary in summaries)


def test_plain_dqn_leaves_the_mask(tiny_config: TrainConfig) -> None:
    env = Recorder(FakeHighway())
    summaries = [event.summary for event in episodes(Trainer(env, changed(tiny_config, method="dqn")))]
    assert not all(mask[action] for action, mask in env.choices)
    assert all(summary.mask_size == 3.0 for summary in summaries)


def test_each_step_and_each_episode_is_an_event(tiny_config: TrainConfig) -> None:
    events = list(Trainer(FakeHighway(), tiny_config).run())
    steps = [event for event in events if isinstance(event, StepEvent)]
    over = [event for event in events if isinstance(event, EpisodeEvent)]
    assert [event.total_steps for event in steps] == list(range(1, len(steps) + 1))
    assert [event.episode for event in over] == [1, 2, 3, 4, 5, 6]
    assert sum(event.summary.steps for event in over) == over[-1].total_steps == len(steps)
    learning_starts = tiny_config.learning.learning_starts
    assert [event.loss is not None for event in steps] == [
        event.total_steps >= learning_starts for event in steps
    ]


def test_an_episode_adds_up(tiny_config: TrainConfig) -> None:
    for event in episodes(Trainer(FakeHighway(), changed(tiny_config, method="dqn"))):
        summary: EpisodeSummary = event.summary
        terms = (
            summary.reward_lane_change,
            summary.reward_velocity,
            summary.reward_collision,
            summary.reward_off_road,
        )
        assert summary.total_return == pytest.approx(sum(terms))
        assert summary.reward_lane_change == -5.0 * summary.lane_changes
        assert summary.reward_velocity == pytest.approx(0.25 * summary.steps)
        assert summary.contact == (summary.reward_collision < 0.0) == bool(summary.contact_reason)
        assert summary.off_road == (summary.reward_off_road < 0.0)
        assert summary.mean_speed == 25.0
        assert summary.distance == 25.0 * summary.steps
        assert summary.interventions <= summary.steps


def test_rates_follow_their_schedules(tiny_config: TrainConfig) -> None:
    rows = list(episodes(Trainer(FakeHighway(), tiny_config)))
    assert [row.learning_rate for row in rows] == pytest.approx(np.linspace(0.01, 1e-4, 6))
    assert [row.epsilon for row in rows] == pytest.approx(np.linspace(0.5, 0.001, 6))


def test_a_run_is_a_function_of_its_seed(tiny_config: TrainConfig) -> None:
    first, second = (list(episodes(Trainer(FakeHighway(), tiny_config))) for _ in range(2))
    other = list(episodes(Trainer(FakeHighway(), changed(tiny_config, seed=1))))
    assert [comparable(event) for event in first] == [comparable(event) for event in second]
    assert [event.summary for event in first] != [event.summary for event in other]


def test_episodes_have_different_seeds(tiny_config: TrainConfig) -> None:
    env = Recorder(FakeHighway())
    list(Trainer(env, tiny_config).run())
    assert len(set(env.seeds)) == len(env.seeds) == 6


def test_a_state_between_episodes_goes_on_bit_for_bit(tiny_config: TrainConfig) -> None:
    whole = Trainer(FakeHighway(), tiny_config)
    expected = [comparable(event) for event in episodes(whole)]
    stopped = Trainer(FakeHighway(), tiny_config)
    for event in stopped.run():
        if isinstance(event, EpisodeEvent) and event.episode == 3:
            break
    resumed = Trainer(FakeHighway(), tiny_config)
    resumed.set_state(stopped.get_state())
    assert [comparable(event) for event in episodes(resumed)] == expected[3:]
    for mine, theirs in zip(
        whole.agent.network.parameters(), resumed.agent.network.parameters(), strict=True
    ):
        assert torch.equal(mine, theirs)


class Corridor(gymnasium.Env[np.ndarray, int]):
    """Six cells, a reward of 1 at the right end; "keep" stays, "left" and "right" move. At most 30 steps."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (6,), np.float32)
    action_space = gymnasium.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):  # type: ignore[no-untyped-def]
        super().reset(seed=seed)
        self._cell, self._steps = 0, 0
        return self._seen(), {"action_mask": np.ones(3, np.int8)}

    def step(self, action):  # type: ignore[no-untyped-def]
        self._cell = int(np.clip(self._cell + (0, -1, 1)[action], 0, 5))
        self._steps += 1
        won = self._cell == 5
        info = {
            "action_mask": np.ones(3, np.int8),
            "rewards": {"velocity": float(won)},
            "lane_change": False,
            "contact": False,
            "off_road": False,
            "at_fault": False,
            "fail_safe": False,
            "speed": 0.0,
            "distance": 0.0,
        }
        return self._seen(), float(won), won, self._steps >= 30, info

    def _seen(self) -> np.ndarray:
        return np.eye(6, dtype=np.float32)[self._cell]


def test_it_learns_the_values_of_a_small_world(tiny_config: TrainConfig) -> None:
    config = changed(
        tiny_config,
        method="dqn",
        episodes=150,
        network={"hidden": [32]},
        learning={"target_every": 50, "batch_size": 32, "learning_starts": 32, "replay_capacity": 1_000},
        schedule={"epsilon_start": 1.0, "epsilon_end": 0.2},
    )
    trainer = Trainer(Corridor(), config)
    last = list(episodes(trainer))[-1]
    assert last.summary.total_return == 1.0
    for cell in range(5):
        values = trainer.agent.policy.values(np.eye(6, dtype=np.float32)[cell])
        assert values.argmax() == 2
        assert values[2] == pytest.approx(0.95 ** (4 - cell), abs=0.1)


class NoChoice(FakeHighway):
    def _mask(self) -> np.ndarray:
        return np.zeros(3, np.int8)


class Blind(FakeHighway):
    def _observation(self) -> np.ndarray:
        return super()._observation() * np.float32(np.nan)


def test_an_empty_mask_stops_the_run(tiny_config: TrainConfig) -> None:
    with pytest.raises(ValueError, match="no action is offered"):
        list(Trainer(NoChoice(), tiny_config).run())


def test_a_blind_environment_stops_the_run(tiny_config: TrainConfig) -> None:
    with pytest.raises(ValueError, match="not finite"):
        list(Trainer(Blind(), tiny_config).run())


def test_spaces_that_do_not_fit_are_refused(tiny_config: TrainConfig) -> None:
    env = FakeHighway()
    env.action_space = gymnasium.spaces.Box(-1.0, 1.0)  # type: ignore[assignment]
    with pytest.raises(TypeError, match="discrete"):
        make_learner(env, tiny_config)
    env = FakeHighway()
    env.observation_space = gymnasium.spaces.Box(0, 1, (4, 4))
    with pytest.raises(TypeError, match="vector"):
        make_learner(env, tiny_config)


def test_a_device_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert resolve_device("auto") == torch.device("cpu")
    with pytest.raises(UserError, match="--device cpu"):
        resolve_device("cuda")


class Diary(FakeHighway):
    """Keeps what it gave, to compare with what was stored."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[np.ndarray, int, float, np.ndarray, bool, np.ndarray]] = []
        self.ends: list[str] = []

    def reset(self, *, seed=None, options=None):  # type: ignore[no-untyped-def]
        self._last, info = super().reset(seed=seed, options=options)
        return self._last, info

    def step(self, action):  # type: ignore[no-untyped-def]
        observation, reward, terminated, truncated, info = super().step(action)
        mask = info["action_mask"].astype(np.bool_)
        self.seen.append((self._last, action, reward, observation, terminated, mask))
        self.ends += ["terminated"] * terminated + ["truncated"] * truncated
        self._last = observation
        return observation, reward, terminated, truncated, info


@pytest.mark.parametrize("method", ["dqn", "dqnsl"])
def test_what_is_stored_is_what_happened(tiny_config: TrainConfig, method: str) -> None:
    env = Diary()
    config = changed(tiny_config, method=method, episodes=12, learning={"replay_capacity": 1_000})
    trainer = Trainer(env, config)
    list(trainer.run())
    assert {"terminated", "truncated"} <= set(env.ends) or method == "dqn"
    fields = {name: value.numpy() for name, value in trainer.get_state()["replay"]["fields"].items()}
    observations, actions, rewards, next_observations, terminated, masks = zip(*env.seen, strict=True)
    np.testing.assert_array_equal(fields["observations"], observations)
    np.testing.assert_array_equal(fields["actions"], actions)
    np.testing.assert_allclose(fields["rewards"], rewards, rtol=1e-6)
    np.testing.assert_array_equal(fields["next_observations"], next_observations)
    np.testing.assert_array_equal(fields["terminated"], terminated)
    offered = np.ones_like(masks) if method == "dqn" else masks
    np.testing.assert_array_equal(fields["next_masks"], offered)
