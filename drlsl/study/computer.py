"""The machine that a study runs on."""

import os
import platform
from pathlib import Path


def cores() -> int:
    """Return the number of processors that this process may use."""
    # os.process_cpu_count is newer than the oldest Python that we support.
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processors() -> str:
    """Return the number and model of the processors, for people."""
    return f"{cores()} cores, {_model()}"


def _model() -> str:
    path = Path("/proc/cpuinfo")
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
