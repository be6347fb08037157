"""The futures of a state, by the environment's table of chances, by copies of it, or by replays."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, Protocol, TypeAlias

import gymnasium
import numpy as np

from drlsl.errors import UserError
from drlsl.induction.environments.learning_domain import NamedDomain
from drlsl.induction.environments.plain_facts import PlainFacts, facts_in

End: TypeAlias = Literal["goes_on", "failed", "terminated", "truncated"]

Way: TypeAlias = Literal["table", "copies", "replays"]
"""How one comes back to a state."""

PROBED: Final = 6
"""Decisions in which one looks whether copies or replays are faithful."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One of the outcomes of an action: how it ended, and the state after it."""

    end: End
    state: Any


class Futures(Protocol):
    """The states of an episode, and what may follow them."""

    exact: bool
    """True if the outcomes are all that have a chance, and states can be compared."""

    def here(self) -> Any:
        """Return the present state of the episode."""

    def outcomes(self, state: Any, action: int) -> Iterator[Outcome]:
        """Yield what may follow if an action is taken in a state."""


class Episode:
    """An episode of a domain's environment, with the actions taken so far."""

    def __init__(self, named: NamedDomain, seed: int) -> None:
        """Begin it.

        Raises:
            UserError: the environment cannot be made.
        """
        self.named, self.seed = named, seed
        self.env: gymnasium.Env[Any, Any] = named.environment(seed)
        self.env.reset(seed=seed)
        self.taken: list[int] = []

    def facts(self) -> PlainFacts:
        """Return the facts of the present state."""
        return facts_in(self.named.domain.facts, self.env)

    def step(self, action: int) -> End:
        """Take an action, and return how it ended."""
        self.taken.append(action)
        return ended(self.named, self.env, self.env.step(action))


def ended(named: NamedDomain, env: gymnasium.Env[Any, Any], step: tuple[Any, ...]) -> End:
    """Return how a step of an environment ended."""
    if named.failed(env, step):
        return "failed"
    return "terminated" if step[2] else "truncated" if step[3] else "goes_on"


class TableFutures:
    """The futures of an environment with Gymnasium's table `P` of chances, and its state `s`."""

    exact = True

    def __init__(self, episode: Episode) -> None:
        self._named = episode.named
        self._env: Any = episode.env.unwrapped
        self._scratch: Any = copy.copy(self._env)

    def here(self) -> int:
        """Return the number of the state."""
        return int(self._env.s)

    def outcomes(self, state: int, action: int) -> Iterator[Outcome]:
        """Yield each outcome that has a chance."""
        for chance, after, reward, terminated in self._env.P[state][action]:
            if chance <= 0.0:
                continue
            self._scratch.s = int(after)
            step = (int(after), reward, terminated, False, {"prob": chance})
            yield Outcome(ended(self._named, self._scratch, step), int(after))


class CopyFutures:
    """The futures of an environment that can be copied."""

    exact = False

    def __init__(self, episode: Episode, draws: int | None = None) -> None:
        self._episode, self._draws = episode, draws or episode.named.domain.draws

    def here(self) -> gymnasium.Env[Any, Any]:
        """Return a copy of the environment."""
        return copy.deepcopy(self._episode.env)

    def facts(self, state: gymnasium.Env[Any, Any]) -> PlainFacts:
        """Return the facts of a state."""
        return facts_in(self._episode.named.domain.facts, state)

    def outcomes(self, state: gymnasium.Env[Any, Any], action: int) -> Iterator[Outcome]:
        """Yield an outcome for each draw."""
        for draw in range(self._draws):
            env = copy.deepcopy(state)
            if self._draws > 1:
                reseed(env, draw)
            yield Outcome(ended(self._episode.named, env, env.step(action)), env)


class ReplayFutures:
    """The futures of an environment that cannot be copied: each is played again from the beginning.

    A state is the actions so far, each with the draw that went before it, if any.
    """

    exact = False

    def __init__(self, episode: Episode, draws: int | None = None) -> None:
        """Make a second environment.

        Raises:
            UserError: `make` returns the one that is being driven.
        """
        named = episode.named
        self._episode, self._draws = episode, draws or named.domain.draws
        self._env = named.environment(episode.seed)
        if self._env is episode.env:
            raise UserError("make returns the same environment again, so that no other can be played")

    def here(self) -> tuple[tuple[int, int | None], ...]:
        """Return the actions so far."""
        return tuple((action, None) for action in self._episode.taken)

    def facts(self, state: Sequence[tuple[int, int | None]]) -> PlainFacts:
        """Return the facts of a state."""
        self._play(state)
        return facts_in(self._episode.named.domain.facts, self._env)

    def outcomes(self, state: Sequence[tuple[int, int | None]], action: int) -> Iterator[Outcome]:
        """Yield an outcome for each draw."""
        for draw in range(self._draws):
            after = (*state, (action, draw if self._draws > 1 else None))
            yield Outcome(self._play(after), after)

    def _play(self, actions: Sequence[tuple[int, int | None]]) -> End:
        """Play some actions, and return how the last of them ended."""
        self._env.reset(seed=self._episode.seed)
        end: End = "goes_on"
        for place, (action, draw) in enumerate(actions):
            if draw is not None:
                reseed(self._env, draw + 1000 * place)
            end = ended(self._episode.named, self._env, self._env.step(action))
        return end


FUTURES: Final[dict[Way, Any]] = {"table": TableFutures, "copies": CopyFutures, "replays": ReplayFutures}


@dataclass(slots=True, eq=False)
class _Moment:
    """A state of an environment without chance, and what is known to follow it, by action."""

    state: Any
    after: dict[int, Outcome] = field(default_factory=dict)


class OnceFutures:
    """The futures of an environment without chance: each action is tried once in a state.

    What an action was found to lead to is still known when the episode has taken it.
    """

    exact = False

    def __init__(self, episode: Episode, futures: Futures) -> None:
        self._episode, self._futures = episode, futures
        self._here, self._taken = _Moment(futures.here()), len(episode.taken)

    def here(self) -> _Moment:
        """Return the present state of the episode."""
        taken = self._episode.taken
        if len(taken) != self._taken:
            known = self._here.after.get(taken[-1]) if len(taken) == self._taken + 1 else None
            self._here = _Moment(self._futures.here()) if known is None else known.state
            self._taken = len(taken)
        return self._here

    def outcomes(self, state: _Moment, action: int) -> Iterator[Outcome]:
        """Yield what follows."""
        if action not in state.after:
            (found,) = self._futures.outcomes(state.state, action)
            state.after[action] = Outcome(found.end, _Moment(found.state))
        yield state.after[action]


def reseed(env: gymnasium.Env[Any, Any], seed: int) -> None:
    """Begin an environment's random numbers anew, wherever it has kept its generator."""
    inner = env.unwrapped
    inner.np_random.bit_generator.state = np.random.default_rng(seed).bit_generator.state


def way_back(named: NamedDomain, seed: int) -> Way:
    """Return how one comes back to the states of a domain's environment.

    Raises:
        UserError: a function of the domain raised an error, neither copies nor replays are faithful, or what
            actions do depends on chance, and the domain has one draw.
    """
    inner: Any = Episode(named, seed).env.unwrapped
    table, state = getattr(inner, "P", None), getattr(inner, "s", None)
    actions = list(named.domain.actions.values())
    if isinstance(table, dict) and state in table and all(one in table[state] for one in actions):
        return "table"
    for _ in _probed(Episode(named, seed)):
        pass  # an error of the domain's own functions is told as it is
    ways: list[Way] = ["copies", "replays"]
    problems = []
    for way in ways:
        problem = _unlike(named, seed, way)
        if not problem:
            if named.domain.draws == 1:
                _check_chance(named, seed, way)
            return way
        problems.append(problem)
    raise UserError(
        f"--domain {named.name}: the environment cannot be brought back to a state, neither by copying it "
        f"({problems[0]}) nor by playing the episode again ({problems[1]})"
    )


def _probed(episode: Episode) -> Iterator[int]:
    """Take some actions, and yield each before it is taken."""
    rng = np.random.default_rng(0)
    for _ in range(PROBED):
        action = int(rng.choice(list(episode.named.domain.actions.values())))
        yield action
        if episode.step(action) != "goes_on":
            return


def _unlike(named: NamedDomain, seed: int, way: Way) -> str:
    """Return in what the futures of an environment are not its own; nothing if they are."""
    episode = Episode(named, seed)
    try:
        futures = FUTURES[way](episode, draws=1)
        for action in _probed(episode):
            before = episode.facts()
            if futures.facts(futures.here()) != before:
                return "its facts are others then"
            ends = [
                _told(futures, outcome)
                for _ in range(2)
                for outcome in futures.outcomes(futures.here(), action)
            ]
            if episode.facts() != before:
                return "it changes when the other is stepped"
            if ends[0] != ends[1]:
                return "it goes on differently each time"
    except UserError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001 - whatever an environment raises that is not made for this
        return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]:.80}"
    return ""


def _check_chance(named: NamedDomain, seed: int, way: Way) -> None:
    """Check that what actions do does not depend on chance.

    Raises:
        UserError: it does.
    """
    episode = Episode(named, seed)
    futures = FUTURES[way](episode, draws=2)
    for _ in _probed(episode):
        for action in named.domain.actions.values():
            one, other = (_told(futures, outcome) for outcome in futures.outcomes(futures.here(), action))
            if one != other:
                raise UserError(
                    f"--domain {named.name}: what an action does depends on chance, after "
                    f"{len(episode.taken)} decisions; give the domain draws=8, or as many as show all that "
                    "may happen"
                )


def _told(futures: Any, outcome: Outcome) -> tuple[End, PlainFacts | None]:
    """Return an outcome in a form that can be compared."""
    return outcome.end, futures.facts(outcome.state) if outcome.end == "goes_on" else None
