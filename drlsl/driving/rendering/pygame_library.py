"""pygame, which draws; it is loaded only when something is drawn."""

from __future__ import annotations

import os
from types import ModuleType

from drlsl.errors import UserError


class CannotRenderError(UserError, TypeError):
    """Nothing can be drawn here.

    A `TypeError`, too: factories of other libraries ask for pictures that nobody may want, and make the
    environment without after that.
    """


def load_pygame() -> ModuleType:
    """Return pygame.

    Raises:
        CannotRenderError: it is not installed.
    """
    # Without this it greets on standard output, which may be the JSON of a command.
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
        import pygame.font
    except ImportError as error:
        raise CannotRenderError("rendering needs pygame: pip install 'drlsl[render]'") from error
    return pygame
