"""All examples of a search: labelled lane changes of several origins, and the eases of their quantities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drlsl.driving.scene import SceneBatch
from drlsl.induction.bias import Bias
from drlsl.induction.labelled_changes import Changes, joined_scenes
from drlsl.traffic import Integers, Mask


class Examples:
    """The lane changes of several lists, one after another: `eases` (N, Q), `unsafe` (N,), `origin` (N,)."""

    def __init__(self, bias: Bias, parts: Sequence[Changes]) -> None:
        """Evaluate the quantities of `bias` in every scene.

        Raises:
            UserError: a quantity is beyond 32 bits, or no number.
        """
        filled = [part for part in parts if len(part)]
        self.bias = bias
        self.parts = filled
        values = [bias.values(part.scenes)[np.arange(len(part)), part.side] for part in filled]
        self.eases: Integers = bias.eases(np.concatenate(values))
        self.unsafe: Mask = np.concatenate([part.unsafe for part in filled])
        self.side: Integers = np.concatenate([part.side for part in filled])
        self.origin = [name for part in filled for name in part.origin]
        self._scenes: SceneBatch | None = None

    @property
    def scenes(self) -> SceneBatch:
        """The scenes in which the lane changes began."""
        if self._scenes is None:
            self._scenes = joined_scenes([part.scenes for part in self.parts])
        return self._scenes

    @property
    def unsafe_places(self) -> Integers:
        """The places of the unsafe ones, shape (U,)."""
        return self.unsafe.nonzero()[0]
