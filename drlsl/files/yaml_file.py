"""YAML files, read strictly, with the position of each value for errors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import yaml

from drlsl.errors import UserError
from drlsl.files.plain_text import read_text

Location: TypeAlias = Sequence[int | str]
"""The keys and indexes that lead to a value of a file."""

Position: TypeAlias = tuple[int, int]
"""Line and column, both from 1."""


@dataclass(frozen=True)
class YamlFile:
    """A parsed YAML mapping: `values`, and the nodes with their positions.

    `name` is its name in errors; `root` is None for an empty file.
    """

    name: str
    values: dict[str, Any]
    root: yaml.MappingNode | None

    def position(self, location: Location) -> Position | None:
        """Return the position of a value, or of its nearest enclosing node in the file; None without one."""
        way = list(self._way(location))
        return way[-1][1] if way else None

    def line(self, location: Location) -> int:
        """Return the line of a value, or of its nearest enclosing node in the file."""
        return (self.position(location) or (1, 1))[0]

    def holds(self, location: Location) -> bool:
        """Return whether the file itself gives this value."""
        return len(list(self._way(location))) == len(location)

    def error(self, location: Location, message: str) -> UserError:
        """Return an error about the value at `location`."""
        return UserError(f"{self.name}:{self.line(location)}: {message}")

    def _way(self, location: Location) -> Iterator[tuple[yaml.Node, Position]]:
        """Yield each existing node on the way to a value, and its position."""
        node: yaml.Node | None = self.root
        for part in location:
            found = None if node is None else _below(node, part)
            if found is None:
                return
            node, mark = found
            yield node, (mark.line + 1, mark.column + 1)


def read_yaml(path: Path, what: str = "", example: str = "") -> YamlFile:
    """Read a file that holds a YAML mapping; `what` names its kind, `example` its contents in errors.

    Raises:
        UserError: it cannot be read, is not YAML, holds a key twice, or is not a mapping.
    """
    return parse_yaml(read_text(path, what), str(path), example)


def parse_yaml(text: str, name: str, example: str = "") -> YamlFile:
    """Parse a YAML mapping; `name` is its name, `example` describes its contents in errors.

    Raises:
        UserError: it is not YAML, holds a key twice, or is not a mapping.
    """
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        values = yaml.safe_load(text)
        for node, path in _mappings(root, (), set()):
            _refuse_doubles(name, node, path)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        raise UserError(f"{where}: not valid YAML: {error.problem or error.context}") from error
    except (yaml.YAMLError, ValueError) as error:
        raise UserError(f"{name}: not valid YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise UserError(f"{name}: the YAML is nested too deeply") from error
    if values is None:
        return YamlFile(name, {}, None)
    if not isinstance(root, yaml.MappingNode) or not isinstance(values, dict):
        such = f" (such as '{example}')" if example else ""
        raise UserError(f"{name}: expected keys with values{such}, got {shown(values)}")
    return YamlFile(name, values, root)


def shown(value: object) -> str:
    """Return a value as text for errors, shortened if it is long."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _below(node: yaml.Node, part: int | str) -> tuple[yaml.Node, yaml.Mark] | None:
    """Return the node that a key or an index leads to, and the mark of the key or the item."""
    if isinstance(node, yaml.SequenceNode):
        if isinstance(part, int) and part < len(node.value):
            return node.value[part], node.value[part].start_mark
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value == str(part):
                return value, key.start_mark
    return None


def _mappings(
    node: yaml.Node | None, path: tuple[str, ...], seen: set[int]
) -> Iterator[tuple[yaml.MappingNode, tuple[str, ...]]]:
    """Yield the mappings below a node, and the keys that lead to them."""
    if node is None or id(node) in seen:  # an alias
        return
    seen.add(id(node))
    if isinstance(node, yaml.MappingNode):
        yield node, path
        for key, value in node.value:
            yield from _mappings(value, (*path, str(key.value)), seen)
    elif isinstance(node, yaml.SequenceNode):
        for item in node.value:
            yield from _mappings(item, path, seen)


def _refuse_doubles(name: str, node: yaml.MappingNode, path: tuple[str, ...]) -> None:
    seen = set()
    for key, _ in node.value:
        if key.value in seen:
            mark, dotted = key.start_mark, ".".join((*path, str(key.value)))
            raise UserError(f"{name}:{mark.line + 1}:{mark.column + 1}: key '{dotted}' is given twice")
        seen.add(key.value)


_LINE_BREAKS: Final = re.compile("[\x85\u2028\u2029]")
"""Line breaks beyond ASCII, which PyYAML writes unescaped and then reads as other ones."""


class _Dumper(yaml.SafeDumper):
    """Escapes `_LINE_BREAKS`."""

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """Return text, in double quotes where it must be escaped."""
        style = '"' if _LINE_BREAKS.search(data) else None
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=style)


_Dumper.add_representer(str, _Dumper.represent_str)


def to_yaml(values: Mapping[str, Any]) -> str:
    """Return plain values as YAML that `parse_yaml` reads back to equal ones, in their order."""
    return yaml.dump(values, Dumper=_Dumper, sort_keys=False, allow_unicode=True)
