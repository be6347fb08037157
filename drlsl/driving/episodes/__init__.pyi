from .driven_episode import NO_DECISION, Ending, Episode, Origin
from .episode_arrays import arguments_of
from .episode_file import PARQUET, SUFFIX, SUFFIXES, episode_files, is_episode, load_episode, save_episode
from .recorder import EpisodeRecorder, episode_of_scene

__all__ = [
    "NO_DECISION",
    "PARQUET",
    "SUFFIX",
    "SUFFIXES",
    "Ending",
    "Episode",
    "EpisodeRecorder",
    "Origin",
    "arguments_of",
    "episode_files",
    "episode_of_scene",
    "is_episode",
    "load_episode",
    "save_episode",
]
