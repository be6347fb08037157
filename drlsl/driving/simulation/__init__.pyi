from .fault import BRAKING, INTRUSION, REACTION, Verdict
from .playback import Playback, in_direction, load_playbacks, playbacks_of
from .reward import TERMS
from .world import StepResult, World

__all__ = [
    "BRAKING",
    "INTRUSION",
    "REACTION",
    "TERMS",
    "Playback",
    "StepResult",
    "Verdict",
    "World",
    "in_direction",
    "load_playbacks",
    "playbacks_of",
]
