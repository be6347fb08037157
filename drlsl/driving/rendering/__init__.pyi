from .film import Film, check_film_path
from .moment import Moment, alarm_of, moment_of_scene, moment_of_world
from .renderer import RENDER_MODES, RGB_ARRAY, Renderer
from .road_view import COLOURS, RoadView
from .window import Window

__all__ = [
    "COLOURS",
    "RENDER_MODES",
    "RGB_ARRAY",
    "Film",
    "Moment",
    "Renderer",
    "RoadView",
    "Window",
    "alarm_of",
    "check_film_path",
    "moment_of_scene",
    "moment_of_world",
]
