"""A vector environment as Stable-Baselines3 sees it: what its own DummyVecEnv tells, and masked PPO on it."""

from __future__ import annotations

from typing import Any, Literal

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from numpy.typing import NDArray

from drlsl.driving import EnvConfig, HighwayEnv, HighwayVectorEnv
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.masks import FormatVectorMask
from drlsl.shield import LogicVectorShield, of_each
from tests.masks.test_masks import Counting, Together, assert_same

pytest.importorskip("sb3_contrib", reason="sb3-contrib, the extra 'sb3', is not installed")

from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from drlsl.masks import Sb3VecEnv

CONFIG = EnvConfig(recording="highway-test", track_length=25.0)
SAME_STEP = AutoresetMode.SAME_STEP


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default(tier="auto")


def highways(shield: Shield, count: int, **settings: Any) -> Sb3VecEnv:
    return Sb3VecEnv(
        HighwayVectorEnv(CONFIG, num_envs=count, autoreset_mode=SAME_STEP, shield=shield, **settings)
    )


@pytest.mark.parametrize("name", ["sb3", "rllib"])
def test_it_tells_what_a_dummy_vec_env_does(shield: Shield, name: str) -> None:
    """Observations, rewards, ends, infos and masks, type for type and bit for bit, over many episodes."""
    ours = highways(shield, 3, mask_format=name)
    theirs = DummyVecEnv([lambda: HighwayEnv(CONFIG, shield=shield, mask_format=name)] * 3)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    compare(ours, theirs, steps=90, ends=4)


def compare(ours: Sb3VecEnv, theirs: DummyVecEnv, *, steps: int, ends: int) -> None:
    """Drive both alike, with random actions."""
    rng = np.random.default_rng(5)
    assert ours.seed(11) == theirs.seed(11)
    assert_same(ours.reset(), theirs.reset())
    ended = 0
    for _ in range(steps):
        assert_infos_same(ours.reset_infos, theirs.reset_infos)
        assert_same(get_action_masks(ours), get_action_masks(theirs))
        actions = rng.integers(3, size=3)
        mine, other = ours.step(actions), theirs.step(actions)
        for left, right in zip(mine[:3], other[:3], strict=True):
            assert_same(left, right)
        assert_infos_same(mine[3], other[3])
        ended += int(mine[2].sum())
    assert ended >= ends


def assert_infos_same(ours: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> None:
    assert len(ours) == len(theirs)
    for left, right in zip(ours, theirs, strict=True):
        assert_same(left, right)
        assert {key: type(value) for key, value in left.items()} == {
            key: type(value) for key, value in right.items()
        }


class Sometimes(Counting):
    """Tells some things in some states only."""

    def __init__(self, start: int) -> None:
        super().__init__()
        self._start = start

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        observation, info = super().reset(seed=seed)
        self.count = self._start
        return observation, info

    def step(self, action: Any) -> Any:
        observation, reward, terminated, _, info = super().step(action)
        if self.count % 2:
            info |= {"odd": self.count, "rare": {"three": self.count % 3 == 0}}
        cut = bool(self.count >= 4 and action == 2)
        return observation, reward, terminated, cut, info


def test_what_some_tell_is_in_their_infos_alone() -> None:
    makers = [lambda start=start: Sometimes(start) for start in range(3)]
    ours = Sb3VecEnv(Together(makers, autoreset_mode=SAME_STEP))
    theirs = DummyVecEnv(list(makers))
    compare(ours, theirs, steps=40, ends=20)


def test_with_ended_a_step_tells_only_of_episodes_that_ended() -> None:
    makers = [lambda start=start: Sometimes(start) for start in range(3)]
    everyone, ended = (
        Sb3VecEnv(Together(makers, autoreset_mode=SAME_STEP), told) for told in ("all", "ended")
    )
    rng = np.random.default_rng(5)
    assert_same(everyone.reset(), ended.reset())
    count = 0
    for _ in range(40):
        actions = rng.integers(3, size=3)
        wanted, got = everyone.step(actions), ended.step(actions)
        for left, right in zip(wanted[:3], got[:3], strict=True):
            assert_same(left, right)
        over = wanted[2].tolist()
        assert_infos_same(
            got[3],
            [
                info if is_over else {"TimeLimit.truncated": False}
                for info, is_over in zip(wanted[3], over, strict=True)
            ],
        )
        for place in np.flatnonzero(over).tolist():
            assert_same(everyone.reset_infos[place], ended.reset_infos[place])
            count += 1
    assert count >= 20
    with pytest.raises(UserError, match=r"infos is 'last'; expected one of all, ended"):
        Sb3VecEnv(Together(makers, autoreset_mode=SAME_STEP), "last")  # type: ignore[arg-type]  # a misspelt one


def test_other_autoreset_modes_are_refused() -> None:
    for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
        with pytest.raises(
            UserError, match=rf"is {mode.value}.* make the environment with autoreset_mode='Sam"
        ):
            Sb3VecEnv(Together([Counting] * 2, autoreset_mode=mode))


def test_attributes_and_methods_are_those_of_the_vector_environment() -> None:
    inside = Together([Counting] * 3, autoreset_mode=SAME_STEP)
    env = Sb3VecEnv(RecordEpisodeStatistics(inside))
    env.reset()
    assert is_masking_supported(env)
    assert not is_masking_supported(Sb3VecEnv(SyncVectorEnv([Counting], autoreset_mode=SAME_STEP)))
    assert env.get_attr("action_space", 1) == [Counting().action_space]
    assert env.env_method("action_masks", indices=[2])[0].tolist() == [True, True, True]
    assert env.env_is_wrapped(RecordEpisodeStatistics, [0, 1]) == [True, True]  # type: ignore[arg-type]  # any class
    assert env.env_is_wrapped(gymnasium.Wrapper) == [False] * 3
    with pytest.raises(AttributeError, match="has no 'speed'"):
        env.get_attr("speed")
    with pytest.raises(UserError, match=r"render_mode.* for 1 alone"):
        env.set_attr("render_mode", None, 1)
    env.set_attr("note", "kept")
    assert env.get_attr("note") == ["kept"] * 3
    with pytest.raises(UserError, match=r"__repr__\(\) .* not an answer for each of 3"):
        env.env_method("__repr__")
    env.set_options([{"a": 1}, {}, {}])
    with pytest.raises(UserError, match="same options"):
        env.reset()


NEW = tuple(map(int, gymnasium.__version__.split(".")[:2])) >= (1, 4)


@pytest.mark.skipif(not NEW, reason="with SAME_STEP the wrapper of Gymnasium 1.2 leaves out first steps")
def test_statistics_of_gymnasiums_wrapper_reach_the_log() -> None:
    assert_logged(Sb3VecEnv(RecordEpisodeStatistics(Together([Counting] * 2, autoreset_mode=SAME_STEP))))


def test_statistics_of_a_monitor_reach_the_log() -> None:
    assert_logged(VecMonitor(Sb3VecEnv(Together([Counting] * 2, autoreset_mode=SAME_STEP))))


def assert_logged(env: Any) -> None:
    """Check that four episodes of five steps are in the model's log."""
    model = MaskablePPO("MlpPolicy", env, n_steps=10, batch_size=10, n_epochs=1, seed=1)
    model.learn(20)
    assert [(one["r"], one["l"]) for one in model.ep_info_buffer or []] == [(5.0, 5)] * 4


def trained(shield: Shield, infos: Literal["all", "ended"]) -> tuple[MaskablePPO, NDArray[np.float32]]:
    """Masked PPO after two updates on 64 environments that refuse what was not offered; its weights."""
    env = Sb3VecEnv(highways(shield, 64, mode="raise").env, infos)
    model = MaskablePPO("MlpPolicy", env, n_steps=16, batch_size=256, n_epochs=2, seed=3)
    model.learn(2 * 64 * 16)
    return model, np.concatenate([one.detach().numpy().ravel() for one in model.policy.parameters()])


def test_masked_ppo_trains_on_64_in_one_process(shield: Shield) -> None:
    (model, weights), (_, again) = trained(shield, "all"), trained(shield, "ended")
    assert model.num_timesteps == 2 * 64 * 16
    assert np.array_equal(weights, again)
    untrained = MaskablePPO("MlpPolicy", highways(shield, 1), seed=3).policy.parameters()
    assert not np.array_equal(weights, np.concatenate([one.detach().numpy().ravel() for one in untrained]))


def test_any_shielded_environment_is_seen_so() -> None:
    """Rules of one's own, in front of several environments."""
    env = LogicVectorShield(
        SyncVectorEnv([lambda: gymnasium.make("CliffWalking-v1")] * 2, autoreset_mode=SAME_STEP),
        ":- dynamic(row/1). offered(up). offered(right) :- row(R), R < 3.",
        actions={"up": 0, "right": 1},
        facts=of_each(lambda cliff: {("row", 1): [(int(cliff.s) // 12,)]}),
        fallback="up",
        mode="raise",
    )
    model = MaskablePPO(
        "MlpPolicy", Sb3VecEnv(FormatVectorMask(env, "sb3")), n_steps=8, batch_size=16, seed=0
    )
    model.learn(32)
    assert model.num_timesteps == 32
