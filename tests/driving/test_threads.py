"""One shield asked from many threads: each answer is that of its own scene."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayEnv
from drlsl.driving.scene import EGO, Scene, SceneBatch, Vehicle
from drlsl.driving.shield import Decisions, Shield
from drlsl.logic import Engine
from drlsl.logic.engine import EngineBusyError
from tests.installed import TIERS
from tests.scenes import road

THREADS = 8
SAMPLE = 40
DECISIONS = [pytest.param(SAMPLE, id="sample"), pytest.param(1_000, id="all", marks=pytest.mark.slow)]

Ask = Callable[[int], object]


@pytest.fixture(autouse=True)
def _many_switches() -> Iterator[None]:
    """Let threads take turns a hundred times as often as usual."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(5e-5)
    yield
    sys.setswitchinterval(before)


def scenes(count: int) -> list[Scene]:
    """Scenes on roads with one to four lanes, and with up to nine vehicles, no two alike."""
    rng = np.random.default_rng(5)
    made = []
    for number in range(count):
        lanes = 1 + number % 4
        lane = int(rng.integers(lanes)) + 1
        names = [f"v{index}" for index in range(int(rng.integers(10)))]
        others = tuple(
            Vehicle(
                name, at, float(rng.uniform(-90, 90)), 3.75 * at, float(rng.uniform(15, 35)), 0.0, 4.6, 1.9
            )
            for name in names
            for at in [int(rng.integers(lanes)) + 1]
        )
        ego = Vehicle(EGO, lane, 0.0, 3.75 * lane, float(rng.uniform(20, 35)), 0.0, 4.6, 1.9)
        made.append(Scene(road(0, lanes), ego, others, lane))
    return made


def in_threads(asks: Sequence[Ask], count: int) -> list[list[object]]:
    """What each of several threads, which begin at once, is answered to `count` questions."""
    answers: list[list[object]] = [[] for _ in asks]
    start = threading.Barrier(len(asks))

    def work(ask: Ask, into: list[object]) -> None:
        start.wait()
        for number in range(count):
            try:
                into.append(ask(number))
            except Exception as error:  # noqa: BLE001  (is compared with what was expected)
                into.append(repr(error))

    threads = [threading.Thread(target=work, args=pair) for pair in zip(asks, answers, strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return answers


def wrong(asks: Sequence[Ask], count: int) -> int:
    """How many answers in threads are not those that one thread gets."""
    expected = [[ask(number) for number in range(count)] for ask in asks]
    found = in_threads(asks, count)
    return sum(
        mine != theirs
        for one, other in zip(expected, found, strict=True)
        for mine, theirs in zip(one, other, strict=True)
    )


def plain(decisions: Decisions) -> object:
    names = ("action_mask", "target_speed", "observation", "front_is_free", "lane_to_keep")
    return [getattr(decisions, name).tolist() for name in names], decisions.failures


@pytest.mark.parametrize("count", DECISIONS)
@pytest.mark.parametrize("tier", TIERS)
def test_every_decision_is_of_its_own_scene(tier: str, count: int) -> None:
    shield, made = Shield.default(tier=tier), scenes(173)

    def ask(thread: int) -> Ask:
        def one(number: int) -> object:
            place = (thread * 31 + number * 7) % len(made)
            match (thread + number) % 4:
                case 0:
                    return shield.decide(made[place])
                case 1:
                    return shield.entry_is_safe(made[place])
                case 2:
                    return plain(shield.decide_batch(SceneBatch.of([made[place]])))
                case _:
                    return shield.entries_are_safe(SceneBatch.of(made[place : place + 3])).tolist()

        return one

    assert wrong([ask(thread) for thread in range(THREADS)], count) == 0


@pytest.mark.parametrize("tier", ["interpreter", "scalar"])
def test_a_tier_that_is_chosen_by_many_threads_at_once(tier: str) -> None:
    made = scenes(8)
    expected = plain(Shield.default(tier=tier).decide_batch(SceneBatch.of(made)))
    for _ in range(3):
        shield = Shield.default(tier=tier)
        asks = [lambda _number: plain(shield.decide_batch(SceneBatch.of(made)))] * THREADS  # noqa: B023
        assert in_threads(asks, 1) == [[expected]] * THREADS


def test_environments_in_threads_share_a_shield() -> None:
    shield, rules = Shield.default(tier="interpreter"), EnvConfig(recording="highway-test")

    def drive(seed: int) -> Ask:
        env = HighwayEnv(rules, shield=shield)
        env.reset(seed=seed)

        def one(number: int) -> object:
            if number == 0:
                env.reset(seed=seed)
            observation, reward, terminated, truncated, info = env.step((number // 9) % 3)
            return (
                observation.tolist(),
                reward,
                terminated,
                truncated,
                {**info, "action_mask": info["action_mask"].tolist()},
            )

        return one

    assert wrong([drive(seed) for seed in range(3)], 15) == 0


def test_scenes_can_be_told_and_asked_about_under_the_shields_lock() -> None:
    shield, made = Shield.default(), scenes(40)

    def one(number: int) -> object:
        with shield.lock:
            shield.state_facts(made[number])
            return sorted(
                str(solution) for solution in shield.engine.query("vehicle(Name, Lane, X, _, _, _, _, _)")
            )

    assert wrong([one] * THREADS, 20) == 0


def blocked(engine: Engine, goal: Callable[[], object]) -> object:
    """What a call comes to while another thread is in the middle of a query."""
    inside, go_on = threading.Event(), threading.Event()

    class Output:
        def write(self, _text: str) -> None:
            inside.set()
            go_on.wait(20)

        def flush(self) -> None:
            pass

    engine.output = Output()  # type: ignore[assignment]
    thread = threading.Thread(target=lambda: engine.holds("write(now)"))
    thread.start()
    assert inside.wait(20)
    try:
        return goal()
    finally:
        go_on.set()
        thread.join()


USES: dict[str, Callable[[Engine], Any]] = {
    "holds": lambda engine: engine.holds("true"),
    "once": lambda engine: engine.once("p(X)"),
    "query": lambda engine: list(engine.query("p(X)")),
    "replace_facts": lambda engine: engine.replace_facts("p", 1, [(3,)]),
    "consult_text": lambda engine: engine.consult_text("q(1)."),
    "consult": lambda engine: engine.consult(Path(__file__).parents[2] / "rules" / "highway.pl"),
    "explain": lambda engine: engine.explain("p(X)"),
}


@pytest.mark.parametrize("use", USES)
def test_an_engine_refuses_a_second_thread(use: str) -> None:
    engine = Engine()
    engine.consult_text("p(1). p(2).")
    with pytest.raises(EngineBusyError, match="busy in another thread"):
        blocked(engine, lambda: USES[use](engine))
    assert [solution["X"] for solution in engine.query("p(X)")] == [1, 2]
    assert not engine.defines("q", 1)


def test_an_engine_goes_from_thread_to_thread_between_two_solutions() -> None:
    engine = Engine()
    engine.consult_text("p(1). p(2). p(3).")
    solutions = engine.query("p(X), p(Y)")
    found = []
    for _ in range(9):
        thread = threading.Thread(target=lambda: found.append(next(solutions)))
        thread.start()
        thread.join()
        assert engine.holds("p(1)")
    assert len({(solution["X"], solution["Y"]) for solution in found}) == 9
    assert next(solutions, None) is None


def test_a_query_may_be_asked_within_another() -> None:
    engine = Engine()
    engine.consult_text("p(1). p(2).")
    assert sum(1 for _ in engine.query("p(X)") for _ in engine.query("p(Y)")) == 4
