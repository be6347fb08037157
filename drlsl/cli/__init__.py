"""The command line: `drlsl train`, `drlsl query` and the rest."""

from __future__ import annotations

import gc
import io
import logging
import os
import sys
import warnings
from collections.abc import Sequence

from drlsl.cli.plain_query import plain_query
from drlsl.errors import UserError
from drlsl.files import printable
from drlsl.logic import PrologError

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # the search for them is slow


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, or 2 after one line on stderr that says what to put right."""
    # Terms and modules are made by the ten thousand and hardly any is garbage: look for it less often.
    gc.set_threshold(50_000, 20, 20)
    warnings.showwarning = _show_warning
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Where it cannot show a character, such as ², it shows its number.
        sys.stdout.reconfigure(errors="backslashreplace")
    if sys.stderr.isatty():
        _show_compiling()
    sys.exit(run(arguments))


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Show a warning on stderr in one line; the line of the program that gave it helps nobody."""
    print(f"drlsl: warning: {printable(str(message))}", file=sys.stderr)


def _show_compiling() -> None:
    """Show on stderr what is compiled to machine code: for some seconds nothing else would happen."""
    logger = logging.getLogger("drlsl.lowering.backends.numba_compile")
    logger.setLevel(logging.INFO)
    logger.addHandler(logging.StreamHandler())


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    line = sys.argv[1:] if arguments is None else arguments
    # The shells of Windows leave patterns and variables as they are; Typer expands them.
    expanded = arguments is not None or os.name != "nt"
    try:
        asked = plain_query(line) if expanded else None
        if asked is None:
            from drlsl.cli.program import run_program

            return run_program(arguments)
        from drlsl.cli.query_answer import answer_query

        answer_query(**asked)
    except UserError as error:
        return _refuse(str(error))
    except PrologError as error:
        return _refuse(str(error).splitlines()[0])
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # who read stdout has gone; Python would write the rest to it at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def _refuse(message: str) -> int:
    print(f"drlsl: {printable(message)}", file=sys.stderr)
    return 2
