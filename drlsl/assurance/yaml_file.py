"""YAML files whose errors name the line: values, where each stands, and checked models of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from drlsl.errors import UserError
from drlsl.plain_text import read_text

Model = TypeVar("Model", bound=BaseModel)
Location = Sequence[int | str]


@dataclass(frozen=True)
class YamlFile:
    """A parsed YAML file: `values`, and the nodes that know where each of them stands."""

    path: Path
    values: dict[str, Any]
    root: yaml.MappingNode

    def line(self, location: Location) -> int:
        """The line of a value, given by its keys and indexes, or of what of it there is."""
        node: yaml.Node = self.root
        line = node.start_mark.line
        for part in location:
            found = _below(node, part)
            if found is None:
                break
            line, node = found
        return line + 1

    def holds(self, location: Location) -> bool:
        """Whether the file itself gives this value."""
        node: yaml.Node = self.root
        for part in location:
            found = _below(node, part)
            if found is None:
                return False
            node = found[1]
        return True

    def error(self, location: Location, message: str) -> UserError:
        """An error about the value at `location`."""
        return UserError(f"{self.path}:{self.line(location)}: {message}")

    def checked(self, model: type[Model], values: object, *locations: Location) -> Model:
        """`values` as a model; `locations` are where they were put together from, the last one weighing most.

        Raises:
            UserError: the values do not fit the model; the message names file, line and key.
        """
        try:
            return model.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False)[0]
            keys = [part for part in first["loc"] if isinstance(part, int) or not _is_tag(part)]
            places = [[*location, *keys] for location in locations]
            place = next((place for place in reversed(places) if self.holds(place)), places[-1])
            raise self.error(place, _explain(first, keys)) from error


def read_yaml(path: Path) -> YamlFile:
    """Read a YAML mapping.

    Raises:
        UserError: the file cannot be read, is not YAML, holds a key twice, or is not a mapping.
    """
    text = read_text(path)
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        values = yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise UserError(f"{path}{line}: not valid YAML: {error.problem or error.context}") from error
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise UserError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from error
    if not isinstance(root, yaml.MappingNode) or not isinstance(values, dict):
        raise UserError(f"{path}: expected keys with values, such as 'scenes:'")
    for node in _mappings(root, set()):
        _refuse_doubles(path, node)
    return YamlFile(path, values, root)


def _below(node: yaml.Node, part: int | str) -> tuple[int, yaml.Node] | None:
    """The line of a key or an item, and its node."""
    if isinstance(node, yaml.SequenceNode):
        if isinstance(part, int) and part < len(node.value):
            return node.value[part].start_mark.line, node.value[part]
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value == str(part):
                return key.start_mark.line, value
    return None


def _mappings(node: yaml.Node, seen: set[int]) -> Iterator[yaml.MappingNode]:
    if id(node) in seen:  # an alias
        return
    seen.add(id(node))
    if isinstance(node, yaml.MappingNode):
        yield node
        for _, value in node.value:
            yield from _mappings(value, seen)
    elif isinstance(node, yaml.SequenceNode):
        for item in node.value:
            yield from _mappings(item, seen)


def _refuse_doubles(path: Path, node: yaml.MappingNode) -> None:
    seen = set()
    for key, _ in node.value:
        if key.value in seen:
            raise UserError(f"{path}:{key.start_mark.line + 1}: key '{key.value}' is given twice")
        seen.add(key.value)


def _is_tag(part: str) -> bool:
    """Whether a part of pydantic's place names a type that it tried, and no key."""
    return "[" in part or part in ("int", "float", "str", "bool", "list", "dict") or part.endswith("Row")


def _explain(problem: Any, keys: Sequence[int | str]) -> str:
    name = ".".join(map(str, keys)) or "the table"
    if problem["type"] == "missing":
        return f"{name} is missing"
    if problem["type"] == "extra_forbidden":
        return f"{name} is no key of a table; docs/testing-rules.md lists them"
    given = problem["input"]
    shown = f", got {given!r}" if isinstance(given, str | int | float | bool | None) else ""
    return f"{name}: {problem['msg'][:1].lower()}{problem['msg'][1:]}{shown}"
