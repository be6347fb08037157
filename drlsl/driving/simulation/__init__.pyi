from .fault import BRAKING as BRAKING
from .fault import INTRUSION as INTRUSION
from .fault import REACTION as REACTION
from .fault import Verdict as Verdict
from .playback import Playback as Playback
from .playback import in_direction as in_direction
from .playback import load_playbacks as load_playbacks
from .playback import playbacks_of as playbacks_of
from .reward import TERMS as TERMS
from .world import StepResult as StepResult
from .world import World as World

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
