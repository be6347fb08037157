from .array_kinds import NUMBERS, Boxes, Floats, Integers, Mask
from .generate import simulate
from .highd_writer import check_folder, write_highd
from .load import bundled_recordings, load_recording
from .recording import Recording, VehicleClass
from .report import RecordingReport, Spread, recording_report
from .road import Direction, Lane, MergingLane, Traffic
from .road_presets import PRESETS, Merge, find_preset
from .sources import BUNDLED, find_source
from .tracks import Tracks, lanes_of_rows, pack
from .words import counted

__all__ = [
    "BUNDLED",
    "NUMBERS",
    "PRESETS",
    "Boxes",
    "Direction",
    "Floats",
    "Integers",
    "Lane",
    "Mask",
    "Merge",
    "MergingLane",
    "Recording",
    "RecordingReport",
    "Spread",
    "Tracks",
    "Traffic",
    "VehicleClass",
    "bundled_recordings",
    "check_folder",
    "counted",
    "find_preset",
    "find_source",
    "lanes_of_rows",
    "load_recording",
    "pack",
    "recording_report",
    "simulate",
    "write_highd",
]
