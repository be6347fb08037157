"""A window that shows a drive as it happens."""

from __future__ import annotations

from typing import Any

from drlsl.driving.rendering.moment import Moment
from drlsl.driving.rendering.pygame_library import load_pygame
from drlsl.driving.rendering.road_view import RoadView
from drlsl.errors import UserError


class Window:
    """A window with a view of the road, in which time runs as on the road.

    Once it is closed, by its button or by `close`, nothing more is shown.
    """

    def __init__(self, view: RoadView, rate: float) -> None:
        """Open a window for a `view`; `rate`: the most moments to show a second.

        Raises:
            UserError: pygame is not installed, or there is no display.
        """
        self._pygame = load_pygame()
        self._view = view
        self._rate = rate
        pygame = self._pygame
        try:
            pygame.display.init()
            self._screen: Any = pygame.display.set_mode(view.size)
        except pygame.error as error:
            raise UserError(
                f"render_mode 'human': no window can be opened ({error}); use 'rgb_array' without a display"
            ) from error
        pygame.display.set_caption("DRLSL")
        self._clock = pygame.time.Clock()

    @property
    def open(self) -> bool:
        """True until it is closed."""
        return self._screen is not None

    def __deepcopy__(self, memo: object) -> Window:
        """Return itself: there is one screen."""
        return self

    def show(self, moment: Moment) -> None:
        """Show a moment, and wait until it is time for the next."""
        if self._screen is None:
            return
        if any(event.type == self._pygame.QUIT for event in self._pygame.event.get()):
            self.close()
            return
        self._screen.blit(self._view.surface(moment), (0, 0))
        self._pygame.display.flip()
        self._clock.tick(self._rate)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._screen is not None:
            self._screen = None
            self._pygame.display.quit()
