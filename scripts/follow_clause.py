"""Print how one clause of highway.pl becomes NumPy code; docs/lowering.md shows what this prints."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from drlsl.driving.scene import SCHEMA
from drlsl.logic import Engine
from drlsl.logic.core import Call, Goal, inside, read_body, term_variables
from drlsl.logic.syntax import ReadTerm
from drlsl.logic.terms import Atom, Operators, format_term
from drlsl.lowering.backends import numpy_source
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import Node, Relation, reach

RULES: Final = Path(__file__).parents[1] / "rules" / "highway.pl"
NAME: Final = "settled"


def walk() -> str:
    """Return the stages of the clause as Markdown."""
    engine = Engine()
    engine.consult(RULES)
    (clause,) = engine.clauses(NAME, 0)
    assert isinstance(clause.origin, ReadTerm)
    lowered = lower(engine, SCHEMA, [Query(NAME, 0, "holds")])
    names = dict.fromkeys(map(id, term_variables(clause.body)), "_")
    names |= {id(variable): name for name, variable in clause.names.items()}
    stages = {
        "The text": _text(clause.origin),
        "The goal tree": "\n".join(_goals(read_body(clause.body), names)),
        "The nodes": "\n".join(_nodes(lowered)),
        "The NumPy code": numpy_source(lowered).strip(),
    }
    return "\n".join(f"{title}:\n\n{_block(text)}\n" for title, text in stages.items())


def _block(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.splitlines())


def _text(read: ReadTerm) -> str:
    lines = read.source.text.splitlines()[read.span.line - 1 :]
    end = next(number for number, line in enumerate(lines, 1) if line.endswith("."))
    return "\n".join(lines[:end])


def _goals(goal: Goal, names: dict[int, str], depth: int = 0) -> Iterator[str]:
    """Yield a line for each goal of the tree."""
    line = "  " * depth + type(goal).__name__
    if isinstance(goal, Call):
        args = [format_term(arg, Operators(), variable_names=names) for arg in goal.args]
        line += f" {goal.name}  {', '.join(args)}"
    yield line.rstrip()
    for part in inside(goal):
        yield from _goals(part, names, depth + 1)


def _nodes(lowered: Lowered) -> Iterator[str]:
    """Yield a line for each node of the answer, operands first."""
    answer = lowered.answers[0]
    numbers: dict[Node, str] = {}
    for node in reach([answer.found]):
        numbers[node] = f"n{len(numbers) + 1}"
        words = [_datum(node.data), *(numbers[arg] for arg in node.args)]
        yield f"{numbers[node]:4} {node.op:7} {node.kind:6} {'  '.join(filter(None, words))}".rstrip()


def _datum(data: object) -> str:
    if isinstance(data, Relation):
        return f"{data.name}/{data.arity}"
    if isinstance(data, tuple) and data and isinstance(data[0], Relation):
        relation, column = data
        return f"{relation.name}.{relation.fields[column] if relation.fields else column}"
    if data is None:
        return ""
    return data.name if isinstance(data, Atom) else str(data)


if __name__ == "__main__":
    print(walk())
