from .cache import cache_folder as cache_folder
from .generate import PRESETS as PRESETS
from .generate import find_preset as find_preset
from .generate import simulate as simulate
from .highd_writer import check_folder as check_folder
from .highd_writer import write_highd as write_highd
from .load import bundled_recordings as bundled_recordings
from .load import load_recording as load_recording
from .recording import Recording as Recording
from .recording import VehicleClass as VehicleClass
from .report import RecordingReport as RecordingReport
from .report import Spread as Spread
from .report import recording_report as recording_report
from .road import Direction as Direction
from .road import Lane as Lane
from .sources import BUNDLED as BUNDLED
from .sources import find_source as find_source
from .tracks import Tracks as Tracks
from .tracks import lanes_of_rows as lanes_of_rows
from .tracks import pack as pack

__all__ = [
    "BUNDLED",
    "PRESETS",
    "Direction",
    "Lane",
    "Recording",
    "RecordingReport",
    "Spread",
    "Tracks",
    "VehicleClass",
    "bundled_recordings",
    "cache_folder",
    "check_folder",
    "find_preset",
    "find_source",
    "lanes_of_rows",
    "load_recording",
    "pack",
    "recording_report",
    "simulate",
    "write_highd",
]
