"""Modules that have moved since 0.1, and a finder that reports their new place."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Final

_CAME_FROM: Final = {
    "drlsl.assurance": "assurance.asking assurance.rows assurance.running",
    "drlsl.benchmarks": "driving.bench driving.bench_env learning.bench logic.bench logic.bench_set",
    "drlsl.counterfactual": "verify.levers verify.whatif",
    "drlsl.driving": "driving.stress",
    "drlsl.driving.envs": "driving.env driving.vector",
    "drlsl.driving.explain": "driving.decision_picture driving.picture driving.reasons",
    "drlsl.driving.scene": (
        "driving.action_space driving.actions driving.batch driving.limits driving.scene_file"
    ),
    "drlsl.driving.shield": "driving.lowered driving.tiers",
    "drlsl.driving.simulation": (
        "driving.contacts driving.control driving.egos driving.entry driving.fault driving.idm "
        "driving.playback driving.prediction driving.reactive driving.reward driving.sensing driving.world"
    ),
    "drlsl.files": "assurance.yaml_file learning.lock learning.seal plain_text",
    "drlsl.learning": "config",
    "drlsl.logic": "logic.values",
    "drlsl.logic.builtins": "logic.builtins.tables logic.inplace",
    "drlsl.logic.core": (
        "logic.arithmetic logic.body logic.builtins.registry logic.dcg logic.deep logic.goals logic.heads "
        "logic.integers logic.program logic.solver logic.tabling logic.unify"
    ),
    "drlsl.logic.explain": "logic.explanation logic.proof",
    "drlsl.logic.jit": (
        "logic.compiler logic.compiler.body logic.compiler.holes logic.compiler.matching "
        "logic.compiler.numbers logic.compiler.predicate logic.compiler.rows logic.compiler.tiers "
        "logic.compiler.writer"
    ),
    "drlsl.logic.loading": "logic.conditions logic.consult logic.linking",
    "drlsl.logic.syntax": "logic.flags logic.parser logic.reader logic.tokens",
    "drlsl.logic.terms": "logic.digits logic.operators logic.writer",
    "drlsl.lowering": "logic.lowering logic.lowering.check",
    "drlsl.lowering.backends": (
        "logic.lowering.array_loops logic.lowering.arrays logic.lowering.batch_program "
        "logic.lowering.loop_ops logic.lowering.loops logic.lowering.numba_backend "
        "logic.lowering.numba_compile logic.lowering.numpy_backend logic.lowering.numpy_ops "
        "logic.lowering.python_text logic.lowering.scalar logic.lowering.sparse logic.lowering.support "
        "logic.lowering.torch_backend logic.lowering.torch_ops"
    ),
    "drlsl.lowering.frontend": (
        "logic.lowering.forms logic.lowering.goals logic.lowering.lower logic.lowering.symbols "
        "logic.lowering.unfold"
    ),
    "drlsl.lowering.ir": (
        "logic.lowering.errors logic.lowering.ir logic.lowering.names logic.lowering.numbers "
        "logic.lowering.schema logic.lowering.trees"
    ),
    "drlsl.registration": "driving.registration",
    "drlsl.study": "study.machine study.schedule study.tables",
    "drlsl.traffic": "traffic.tables",
    "drlsl.verify": "verify.replay",
    "drlsl.verify.attack": (
        "verify.changing verify.closeness verify.drawing verify.drawn_facts verify.enclosures verify.exact"
    ),
    "drlsl.verify.floats": "verify.assumed verify.intervals verify.margins verify.ordering verify.rounding",
    "drlsl.verify.smt": (
        "verify.booleans verify.formula verify.functions verify.polynomials verify.second verify.signature "
        "verify.solver verify.symbolic verify.values"
    ),
    "drlsl.workers": "study.cluster study.local study.workers verify.workers",
}
"""By package, the modules of 0.1, without `drlsl.`, whose work it does now."""

MOVED: Final = {f"drlsl.{old}": home for home, modules in _CAME_FROM.items() for old in modules.split()}
"""The present package of each module, by its old name."""


class _Signpost:
    """The last finder, for modules that no other has found."""

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> None:
        """Report where a module has moved to.

        Raises:
            ModuleNotFoundError: it has moved.
        """
        if home := MOVED.get(fullname):
            raise ModuleNotFoundError(f"{fullname} has moved; import from {home} instead", name=fullname)


def say_where() -> None:
    """Have the import of a moved module fail with a line that names its new place."""
    sys.meta_path.append(_Signpost())
