"""Values of a YAML file as checked models, with errors that name the line."""

from __future__ import annotations

from typing import TypeVar

from pydantic import BaseModel, ValidationError

from drlsl.files import Location, YamlFile, problem_text

Model = TypeVar("Model", bound=BaseModel)


def checked(file: YamlFile, model: type[Model], values: object, *locations: Location) -> Model:
    """Return `values` as a model; `locations` are their origins, later ones taking precedence in errors.

    Raises:
        UserError: the values do not fit the model; the message names file, line and key.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        keys = [part for part in first["loc"] if isinstance(part, int) or not _is_tag(part)]
        places = [[*location, *keys] for location in locations]
        place = next((place for place in reversed(places) if file.holds(place)), places[-1])
        name = ".".join(map(str, keys)) or "the table"
        text = problem_text(first, name, "is not a key of a table; docs/testing-rules.md lists them")
        raise file.error(place, text) from error


def _is_tag(part: str) -> bool:
    """Return whether a part of pydantic's location names a type that it tried instead of a key."""
    return "[" in part or part in ("int", "float", "str", "bool", "list", "dict") or part.endswith("Row")
