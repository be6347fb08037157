"""The rules of an episode as JavaScript in the page, so that a changed scene is decided by them there."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from drlsl.driving.explain import clause_text
from drlsl.driving.export import RuleProgram, js_page_module
from drlsl.errors import UserError
from drlsl.logic import PrologError
from drlsl.lowering.ir import NotLowerable


def page_program(rules: Sequence[str | Path], digests: Mapping[str, str]) -> dict[str, Any]:
    """Return a rule program for the page, or why its scenes cannot be changed: `module` is then None.

    `rules` are its files, none for highway.pl; `digests` the SHA-256 that its files had when it drove.
    """
    try:
        program = RuleProgram.of([Path(path) for path in rules])
    except (UserError, PrologError) as error:
        return _refused(f"the rules cannot be loaded here, give --rules: {str(error).splitlines()[0]}")
    names = {*digests, *program.files}
    changed = sorted(name for name in names if digests.get(name) != program.files.get(name))
    if changed:
        return _refused(f"the rules are not those that drove: {', '.join(changed)} changed since")
    engine = program.shield.engine
    against = engine.clauses("objection", 2) if program.has_reasons else []
    clauses = [asdict(clause_text(one)) for one in against]
    try:
        module = js_page_module(program)
    except NotLowerable as problem:
        return _refused(f"these rules run only in the interpreter: {problem}")
    packed = base64.b64encode(zlib.compress(module.encode("utf-8"), 9)).decode("ascii")
    return {"module": packed, "refused": "", "clauses": clauses}


def _refused(reason: str) -> dict[str, Any]:
    return {"module": None, "refused": reason, "clauses": []}
