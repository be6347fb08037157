from .driven_episode import NO_DECISION, Ending, Episode, Origin
from .episode_file import SUFFIX, arguments_of, load_episode, save_episode
from .recorder import EpisodeRecorder, episode_of_scene

__all__ = [
    "NO_DECISION",
    "SUFFIX",
    "Ending",
    "Episode",
    "EpisodeRecorder",
    "Origin",
    "arguments_of",
    "episode_of_scene",
    "load_episode",
    "save_episode",
]
