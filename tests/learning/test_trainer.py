import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving.simulation import TERMS
from drlsl.errors import UserError
from drlsl.learning import Trainer, make_learner
from drlsl.learning.config import TrainConfig, make_config, merged
from drlsl.learning.divergence import DivergedError
from drlsl.learning.dqn import DqnAgent
from drlsl.learning.episode import TRAINING_STREAM, EpisodeSummary, episode_seed
from drlsl.learning.trainer import EpisodeEvent, resolve_device

from .conftest import small_config
from .fake import LANES, FakeHighway, FakeVector, fakes
from .layers import plain


def changed(config: TrainConfig, **values: object) -> TrainConfig:
    return make_config(merged(config.model_dump(), values), "test")


def episodes(trainer: Trainer) -> Iterator[EpisodeEvent]:
    return (episode for event in trainer.run() for episode in event.ended)


def comparable(event: EpisodeEvent) -> EpisodeEvent:
    """All of an episode but its wall time."""
    return dataclasses.replace(event, wall_s=0.0)


def trained(config: TrainConfig) -> Trainer:
    """A trainer in as many fake environments as its configuration asks for."""
    return Trainer(fakes(config.num_envs), config)


class Recorder(gymnasium.Wrapper[Any, Any, Any, Any]):
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


@pytest.mark.parametrize("num_envs", [1, 3])
def test_the_shield_keeps_to_the_mask(tiny_config: TrainConfig, num_envs: int) -> None:
    envs = [Recorder(FakeHighway()) for _ in range(num_envs)]
    config = changed(tiny_config, num_envs=num_envs)
    summaries = [event.summary for event in episodes(Trainer(FakeVector(*envs), config))]
    assert all(mask[action] for env in envs for action, mask in env.choices)
    assert not any(summary.off_road for summary in summaries)
    assert all(1.0 <= summary.mask_size <= LANES for summary in summaries)


def test_plain_dqn_leaves_the_mask(tiny_config: TrainConfig) -> None:
    env = Recorder(FakeHighway())
    config = changed(tiny_config, method="dqn")
    summaries = [event.summary for event in episodes(Trainer(FakeVector(env), config))]
    assert not all(mask[action] for action, mask in env.choices)
    assert all(summary.mask_size == 3.0 for summary in summaries)


@pytest.mark.parametrize("num_envs", [1, 4, 9])
def test_every_step_is_counted_and_learnt_from_once(tiny_config: TrainConfig, num_envs: int) -> None:
    trainer = trained(changed(tiny_config, num_envs=num_envs))
    driven = 0
    finished: list[EpisodeEvent] = []
    for event in trainer.run():
        taken = event.total_steps - driven
        driven = event.total_steps
        assert 1 <= taken <= num_envs
        assert len(event.losses) == (taken if driven >= tiny_config.learning.learning_starts else 0)
        finished += event.ended
    assert sorted(event.episode for event in finished) == [1, 2, 3, 4, 5, 6]
    assert [event.finished for event in finished] == [1, 2, 3, 4, 5, 6]
    assert sum(event.summary.steps for event in finished) == driven == trainer.total_steps
    assert finished[-1].total_steps == driven


@pytest.mark.parametrize("num_envs", [1, 4])
def test_an_episodes_loss_is_the_mean_over_its_updates(tiny_config: TrainConfig, num_envs: int) -> None:
    config = changed(tiny_config, num_envs=num_envs)
    losses: list[tuple[int, float]] = []
    for step, event in enumerate(trained(config).run()):
        losses += [(step, loss) for loss in event.losses]
        for episode in event.ended:
            mine = [loss for when, loss in losses if when > step - episode.summary.steps]
            assert episode.loss == pytest.approx(np.mean(mine))


@pytest.mark.parametrize("num_envs", [1, 3])
def test_an_episode_adds_up(tiny_config: TrainConfig, num_envs: int) -> None:
    for event in episodes(trained(changed(tiny_config, method="dqn", num_envs=num_envs))):
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


@pytest.mark.parametrize("method", ["dqn", "dqnsl"])
def test_interventions_are_steps_whose_best_action_is_not_safe(tiny_config: TrainConfig, method: str) -> None:
    starts = {"learning_starts": 10_000, "replay_capacity": 10_000}
    envs = [Recorder(FakeHighway()) for _ in range(2)]
    config = changed(tiny_config, method=method, num_envs=2, episodes=2, learning=starts)
    trainer = Trainer(FakeVector(*envs), config)
    plain(trainer.agent.network).parameters.zero_()
    plain(trainer.agent.network).layers[-1].bias[2] = 1.0
    for event in episodes(trainer):
        env = envs[event.episode - 1]
        masks = [mask for _, mask in env.choices[: event.summary.steps]]
        assert event.summary.interventions == sum(not mask[2] for mask in masks)
        assert event.loss is None


@pytest.mark.parametrize("num_envs", [1, 4])
def test_rates_follow_the_episodes_that_are_over(tiny_config: TrainConfig, num_envs: int) -> None:
    config = changed(tiny_config, num_envs=num_envs)
    rates, epsilons = np.linspace(0.01, 1e-4, 6), np.linspace(0.5, 0.001, 6)
    over = 0
    for event in trained(config).run():
        for row in event.ended:
            assert row.learning_rate == pytest.approx(rates[over])
            assert row.epsilon == pytest.approx(epsilons[over])
        over += len(event.ended)
    assert over == 6


@pytest.mark.parametrize("num_envs", [1, 3])
def test_a_run_is_a_function_of_its_seed(tiny_config: TrainConfig, num_envs: int) -> None:
    config = changed(tiny_config, num_envs=num_envs)
    first, second = (list(episodes(trained(config))) for _ in range(2))
    other = list(episodes(trained(changed(config, seed=1))))
    assert [comparable(event) for event in first] == [comparable(event) for event in second]
    assert [event.summary for event in first] != [event.summary for event in other]


@pytest.mark.parametrize("num_envs", [1, 4])
def test_episodes_are_seeded_in_the_order_they_begin(tiny_config: TrainConfig, num_envs: int) -> None:
    envs = [Recorder(FakeHighway()) for _ in range(num_envs)]
    list(Trainer(FakeVector(*envs), changed(tiny_config, num_envs=num_envs)).run())
    expected = [episode_seed(0, TRAINING_STREAM, index) for index in range(6)]
    given = [seed for env in envs for seed in env.seeds]
    assert set(expected) <= set(given)
    assert [env.seeds[0] for env in envs] == expected[:num_envs]
    # What is driven beyond them, while the last are still on their way, is not among them.
    assert set(given) - set(expected) <= {episode_seed(0, TRAINING_STREAM, 6)}
    assert all(given.count(seed) == 1 for seed in expected)


@given(
    num_envs=st.integers(1, 5),
    stop_after=st.integers(0, 60),
    noisy=st.booleans(),
    precision=st.sampled_from(["float32", "bfloat16"]),
    overlap=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_a_state_between_two_steps_goes_on_bit_for_bit(
    num_envs: int, stop_after: int, noisy: bool, precision: str, overlap: bool
) -> None:
    config = changed(
        small_config(),
        num_envs=num_envs,
        network={"hidden": [16, 16], "noisy": noisy},
        learning={"precision": precision, "overlap": overlap},
    )
    whole, stopped, resumed = trained(config), trained(config), trained(config)
    events = list(whole.run())
    for _ in zip(range(stop_after), stopped.run(), strict=False):
        pass
    state = stopped.get_state()
    list(stopped.run())
    resumed.set_state(state)
    rest = list(resumed.run())
    assert [event.losses for event in rest] == [event.losses for event in events[len(events) - len(rest) :]]
    ended = [comparable(episode) for event in events for episode in event.ended]
    again = [comparable(episode) for event in rest for episode in event.ended]
    assert again == ended[len(ended) - len(again) :]
    assert torch.equal(plain(whole.agent.network).parameters, plain(resumed.agent.network).parameters)
    assert torch.equal(plain(whole.agent.network).parameters, plain(stopped.agent.network).parameters)


@pytest.mark.parametrize("num_envs", [1, 3])
def test_with_overlap_the_updates_of_a_step_follow_one_step_later(
    tiny_config: TrainConfig, num_envs: int
) -> None:
    config = changed(tiny_config, num_envs=num_envs, learning={"overlap": True})
    events = list(trained(config).run())
    steps = [0, *(event.total_steps for event in events)]
    held = config.learning.learning_starts
    due = [after - before if after >= held else 0 for before, after in itertools.pairwise(steps)]
    assert [len(event.losses) for event in events] == [0, *due[:-1]]


def test_with_overlap_an_action_rests_on_the_weights_before_the_updates(
    tiny_config: TrainConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    trainer = trained(changed(tiny_config, num_envs=2, learning={"overlap": True}))
    agent, seen = trainer.agent, []
    act = agent.act

    def watched(*arguments: Any) -> Any:
        seen.append(agent.updates)
        return act(*arguments)

    monkeypatch.setattr(agent, "act", watched)
    made = [0]
    for event in trainer.run():
        made.append(made[-1] + len(event.losses))
    assert seen == made[:-1]


def test_with_overlap_a_failure_of_learning_stops_the_run(
    tiny_config: TrainConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(self: DqnAgent, replay: object, updates: int) -> list[float]:
        raise DivergedError("the loss is nan")

    monkeypatch.setattr(DqnAgent, "learn", fails)
    with pytest.raises(DivergedError, match="the loss is nan"):
        list(trained(changed(tiny_config, learning={"overlap": True})).run())


def test_rules_that_changed_since_the_checkpoint_are_noticed(tiny_config: TrainConfig) -> None:
    trainer = trained(tiny_config)
    next(trainer.run())
    changed_rules = Trainer(FakeVector(NoChoice()), tiny_config)
    with pytest.raises(UserError, match="rules find other actions safe"):
        changed_rules.set_state(trainer.get_state())


def test_an_environment_that_resets_itself_is_refused(tiny_config: TrainConfig) -> None:
    env = gymnasium.vector.SyncVectorEnv([FakeHighway])
    with pytest.raises(TypeError, match="without autoreset"):
        Trainer(env, tiny_config)  # type: ignore[arg-type]  # the point of the test


class Corridor(gymnasium.Env[np.ndarray, np.int64]):
    """Six cells, a reward of 1 at the right end; "keep" stays, "left" and "right" move. At most 30 steps."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (6,), np.float32)
    action_space = gymnasium.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):  # type: ignore[no-untyped-def]
        super().reset(seed=seed)
        self._cell, self._steps = 0, 0
        return self._seen(), {"action_mask": np.ones(3, np.int8)}

    def step(self, action: np.int64) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self._cell = int(np.clip(self._cell + (0, -1, 1)[action], 0, 5))
        self._steps += 1
        won = self._cell == 5
        info = {
            "action_mask": np.ones(3, np.int8),
            "rewards": dict.fromkeys(TERMS, 0.0) | {"velocity": float(won)},
            "lane_change": False,
            "contact": False,
            "off_road": False,
            "at_fault": False,
            "fail_safe": False,
            "offered": True,
            "speed": 0.0,
            "distance": 0.0,
        }
        return self._seen(), float(won), won, self._steps >= 30, info

    def _seen(self) -> np.ndarray:
        seen: np.ndarray = np.eye(6, dtype=np.float32)[self._cell]
        return seen


@pytest.mark.parametrize("num_envs", [1, 4])
def test_it_learns_the_values_of_a_small_world(tiny_config: TrainConfig, num_envs: int) -> None:
    config = changed(
        tiny_config,
        method="dqn",
        num_envs=num_envs,
        episodes=150,
        network={"hidden": [32]},
        learning={"target_every": 50, "batch_size": 32, "learning_starts": 32, "replay_capacity": 1_000},
        schedule={"epsilon_start": 1.0, "epsilon_end": 0.2},
    )
    trainer = Trainer(FakeVector(*(Corridor() for _ in range(num_envs))), config)
    last = list(episodes(trainer))[-1]
    assert last.summary.total_return == 1.0
    for cell, values in enumerate(trainer.agent.policy.values(np.eye(6, dtype=np.float32)[:5])):
        assert values.argmax() == 2
        assert values[2] == pytest.approx(0.95 ** (4 - cell), abs=0.1)


class Levers(Corridor):
    """Each of the six cells pays 1 for one action; the next cell is drawn. 30 steps."""

    def step(self, action: np.int64) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        paid = float(action == self._cell % 3)
        *_, info = super().step(action)
        self._cell = int(self.np_random.integers(6))
        return self._seen(), paid, False, self._steps >= 30, info


def test_noise_explores_and_then_learns_to_keep_still(tiny_config: TrainConfig) -> None:
    config = changed(
        tiny_config,
        method="dqn",
        episodes=100,
        network={"hidden": [32], "noisy": True},
        learning={"target_every": 50, "batch_size": 32, "learning_starts": 32, "replay_capacity": 1_000},
        # Would be a random action half of the time, were it not for the noise.
        schedule={"epsilon_start": 0.5, "epsilon_end": 0.5},
    )
    returns = [event.summary.total_return for event in episodes(Trainer(FakeVector(Levers()), config))]
    assert returns[0] < 20.0
    assert min(returns[-10:]) >= 28.0


class NoChoice(FakeHighway):
    def _mask(self) -> np.ndarray:
        return np.zeros(3, np.int8)


class Blind(FakeHighway):
    def _observation(self) -> np.ndarray:
        return super()._observation() * np.float32(np.nan)


def test_an_empty_mask_stops_the_run(tiny_config: TrainConfig) -> None:
    with pytest.raises(ValueError, match="no action is offered"):
        list(Trainer(FakeVector(NoChoice()), tiny_config).run())


def test_a_blind_environment_stops_the_run(tiny_config: TrainConfig) -> None:
    with pytest.raises(ValueError, match="not finite"):
        list(Trainer(FakeVector(Blind()), tiny_config).run())


def test_spaces_that_do_not_fit_are_refused(tiny_config: TrainConfig) -> None:
    env = FakeHighway()
    box = gymnasium.spaces.Box(-1.0, 1.0)
    with pytest.raises(TypeError, match="discrete"):
        make_learner(env.observation_space, box, tiny_config)
    with pytest.raises(TypeError, match="vector"):
        make_learner(gymnasium.spaces.Box(0, 1, (4, 4)), env.action_space, tiny_config)


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

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = super().step(action)
        mask = info["action_mask"].astype(np.bool_)
        self.seen.append((self._last, action, reward, observation, terminated, mask))
        self.ends += ["terminated"] * terminated + ["truncated"] * truncated
        self._last = observation
        return observation, reward, terminated, truncated, info


@pytest.mark.parametrize("num_envs", [1, 4])
@pytest.mark.parametrize("method", ["dqn", "dqnsl"])
def test_what_is_stored_is_what_happened(tiny_config: TrainConfig, method: str, num_envs: int) -> None:
    envs = [Diary() for _ in range(num_envs)]
    capacity = {"replay_capacity": 1_000}
    config = changed(tiny_config, method=method, episodes=12, learning=capacity, num_envs=num_envs)
    trainer = Trainer(FakeVector(*envs), config)
    list(trainer.run())
    assert {"terminated", "truncated"} <= {end for env in envs for end in env.ends} or method == "dqn"
    fields = {name: value.numpy() for name, value in trainer.get_state()["replay"]["fields"].items()}
    stored = {_key(*row) for row in zip(*fields.values(), strict=True)}
    happened = {
        _key(seen[0], *seen[1:5], np.ones_like(seen[5]) if method == "dqn" else seen[5])
        for env in envs
        for seen in env.seen
    }
    assert len(fields["rewards"]) == trainer.total_steps
    # What is driven for nothing while the last episodes are on their way is not stored.
    assert stored == happened if num_envs == 1 else stored < happened
    if num_envs == 1:
        np.testing.assert_array_equal(fields["actions"], [seen[1] for seen in envs[0].seen])


def _key(*fields: object) -> tuple[bytes, ...]:
    kinds = (np.float32, np.int64, np.float32, np.float32, np.bool_, np.bool_)
    return tuple(np.asarray(field, kind).tobytes() for field, kind in zip(fields, kinds, strict=True))
