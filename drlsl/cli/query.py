"""`drlsl query`: its options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from drlsl.cli.options import AsJson, Rules
from drlsl.cli.query_answer import answer_query

Actions = Annotated[
    list[str] | None,
    typer.Argument(metavar="ACTION...", help="Actions that --what-if examines; default: every action."),
]
Goal = Annotated[
    str | None,
    typer.Option("--goal", metavar="GOAL", help="Run this goal in the scene and print its solutions."),
]
Explain = Annotated[
    bool,
    typer.Option(
        "--explain",
        help="Print the proof of every safe action and of the speed, and why others have none.",
    ),
]
WhatIf = Annotated[
    bool,
    typer.Option(
        "--what-if", help="Print the least change of a gap or a speed that would change the decision."
    ),
]
Picture = Annotated[
    Path | None,
    typer.Option(
        "--picture", metavar="FILE", help="Draw the decision and its reasons here, as .png, .pdf or .svg."
    ),
]


def query(
    state: Annotated[
        Path, typer.Option("--state", metavar="FILE", help="The scene, as JSON; docs/scene.md describes it.")
    ],
    actions: Actions = None,
    rules: Rules = None,
    goal: Goal = None,
    explain: Explain = False,
    what_if: WhatIf = False,
    picture: Picture = None,
    time_limit: Annotated[
        float, typer.Option(metavar="SECONDS", min=0.1, help="For one action, with --what-if.")
    ] = 10.0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the changed scenes of --what-if here, as scene files."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print which actions are safe in a scene, what speaks against the others, and the target speed."""
    answer_query(state, actions, rules, goal, explain, what_if, picture, time_limit, out, as_json)
