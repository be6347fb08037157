"""The files of a rule program, and the programs that ship with the package."""

from __future__ import annotations

from collections.abc import Sequence
from errno import ENOENT
from pathlib import Path
from typing import Final, TypeAlias

from drlsl.errors import UserError
from drlsl.logic import Engine, Limits, PrologError
from drlsl.logic.loading import shipped_folder, similar_file

Rules: TypeAlias = str | Path | Sequence[str | Path]
"""A rule file (a path, or a name such as highway.pl), several, or the text of a program."""

LOADING: Final = Limits(inferences=20_000_000, seconds=60.0)
"""The limits of loading a rule file, its directives included."""


def rules_folder() -> Path:
    """Return the folder of the programs that ship.

    Raises:
        UserError: there is none.
    """
    folder = shipped_folder()
    if folder is None:
        raise UserError("the package has no rules/highway.pl; install drlsl again")
    return folder


def consult_rules(engine: Engine, path: str | Path) -> None:
    """Consult a rule file, or the program of this name that ships with the package.

    Files that it names are searched beside it, then among the programs that ship.

    Raises:
        UserError: the file cannot be read.
        PrologError: it is not a valid program, or loading it goes beyond `LOADING`.
    """
    try:
        engine.consult(rule_file(path), limits=LOADING)
    except OSError as error:
        hint = similar_file(str(path), (Path(), rules_folder())) if error.errno == ENOENT else ""
        raise UserError(f"cannot read the rule file {path}: {error.strerror}{hint}") from error


def rule_file(path: str | Path) -> Path:
    """Return a rule file, or the program of this name that ships with the package."""
    if Path(path).exists() or Path(path).is_absolute():
        return Path(path)
    shipped = rules_folder() / path
    return shipped if shipped.is_file() else Path(path)


def program_files(engine: Engine) -> list[Path]:
    """Return the files that a program comes from, in the order of their names.

    One that has only directives is among them, since it may abolish clauses of others.
    """
    clauses = (clause for key in engine.predicates() for clause in engine.clauses(*key))
    names = {clause.span.name for clause in clauses if clause.span is not None}
    return sorted({Path(name) for name in (*names, *engine.loaded.values())})


def own_files(engine: Engine) -> list[Path]:
    """Return the files of a program that do not ship with the package."""
    shipped = rules_folder().resolve()
    files = [path for path in program_files(engine) if path.is_file()]
    return [path for path in files if not path.resolve().is_relative_to(shipped)]


def loaded(rules: Rules) -> Engine:
    """Return an engine with the program of rule files, consulted in order, or of a text.

    A string is a file if it ends in `.pl` and is one line.

    Raises:
        UserError: a file cannot be read, or is not a valid program, or `rules` is neither files nor a text.
    """
    if not isinstance(rules, str | Path | Sequence):
        raise UserError(f"rules is {rules!r:.80}; expected a rule file, several, or the text of a program")
    engine = Engine()
    try:
        if isinstance(rules, str) and not (rules.endswith(".pl") and "\n" not in rules):
            engine.consult_text(rules, "rules", limits=LOADING)
        else:
            for path in [rules] if isinstance(rules, str | Path) else rules:
                if not isinstance(path, str | Path):
                    raise UserError(f"rules has {path!r:.80}; expected the path of a rule file")
                consult_rules(engine, path)
    except PrologError as error:
        raise UserError(f"the rules cannot be loaded: {error}") from error
    return engine
