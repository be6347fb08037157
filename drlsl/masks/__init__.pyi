from .formats import FORMATS, MaskFormat, mask_format
from .not_offered import MODES, ActionNotOffered, Mode, Settled, check_mode, settle
from .wrappers import FormatMask, FormatVectorMask

__all__ = [
    "FORMATS",
    "MODES",
    "ActionNotOffered",
    "FormatMask",
    "FormatVectorMask",
    "MaskFormat",
    "Mode",
    "Settled",
    "check_mode",
    "mask_format",
    "settle",
]
