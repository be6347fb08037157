from .cluster import RayWorkers
from .crew import ALONE, Crew, cores, in_order
from .local import LocalWorkers
from .outcome import Failure, Function, Make, Outcome, Stop, Workers, followed

__all__ = [
    "ALONE",
    "Crew",
    "Failure",
    "Function",
    "LocalWorkers",
    "Make",
    "Outcome",
    "RayWorkers",
    "Stop",
    "Workers",
    "cores",
    "followed",
    "in_order",
]
