"""Rules from an environment's own failures: what labels promise, the loop, the file, and what is refused."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.assurance import load_tables, measure, run_cases
from drlsl.cli import run as command
from drlsl.errors import UserError
from drlsl.induction import Effort, LearningRun, Learnt, covered
from drlsl.induction.environments import (
    EnvironmentDomain,
    EnvRequest,
    LearningDomain,
    Lookahead,
    NamedDomain,
    StateBias,
    Verdict,
    find_domain,
    write_states_table,
)
from drlsl.induction.environments.futures import FUTURES, Episode, TableFutures, way_back
from drlsl.induction.environments.labelled_actions import LabelledActions, label_episode, labelled_actions
from drlsl.induction.environments.learnt_states import simplified
from drlsl.induction.environments.plain_facts import as_facts
from drlsl.induction.environments.rule_stress import learnt_rules, rule_stress
from drlsl.shield import LogicShield
from drlsl.workers import Crew
from tests.induction.sleds import Sled, margin, sled

SLEDS = "tests.induction.sleds:"
DOMAIN = "drlsl.induction.environments.environment_domain"
LABELS = "drlsl.induction.environments.labelled_actions"


def learn(out: Path, name: str, **settings: Any) -> Learnt[Any]:
    request = EnvRequest(name, **{"effort": Effort(seconds=5.0), **settings})
    return LearningRun(EnvironmentDomain(request), out, lambda _: None).run()


class Table(gymnasium.Env[Any, Any]):
    """An environment that is a table of chances; odd rewards are failures."""

    action_space = gymnasium.spaces.Discrete(2)
    observation_space = gymnasium.spaces.Discrete(5)

    def __init__(self, table: dict[int, dict[int, list[tuple[float, int, float, bool]]]]) -> None:
        self.P, self.s = table, 0


TRANSITIONS = st.lists(
    st.tuples(
        st.sampled_from([0.0, 0.5]), st.integers(0, 4), st.sampled_from([0.0, 0.0, 1.0]), st.booleans()
    ),
    min_size=1,
    max_size=3,
)
TABLES = st.fixed_dictionaries({s: st.fixed_dictionaries({0: TRANSITIONS, 1: TRANSITIONS}) for s in range(5)})


@settings(max_examples=200, deadline=None)
@given(table=TABLES, horizon=st.integers(1, 5))
def test_a_verdict_is_that_of_sets_of_states_grown_backwards(table: Any, horizon: int) -> None:
    """Independently: the states from which a failure cannot be averted within 1, 2, … decisions."""
    named = NamedDomain(
        "table",
        LearningDomain(
            make=lambda seed: Table(table),
            actions={"a": 0, "b": 1},
            facts=lambda env: {},
            failed=lambda step: step.reward == 1.0,
            bias="",
            fallback="a",
        ),
        Path(),
    )
    lost: set[int] = set()
    unsafe: set[tuple[int, int]] = set()
    for _ in range(horizon):
        unsafe = {
            (state, action)
            for state, actions in table.items()
            for action, ends in actions.items()
            if any(
                chance > 0 and (reward == 1.0 or (not terminated and after in lost))
                for chance, after, reward, terminated in ends
            )
        }
        lost = {state for state in table if all((state, action) in unsafe for action in (0, 1))}
    episode = object.__new__(Episode)
    episode.named, episode.env = named, Table(table)
    lookahead = Lookahead(TableFutures(episode), [0, 1], horizon)
    for state in table:
        for action in (0, 1):
            expected = Verdict.UNSAFE if (state, action) in unsafe else Verdict.SAFE
            assert lookahead.verdict(state, action) == expected


@pytest.mark.parametrize(("name", "way"), [("sled", "copies"), ("replayed", "replays")])
def test_an_action_is_unsafe_where_the_sled_can_no_longer_stop(name: str, way: Any) -> None:
    bias = StateBias.of(SLEDS + name)
    assert way_back(bias.named, 0) == way
    some = 0
    for seed in range(8):
        rows = label_episode(bias, way, seed)
        for facts, action, unsafe in zip(rows.facts, rows.action, rows.unsafe, strict=True):
            told = as_facts(facts)
            x, speed = told["at", 1][0][0], told["speed", 1][0][0]
            assert unsafe == (margin(x, speed, sled.actions[action]) < 0), (x, speed, action)
            some += unsafe
    assert some > 10


def test_with_chance_an_action_is_unsafe_if_any_draw_leads_to_a_failure() -> None:
    bias = StateBias.of(SLEDS + "windy")
    for seed in range(6):
        rows = label_episode(bias, "copies", seed)
        for facts, action, unsafe in zip(rows.facts, rows.action, rows.unsafe, strict=True):
            told = as_facts(facts)
            x, speed = told["at", 1][0][0], told["speed", 1][0][0]
            assert unsafe == (margin(x, speed, sled.actions[action], wind=1) < 0), (x, speed, action)


def test_what_the_end_of_an_episode_hides_has_no_label() -> None:
    """In the last decisions a sled that is too fast has not fallen yet."""
    bias = StateBias.of(SLEDS + "sled")
    found = [label_episode(bias, "copies", seed) for seed in range(20)]
    whole = [one for one in found if not one.failures]
    assert whole
    for one in whole:
        assert one.left_out.get("cut short", 0) + len(one) == 3 * 15


@pytest.mark.parametrize(("name", "way"), [("sled", "copies"), ("replayed", "replays")])
def test_without_chance_an_action_is_tried_once_in_a_state(
    name: str, way: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The labels are those of trying everything anew in each decision, in fewer steps."""
    bias, steps = StateBias.of(SLEDS + name), [0]
    step = Sled.step

    def counted(self: Sled, action: int) -> Any:
        steps[0] += 1
        return step(self, action)

    monkeypatch.setattr(Sled, "step", counted)
    once = [label_episode(bias, way, seed) for seed in range(12)]
    few, steps[0] = steps[0], 0
    monkeypatch.setattr(f"{LABELS}.OnceFutures", lambda episode, futures: futures)
    assert [label_episode(bias, way, seed) for seed in range(12)] == once
    assert few < 0.8 * steps[0]


def test_driving_is_not_disturbed_by_looking_ahead() -> None:
    for name in ("sled", "replayed"):
        episode = Episode(find_domain(SLEDS + name), 3)
        way = way_back(episode.named, 0)
        futures = FUTURES[way](episode)
        lookahead = Lookahead(futures, [0, 1, 2], 4)
        plain = Sled()
        plain.reset(seed=3)
        for action in (2, 1, 0, 2):
            lookahead.verdict(futures.here(), 2)
            episode.step(action)
            plain.step(action)
            assert episode.facts() == (("at", 1, ((plain.x,),)), ("speed", 1, ((plain.speed,),)))


def test_numbers_of_generated_code_are_those_of_the_interpreter() -> None:
    for name in (SLEDS + "sled", "frozen_lake"):
        bias = StateBias.of(name)
        episode = Episode(bias.named, 5)
        for _ in range(6):
            facts = episode.facts()
            found = bias.values(facts).ravel()
            answers = bias._interpreted(as_facts(facts))
            expected = [np.nan if one is None else float(one) for one in answers[: len(bias.names)]]
            np.testing.assert_array_equal(found, expected)
            assert bias._programs, "generated code was compared"
            if episode.step(1) != "goes_on":
                break


def test_a_condition_is_a_quantity_that_is_met_or_not() -> None:
    bias = StateBias.of(SLEDS + "sled")
    assert [one.direction for one in bias.quantities] == ["more", "less", "holds", "fails"]
    holds, fails = bias.quantities[2:]
    assert (holds.literal(1, "V"), fails.literal(1, "V")) == ("pushes(Action)", "\\+ pushes(Action)")
    eases = bias.eases(bias.values(Episode(bias.named, 0).facts()))
    push = bias.choices.index("push")
    for place in range(3):
        assert (eases[place, 2] > 1, eases[place, 3] > 1) == (place == push, place != push)
        assert (holds.words(eases[place, 2]), fails.words(eases[place, 3])) == (
            ("yes", "yes") if place == push else ("no", "no")
        )


def test_a_sled_learns_to_stop(tmp_path: Path) -> None:
    out = tmp_path / "learnt.pl"
    result = learn(out, SLEDS + "sled")
    assert result.finished
    assert not covered(result.clauses, result.examples.eases[result.examples.unsafe]).any()
    text = out.read_text()
    assert "forall(margin(Action, V1), V1 >= 0.0)" in text
    assert "% Clause 1 offers " in text
    assert result.examples.words(0).count("pushes") == 1
    inner = Sled()
    env = LogicShield(inner, [out], actions=sled.actions, facts=sled.facts, fallback="brake", mode="raise")
    rng = np.random.default_rng(0)
    for seed in range(30):
        _, info = env.reset(seed=seed)
        if margin(inner.x, inner.speed, 0) < 0:
            continue
        over = False
        while not over:
            offered = info["action_mask"].nonzero()[0]
            _, _, fallen, over, info = env.step(int(rng.choice(offered)))
            assert not fallen
    assert env.counts.fail_safes == 0


@pytest.fixture
def too_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Labels without the actions that are just unsafe, so that the first clauses are too bold."""

    def some(*given: Any, **options: Any) -> LabelledActions:
        found = labelled_actions(*given, **options)
        rows = [
            row
            for row in zip(found.facts, found.action, found.unsafe, found.origin, strict=True)
            if margin(row[0][0][2][0][0], row[0][1][2][0][0], sled.actions[row[1]]) != -1
        ]
        facts, action, unsafe, origin = zip(*rows, strict=True)
        return LabelledActions(facts, action, unsafe, origin)

    monkeypatch.setattr(f"{DOMAIN}.labelled_actions", some)


@pytest.mark.usefixtures("too_few")
def test_what_goes_wrong_is_learnt_from(tmp_path: Path) -> None:
    result = learn(tmp_path / "learnt.pl", SLEDS + "sled")
    assert len(result.rounds) > 1
    assert result.rounds[0].bad
    assert result.finished
    assert result.examples.origin[-1].startswith("stress, seed 1")
    assert "V1 >= 0.0" in (tmp_path / "learnt.pl").read_text()
    for one in result.rounds[0].bad:
        told = as_facts(one.facts)
        assert margin(told["at", 1][0][0], told["speed", 1][0][0], sled.actions[one.action]) < 0


@pytest.mark.usefixtures("too_few")
def test_a_stopped_run_goes_on_to_the_same_rules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = learn(tmp_path / "whole.pl", SLEDS + "sled")
    rounds = [0]

    def stopped(*given: Any, **options: Any) -> Any:
        rounds[0] += 1
        if rounds[0] == 2:
            raise KeyboardInterrupt
        return rule_stress(*given, **options)

    out = tmp_path / "parts.pl"
    with monkeypatch.context() as patched:
        patched.setattr(f"{DOMAIN}.rule_stress", stopped)
        with pytest.raises(KeyboardInterrupt):
            learn(out, SLEDS + "sled")
    assert "learnt(Action) :-" in out.read_text(), "the best so far is left"
    monkeypatch.setattr("drlsl.induction.environments.labelled_actions.label_episode", None)
    rest = learn(out, SLEDS + "sled")
    assert rest.rounds == whole.rounds
    assert out.read_text().splitlines()[1:] == (tmp_path / "whole.pl").read_text().splitlines()[1:]
    with pytest.raises(UserError, match="holds the rounds of other settings"):
        learn(out, SLEDS + "sled", examples=25)


def test_the_number_of_processes_makes_no_difference(tmp_path: Path) -> None:
    one, two = (
        learn(tmp_path / f"{jobs}.pl", SLEDS + "sled", examples=60, episodes=12, crew=Crew(jobs))
        for jobs in (1, 2)
    )
    assert one.rounds == two.rounds
    assert (one.examples.eases == two.examples.eases).all()


def test_frozen_lake_learns_the_exact_rule_for_three_moves(tmp_path: Path) -> None:
    """Where no move is learnt to be safe, the file offers what the program says otherwise."""
    out = tmp_path / "lake.pl"
    result = learn(out, "frozen_lake", examples=1500, episodes=4)
    assert "\\+ may_fall(Action),\n    forall(lasting_moves(Action, V2), V2 >= 1.0)." in out.read_text()
    assert result.rounds[-1].optimal
    assert result.rounds[-1].safe == result.problem.safe_count
    bias = StateBias.of("frozen_lake")
    rules = learnt_rules(bias.named, out)
    otherwise = 0
    for facts in list(dict.fromkeys(_lake_states(bias)))[:40]:
        met = covered(result.clauses, bias.eases(bias.values(facts)))
        offered = set(rules.offer(as_facts(facts)).actions)
        if met.any():
            assert offered == {name for name, one in zip(bias.choices, met, strict=True) if one}
        else:
            otherwise += 1
            assert offered == {str(one) for one in _solutions(bias, facts, "otherwise")}
    assert otherwise
    assert rules.counts.fail_safes == 0


def _lake_states(bias: StateBias) -> Sequence[Any]:
    return [facts for seed in (77, 79) for facts in label_episode(bias, "table", seed).facts]


def _solutions(bias: StateBias, facts: Any, name: str) -> Sequence[Any]:
    bias._reference.state(as_facts(facts))
    return [one["A"] for one in bias.engine.query(f"{name}(A)")]


def test_one_command_learns_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "sled.pl"
    arguments = ["--domain", f"{SLEDS}sled", "--out", str(out), "--jobs", "1", "--search-time", "5"]
    assert command(["rules", "learn", *arguments]) == 0
    printed = capsys.readouterr()
    assert "| other seeds | no rules | " in printed.out
    assert "labelling 300 actions in " in printed.err.splitlines()[0]
    report = (tmp_path / "sled.report" / "report.md").read_text()
    bare, learnt = (
        int(line.split("|")[3].split(" of ")[0]) for line in report.splitlines() if line.startswith("| other")
    )
    assert learnt < bare / 4
    settings = json.loads((tmp_path / "sled.rounds" / "settings.json").read_text())
    assert settings["domain"] == f"{SLEDS}sled"
    (wrote,) = re.findall(r"wrote .* and its table, which notices (\d+ of \d+) mutants", printed.out)
    assert f"- the table notices {wrote} mutants; " in report


def test_its_table_has_real_states_on_both_sides_of_each_limit(tmp_path: Path) -> None:
    """The sled's rules pass it, reach all of it, and a limit moved by a step is noticed or has a reason."""
    out = tmp_path / "sled.pl"
    learnt = learn(out, f"{SLEDS}sled")
    mutants = write_states_table(out, learnt.clauses, learnt.examples)
    assert mutants.unexplained == []
    rules, cases = load_tables([out], [out.with_suffix(".test.yaml")])
    assert run_cases(rules, cases).failures == []
    assert measure(rules, cases)[0].missed == ()
    sides = {case.name.rpartition(" / ")[2]: case for case in cases}
    for words, is_safe in (("just not", False), ("just", True)):
        state = sides[words].state
        (action,) = (check.what.removeprefix("objections ") for check in sides[words].checks[1:])
        (x,), (speed,) = state["at", 1][0], state["speed", 1][0]
        assert (margin(x, speed, sled.actions[action]) >= 0) == is_safe, (x, speed, action)
    limits = [one for one in mutants.verdicts if one.name.startswith("learnt/1") and one.kind == "constant"]
    assert any(one.killed_by for one in limits)


@given(
    rows=st.lists(st.tuples(st.integers(0, 9), st.floats(0, 9)), min_size=1, max_size=6),
    matters=st.integers(0, 9),
)
def test_a_state_keeps_what_its_verdict_depends_on(rows: list[tuple[int, float]], matters: int) -> None:
    facts: Any = (("car", 2, tuple(rows)), ("ego", 1, ((1.23456789,),)))

    def verdict(one: Any) -> Any:
        return sorted(round(x, 2) for car, x in one[0][2] if car == matters), one[1][2][0][0] > 1.2

    wanted = verdict(facts)
    plain = simplified(facts, {("car", 2)}, lambda one: verdict(one) == wanted)
    assert verdict(plain) == wanted
    assert all(car == matters for car, _ in plain[0][2])
    assert len(plain[1][2]) == 1


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["nowhere"], "expected frozen_lake, highway_env, FILE.py:NAME or PACKAGE.MODULE:NAME"),
        (["nowhere.py:domain"], "no file nowhere.py in"),
        (["drlsl_nowhere:domain"], "cannot import the module: ModuleNotFoundError"),
        ([f"{SLEDS}no_such"], "has no 'no_such'"),
        ([f"{SLEDS}no_domain"], "it is a dict; expected a LearningDomain"),
        ([f"{SLEDS}no_environment"], "returned None; expected an environment"),
        ([f"{SLEDS}wrong_facts"], "facts raised AttributeError: 'Sled' object has no attribute 'nowhere'"),
        (
            [f"{SLEDS}wrong_failed"],
            f"drlsl: --domain {SLEDS}wrong_failed: failed: AttributeError: 'Sled' object has no attribute",
        ),
        ([f"{SLEDS}unknown_quantity"], "distance/2 is not defined"),
        (
            [f"{SLEDS}lost"],
            "neither by copying it (TypeError: a sled of C++ cannot be copied) nor by playing",
        ),
        ([f"{SLEDS}unseen_wind"], "what an action does depends on chance"),
        ([f"{SLEDS}never_fails"], "none of 300 actions was unsafe in"),
        ([f"{SLEDS}always_fails"], "no safe example, only unsafe ones: there is nothing to learn"),
        ([f"{SLEDS}sled", "--label", "rss"], "--label is for lane changes, and means nothing with --domain"),
        ([f"{SLEDS}sled", "--must", "a"], "--must is for lane changes"),
        ([f"{SLEDS}sled", "--clauses", "0"], "--clauses 0: expected 1 or more"),
    ],
)
def test_what_cannot_be_learnt_is_one_line(
    arguments: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "learnt.pl")
    assert command(["rules", "learn", "--out", out, "--jobs", "1", "--domain", *arguments]) == 2
    error = capsys.readouterr().err.splitlines()
    assert why in error[-1]
    assert not any("Traceback" in line for line in error)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"fallback": "jump"}, "fallback: jump is not among brake, coast, push"),
        ({"actions": {"Brake now": 0}}, "'Brake now' is no name for rules"),
        ({"horizon": 0}, "horizon is 0; expected 1 or more"),
        ({"draws": 0}, "draws is 0; expected 1 or more"),
    ],
)
def test_a_wrong_domain_is_refused_where_it_is_made(wrong: dict[str, Any], why: str) -> None:
    with pytest.raises(UserError, match=why):
        replace(sled, **wrong)


def test_an_action_that_the_environment_lacks_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = replace(sled, actions={**sled.actions, "jump": 7})
    monkeypatch.setattr("tests.induction.sleds.beyond", wrong, raising=False)
    with pytest.raises(UserError, match="jump is 7; the environment's are 0 to 2"):
        EnvironmentDomain(EnvRequest(f"{SLEDS}beyond"))
