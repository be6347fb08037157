"""A rule program written to a folder in another language."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drlsl.driving.export.c_files import c_files
from drlsl.driving.export.js_files import js_files
from drlsl.driving.export.prolog_files import prolog_files
from drlsl.driving.export.rule_program import RuleProgram
from drlsl.driving.export.scenes import draw_scenes
from drlsl.driving.export.stored import StoredDecision, decide_all
from drlsl.errors import UserError
from drlsl.files import scratch_beside
from drlsl.lowering.ir import NotLowerable

DECISIONS: Final = 1_000
"""Decisions that an exported program is checked against."""

VEHICLES: Final = 12
"""Vehicles in the scenes of these decisions."""

Files = dict[str, str]


@dataclass(frozen=True, slots=True)
class Format:
    """A language: the function that makes its files, and the command that runs their check."""

    files: Callable[[RuleProgram, Sequence[StoredDecision]], Files]
    check: str


FORMATS: Final = {
    "js": Format(js_files, "node check.mjs"),
    "c": Format(c_files, "cc -std=c99 -O2 rules.c check.c -lm -o check && ./check"),
    "prolog": Format(prolog_files, "swipl -g drlsl_check -t halt rules.pl check.pl"),
}
"""The languages by name."""


def export_rules(paths: Sequence[Path], to: str, out: Path, *, decisions: int = DECISIONS) -> list[Path]:
    """Write the program in some files, highway.pl if none, to a new folder; return the files written.

    `decisions`: how many stored ones its check compares.

    Raises:
        UserError: the folder exists or cannot be written, a rule file cannot be read, or the program cannot
            be exported, with the clause and the reason.
        PrologError: a rule file is not a valid program.
    """
    if out.exists() or out.is_symlink():
        raise UserError(f"{out} exists; name a new folder for the exported rules")
    program = RuleProgram.of(paths)
    try:
        make = FORMATS[to].files
        make(program, ())  # what cannot be exported is refused before a thousand scenes are decided
        scenes = draw_scenes(decisions, VEHICLES, seed=1, ends=program.knows_lane_ends)
        files = make(program, decide_all(program, scenes))
    except NotLowerable as problem:
        raise UserError(f"these rules cannot be exported to {to}: {problem}") from problem
    return _write(out, files)


def _write(out: Path, files: Files) -> list[Path]:
    """Write files to a new folder, whole or not at all."""
    try:
        with scratch_beside(out) as scratch:
            whole = scratch / "whole"
            whole.mkdir()
            for name, text in files.items():
                (whole / name).write_text(text, encoding="utf-8")
            whole.rename(out)
    except OSError as error:
        raise UserError(f"{out}: cannot write: {error.strerror or error}") from error
    return [out / name for name in files]
