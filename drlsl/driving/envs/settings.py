"""The settings of an environment: a configuration or its fields, and errors that say what is meant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

from drlsl.driving.config import EnvConfig
from drlsl.errors import UserError
from drlsl.files import problem_text, setting_path


def config_of(who: str, settings: Mapping[str, Any], others: Sequence[str]) -> EnvConfig:
    """Return the configuration with these settings, for the environment called `who`.

    `others` are the keywords that it takes besides the fields of `EnvConfig`.

    Raises:
        TypeError: there is no such setting. Factories of other libraries try keywords that not every
            environment has, and go on without them after a `TypeError` of these words.
        UserError: a setting has a value that it cannot have.
    """
    known = [*EnvConfig.model_fields, *others]
    for name in settings:
        if name not in EnvConfig.model_fields:
            near = get_close_matches(name, known, n=1)
            instead = f"the nearest that it has is {near[0]!r}" if near else f"it takes {', '.join(known)}"
            raise TypeError(f"{who}.__init__() got an unexpected keyword argument {name!r}; {instead}")
    try:
        return EnvConfig(**settings)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        unknown = problem["type"] == "extra_forbidden"
        place = ".".join(map(str, problem["loc"])) if unknown else setting_path(EnvConfig, problem["loc"])
        raise UserError(f"{who}: {problem_text(problem, place, 'is not a setting')}") from error


def the_config(
    who: str,
    config: Any,
    settings: Mapping[str, Any],
    others: Sequence[str],
    defaults: Mapping[str, Any],
) -> Any:
    """Return `config`, or the configuration with these settings, else with `defaults`, if it is None.

    Raises:
        TypeError: there are both, or there is no such setting.
        UserError: a setting has a value that it cannot have.
    """
    if config is None:
        return config_of(who, {**defaults, **settings}, others)
    if settings:
        raise TypeError(
            f"{who}.__init__() got a configuration and {', '.join(settings)}: put them into the configuration"
        )
    return config


def check_options(options: Mapping[str, Any] | None, known: Sequence[str] = ()) -> None:
    """Check that `reset` takes these options.

    Raises:
        ValueError: it has no such option.
    """
    for name in options or ():
        if name not in known:
            raise ValueError(f"reset() has no option {name!r}; it takes {', '.join(known) or 'none'}")
