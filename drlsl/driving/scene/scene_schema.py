"""The JSON schema of a scene file, and what is wrong with one; pydantic makes both from the declared keys."""

from __future__ import annotations

from types import GenericAlias
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from drlsl.driving.scene.scene_keys import (
    DIRECTIONS,
    SCENE,
    Key,
    Kind,
    Part,
    count,
    direction,
    number,
    positive,
    text,
    whole,
)
from drlsl.errors import UserError
from drlsl.files import problem_text


class _Model(BaseModel):
    # Only whole scenes are validated: parts without validators of their own save time.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True, defer_build=True)


_TYPES: Final[dict[Kind, Any]] = {
    number: float,
    positive: Annotated[float, Field(gt=0)],
    whole: int,
    count: Annotated[int, Field(ge=1)],
    direction: Literal[*DIRECTIONS],
    text: Annotated[str, Field(min_length=1)],
}


def _model(part: Part) -> type[BaseModel]:
    fields: dict[str, Any] = {name: _field(key) for name, key in part.keys.items()}
    return create_model(part.name, __base__=_Model, __doc__=part.words, **fields)


def _field(key: Key) -> tuple[Any, Any]:
    if isinstance(key.kind, Part):
        kind: Any = _model(key.kind)
        fewest = key.kind.fewest
        if fewest is not None:
            kind = Annotated[GenericAlias(list, kind), Field(min_length=fewest or None)]
    else:
        kind = _TYPES[key.kind]
    return (kind | None if key.default is None else kind), Field(key.default, description=key.words or None)


SceneModel: Final = _model(SCENE)
"""A whole scene file."""


def check_scene(data: Any, name: str) -> None:
    """Check that data has the keys and the kinds of values of a scene; `name` is its name in errors.

    Raises:
        UserError: it has not; the first problem is told, and the number of further ones.
    """
    try:
        SceneModel.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{name}: {_first_problem(error)}") from error


def _first_problem(error: ValidationError) -> str:
    """Return the first problem, with its place, and the number of further ones."""
    problems = error.errors(include_url=False, include_context=False)
    first = problems[0]
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    unknown = f"is not a field of a scene{more}; docs/scene.schema.json lists them"
    return problem_text(first, place or "the scene", unknown, more)
