"""The quantities of lane changes: their numbers in many scenes, at array speed."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np

from drlsl.driving.scene import SCHEMA, SceneBatch, facts_of
from drlsl.driving.shield import LIMITS, SceneProgram
from drlsl.induction.learnt_file import FileForm
from drlsl.induction.quantities import Bias
from drlsl.lowering.backends import compile_numpy
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import NotLowerable
from drlsl.traffic import Floats

Side: TypeAlias = Literal["left", "right"]

SIDES: Final[tuple[Side, ...]] = ("left", "right")

OPENINGS: Final = "learning.pl"
"""The program that declares quantities where no other is named."""

OBJECTIONS: Final = """\
:- abolish(objection/2).

% objection(Action, Reason): Reason speaks against a lane change: one is under way, or no lane is open.
objection(Action, changing_lanes) :- lane_change(Action, _), \\+ settled.
objection(Action, no_lane) :- lane_change(Action, Side), \\+ side_lane(Side, _).
objection(Action, no_opening) :- lane_change(Action, Side), \\+ opening(Side).
"""
"""The objections of a learnt program; `opening(Side)` is what is learnt."""

FORM: Final = FileForm(
    title="when a lane change is open, learnt from driving by drlsl rules learn.",
    prelude=OBJECTIONS,
    head="opening(Side)",
    about="opening(Side): the lane on that side is open: no vehicle there is too near, or too fast.",
)


class SceneBias(Bias):
    """A rule program, and the quantities that it declares for lane changes."""

    noun = "lane change"

    def __init__(self, path: str | Path) -> None:
        """Load the program.

        Raises:
            UserError: the file cannot be read, or does not declare quantities as it should.
            PrologError: it is not a valid program.
        """
        super().__init__(path, SIDES, "Side", SCHEMA)
        self._program = self._lowered()

    def _lowered(self) -> SceneProgram | None:
        """Return the array program of the quantities; None if only the interpreter can run it."""
        try:
            queries = [Query(name, 1, "first") for name in self.names]
            return SceneProgram(compile_numpy(lower(self.engine, SCHEMA, queries)))
        except NotLowerable:
            return None

    def choice_words(self, choice: int) -> str:
        """Return a side for people."""
        return f"to the {self.choices[choice]}"

    def values(self, scenes: SceneBatch) -> Floats:
        """Return the hardest value of each quantity on each side, shape (N, 2, Q); NaN without a solution.

        Raises:
            UserError: a quantity has a solution that is no finite number.
        """
        count = len(self.quantities)
        result = np.full((len(scenes), len(self.names)), np.nan)
        undecided = np.ones(len(scenes), dtype=np.bool_)
        if self._program is not None and len(scenes):
            answers, undecided = self._program(scenes)
            for column, answer in enumerate(answers):
                result[:, column] = np.where(answer.fails, np.nan, np.asarray(answer.value, np.float64))
        for index in undecided.nonzero()[0].tolist():
            result[index] = self._asked(scenes, index)
        return result.reshape(len(scenes), len(SIDES), count)

    def _asked(self, scenes: SceneBatch, index: int) -> list[float]:
        """Return what the interpreter says of one scene."""
        for (name, arity), rows in facts_of(scenes.scene(index)).items():
            self.engine.replace_facts(name, arity, rows)
        found = []
        for name in self.names:
            solution = self.engine.once(f"{name}(V)", limits=LIMITS)
            found.append(self.number(None if solution is None else solution["V"]))
        return found
