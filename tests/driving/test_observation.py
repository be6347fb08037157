"""What the agent observes: the names and bounds that a program declares, and programs that do not fit."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.cli import run
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.scene import EGO, Scene, SceneBatch, Vehicle
from drlsl.driving.shield import PAPER_OBSERVATION, ObservationSpace, RuleFailure, Shield
from drlsl.errors import UserError
from drlsl.logic import Engine
from tests.installed import TIERS
from tests.scenes import road

SCENE = Scene(road(0, 3), Vehicle(EGO, 2, 0.0, 7.25, 30.0, 0.0, 4.6, 1.9), (), 2)
OTHER = Scene(SCENE.road, SCENE.ego._replace(lane=1, y=3.5), (), 1)
EXAMPLE = str(Path(__file__).parents[2] / "examples" / "scene.json")

REST = """
safe_actions(lane_keeping).
front_is_free.
longitudinal_velocity(20.0).
entry_is_safe.
:- dynamic(vehicle/8).
"""
THREE = REST + "state([0.5, X, 1]) :- vehicle(ego, _, _, _, Vx, _, _, _), X is Vx / 50.0.\n"


def shield(text: str, tier: str = "interpreter") -> Shield:
    engine = Engine()
    engine.consult_text(text, "mine.pl")
    return Shield(engine, tier=tier)


def term(value: Any) -> str:
    """A Python value as Prolog text."""
    if isinstance(value, list):
        return f"[{', '.join(map(term, value))}]"
    if isinstance(value, tuple):
        return f"({term(value[0])}) - ({term(value[1])})"
    if isinstance(value, float):
        mantissa, sign, exponent = repr(value).partition("e")
        return mantissa + (".0" if sign and "." not in mantissa else "") + sign + exponent
    return f"'{value}'" if isinstance(value, str) else repr(value)


numbers = st.one_of(st.integers(-1000, 1000), st.floats(-1e30, 1e30))
bounds = st.tuples(numbers, numbers).filter(lambda pair: pair[0] < pair[1])
names = st.text(
    st.characters(codec="ascii", categories=("L", "N", "Zs"), exclude_characters="'\\"), min_size=1
)


@given(st.dictionaries(names, bounds, min_size=1, max_size=40))
@settings(max_examples=60, deadline=None)
def test_any_names_and_bounds_are_read_back_as_they_were_written(declared: dict[str, Any]) -> None:
    """The fail-safe's observation and the middle of every bound lie within; just outside does not."""
    state = [low / 2 + high / 2 for low, high in declared.values()]
    space = shield(
        f"{REST}state({term(state)}).\nstate_names({term(list(declared))}).\n"
        f"state_bounds({term(list(declared.values()))}).\n"
    ).observation
    assert space == ObservationSpace.of(list(declared), list(declared.values()))
    assert (space.names, len(space)) == (tuple(declared), len(declared))
    assert space.outside(state) is space.outside(space.zero) is space.outside(space.low) is None
    above = [math.nextafter(high, math.inf) for high in space.high]
    assert space.outside(above) == 0
    assert space.outside([*space.low[:-1], math.nan]) == len(space) - 1


@pytest.mark.parametrize("tier", ["interpreter", "scalar", "numpy"])
@given(st.data())
@settings(max_examples=15, deadline=None)
def test_tiers_observe_any_number_of_numbers(tier: str, data: st.DataObject) -> None:
    pairs = data.draw(st.lists(bounds, min_size=1, max_size=12))
    shares = data.draw(st.lists(st.floats(0, 1), min_size=len(pairs), max_size=len(pairs)))
    values = [
        float(min(max(low + share * (high - low), low), high))
        for (low, high), share in zip(pairs, shares, strict=True)
    ]
    named = [f"n{number}" for number in range(len(pairs))]
    variables = [f"X{number}" for number in range(len(pairs))]
    computed = [f"{one} is {term(value)} + 0.0 * Vx" for one, value in zip(variables, values, strict=True)]
    body = ["vehicle(ego, _, _, _, Vx, _, _, _)", *computed]
    asked = shield(
        f"{REST}state([{', '.join(variables)}]) :- {', '.join(body)}.\n"
        f"state_names({term(named)}).\nstate_bounds({term(pairs)}).\n",
        tier,
    )
    decisions = asked.decide_batch(SceneBatch.of([SCENE, OTHER]))
    assert decisions.failures == {}
    assert decisions.observation.tolist() == [values, values]
    assert asked.decide(SCENE).observation == tuple(values)


def test_a_program_without_names_observes_the_papers_ten() -> None:
    space = shield(f"{REST}state([0, 0, 0, 0, 0, 0, 0, 0, 0.5, 1]).").observation
    assert space is PAPER_OBSERVATION
    assert (len(space), set(space.low), set(space.high)) == (10, {0.0}, {1.0})


@pytest.mark.parametrize("tier", TIERS)
def test_a_number_out_of_its_bounds_fails_the_rules_by_name(tier: str) -> None:
    declared = "state_names([a, fast, c]).\nstate_bounds([0 - 1, -1 - 0.5, 0.25 - 2]).\n"
    asked = shield(THREE + declared, tier)
    slow = Scene(SCENE.road, SCENE.ego._replace(vx=10.0), (), 2)
    assert asked.decide(slow).observation == (0.5, 0.2, 1.0)
    with pytest.raises(RuleFailure, match=r"in which fast is 0\.6; expected a number from -1 to 0\.5"):
        asked.decide(SCENE)
    decisions = asked.decide_batch(SceneBatch.of([SCENE, slow]))
    assert list(decisions.failures) == [0]
    assert decisions.observation.tolist() == [[0.0, 0.0, 0.25], [0.5, 0.2, 1.0]]


def test_environments_have_the_space_that_the_rules_declare(tmp_path: Path) -> None:
    """A bound that single precision rounds still holds its numbers."""
    path = tmp_path / "mine.pl"
    path.write_text(THREE + "state_names([a, fast, c]).\nstate_bounds([0 - 0.5, -1 - 1, 0.1 - 3]).\n")
    env = HighwayEnv(recording="highway-test", rules=(str(path),))
    low, high = np.array([0, -1, 0.1], np.float32), np.array([0.5, 1, 3], np.float32)
    assert env.observation_space == gymnasium.spaces.Box(low, high, dtype=np.float32)
    observation, _ = env.reset(seed=3)
    assert observation in env.observation_space
    assert observation.dtype == np.float32
    many = HighwayVectorEnv(env.config, num_envs=2)
    assert many.single_observation_space == env.observation_space
    observations, _ = many.reset(seed=3)
    assert observations in many.observation_space
    assert observations[0].tobytes() == observation.tobytes()


WRONG_NAMES = {
    "state_names([a, b, a]).": "state_names/1: the name a is given more than once",
    "state_names([a, 2, c]).": "state_names/1: name 2 is 2; expected an atom",
    'state_names([a, "b", c]).': "state_names/1: name 2 is [98]; expected an atom",
    "state_names([a, '', c]).": "state_names/1: name 2 is ; expected an atom",
    "state_names([a, _, c]).": "state_names/1: name 2 is",
    "state_names([a, f(b), c]).": "state_names/1: name 2 is f(b); expected an atom",
    "state_names([]).": "state_names/1 gave []; expected a list of one or more",
    "state_names(a).": "state_names/1 gave a; expected a list of one or more",
    "state_names([a | _]).": "state_names/1 gave",
    "state_names(_).": "state_names/1 gave",
    "state_names(_) :- fail.": "state_names/1 has no solution",
    "state_names([a, b, c]) :- vehicle(ego, _, _, _, _, _, _, _).": "state_names/1 has no solution",
    "state_names([a, b, c]). state_names([d, e, f]).": "state_names/1 has 2 solutions",
    "state_names(X) :- atom_length(X, _).": "state_names/1: ",
    "state_names(X) :- state_names(X).": "state_names/1: ",
}
WRONG_BOUNDS = {
    "[0 - 1, 0 - 1]": "there are 2 bounds for the 3 names",
    "[0 - 1, 0 - 1, 0 - 1, 0 - 1]": "there are 4 bounds for the 3 names",
    "[0 - 1, 1 - 1, 0 - 1]": "the bounds of b are 1-1; the first must be less",
    "[0 - 1, 1 - 0, 0 - 1]": "the bounds of b are 1-0; the first must be less",
    "[0 - 1, 0 - inf, 0 - 1]": "the bounds of b are 0-inf; expected two finite numbers",
    "[0 - 1, _ - 1, 0 - 1]": "expected two finite numbers",
    "[0 - 1, a - 1, 0 - 1]": "the bounds of b are a-1; expected two finite numbers",
    f"[0 - 1, 0 - 1{'0' * 40}, 0 - 1]": "expected two finite numbers",
    f"[0 - 1, 0 - 1{'0' * 400}, 0 - 1]": "expected two finite numbers",
    "[0 - 1, _, 0 - 1]": "expected Low-High",
    "[0 - 1, 0, 0 - 1]": "the bounds of b are 0; expected Low-High",
    "[0 - 1, (0, 1), 0 - 1]": "expected Low-High",
    "[]": "state_bounds/1 gave []; expected a list",
    "_": "state_bounds/1 gave",
}


@pytest.mark.parametrize(
    ("declared", "problem"),
    [
        *WRONG_NAMES.items(),
        *((f"state_names([a, b, c]). state_bounds({pairs}).", why) for pairs, why in WRONG_BOUNDS.items()),
        ("state_names([a, b, c]). state_bounds([0-1, X, 0-1]) :- X is 0-inf.", "state_bounds/1: "),
        ("state_bounds([0 - 1, 0 - 1, 0 - 1]).", "bounds need names: the program has no state_names/1"),
    ],
)
def test_a_slip_in_names_or_bounds_is_refused_when_the_shield_is_made(declared: str, problem: str) -> None:
    with pytest.raises(UserError) as refused:
        shield(THREE + declared)
    message = str(refused.value)
    assert problem in message
    assert message.startswith("mine.pl:")
    assert "\n" not in message


MISFITS = {
    "without names": (THREE, "state/1 gives a list of 3; expected 10 numbers, the paper's"),
    "a name without a number": (
        THREE + "state_names([a, b, c, d]).",
        "state/1 gives a list of 3; expected 4 numbers, one for each name of state_names/1",
    ),
    "a number without a name": (THREE + "state_names([a, b]).", "state/1 gives a list of 3; expected 2"),
    "of changing length": (
        f"{REST}state_names([a, b]).\nstate([0, 1]) :- vehicle(ego, 1, _, _, _, _, _, _), !.\nstate([0]).\n",
        "state/1 gives a list of 1; expected 2",
    ),
    "an atom": (f"{REST}state_names([a, b]).\nstate([0, none]).\n", "state/1 gives no number as b"),
    "no list": (f"{REST}state_names([a]).\nstate(0.5).\n", "state/1 gives no list; expected 1"),
    "an empty list": (f"{REST}state_names([a]).\nstate([]).\n", "state/1 gives a list of 0; expected 1"),
}


@pytest.mark.parametrize(("text", "problem"), MISFITS.values(), ids=MISFITS)
@pytest.mark.parametrize("tier", [*TIERS, "auto"])
def test_a_state_that_does_not_fit_is_refused_before_it_drives(tier: str, text: str, problem: str) -> None:
    asked = shield(text, tier)
    with pytest.raises(UserError, match=r"^mine\.pl:\d+: ") as refused:
        asked.prepare()
    assert problem in str(refused.value)


def test_a_length_that_only_driving_shows_is_a_counted_failure() -> None:
    """The interpreter alone can run it, so no length is known before there is a scene."""
    text = f"{REST}state_names([a, b]).\n"
    state = "state(L) :- vehicle(ego, N, _, _, _, _, _, _), numlist(1, N, L0), maplist(half, L0, L).\n"
    asked = shield(f"{text}{state}half(_, 0.5).\n", "auto")
    asked.prepare()
    assert asked.tier == "interpreter"
    decisions = asked.decide_batch(SceneBatch.of([SCENE, OTHER]))
    assert list(decisions.failures) == [1]
    assert decisions.observation.tolist() == [[0.5, 0.5], [0.0, 0.0]]
    assert decisions.action_mask[1].tolist() == [True, False, False]


def study_of(rules: Path) -> Path:
    """A study of one method with a rule program."""
    file = rules.with_name("study.yaml")
    method = f"mine: {{label: mine, train: {{method: dqnsl, env: {{rules: [{rules}]}}}}}}"
    test = "test: {label: test, recording: highway-test, direction: left_to_right}"
    file.write_text(f"methods:\n  {method}\ntests:\n  {test}\n")
    return file


@pytest.mark.parametrize(
    "command",
    [
        ["query", "--state", EXAMPLE],
        ["train", "--out", "run"],
        ["stress", "highway-test", "--episodes", "1"],
        ["study", "--out", "study", "--config"],
    ],
    ids=lambda command: command[0],
)
@pytest.mark.parametrize("slip", ["state_names([a, b, c, d]).", "state_names([a, b, a])."])
def test_every_command_refuses_it_in_one_line_and_writes_nothing(
    command: list[str],
    slip: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.pl"
    path.write_text(THREE + slip)
    rules = [str(study_of(path))] if command[0] == "study" else ["--rules", str(path)]
    assert run([*command, *rules]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "state/1" in printed.err or "state_names/1" in printed.err
    assert [one.name for one in tmp_path.iterdir() if one.is_dir()] == []


def test_a_query_prints_the_observation_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.pl"
    path.write_text(THREE + "state_names([a, 'how fast', c]).")
    assert run(["query", "--state", EXAMPLE, "--rules", str(path)]) == 0
    text = capsys.readouterr().out
    assert text.endswith(
        "observation\n  a                   0.500   how fast            0.590\n  c                   1.000\n"
    )
    assert run(["query", "--state", EXAMPLE, "--rules", str(path), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["observation"] == [0.5, 0.59, 1.0]
    assert data["observation_names"] == ["a", "how fast", "c"]


@pytest.mark.parametrize("slip", ["state_names([a, b, c, d]).", "state_names([a, b, a])."])
def test_the_check_of_rules_finds_it(slip: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.pl"
    path.write_text(THREE + slip)
    assert run(["rules", "check", str(path)]) == 1
    out = capsys.readouterr().out
    assert f"error  {path}:" in out
    assert "1 finding\n" in out
