"""The ways in which users' stacks make the environments, and actions that were not offered."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

import drlsl  # noqa: F401  (registers the environment)
from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.masks import FORMATS, ActionNotOffered, FormatMask, FormatVectorMask
from tests.driving.test_vector import marked

ID = "drlsl/Highway-v0"
SETTINGS: dict[str, Any] = {"recording": "highway-test", "tier": "numpy"}
CONFIG = EnvConfig(recording="highway-test", track_length=25.0)
CLASSES = (HighwayEnv, HighwayVectorEnv)


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default(tier="auto")


def test_gymnasium_makes_it_however_it_is_asked() -> None:
    assert gymnasium.make(ID, render_mode=None, **SETTINGS).render_mode is None
    assert gymnasium.make_vec(ID, num_envs=2, render_mode=None, **SETTINGS).num_envs == 2
    for vectorization in ("sync", "async"):
        envs = gymnasium.make_vec(
            ID,
            num_envs=2,
            vectorization_mode=vectorization,
            vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
            **SETTINGS,
        )
        try:
            observations, info = envs.reset(seed=0)
            assert observations.shape == (2, 21)
            assert info["action_mask"].dtype == np.int8
            envs.step(envs.action_space.sample(mask=tuple(info["action_mask"])))
        finally:
            envs.close()


@pytest.mark.parametrize(
    "before",
    ["", "import gymnasium", "import importlib.util; importlib.util.find_spec('gymnasium')"],
    ids=["first", "after gymnasium", "looked for and not loaded, as torchrl does"],
)
def test_it_is_registered_whoever_imports_gymnasium_and_when(before: str) -> None:
    looked = before if "find_spec" in before else ""
    code = (
        f"{'' if looked else before}\nimport drlsl\n{looked}\nimport gymnasium, sys\ngymnasium.spec('{ID}')\n"
    )
    code += "assert not [one for one in sys.meta_path if type(one).__module__ == 'drlsl.registration']"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("made", CLASSES)
def test_an_unknown_keyword_is_a_type_error_that_names_the_nearest(made: Any) -> None:
    who = made.__name__
    unexpected = rf"^{who}\.__init__\(\) got an unexpected keyword argument 'recordng'"
    with pytest.raises(TypeError, match=unexpected + "; the nearest that it has is 'recording'$"):
        made(recordng="highway-test")
    with pytest.raises(TypeError, match=r"'mask_fromat'.* 'mask_format'"):
        made(mask_fromat="sb3", recording="highway-test")
    with pytest.raises(TypeError, match=r"'most_steps'; it takes recording, .*, render_mode$"):
        made(most_steps=100)
    # The words that Stable-Baselines3 and TorchRL look for before they try without the keyword.
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        gymnasium.make(ID, frameskip=1, **SETTINGS)
    with pytest.raises(TypeError, match="got a configuration and direction"):
        made(CONFIG, direction="both")


@pytest.mark.parametrize("made", CLASSES)
def test_an_unknown_option_of_a_reset_is_refused_by_name(made: Any) -> None:
    env = made(CONFIG)
    known = "it takes reset_mask" if isinstance(env, VectorEnv) else "it takes none"
    for options in (None, dict[str, Any]()):
        env.reset(seed=1, options=options)
    with pytest.raises(ValueError, match=rf"^reset\(\) has no option 'reset_msk'; {known}$"):
        env.reset(options={"reset_msk": np.array([True])})
    env.close()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"direction": "up"},
            "direction: input should be 'both', 'left_to_right' or 'right_to_left', got 'up'",
        ),
        ({"track_length": -1.0}, "track_length: input should be greater than 0, got -1.0"),
        ({"rules": "my.pl"}, "rules: input should be a list, such as ['my.pl'], got 'my.pl'"),
        ({"recording": 5}, "Env: recording: input should be a valid string, got 5"),
        ({"reward": 5}, "reward: input should be keys with values, got 5"),
        ({"reward": {"velocty": 1.0}}, "reward.velocty is not a setting"),
        ({"mode": "penalise"}, "mode 'penalise': no such mode; expected one of mask, replace, raise"),
        ({"mask_format": "keras"}, "mask_format 'keras': no such format; expected one of gymnasium, "),
    ],
)
@pytest.mark.parametrize("made", CLASSES)
def test_a_bad_value_is_told_in_one_line(made: Any, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError) as caught:
        made(**settings)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("mode", ["sameStep", "SAME_STEP", None])
def test_an_unknown_autoreset_mode_is_told_with_those_there_are(mode: Any) -> None:
    with pytest.raises(UserError, match=r"no such mode; expected one of NextStep, SameStep, Disabled$"):
        HighwayVectorEnv(num_envs=2, autoreset_mode=mode, **SETTINGS)


@pytest.mark.parametrize("made", CLASSES)
def test_a_step_before_the_first_reset_is_refused(made: Any) -> None:
    with pytest.raises(RuntimeError, match=r"^reset the environment first: it has no scenes yet$"):
        made(**SETTINGS).step(0 if made is HighwayEnv else [0])


def not_offered(mask: Any) -> int:
    """An action that is not offered; -1 if all are."""
    return int(np.argmin(mask)) if not np.all(mask) else -1


def drive_to_a_refusal(env: HighwayEnv) -> int:
    """Keep the lane until something is not offered."""
    _, info = env.reset(seed=5)
    while (action := not_offered(info["action_mask"])) < 0:
        info = env.step(0)[-1]
    return action


def test_an_action_that_was_not_offered_is_driven_and_told(shield: Shield) -> None:
    env = HighwayEnv(CONFIG, shield=shield)
    _, info = env.reset(seed=5)
    assert (info["offered"], info["taken"]) == (True, -1)
    action = drive_to_a_refusal(env)
    info = env.step(action)[-1]
    assert (info["offered"], info["taken"]) == (False, action)
    info = env.step(0)[-1]
    assert (info["offered"], info["taken"]) == (True, 0)


def test_it_is_replaced_by_keeping_the_lane(shield: Shield) -> None:
    told = []
    for mode, first in (("replace", None), ("mask", 0)):
        env = HighwayEnv(CONFIG, shield=shield, mode=mode)  # type: ignore[arg-type]  # both are modes
        action = drive_to_a_refusal(env)
        told.append(env.step(action if first is None else first))
    replaced, kept = told
    assert (replaced[-1].pop("offered"), kept[-1].pop("offered")) == (False, True)
    assert replaced[-1]["taken"] == 0
    assert np.array_equal(replaced[0], kept[0])
    assert replaced[1:4] == kept[1:4]
    assert all(np.array_equal(replaced[-1][key], kept[-1][key]) for key in kept[-1])


def test_it_is_refused_and_nothing_is_driven(shield: Shield) -> None:
    env = HighwayEnv(CONFIG, shield=shield, mode="raise")
    action = drive_to_a_refusal(env)
    twin = HighwayEnv(CONFIG, shield=shield)
    drive_to_a_refusal(twin)
    names = "lane_keeping", "left_lane_change", "right_lane_change"
    with pytest.raises(
        ActionNotOffered, match=f"action {action} {names[action]} was not offered; offered: 0"
    ):
        env.step(action)
    assert np.array_equal(env.step(0)[0], twin.step(0)[0])


def sync(configs: list[EnvConfig], autoreset: AutoresetMode, **settings: Any) -> SyncVectorEnv:
    makers = [lambda config=config: HighwayEnv(config, **settings) for config in configs]
    return SyncVectorEnv(makers, autoreset_mode=autoreset)


def alike(left: Any, right: Any) -> bool:
    """Whether two answers are alike, key for key, type for type and bit for bit."""
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(alike(left[key], right[key]) for key in left)
    if isinstance(left, np.ndarray) and left.dtype != object:
        return left.dtype == right.dtype and np.array_equal(left, right)
    if isinstance(left, np.ndarray):
        return len(left) == len(right) and all(map(alike, left, right))
    return type(left) is type(right) and bool(left == right)


def compare(ours: Any, theirs: Any, steps: int, actions: Callable[[Any], Any]) -> int:
    """Drive both alike and compare all that they tell; the number of episodes that ended."""
    mine: tuple[Any, ...] = ours.reset(seed=9)
    other: tuple[Any, ...] = theirs.reset(seed=9)
    ended = 0
    for _ in range(steps):
        assert len(mine) == len(other)
        for left, right in zip(mine, other, strict=True):
            assert alike(*(marked(one) if isinstance(one, dict) else one for one in (left, right)))
        if len(mine) == 5:
            ended += int((mine[2] | mine[3]).sum())
        chosen = actions(mine[-1])
        mine, other = ours.step(chosen), theirs.step(chosen)
    return ended


@pytest.mark.parametrize("autoreset", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("mode", ["mask", "replace"])
def test_many_are_told_of_it_as_one_is(shield: Shield, autoreset: AutoresetMode, mode: str) -> None:
    rng = np.random.default_rng(2)
    settings: dict[str, Any] = {"shield": shield, "mode": mode, "mask_format": "agilerl"}
    ours = HighwayVectorEnv(CONFIG, num_envs=3, autoreset_mode=autoreset, **settings)
    ended = compare(ours, sync([CONFIG] * 3, autoreset, **settings), 90, lambda info: rng.integers(3, size=3))
    assert ended > 3


def test_a_step_that_begins_an_episode_takes_no_action(shield: Shield) -> None:
    env = HighwayVectorEnv(CONFIG, num_envs=2, shield=shield, mode="raise")
    _, info = env.reset(seed=1)
    over = np.zeros(2, dtype=np.bool_)
    begun = 0
    for _ in range(90):
        actions = np.where(over, [not_offered(mask) for mask in info["action_mask"]], 0)
        begun += int((actions > 0).sum())
        *_, terminated, truncated, info = env.step(np.maximum(actions, 0))
        assert info["offered"].all()
        assert info["taken"].tolist() == np.where(over, -1, 0).tolist()
        over = terminated | truncated
    assert begun > 0
    for _ in range(90):
        wanted = np.array([max(0, not_offered(mask)) for mask in info["action_mask"]])
        if wanted.any() and not over.any():
            with pytest.raises(ActionNotOffered, match=r"was not offered in environment [01]; offered: 0"):
                env.step(wanted)
            return
        *_, terminated, truncated, info = env.step(np.zeros(2, dtype=np.int64))
        over = terminated | truncated
    pytest.fail("every action was offered all the time")


@pytest.mark.parametrize("name", FORMATS)
def test_masks_have_the_format_of_the_library(shield: Shield, name: str) -> None:
    env = HighwayEnv(CONFIG, shield=shield, mask_format=name)
    check_env(env, skip_render_check=True)
    wrapped = FormatMask(HighwayEnv(CONFIG, shield=shield), name)
    assert env.observation_space == wrapped.observation_space
    for ours, theirs in ((env.reset(seed=1), wrapped.reset(seed=1)), (env.step(0), wrapped.step(0))):
        for left, right in zip(ours, theirs, strict=True):
            assert alike(left, right)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("name", FORMATS)
def test_those_of_many_have_it_too(shield: Shield, name: str, mode: AutoresetMode) -> None:
    settings: dict[str, Any] = {"shield": shield, "mask_format": name}
    ours = HighwayVectorEnv(CONFIG, num_envs=2, autoreset_mode=mode, **settings)
    theirs = sync([CONFIG] * 2, mode, **settings)
    assert ours.observation_space == theirs.observation_space
    assert compare(ours, theirs, 70, lambda info: np.zeros(2, np.int64)) >= 2
    wrapped = FormatVectorMask(HighwayVectorEnv(CONFIG, num_envs=2, autoreset_mode=mode, shield=shield), name)
    assert compare(ours, wrapped, 70, lambda info: np.zeros(2, np.int64)) >= 2
