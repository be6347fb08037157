"""The machine that a study runs on."""

import platform
from pathlib import Path

from drlsl.workers import cores


def processors() -> str:
    """Return the number and model of the processors, for people."""
    return f"{cores()} cores, {_model()}"


def _model() -> str:
    path = Path("/proc/cpuinfo")
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
