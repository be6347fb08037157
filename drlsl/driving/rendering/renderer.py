"""The view of a world in the render modes of Gymnasium."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.rendering.moment import Moment, alarm_of, moment_of_world
from drlsl.driving.rendering.road_view import RoadView
from drlsl.driving.rendering.window import Window
from drlsl.driving.simulation import StepResult, World
from drlsl.errors import UserError

RGB_ARRAY: Final = "rgb_array"
RENDER_MODES: Final = ("human", RGB_ARRAY)


class Renderer:
    """The view of a world in a render mode; in `human` it opens a window when there is something to see."""

    def __init__(self, mode: str, world: World, modes: tuple[str, ...] = RENDER_MODES) -> None:
        """Make a renderer of a `mode`, one of `modes`.

        Raises:
            UserError: there is no such mode, or pygame is not installed.
        """
        if mode not in modes:
            raise UserError.no_such("render_mode", mode, (*modes, "None"))
        self.live = mode == "human"
        """True if every frame is shown as it is driven."""
        self._world = world
        self._view = RoadView()
        self._window: Window | None = None
        self._result: StepResult | None = None

    def watch(self, result: StepResult | None) -> None:
        """Take the result of a frame, None after a reset; in the mode `human` show it."""
        self._result = result
        if not self.live:
            return
        if self._window is None:
            self._window = Window(self._view, 1 / self._world.playback_of(0).road.time_step)
        self._window.show(self._moment(0))

    def picture(self, ego: int = 0) -> npt.NDArray[np.uint8]:
        """Return the picture of the present, uint8 (height, width, 3)."""
        return self._view.draw(self._moment(ego))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _moment(self, ego: int) -> Moment:
        return moment_of_world(self._world, ego, alarm=alarm_of(self._result, ego))
