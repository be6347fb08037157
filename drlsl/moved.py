"""Modules that have moved since 0.1, and a finder that says where to."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from types import ModuleType
from typing import Final

MOVED: Final = {
    "drlsl.assurance.asking": "drlsl.assurance",
    "drlsl.assurance.rows": "drlsl.assurance",
    "drlsl.assurance.running": "drlsl.assurance",
    "drlsl.driving.action_space": "drlsl.driving.scene",
    "drlsl.driving.actions": "drlsl.driving.scene",
    "drlsl.driving.batch": "drlsl.driving.scene",
    "drlsl.driving.bench": "drlsl.benchmarks",
    "drlsl.driving.bench_env": "drlsl.benchmarks",
    "drlsl.driving.contacts": "drlsl.driving.simulation",
    "drlsl.driving.control": "drlsl.driving.simulation",
    "drlsl.driving.decision_picture": "drlsl.driving.explain",
    "drlsl.driving.egos": "drlsl.driving.simulation",
    "drlsl.driving.entry": "drlsl.driving.simulation",
    "drlsl.driving.env": "drlsl.driving.envs",
    "drlsl.driving.fault": "drlsl.driving.simulation",
    "drlsl.driving.idm": "drlsl.driving.simulation",
    "drlsl.driving.limits": "drlsl.driving.scene",
    "drlsl.driving.lowered": "drlsl.driving.shield",
    "drlsl.driving.picture": "drlsl.driving.explain",
    "drlsl.driving.playback": "drlsl.driving.simulation",
    "drlsl.driving.prediction": "drlsl.driving.simulation",
    "drlsl.driving.reactive": "drlsl.driving.simulation",
    "drlsl.driving.reasons": "drlsl.driving.explain",
    "drlsl.driving.registration": "drlsl.registration",
    "drlsl.driving.reward": "drlsl.driving.simulation",
    "drlsl.driving.scene_file": "drlsl.driving.scene",
    "drlsl.driving.sensing": "drlsl.driving.simulation",
    "drlsl.driving.stress": "drlsl.driving",
    "drlsl.driving.tiers": "drlsl.driving.shield",
    "drlsl.driving.vector": "drlsl.driving.envs",
    "drlsl.driving.world": "drlsl.driving.simulation",
    "drlsl.learning.bench": "drlsl.benchmarks",
    "drlsl.logic.arithmetic": "drlsl.logic.core",
    "drlsl.logic.bench": "drlsl.benchmarks",
    "drlsl.logic.bench_set": "drlsl.benchmarks",
    "drlsl.logic.body": "drlsl.logic.core",
    "drlsl.logic.builtins.registry": "drlsl.logic.core",
    "drlsl.logic.builtins.tables": "drlsl.logic.builtins",
    "drlsl.logic.compiler": "drlsl.logic.jit",
    "drlsl.logic.compiler.body": "drlsl.logic.jit",
    "drlsl.logic.compiler.holes": "drlsl.logic.jit",
    "drlsl.logic.compiler.matching": "drlsl.logic.jit",
    "drlsl.logic.compiler.numbers": "drlsl.logic.jit",
    "drlsl.logic.compiler.predicate": "drlsl.logic.jit",
    "drlsl.logic.compiler.rows": "drlsl.logic.jit",
    "drlsl.logic.compiler.tiers": "drlsl.logic.jit",
    "drlsl.logic.compiler.writer": "drlsl.logic.jit",
    "drlsl.logic.conditions": "drlsl.logic.loading",
    "drlsl.logic.consult": "drlsl.logic.loading",
    "drlsl.logic.dcg": "drlsl.logic.core",
    "drlsl.logic.deep": "drlsl.logic.core",
    "drlsl.logic.digits": "drlsl.logic.terms",
    "drlsl.logic.explanation": "drlsl.logic.explain",
    "drlsl.logic.flags": "drlsl.logic.syntax",
    "drlsl.logic.goals": "drlsl.logic.core",
    "drlsl.logic.heads": "drlsl.logic.core",
    "drlsl.logic.inplace": "drlsl.logic.builtins",
    "drlsl.logic.integers": "drlsl.logic.core",
    "drlsl.logic.linking": "drlsl.logic.loading",
    "drlsl.logic.lowering": "drlsl.lowering",
    "drlsl.logic.lowering.array_loops": "drlsl.lowering.backends",
    "drlsl.logic.lowering.arrays": "drlsl.lowering.backends",
    "drlsl.logic.lowering.batch_program": "drlsl.lowering.backends",
    "drlsl.logic.lowering.check": "drlsl.lowering",
    "drlsl.logic.lowering.errors": "drlsl.lowering.ir",
    "drlsl.logic.lowering.forms": "drlsl.lowering.frontend",
    "drlsl.logic.lowering.goals": "drlsl.lowering.frontend",
    "drlsl.logic.lowering.ir": "drlsl.lowering.ir",
    "drlsl.logic.lowering.loop_ops": "drlsl.lowering.backends",
    "drlsl.logic.lowering.loops": "drlsl.lowering.backends",
    "drlsl.logic.lowering.lower": "drlsl.lowering.frontend",
    "drlsl.logic.lowering.names": "drlsl.lowering.ir",
    "drlsl.logic.lowering.numba_backend": "drlsl.lowering.backends",
    "drlsl.logic.lowering.numba_compile": "drlsl.lowering.backends",
    "drlsl.logic.lowering.numbers": "drlsl.lowering.ir",
    "drlsl.logic.lowering.numpy_backend": "drlsl.lowering.backends",
    "drlsl.logic.lowering.numpy_ops": "drlsl.lowering.backends",
    "drlsl.logic.lowering.python_text": "drlsl.lowering.backends",
    "drlsl.logic.lowering.scalar": "drlsl.lowering.backends",
    "drlsl.logic.lowering.schema": "drlsl.lowering.ir",
    "drlsl.logic.lowering.sparse": "drlsl.lowering.backends",
    "drlsl.logic.lowering.support": "drlsl.lowering.backends",
    "drlsl.logic.lowering.symbols": "drlsl.lowering.frontend",
    "drlsl.logic.lowering.torch_backend": "drlsl.lowering.backends",
    "drlsl.logic.lowering.torch_ops": "drlsl.lowering.backends",
    "drlsl.logic.lowering.trees": "drlsl.lowering.ir",
    "drlsl.logic.lowering.unfold": "drlsl.lowering.frontend",
    "drlsl.logic.operators": "drlsl.logic.terms",
    "drlsl.logic.parser": "drlsl.logic.syntax",
    "drlsl.logic.program": "drlsl.logic.core",
    "drlsl.logic.proof": "drlsl.logic.explain",
    "drlsl.logic.reader": "drlsl.logic.syntax",
    "drlsl.logic.solver": "drlsl.logic.core",
    "drlsl.logic.tabling": "drlsl.logic.core",
    "drlsl.logic.tokens": "drlsl.logic.syntax",
    "drlsl.logic.unify": "drlsl.logic.core",
    "drlsl.logic.values": "drlsl.logic",
    "drlsl.logic.writer": "drlsl.logic.terms",
    "drlsl.study.machine": "drlsl.study",
    "drlsl.study.schedule": "drlsl.study",
    "drlsl.study.tables": "drlsl.study",
    "drlsl.traffic.tables": "drlsl.traffic",
    "drlsl.verify.assumed": "drlsl.verify.floats",
    "drlsl.verify.booleans": "drlsl.verify.smt",
    "drlsl.verify.changing": "drlsl.verify.attack",
    "drlsl.verify.closeness": "drlsl.verify.attack",
    "drlsl.verify.drawing": "drlsl.verify.attack",
    "drlsl.verify.drawn_facts": "drlsl.verify.attack",
    "drlsl.verify.enclosures": "drlsl.verify.attack",
    "drlsl.verify.exact": "drlsl.verify.attack",
    "drlsl.verify.formula": "drlsl.verify.smt",
    "drlsl.verify.functions": "drlsl.verify.smt",
    "drlsl.verify.intervals": "drlsl.verify.floats",
    "drlsl.verify.levers": "drlsl.counterfactual",
    "drlsl.verify.margins": "drlsl.verify.floats",
    "drlsl.verify.ordering": "drlsl.verify.floats",
    "drlsl.verify.polynomials": "drlsl.verify.smt",
    "drlsl.verify.replay": "drlsl.verify",
    "drlsl.verify.rounding": "drlsl.verify.floats",
    "drlsl.verify.second": "drlsl.verify.smt",
    "drlsl.verify.signature": "drlsl.verify.smt",
    "drlsl.verify.solver": "drlsl.verify.smt",
    "drlsl.verify.symbolic": "drlsl.verify.smt",
    "drlsl.verify.values": "drlsl.verify.smt",
    "drlsl.verify.whatif": "drlsl.counterfactual",
    "drlsl.verify.workers": "drlsl.verify",
}
"""By old name, the package that offers now what the module did."""


class _Signpost(MetaPathFinder):
    """Asked last, for modules that nobody has found."""

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> None:
        """Say where a module has moved to.

        Raises:
            ModuleNotFoundError: it has moved.
        """
        if home := MOVED.get(fullname):
            raise ModuleNotFoundError(f"{fullname} has moved; import from {home} instead", name=fullname)


def say_where() -> None:
    """Have the import of a module that has moved fail with a line that says where to."""
    sys.meta_path.append(_Signpost())
