from .array_kinds import NUMBERS, Boxes, Floats, Integers, Mask
from .as_highd import highd_content
from .edit import cut, fill_gaps, smooth, thin
from .formats import FORMATS, write_parquet
from .generate import simulate
from .highd_writer import check_folder, write_highd
from .load import load_recording, load_recordings, load_source
from .packed_frames import CELL, FIRST, LANE, LENGTH, OFF_LANE, PIECE, UNIT, VEHICLE, WIDTH, Film
from .recording import Recording, VehicleClass
from .report import RecordingReport, Spread, recording_report
from .road import Direction, Lane, MergingLane, Traffic
from .road_network import RAMP_LIMIT
from .road_presets import PRESETS, Merge, find_preset
from .source import Source
from .sources import BUNDLED, bundled_recordings, find_source, find_sources, recording_names
from .tracks import Tracks, lanes_of_rows, pack
from .words import counted

__all__ = [
    "BUNDLED",
    "CELL",
    "FIRST",
    "FORMATS",
    "LANE",
    "LENGTH",
    "NUMBERS",
    "OFF_LANE",
    "PIECE",
    "PRESETS",
    "RAMP_LIMIT",
    "UNIT",
    "VEHICLE",
    "WIDTH",
    "Boxes",
    "Direction",
    "Film",
    "Floats",
    "Integers",
    "Lane",
    "Mask",
    "Merge",
    "MergingLane",
    "Recording",
    "RecordingReport",
    "Source",
    "Spread",
    "Tracks",
    "Traffic",
    "VehicleClass",
    "bundled_recordings",
    "check_folder",
    "counted",
    "cut",
    "fill_gaps",
    "find_preset",
    "find_source",
    "find_sources",
    "highd_content",
    "lanes_of_rows",
    "load_recording",
    "load_recordings",
    "load_source",
    "pack",
    "recording_names",
    "recording_report",
    "simulate",
    "smooth",
    "thin",
    "write_highd",
    "write_parquet",
]
