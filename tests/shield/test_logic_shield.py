"""A shield around an environment: what it offers, takes, tells and refuses."""

from __future__ import annotations

import copy
import pickle
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv

from drlsl import LogicShield
from drlsl.cli import run as command
from drlsl.errors import UserError
from drlsl.logic import Limits
from drlsl.lowering import Relation, Schema
from drlsl.masks import FORMATS, MODES, ActionNotOffered, FormatMask
from tests.shield.walks import ACTIONS, LEFT, RIGHT, RULES, STAY, Walk, facts

PAGE = Path(__file__).parents[2] / "docs" / "logic-shield.md"
TIERS = ("auto", "interpreter", "scalar", "numpy")


def shielded(env: gymnasium.Env[Any, Any] | None = None, rules: Any = RULES, **settings: Any) -> LogicShield:
    given = {"actions": ACTIONS, "facts": facts, "fallback": "stay", **settings}
    return LogicShield(Walk() if env is None else env, rules, **given)


def walk_to(env: LogicShield, place: int) -> dict[str, Any]:
    """Reset the walk at a place."""
    for seed in range(100):
        _, info = env.reset(seed=seed)
        if info["place"] == place:
            return info
    raise AssertionError(place)


def walked(env: LogicShield) -> Walk:
    walk = env.unwrapped
    assert isinstance(walk, Walk)
    return walk


@pytest.mark.parametrize("tier", TIERS)
def test_what_is_offered_never_falls(tier: str) -> None:
    env, rng = shielded(tier=tier), np.random.default_rng(0)
    for seed in range(30):
        _, info = env.reset(seed=seed)
        over = False
        while not over:
            assert info["action_mask"].dtype == np.int8
            action = env.action_space.sample(mask=info["action_mask"])
            action = rng.choice(np.flatnonzero(env.action_masks())) + 2 if rng.random() < 0.5 else action
            _, _, terminated, over, info = env.step(action)
            assert not terminated
            assert info["shield"]["taken"] == info["shield"]["asked"]
    assert env.counts.not_offered == env.counts.fail_safes == env.counts.interpreted == 0
    assert env.counts.decisions == 30 * 13
    assert env.rules.tier == ("scalar" if tier == "auto" else tier)


def test_info_tells_the_offer_of_the_state_and_what_became_of_the_action() -> None:
    env = shielded(mode="replace")
    info = walk_to(env, 1)
    assert info["shield"] == {
        "offered": ("stay", "right"),
        "asked": "",
        "taken": "",
        "replaced": False,
        "reason": "",
        "penalty": 0.0,
        "fail_safe": False,
        "fail_safe_reason": "",
    }
    assert info["action_mask"].tolist() == [0, 1, 1, 0]
    *_, info = env.step(np.int64(LEFT))
    assert info["shield"] == {
        "offered": ("stay", "right"),
        "asked": "left",
        "taken": "stay",
        "replaced": True,
        "reason": "falls(west)",
        "penalty": 0.0,
        "fail_safe": False,
        "fail_safe_reason": "",
    }
    *_, info = env.step(RIGHT)
    assert info["shield"]["offered"] == ("left", "stay", "right")
    assert (info["shield"]["asked"], info["shield"]["taken"]) == ("right", "right")
    assert walked(env).taken == [STAY, RIGHT]
    assert (env.counts.not_offered, env.counts.replaced) == (1, 1)


def test_an_action_without_a_name_is_never_offered() -> None:
    env = shielded(mode="replace")
    walk_to(env, 2)
    *_, info = env.step(5)
    assert (info["shield"]["asked"], info["shield"]["taken"]) == ("5", "stay")
    assert info["shield"]["reason"] == "the rules do not offer it"


def test_the_modes() -> None:
    rewards = {}
    for mode in ("mask", "penalise"):
        env = shielded(mode=mode, penalty=0.25)
        walk_to(env, 1)
        _, rewards[mode], terminated, _, info = env.step(LEFT)
        assert terminated
        assert not info["shield"]["replaced"]
        assert info["shield"]["reason"] == "falls(west)"
        assert rewards[mode] + info["shield"]["penalty"] == 1.0
        assert (env.counts.not_offered, env.counts.replaced) == (1, 0)
    assert rewards == {"mask": 1.0, "penalise": 0.75}
    env = shielded(mode="raise")
    walk_to(env, 1)
    with pytest.raises(ActionNotOffered, match=r"left was not offered; offered: 1 stay, 2 right"):
        env.step(LEFT)
    assert walked(env).taken == []
    env.step(STAY)


def test_the_first_offered_action_is_taken_where_the_fallback_is_not_offered() -> None:
    env = shielded(mode="replace", fallback="left")
    walk_to(env, 1)
    *_, info = env.step(LEFT)
    assert info["shield"]["taken"] == "stay"


FAILING = {
    "nothing": ("offered(left) :- at(X), X > 99.", "the rules offer no action"),
    "an error": ("offered(left) :- at(X), X > up.", "the rules raised an error"),
    "endless": ("offered(left) :- offered(left).", "the rules went beyond the limit of "),
    "undefined": ("offered(left) :- G = nosuch, call(G).", "the rules raised an error"),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", FAILING)
def test_rules_that_fail_leave_the_fallback_and_are_counted(kind: str, mode: str) -> None:
    rules, reason = FAILING[kind]
    env = shielded(
        rules=f":- dynamic at/1, cliff/2.\n{rules}", mode=mode, limits=Limits(inferences=2_000, depth=10_000)
    )
    info = walk_to(env, 2)
    for _ in range(3):
        assert info["shield"]["offered"] == ("stay",)
        assert info["shield"]["fail_safe"]
        assert reason in info["shield"]["fail_safe_reason"]
        assert env.action_masks().tolist() == [False, True, False, False]
        *_, info = env.step(STAY)
    assert env.counts.fail_safes == env.counts.decisions == sum(env.counts.failures.values())
    if mode == "replace":
        *_, info = env.step(LEFT)
        assert info["shield"]["taken"] == "stay"
        assert reason in info["shield"]["reason"]


def test_a_number_that_is_nan_leaves_the_fallback() -> None:
    for tier in TIERS:
        env = shielded(
            rules=":- dynamic v/1.\noffered(left) :- v(X), X < 1.0.\noffered(right) :- v(X), \\+ X < 1.0.",
            facts=lambda walk: {("v", 1): [(float("nan") if walk.steps else 0.0,)]},
            tier=tier,
        )
        info = walk_to(env, 2)
        assert info["shield"]["offered"] == ("left",)
        *_, info = env.step(STAY)
        assert info["shield"]["offered"] == ("stay",)
        assert "NaN" in info["shield"]["fail_safe_reason"]


def test_the_rules_are_not_asked_where_an_episode_has_terminated() -> None:
    def once(env: Any) -> Any:
        assert 0 < env.at < env.length
        return facts(env)

    env = shielded(facts=once)
    walk_to(env, 1)
    asked = env.counts.decisions
    *_, info = env.step(LEFT)
    assert env.counts.decisions == asked
    assert info["shield"]["offered"] == ("stay",)
    assert not info["shield"]["fail_safe"]


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "unknown action in a head": ({"rules": "offered(lft)."}, "rules:1: offered/1: .* lft, .*mean left"),
    "unknown action in a body": (
        {"rules": ":- dynamic at/1.\noffered(A) :- at(_), member(A, [left, rigt])."},
        "rigt",
    ),
    "unknown action in an objection": ({"rules": "offered(left). objection(up, _)."}, "objection/2: .* up"),
    "an action with arguments in a head": (
        {"rules": "offered(go(X, _)) :- member(X, [1, 2])."},
        "^rules:1: offered/1: the rules name the action go/2, a term with arguments; .*such as go_left$",
    ),
    "an action with arguments in an objection": (
        {"rules": "offered(left). objection(go(X), far) :- X > 1."},
        "^rules:1: objection/2: the rules name the action go/1, a term",
    ),
    "an action that is a number": ({"rules": "offered(2)."}, "the action 2"),
    "nothing to ask": ({"rules": "p."}, "do not define offered/1"),
    "another ask": ({"ask": "safe(X)"}, "do not define safe/1"),
    "an ask that is no goal": ({"ask": "offered("}, "ask is 'offered\\('"),
    "an ask with constants": ({"ask": "offered(ego, Action)"}, "expected a goal whose arguments"),
    "reasons that are not defined": ({"reasons": "why(Action, Reason)"}, "do not define why/2"),
    "reasons without Action": ({"reasons": "objection(A, B)"}, "called Action"),
    "no syntax": ({"rules": "offered(left"}, "cannot be loaded"),
    "no file": ({"rules": "nosuch.pl"}, "nosuch.pl"),
    "no mode": ({"mode": "mend"}, "mode 'mend'"),
    "no tier": ({"tier": "fast"}, "tier 'fast'"),
    "no fallback": ({"fallback": "brake"}, "fallback: brake is not among"),
    "an action beyond": ({"actions": {"stay": 7}}, "stay is 7; the environment's are 2 to 5"),
    "an action twice": ({"actions": {"stay": 2, "left": 2}}, "left and stay are both 2"),
    "an action that is no number": ({"actions": {"stay": "2"}}, "stay is '2'"),
    "no actions": ({"actions": {}}, "there are none"),
    "facts that are none": ({"facts": {}}, "expected a function"),
    "rules that are none": ({"rules": None}, "^rules is None; expected a rule file, several, or the text of"),
    "rules of which one is none": ({"rules": ["highway.pl", 3]}, "^rules has 3; expected the path of a rule"),
    "limits that are none": ({"limits": 5}, r"^limits is 5; expected drlsl.logic.Limits\("),
    "a penalty that rewards": ({"penalty": -1.0}, r"^penalty is -1.0; expected a number from 0 on"),
    "a penalty that is no number": ({"penalty": "1"}, "^penalty is '1'; expected"),
    "a penalty that is NaN": ({"penalty": float("nan")}, "^penalty is nan; expected"),
    "a tier that cannot run them": (
        {
            "rules": ":- dynamic at/1.\noffered(left) :- at(N), p(N). p(N) :- p(N).",
            "tier": "scalar",
            "schema": Schema([Relation("at", ("int",))]),
        },
        "scalar tier cannot run",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_bad_input_is_refused_at_construction(kind: str) -> None:
    settings, message = BAD[kind]
    with pytest.raises(UserError, match=message) as caught:
        shielded(**settings)
    assert len(str(caught.value).splitlines()) == 1 or kind == "no syntax"


@pytest.mark.parametrize(
    "space", [gymnasium.spaces.Box(0, 1, (2,)), gymnasium.spaces.MultiDiscrete([2, 2])], ids=["box", "multi"]
)
def test_only_discrete_actions_can_be_shielded(space: Any) -> None:
    env = Walk()
    env.action_space = space
    with pytest.raises(UserError, match="needs discrete ones"):
        shielded(env)


WRONG_FACTS: dict[str, tuple[Any, str]] = {
    "of another arity": ({("at", 2): [(1, 1)], ("cliff", 2): []}, "at/2 are given, .* declared is at/1"),
    "of no relation": ({("at", 1): [], ("cliff", 2): [], ("car", 1): []}, "declare it by `:- dynamic car/1"),
    "left out": ({("at", 1): [(1,)]}, "no facts of cliff/2"),
    "with a short row": ({("at", 1): [()], ("cliff", 2): []}, "a row of at/1 is"),
    "with no rows": ({("at", 1): [1], ("cliff", 2): []}, "a row of at/1 is 1"),
    "with None": ({("at", 1): [(None,)], ("cliff", 2): []}, "column 0 of at/1 is None"),
    "with a bool of NumPy": ({("at", 1): [(np.True_,)], ("cliff", 2): []}, "is np.True_; .*arity 0"),
    "misspelt": ({("att", 1): [(1,)], ("cliff", 2): []}, r"of att/1 are given, .*; did you mean at/1\?$"),
    "with a bool": ({("at", 1): [(True,)], ("cliff", 2): []}, "column 0 of at/1 is True; .*arity 0"),
    "that are no rows": ({("at", 1): 1, ("cliff", 2): []}, "facts of at/1 are 1; expected a list of rows"),
    "that are a text": ({("at", 1): "a", ("cliff", 2): []}, "facts of at/1 are 'a'; expected a list of rows"),
    "of names and numbers": ({("at", 1): [(1,), ("a",)], ("cliff", 2): []}, "names and numbers"),
    "by a text": ({"at/1": [(1,)]}, "expected \\(name, arity\\)"),
    "that are a list": ([("at", 1)], "expected a mapping"),
}


@pytest.mark.parametrize("kind", WRONG_FACTS)
def test_facts_of_a_wrong_form_are_refused_at_once(kind: str) -> None:
    wrong, message = WRONG_FACTS[kind]
    env = shielded(facts=lambda _: wrong)
    with pytest.raises(UserError, match=message):
        env.reset(seed=0)


@pytest.mark.parametrize("tier", TIERS)
def test_facts_that_change_their_form_are_refused(tier: str) -> None:
    later: list[Any] = [[(1.5,)], [("a",)], [(1, 2)], [(True,)]]
    for rows in later:
        env = shielded(
            facts=lambda walk, rows=rows: {**facts(walk), ("at", 1): rows if walk.steps else [(1,)]},
            tier=tier,
        )
        env.reset(seed=0)
        with pytest.raises(UserError, match="at/1"):
            env.step(STAY)


def test_facts_that_raise_are_a_users_error() -> None:
    env = shielded(facts=lambda walk: walk.nosuch)
    with pytest.raises(UserError, match=r"facts raised AttributeError: .*nosuch"):
        env.reset(seed=0)


@pytest.mark.parametrize("tier", ["auto", "interpreter"])
def test_a_relation_that_is_empty_at_first_is_learnt_later(tier: str) -> None:
    def later(walk: Walk) -> Any:
        return {**facts(walk), ("cliff", 2): facts(walk)[("cliff", 2)] if walk.steps else []}

    env = shielded(facts=later, tier=tier)
    info = walk_to(env, 1)
    assert info["shield"]["offered"] == ("left", "stay", "right")
    assert env.rules.tier == "interpreter"
    *_, info = env.step(STAY)
    assert info["shield"]["offered"] == ("stay", "right")
    assert env.rules.tier == ("scalar" if tier == "auto" else tier)


def test_numpys_numbers_are_facts() -> None:
    env = shielded(
        facts=lambda walk: {
            ("at", 1): np.array([[walk.at]]),
            ("cliff", 2): [(np.str_("west"), np.int8(0)), ("east", np.int64(walk.length))],
        }
    )
    assert walk_to(env, 1)["shield"]["offered"] == ("stay", "right")


@pytest.mark.parametrize("action", [1, 6, -1])
def test_an_action_that_the_environment_has_not_is_refused(action: int) -> None:
    env = shielded()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"unknown action .*; expected 2 left, 3 stay, 4 right, 5 5"):
        env.step(action)
    for given in (2.0, "left", True, None):
        with pytest.raises(TypeError, match="expected an integer"):
            env.step(given)
    assert walked(env).taken == []


def test_it_is_an_environment_as_gymnasium_wants_it() -> None:
    check_env(shielded(mode="replace"), skip_render_check=True)


def test_it_needs_a_reset() -> None:
    with pytest.raises(RuntimeError, match="reset"):
        shielded().action_masks()


@pytest.mark.parametrize("name", FORMATS)
def test_its_masks_have_every_librarys_format(name: str) -> None:
    env = FormatMask(shielded(), name)
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert ("action_mask" in info) == (name != "torchrl")


@pytest.mark.parametrize("way", ["deepcopy", "pickle"])
def test_a_copy_goes_on_alike_and_on_its_own(way: str) -> None:
    env = shielded(mode="replace")
    env.reset(seed=3)
    env.step(LEFT)
    twin: Any = copy.deepcopy(env) if way == "deepcopy" else pickle.loads(pickle.dumps(env))  # noqa: S301
    for action in (LEFT, LEFT, RIGHT, LEFT, 5):
        assert str(env.step(action)) == str(twin.step(action))
    assert env.counts == twin.counts
    twin.step(STAY)
    assert env.counts != twin.counts


def test_shields_in_a_vector_environment() -> None:
    envs = SyncVectorEnv([lambda: shielded(mode="replace")] * 3)
    envs.reset(seed=0)
    *_, infos = envs.step(np.array([LEFT, STAY, 5]))
    assert infos["shield"]["asked"].tolist() == ["left", "stay", "5"]
    assert infos["action_mask"].shape == (3, 4)


def test_rules_may_come_from_files(tmp_path: Path) -> None:
    path = tmp_path / "walk.pl"
    path.write_text(RULES)
    for rules in (path, str(path), [path], RULES):
        assert walk_to(shielded(rules=rules), 1)["shield"]["offered"] == ("stay", "right")
    names = {"lane_keeping": 2, "left_lane_change": 3, "right_lane_change": 4}
    shielded(rules="highway.pl", ask="safe_actions(A)", actions=names, fallback="lane_keeping")


def test_rules_that_call_what_is_not_defined_are_refused() -> None:
    misspelt = RULES.replace("cliff(Name", "clif(Name")
    with pytest.raises(UserError, match=r"rules:\d+: clif/2 is not defined; did you mean cliff/2\?$"):
        shielded(rules=misspelt)
    with pytest.raises(UserError, match=r"cliff/3 is not defined; there is cliff/2$"):
        shielded(rules=RULES.replace("cliff(Name", "cliff(_, Name"))


@pytest.mark.parametrize("tier", ["interpreter", "auto"])
def test_rules_that_fail_are_told_once(tier: str, caplog: pytest.LogCaptureFixture) -> None:
    env = shielded(rules=RULES + "offered(stay) :- at(X), 1 / (X - X) > 0.\n", tier=tier)
    for _ in range(3):
        env.reset(seed=0)
    told = [message for message in caplog.messages if "the fallback stay alone is offered" in message]
    assert len(told) == 1
    assert "zero" in told[0]
    assert env.counts.fail_safes == 3


def test_a_schema_that_is_none_is_refused() -> None:
    with pytest.raises(UserError, match=r"schema is \{'at': 'int'\}; expected drlsl.lowering.Schema"):
        shielded(schema={"at": "int"})


def test_a_fraction_in_a_column_of_integers_is_told() -> None:
    rules = shielded(rules=":- dynamic at/1.\noffered(stay) :- at(X), X > 0.").rules
    assert rules.offer({("at", 1): [(1,)]}).actions == ("stay",)
    with pytest.raises(
        UserError, match=r"at/1 is 1\.5; expected an integer, as in the first facts; write float"
    ):
        rules.offer({("at", 1): [(1.5,)]})


def test_many_states_in_which_rules_fail_are_told_once(caplog: pytest.LogCaptureFixture) -> None:
    rules = shielded(rules=":- dynamic at/1, cliff/2.\noffered(stay) :- at(X), X > 2.", tier="numpy").rules
    offers = rules.offers([{("at", 1): [(place,)], ("cliff", 2): []} for place in (1, 2, 3)])
    assert sorted(offers.failures) == [0, 1]
    (told,) = [message for message in caplog.messages if "the fallback stay alone is offered" in message]
    assert told.endswith(": the rules offer no action")


def test_an_action_without_a_value_is_refused() -> None:
    env = shielded(rules=":- dynamic at/1, cliff/2.\noffered(Stay) :- at(_).")
    with pytest.raises(UserError, match="an action is a variable without a value; names begin in lower case"):
        env.reset(seed=0)


def test_an_action_with_arguments_is_refused() -> None:
    env = shielded(rules=":- dynamic at/1, cliff/2.\noffered(A) :- at(X), member(A, [go(X), left]).")
    with pytest.raises(UserError, match=r"^offered/1: the rules name the action go/1, a term with arguments"):
        env.reset(seed=0)


def test_the_table_of_the_page_answers_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = PAGE.read_text(encoding="utf-8")
    (rules,) = re.findall(r'^RULES = r"""\n(.*?)"""', page, re.M | re.S)
    (table,) = re.findall(r"^```yaml\n(.*?)^```", page, re.M | re.S)
    ((told, answer),) = re.findall(r"^ {4}\$ drlsl (.*)\n((?: {4}[^$].*\n)+)", page, re.M)[:1]
    (tmp_path / "taxi.pl").write_text(rules)
    (tmp_path / "taxi.test.yaml").write_text(table)
    monkeypatch.chdir(tmp_path)
    assert command(told.split()) == 0
    assert capsys.readouterr().out == textwrap.dedent(answer)


def test_the_page_shields_an_environment_in_thirty_lines() -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    printed = re.findall(r"^```\n\n((?: {4}.*\n)+)", PAGE.read_text(encoding="utf-8"), re.M)
    assert len(blocks[0].splitlines()) < 30
    assert len(blocks) == len(printed) == 3
    if "Taxi-v4" not in gymnasium.registry:
        pytest.skip("this Gymnasium has an older Taxi")
    done = subprocess.run(
        [sys.executable, "-c", "".join(blocks)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == textwrap.dedent("".join(printed))
    assert not done.stderr
