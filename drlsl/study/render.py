"""A report's blocks as Markdown and as one self-contained HTML page."""

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import pandas as pd

from drlsl.study.result_tables import Table


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading, level 1 to 3."""

    level: int
    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Text; `code` keeps its lines and spaces."""

    text: str
    code: bool = False


@dataclass(frozen=True, slots=True)
class Listing:
    """Points, numbered where their order means something."""

    points: tuple[str, ...]
    numbered: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG with a caption; `path` is where the Markdown finds it."""

    path: str
    caption: str
    png: bytes


Block: TypeAlias = Heading | Paragraph | Listing | Picture | Table


def markdown(blocks: Sequence[Block]) -> str:
    """The blocks as Markdown."""
    return "\n\n".join(map(_markdown, blocks)) + "\n"


def page(title: str, blocks: Sequence[Block]) -> str:
    """The blocks as an HTML page that needs no other file, no script and no network."""
    body = "\n".join(map(_html, blocks))
    return _PAGE.format(title=html.escape(title), style=_STYLE, body=body)


def _markdown(block: Block) -> str:
    match block:
        case Heading(level, text):
            return f"{'#' * level} {text}"
        case Paragraph(text, True):
            return "\n".join(f"    {line}".rstrip() for line in text.splitlines())
        case Paragraph(text):
            return text
        case Listing(points, numbered):
            return "\n".join(
                f"{f'{place}.' if numbered else '-'} {text}" for place, text in enumerate(points, 1)
            )
        case Picture(path, caption):
            return f"![{caption}]({path})"
        case Table():
            note = f"\n\n{block.note}" if block.note else ""
            return f"**{block.title}**\n\n{_markdown_table(block.shown)}{note}"


def _markdown_table(frame: pd.DataFrame) -> str:
    numbers = _right_aligned(frame)
    rule = ["--:" if column in numbers else "---" for column in frame.columns]
    rows = [list(frame.columns), rule, *frame.to_numpy().tolist()]
    return "\n".join(
        f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in row)} |" for row in rows
    )


def _html(block: Block) -> str:
    match block:
        case Heading(level, text):
            return f"<h{level}>{html.escape(text)}</h{level}>"
        case Paragraph(text, True):
            return f"<pre>{html.escape(text)}</pre>"
        case Paragraph(text):
            return f"<p>{html.escape(text)}</p>"
        case Listing(points, numbered):
            tag = "ol" if numbered else "ul"
            return f"<{tag}>{''.join(f'<li>{html.escape(text)}</li>' for text in points)}</{tag}>"
        case Picture(_, caption, png):
            data = base64.b64encode(png).decode("ascii")
            text = html.escape(caption)
            source = f"data:image/png;base64,{data}"
            return f'<figure><img src="{source}" alt="{text}"><figcaption>{text}</figcaption></figure>'
        case Table():
            note = f'<p class="note">{html.escape(block.note)}</p>' if block.note else ""
            return f"{_html_table(block)}{note}"


def _html_table(table: Table) -> str:
    numbers = _right_aligned(table.shown)
    kinds = [' class="number"' if column in numbers else "" for column in table.shown.columns]

    def row(cells: Sequence[object], tag: str) -> str:
        inside = (
            f"<{tag}{kind}>{html.escape(str(cell))}</{tag}>" for cell, kind in zip(cells, kinds, strict=True)
        )
        return f"<tr>{''.join(inside)}</tr>"

    head = row(list(table.shown.columns), "th")
    body = "".join(row(cells, "td") for cells in table.shown.to_numpy().tolist())
    caption = f"<caption>{html.escape(table.title)}</caption>"
    return f'<div class="wide"><table>{caption}<thead>{head}</thead><tbody>{body}</tbody></table></div>'


def _right_aligned(frame: pd.DataFrame) -> set[str]:
    """Columns whose every cell begins with a number, or with the dash that stands for none."""

    def is_number(cell: object) -> bool:
        text = str(cell)
        return text.split(" ")[0] == "-" or text.removeprefix("-")[:1].isdigit()

    return {column for column in frame.columns if all(map(is_number, frame[column]))}


_STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --paper: #fff; --line: #ccc; --soft: #f4f4f4; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e6; --paper: #16181b; --line: #444; --soft: #22252a; }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 62rem; margin: 0 auto; padding: 1rem; overflow-wrap: break-word; }
h2 { margin-top: 2.5rem; border-bottom: 1px solid var(--line); }
.wide { overflow-x: auto; margin: 1.2rem 0 0.4rem; }
table { border-collapse: collapse; font-size: 0.9rem; }
caption { text-align: left; font-weight: 600; padding-bottom: 0.3rem; white-space: nowrap; }
th, td { padding: 0.3rem 0.6rem; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; }
thead th { border-bottom: 2px solid var(--line); }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.note { margin-top: 0; font-size: 0.85rem; }
figure { margin: 1.5rem 0; }
img { max-width: 100%; height: auto; background: #fff; }
figcaption { font-size: 0.85rem; }
pre { overflow-x: auto; background: var(--soft); padding: 0.8rem; font-size: 0.85rem; }
@media print { body { max-width: none; } figure, table { break-inside: avoid; } }
"""

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""
