from .decision_period import drive_decision, frames_per_decision
from .fault import BRAKING, INTRUSION, REACTION, Verdict
from .idm import idm_acceleration
from .measures import EpisodeMeasures, Measures, headway_quantile, measures_of
from .playback import Playback, in_direction, load_playbacks, playbacks_of
from .reward import TERMS
from .world import StepResult, World

__all__ = [
    "BRAKING",
    "INTRUSION",
    "REACTION",
    "TERMS",
    "EpisodeMeasures",
    "Measures",
    "Playback",
    "StepResult",
    "Verdict",
    "World",
    "drive_decision",
    "frames_per_decision",
    "headway_quantile",
    "idm_acceleration",
    "in_direction",
    "load_playbacks",
    "measures_of",
    "playbacks_of",
]
