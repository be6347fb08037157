"""Render a report's blocks as Markdown and as one HTML page, by the templates beside this module."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, TypeAlias

import jinja2
import pandas as pd

from drlsl.study.result_tables import Table


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading, level 1 to 3."""

    kind: ClassVar = "heading"
    level: int
    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Text; `code` keeps its lines and spaces."""

    text: str
    code: bool = False

    @property
    def kind(self) -> str:
        """The name of the kind in the templates."""
        return "code" if self.code else "paragraph"


@dataclass(frozen=True, slots=True)
class Link:
    """A sentence that leads to a file beside the report."""

    kind: ClassVar = "link"
    text: str
    path: str


@dataclass(frozen=True, slots=True)
class Listing:
    """Items, numbered if their order matters."""

    kind: ClassVar = "listing"
    points: tuple[str, ...]
    numbered: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG with a caption; `path` is its place for the Markdown."""

    kind: ClassVar = "picture"
    path: str
    caption: str
    png: bytes


Block: TypeAlias = Heading | Paragraph | Link | Listing | Picture | Table


def markdown(blocks: Sequence[Block]) -> str:
    """Return the blocks as Markdown."""
    return _templates().get_template("report.md").render(blocks=blocks)


def page(title: str, blocks: Sequence[Block]) -> str:
    """Return the blocks as an HTML page that needs no other file, no script and no network."""
    return _templates().get_template("report.html").render(title=title, blocks=blocks)


@cache
def _templates() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("drlsl.study"),
        autoescape=jinja2.select_autoescape(["html"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode("ascii")
    environment.filters["columns"] = _columns
    environment.filters["cell"] = lambda value: str(value).replace("|", "\\|")
    return environment


def _columns(frame: pd.DataFrame) -> list[tuple[str, bool]]:
    """Return the columns, and whether every cell of each is a number or the dash for a missing one."""

    def is_number(cell: object) -> bool:
        text = str(cell)
        return text.split(" ")[0] == "-" or text.removeprefix("-")[:1].isdigit()

    return [(name, all(map(is_number, frame[name]))) for name in frame.columns]
