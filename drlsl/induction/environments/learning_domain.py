"""The description of an environment for learning: how to make it, its actions, facts and failures."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import gymnasium

from drlsl.errors import UserError
from drlsl.files import find_object, users_code
from drlsl.lowering import Schema
from drlsl.shield import Facts, LogicShield, rule_file

Make: TypeAlias = Callable[[int], gymnasium.Env[Any, Any]]
"""Returns the environment of an episode, given the episode's seed; it is reset with that seed."""

_PLACE: Final = "drlsl.induction.environments.shipped_domains"

SHIPPED: Final = {"frozen_lake": f"{_PLACE}:frozen_lake", "highway_env": f"{_PLACE}:highway_env"}
"""The domains that have a short name, and where they are."""

_NAME: Final = re.compile(r"[a-z]\w*")


class Step(NamedTuple):
    """The result of a step; `env` is the environment without its wrappers, after it."""

    env: Any
    reward: float
    terminated: bool
    info: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class LearningDomain:
    """An environment with discrete actions in which rules are learnt from its own failures.

    `make(seed)` returns the environment of an episode; `actions`, `facts`, `fallback`, `schema` and `tier`
    are as of `LogicShield`; `failed(step)` says whether a step ended in a failure. `bias` is the program
    whose `learn/2` declares what clauses are made of, its path as from the file of the domain.

    An action is unsafe if after it some chance leads to a failure within `horizon` decisions, itself
    included, whatever is done then. Where the environment has no table of its chances, each action is tried
    with `draws` random numbers; 1 is for an environment without chance.

    `held_out` makes environments to judge by, by name; without it, further seeds of `make`. `shield` puts an
    environment behind rules that are known, by the same facts, to set beside the learnt ones. `examples`,
    `episodes` and `trials` are the usual numbers of actions to label, of episodes of stress in a round, and
    of held-out episodes.
    """

    make: Make
    actions: Mapping[str, int]
    facts: Callable[[Any], Facts]
    failed: Callable[[Step], bool]
    bias: str | Path
    fallback: str
    horizon: int = 4
    draws: int = 1
    schema: Schema | None = None
    tier: str = "auto"
    held_out: Mapping[str, Make] = field(default_factory=dict)
    shield: Callable[[gymnasium.Env[Any, Any]], LogicShield] | None = None
    examples: int = 2000
    episodes: int = 500
    trials: int = 200

    def __post_init__(self) -> None:
        """Check what can be checked without an environment.

        Raises:
            UserError: a setting is not usable.
        """
        for name in self.actions:
            if not isinstance(name, str) or not _NAME.fullmatch(name):
                raise UserError(f"actions: {name!r} is no name for rules; expected one such as turn_left")
        if self.fallback not in self.actions:
            raise UserError(f"fallback: {self.fallback} is not among {', '.join(self.actions)}")
        for word in ("horizon", "draws", "examples", "episodes", "trials"):
            if getattr(self, word) < 1:
                raise UserError(f"{word} is {getattr(self, word)}; expected 1 or more")

    @property
    def preferred(self) -> Sequence[str]:
        """The names of the actions, the fallback first."""
        return sorted(self.actions, key=lambda name: name != self.fallback)


@dataclass(frozen=True, slots=True)
class NamedDomain:
    """A domain, the name by which a process finds it again, and the path of its bias."""

    name: str
    domain: LearningDomain
    bias: Path

    def environment(self, seed: int, make: Make | None = None) -> gymnasium.Env[Any, Any]:
        """Return the environment of an episode, from `make` if it is given.

        Raises:
            UserError: it cannot be made.
        """
        with users_code(f"--domain {self.name}: make({seed})"):
            made = (make or self.domain.make)(seed)
        if not isinstance(made, gymnasium.Env):
            raise UserError(
                f"--domain {self.name}: make({seed}) returned {made!r:.80}; expected an environment"
            )
        return made

    def failed(self, env: Any, step: tuple[Any, ...]) -> bool:
        """Return whether what `env.step` returned was a failure.

        Raises:
            UserError: `failed` raised an error.
        """
        _, reward, terminated, _, info = step
        with users_code(f"--domain {self.name}: failed"):
            return bool(self.domain.failed(Step(env.unwrapped, float(reward), bool(terminated), info)))


def find_domain(name: str) -> NamedDomain:
    """Return a domain by FILE.py:NAME, PACKAGE.MODULE:NAME, or a name of `SHIPPED`.

    Raises:
        UserError: there is none, or it is no `LearningDomain`.
    """
    place = SHIPPED.get(name, name)
    if ":" not in place:
        raise UserError(
            f"--domain {name}: expected {', '.join(SHIPPED)}, FILE.py:NAME or PACKAGE.MODULE:NAME"
        )
    found = find_object(place, f"--domain {name}")
    if not isinstance(found, LearningDomain):
        raise UserError(
            f"--domain {name}: it is a {type(found).__name__}; expected a LearningDomain of "
            "drlsl.induction.environments"
        )
    file = place.rpartition(":")[0]
    beside = Path(file).parent / found.bias if file.endswith(".py") else Path(found.bias)
    return NamedDomain(name, found, beside if beside.is_file() else rule_file(found.bias))
