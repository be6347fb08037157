"""A shield around many environments is, to every answer, many shields around one."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

from drlsl import LogicShield, LogicVectorShield
from drlsl.errors import UserError
from drlsl.lowering import Rows
from drlsl.masks import FORMATS, ActionNotOffered, FormatVectorMask
from drlsl.shield import of_each
from tests.shield.walks import ACTIONS, LEFT, RULES, STAY, Walk, facts

COUNT = 5
SETTINGS: dict[str, Any] = {"actions": ACTIONS, "fallback": "stay"}


def walks(autoreset: AutoresetMode = AutoresetMode.NEXT_STEP) -> SyncVectorEnv:
    return SyncVectorEnv([Walk] * COUNT, autoreset_mode=autoreset)


def in_arrays(envs: Any) -> dict[tuple[str, int], Rows]:
    """The facts of all walks as arrays; the cliffs are the same everywhere."""
    return {
        ("at", 1): Rows([np.array([[env.unwrapped.at] for env in envs.envs])]),
        ("cliff", 2): Rows([np.array([["west", "east"]]), np.array([[0, 4]])]),
    }


FORMS: dict[str, Any] = {"mappings": of_each(facts), "arrays": in_arrays}


def plain(told: Any) -> Any:
    """What was told, to be compared."""
    if isinstance(told, dict):
        return {key: plain(value) for key, value in sorted(told.items())}
    if isinstance(told, tuple | list):
        return [plain(one) for one in told]
    return (told.dtype.kind, told.tolist()) if isinstance(told, np.ndarray) else told


@pytest.mark.parametrize(
    ("tier", "remember"), [("auto", 0), ("interpreter", 0), ("interpreter", 3), ("scalar", 0), ("numpy", 3)]
)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("mode", ["mask", "replace", "penalise"])
def test_it_is_many_shields(mode: str, form: str, tier: str, remember: int) -> None:
    def one() -> LogicShield:
        return LogicShield(Walk(), RULES, facts=facts, mode=mode, **SETTINGS)

    alone = SyncVectorEnv([one] * COUNT)
    how = {"facts": FORMS[form], "mode": mode, "tier": tier, "remember": remember}
    together = LogicVectorShield(walks(), RULES, **how, **SETTINGS)
    rng = np.random.default_rng(1)
    assert plain(alone.reset(seed=3)) == plain(together.reset(seed=3))
    for _ in range(40):
        actions = rng.integers(2, 6, COUNT)
        assert plain(alone.step(actions)) == plain(together.step(actions))
        masks = np.array([env.get_wrapper_attr("action_masks")() for env in alone.envs])
        assert masks.tolist() == together.action_masks().tolist()
    counted = [env.counts for env in alone.envs if isinstance(env, LogicShield)]
    for name in ("decisions", "not_offered", "replaced", "fail_safes"):
        assert sum(getattr(counts, name) for counts in counted) == getattr(together.counts, name)
    assert together.counts.not_offered > 20


def test_nothing_is_refused_where_an_episode_begins() -> None:
    envs = LogicVectorShield(walks(), RULES, facts=of_each(facts), mode="raise", **SETTINGS)
    _, infos = envs.reset(seed=0)
    for _ in range(12):
        *_, truncated, infos = envs.step(np.full(COUNT, STAY))
    assert truncated.all()
    *_, infos = envs.step(np.full(COUNT, 5))  # no action is taken: the episodes begin
    assert infos["shield"]["asked"].tolist() == [""] * COUNT
    with pytest.raises(ActionNotOffered, match="in environment 2"):
        envs.step(np.array([STAY, STAY, 5, STAY, 5]))


def test_an_episode_that_is_reset_by_hand() -> None:
    envs = LogicVectorShield(
        walks(AutoresetMode.DISABLED), RULES, facts=of_each(facts), mode="mask", **SETTINGS
    )
    envs.reset(seed=0)
    over = np.zeros(COUNT, dtype=np.bool_)
    while not over.any():
        *_, over, _, infos = envs.step(np.full(COUNT, LEFT))
    assert all(infos["shield"]["offered"][place] == ("stay",) for place in np.flatnonzero(over))
    decisions = envs.counts.decisions
    _, infos = envs.reset(options={"reset_mask": over})
    assert all(len(infos["shield"]["offered"][place]) > 1 for place in np.flatnonzero(over))
    assert envs.counts.decisions == decisions + COUNT


def test_an_episode_that_is_reset_in_the_same_step() -> None:
    envs = LogicVectorShield(
        walks(AutoresetMode.SAME_STEP), RULES, facts=of_each(facts), mode="mask", **SETTINGS
    )
    envs.reset(seed=0)
    for _ in range(30):
        *_, infos = envs.step(np.full(COUNT, LEFT))
        assert infos["shield"]["asked"].tolist() == ["left"] * COUNT
        places = np.array([env.unwrapped.at for env in envs.unwrapped.envs])  # type: ignore[attr-defined]
        assert envs.action_masks()[:, 0].tolist() == (places > 1).tolist()
        assert ("action_mask" in infos.get("final_info", {})) is False


@pytest.mark.parametrize("form", FORMS)
def test_states_in_which_the_rules_fail_have_the_fallback(form: str) -> None:
    rules = RULES.replace("offered(Action) :- ", "offered(Action) :- at(P), 1 / (P - 1) < 9, ")
    for tier in ("auto", "interpreter", "scalar", "numpy"):
        envs = LogicVectorShield(walks(), rules, facts=FORMS[form], mode="replace", tier=tier, **SETTINGS)
        failed = 0
        for seed in range(0, 40, COUNT):
            _, infos = envs.reset(seed=seed)
            at_one = [env.unwrapped.at == 1 for env in envs.unwrapped.envs]  # type: ignore[attr-defined]
            failed += sum(at_one)
            assert infos["shield"]["fail_safe"].tolist() == at_one
            for place in np.flatnonzero(at_one):
                assert infos["shield"]["offered"][place] == ("stay",)
                assert "divi" in infos["shield"]["fail_safe_reason"][place]
            assert envs.counts.fail_safes == failed
            *_, infos = envs.step(np.full(COUNT, LEFT))
            assert all("divi" in infos["shield"]["reason"][place] for place in np.flatnonzero(at_one))
            failed = envs.counts.fail_safes
        assert failed > 0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda envs: of_each(facts)(envs)[:3], "facts of 3 states are given; expected those of 5"),
        (lambda envs: envs.nosuch, "facts raised AttributeError"),
        (lambda envs: [{}] * COUNT, "no facts of"),
        (lambda envs: {("at", 1): Rows([np.zeros((COUNT, 1))])}, "no facts of cliff/2"),
        (lambda envs: in_arrays(envs) | {("at", 1): Rows([])}, "at/1 is given 0 columns"),
        (lambda envs: in_arrays(envs) | {("at", 1): Rows([np.zeros((3, 1))])}, "3 states are given"),
        (lambda envs: in_arrays(envs) | {("at", 1): Rows([np.ones((COUNT, 1), bool)])}, "is of bool"),
    ],
)
def test_wrong_facts_are_refused(wrong: Any, message: str) -> None:
    envs = LogicVectorShield(walks(), RULES, facts=wrong, tier="numpy", **SETTINGS)
    with pytest.raises(UserError, match=message):
        envs.reset(seed=0)


def test_arrays_that_change_their_kind_are_refused() -> None:
    def later(envs: Any) -> Any:
        given = in_arrays(envs)
        at: Any = given["at", 1].columns[0]
        return given | {("at", 1): Rows([at + 0.5 if envs.envs[0].unwrapped.steps else at])}

    for tier in ("numpy", "scalar", "interpreter"):
        envs = LogicVectorShield(walks(), RULES, facts=later, tier=tier, **SETTINGS)
        envs.reset(seed=0)
        with pytest.raises(UserError, match="at/1"):
            envs.step(np.full(COUNT, STAY))


@pytest.mark.parametrize("name", FORMATS)
def test_its_masks_have_every_librarys_format(name: str) -> None:
    envs = FormatVectorMask(LogicVectorShield(walks(), RULES, facts=of_each(facts), **SETTINGS), name)
    observations, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observations) or not isinstance(observations, dict)


def test_actions_that_the_environments_have_not_are_refused() -> None:
    envs = LogicVectorShield(walks(), RULES, facts=of_each(facts), **SETTINGS)
    envs.reset(seed=0)
    for wrong in ([3, 3, 3], np.full(COUNT, 6), np.full(COUNT, 1)):
        with pytest.raises(ValueError, match=r"shape|unknown action"):
            envs.step(wrong)
    with pytest.raises(TypeError, match="expected 5 integers"):
        envs.step(np.full(COUNT, 3.0))


def test_facts_for_one_environment_are_told_from_those_of_all() -> None:
    envs = LogicVectorShield(walks(), RULES, **{**SETTINGS, "facts": facts})
    with pytest.raises(
        UserError, match=r"a function of one environment becomes one of all by drlsl\.of_each"
    ):
        envs.reset(seed=0)


def test_it_is_told_of_which_environment_facts_raised() -> None:
    def failing(walk: Walk) -> dict[tuple[str, int], Any]:
        if walk is raising:
            raise KeyError("lost")
        return facts(walk)

    env = walks()
    raising = env.envs[3].unwrapped
    envs = LogicVectorShield(env, RULES, facts=of_each(failing), **SETTINGS)
    with pytest.raises(UserError, match="facts of environment 3 raised KeyError: 'lost'"):
        envs.reset(seed=0)


def test_a_shield_of_many_can_be_pickled() -> None:
    envs = LogicVectorShield(walks(), RULES, facts=of_each(facts), **SETTINGS)
    envs.reset(seed=0)
    twin: Any = pickle.loads(pickle.dumps(envs))  # noqa: S301
    for action in (STAY, LEFT):
        actions = np.full(COUNT, action)
        assert str(envs.step(actions)) == str(twin.step(actions))


def test_environments_that_are_one_object_are_made_one_by_one() -> None:
    made = gymnasium.make_vec("CartPole-v1", num_envs=2)
    envs = LogicVectorShield(
        made, "offered(left).", actions={"left": 0}, facts=of_each(facts), fallback="left"
    )
    with pytest.raises(UserError, match=r'of CartPoleVectorEnv, .* with vectorization_mode="sync"'):
        envs.reset(seed=0)


def test_environments_in_other_processes_are_shielded_there() -> None:
    envs = LogicVectorShield(AsyncVectorEnv([Walk]), RULES, facts=of_each(facts), **SETTINGS)
    try:
        with pytest.raises(UserError, match=r"of AsyncVectorEnv, .* shield each by itself: wrappers="):
            envs.reset(seed=0)
    finally:
        envs.close()
