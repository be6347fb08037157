"""The discrete actions of an environment, and the names that rules have for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import index
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError


@dataclass(frozen=True, slots=True)
class NamedActions:
    """The actions of an environment, numbered from `start`.

    `names` are the rules', `places` those of their actions in a mask; `labels` has the name of every action,
    its number if the rules have none.
    """

    start: int
    names: tuple[str, ...]
    places: tuple[int, ...]
    labels: tuple[str, ...]

    @classmethod
    def of(cls, space: gymnasium.Space[Any], actions: Mapping[str, int]) -> NamedActions:
        """Return the actions of an environment with the action space `space`.

        Raises:
            UserError: the space is not discrete, or a name's action is not in it or has another name.
        """
        if not isinstance(space, gymnasium.spaces.Discrete):
            raise UserError(
                f"the actions are {space}; a shield needs discrete ones: gymnasium.spaces.Discrete"
            )
        if not isinstance(actions, Mapping):
            raise UserError(
                f"actions is {actions!r:.80}; expected a mapping of names to the numbers of actions"
            )
        start, count = int(space.start), int(space.n)
        labels = [str(start + place) for place in range(count)]
        for name, number in actions.items():
            if isinstance(number, bool) or not hasattr(number, "__index__"):
                raise UserError(f"actions: {name} is {number!r}; expected the number of an action")
            place = index(number) - start
            if not 0 <= place < count:
                raise UserError(
                    f"actions: {name} is {number}; the environment's are {start} to {start + count - 1}"
                )
            if labels[place] != str(number):
                raise UserError(f"actions: {name} and {labels[place]} are both {number}")
            labels[place] = str(name)
        places = tuple(index(number) - start for number in actions.values())
        return cls(start, tuple(actions), places, tuple(labels))

    def place(self, action: Any) -> int:
        """Return the place of an action in a mask.

        Raises:
            TypeError: it is no integer.
            ValueError: the environment has no such action.
        """
        if isinstance(action, bool | np.bool_):
            raise TypeError(f"the action is {action!r}; expected an integer")
        try:
            place = index(action) - self.start
        except TypeError as error:
            raise TypeError(f"the action is {action!r:.80}; expected an integer") from error
        if not 0 <= place < len(self.labels):
            raise ValueError(f"unknown action {action}; expected {self._known()}")
        return place

    def all_places(self, actions: Any, count: int) -> npt.NDArray[np.int64]:
        """Return the places of `count` actions in masks, shape (N,).

        Raises:
            TypeError: they are no integers.
            ValueError: they are not as many, or the environments have no such action.
        """
        numbers = np.asarray(actions)
        if numbers.dtype.kind not in "iu":
            raise TypeError(f"the actions are of {numbers.dtype}; expected {count} integers")
        if numbers.shape != (count,):
            raise ValueError(f"the actions are of shape {numbers.shape}; expected ({count},)")
        places = numbers.astype(np.int64) - self.start
        wrong = (places < 0) | (places >= len(self.labels))
        if wrong.any():
            raise ValueError(f"unknown action {numbers[wrong][0]}; expected {self._known()}")
        return places

    def _known(self) -> str:
        return ", ".join(f"{self.start + place} {label}" for place, label in enumerate(self.labels))


def check_facts_function(facts: Any) -> Callable[[Any], Any]:
    """Return a function of facts.

    Raises:
        UserError: it is none.
    """
    if not callable(facts):
        raise UserError(f"facts is {facts!r:.80}; expected a function of the environment")
    return facts  # type: ignore[no-any-return]


def told_facts(facts: Callable[[Any], Any], env: Any, which: str = "") -> Any:
    """Return the facts of the present state of an environment, or of all in a vector environment.

    Raises:
        UserError: the function raised an error; `which` says of which environment the facts were to be.
    """
    try:
        return facts(env)
    except UserError:
        raise
    except Exception as error:
        told = f"facts {which}".strip() + f" raised {type(error).__name__}: {error}; it was given {env}"
        if isinstance(env, gymnasium.vector.VectorEnv):
            told += "; a function of one environment becomes one of all by drlsl.of_each(facts)"
        raise UserError(told) from error
