"""All examples of a search for lane changes: labelled ones of several origins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drlsl.driving.scene import SceneBatch
from drlsl.induction.examples import Examples
from drlsl.induction.lane_changes.labelled_changes import Changes, joined_scenes
from drlsl.induction.lane_changes.scene_bias import SceneBias


class ChangeExamples(Examples):
    """The lane changes of several lists, one after another."""

    def __init__(self, bias: SceneBias, parts: Sequence[Changes]) -> None:
        """Evaluate the quantities of `bias` in every scene.

        Raises:
            UserError: a quantity is beyond 32 bits, or no number.
        """
        filled = [part for part in parts if len(part)]
        self.scene_bias = bias
        self.parts = filled
        values = [bias.values(part.scenes)[np.arange(len(part)), part.side] for part in filled]
        super().__init__(
            bias,
            np.concatenate(values),
            np.concatenate([part.side for part in filled]),
            np.concatenate([part.unsafe for part in filled]),
            [name for part in filled for name in part.origin],
        )
        self._scenes: SceneBatch | None = None

    @property
    def scenes(self) -> SceneBatch:
        """The scenes in which the lane changes began."""
        if self._scenes is None:
            self._scenes = joined_scenes([part.scenes for part in self.parts])
        return self._scenes
