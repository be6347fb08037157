from .formats import FORMATS, MaskFormat, mask_format
from .not_offered import MODES, ActionNotOffered, Mode, Settled, check_mode, settle
from .sb3_vec_env import Sb3VecEnv
from .wrappers import FormatMask, FormatVectorMask

__all__ = [
    "FORMATS",
    "MODES",
    "ActionNotOffered",
    "FormatMask",
    "FormatVectorMask",
    "MaskFormat",
    "Mode",
    "Sb3VecEnv",
    "Settled",
    "check_mode",
    "mask_format",
    "settle",
]
