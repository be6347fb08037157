"""The program as Typer has it: every command by its name, imported when it is asked for."""

from __future__ import annotations

import sys
from collections import UserDict
from collections.abc import Sequence
from pkgutil import resolve_name
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from drlsl.errors import UserError
from drlsl.version import __version__

CLICK_ERROR: Any = typer.BadParameter.__mro__[2]
"""ClickException, the base of everything that a command line can get wrong; Typer does not export it."""

_PLACES: Final = {
    "train": "drlsl.cli.train:train",
    "study": "drlsl.cli.study:study",
    "eval": "drlsl.cli.evaluate:evaluate",
    "export": "drlsl.cli.export:export",
    "query": "drlsl.cli.query:query",
    "stress": "drlsl.cli.stress:stress",
    "render": "drlsl.cli.render:render",
    "view": "drlsl.cli.view:view",
    "runs": "drlsl.cli.runs:app",
    "config": "drlsl.cli.config:app",
    "data": "drlsl.cli.data:app",
    "rules": "drlsl.cli.rules:app",
    "bench": "drlsl.cli.bench:app",
}
"""Where each command is: a function, or a Typer application of several."""


class _Commands(UserDict[str, Any]):
    """The commands by their names; the module of one is imported when it is asked for."""

    def __getitem__(self, name: str) -> Any:
        if isinstance(self.data[name], str):
            self.data[name] = _made_command(name, resolve_name(self.data[name]))
        return self.data[name]


def _made_command(name: str, found: Any) -> Any:
    alone = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)
    if isinstance(found, typer.Typer):
        alone.add_typer(found, name=name)
    else:
        alone.command(name)(found)
    return typer.main.get_group(alone).commands[name]


class _Program(TyperGroup):
    """The program, whose commands are not all imported for one."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.commands = _Commands(_PLACES)


app = typer.Typer(
    name="drlsl",
    cls=_Program,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"drlsl {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_print_version, help="Show the version and exit."),
    ] = False,
) -> None:
    """Safe reinforcement learning for highway driving, shielded by readable Prolog rules."""


def run_program(arguments: Sequence[str] | None) -> int:
    """Run a command, by default the one that the shell gave, and return its exit status; 130: interrupted.

    Raises:
        UserError: the line is wrong, or the command refuses something.
        PrologError: rules are not a valid program.
    """
    command = typer.main.get_command(app)
    try:
        status = command.main(args=arguments, prog_name="drlsl", standalone_mode=False)
    except CLICK_ERROR as error:
        return _explain(_message(error), getattr(error, "ctx", None))
    except typer.Abort:
        return 130
    return status if isinstance(status, int) else 0


def _message(error: Any) -> str:
    """Return what is wrong with the command line, in a sentence."""
    if error.__cause__ is not None:
        from pydantic import ValidationError

        from drlsl.files import reason_of

        if isinstance(error.__cause__, ValidationError):
            problem = error.__cause__.errors(include_url=False)[0]
            got = "" if problem["type"] == "value_error" else f", got {problem['input']!r}"
            error.message = f"{reason_of(problem)}{got}"
    message: str = error.format_message()
    return message


def _explain(message: str, context: typer.Context | None) -> int:
    if context is not None and message == context.get_help():  # nothing was asked: there is no more to say
        print(message, file=sys.stderr)
        return 2
    end = "" if message.endswith((".", "?")) else "."
    command = "drlsl" if context is None else context.command_path
    raise UserError(f"{message}{end} See '{command} --help'.")
