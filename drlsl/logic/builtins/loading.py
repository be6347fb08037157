"""Loading files by goals: consult/1 and others, which are directives, too."""

from __future__ import annotations

from collections.abc import Sequence

from drlsl.logic.core import FAIL, Machine, Task, control
from drlsl.logic.errors import existence_error, permission_error
from drlsl.logic.terms import Struct, Term


def _load(machine: Machine, files: Term, continuation: Task, *, again: bool) -> Task:
    try:
        machine.engine.load_files(files, again=again, meter=machine.meter)
    except FileNotFoundError:
        raise existence_error("source_sink", files) from None
    except OSError:
        raise permission_error("open", "source_sink", files) from None
    return continuation


@control("consult", 1)
@control("load_files", 1)
@control("load_files", 2)
def consult(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Load files, with or without the options of SWI-Prolog's load_files/2."""
    return _load(machine, args[0], continuation, again=True)


@control(".", 2)
def consult_list(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Load the files of ``[File, ...]``."""
    return _load(machine, Struct(".", tuple(args)), continuation, again=True)


@control("ensure_loaded", 1)
def ensure_loaded(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Source: ISO 13211-1, 7.4.2.8."""
    return _load(machine, args[0], continuation, again=False)


@control("exists_source", 1)
def exists_source(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Succeed if there is a library or a file to load."""
    return continuation if machine.engine.finds(args[0]) else FAIL
