from .driven_by import DrivenBy
from .driver import Choice, Driver, Preferences, Situations, most_wanted, wanting
from .mobil import Mobil
from .named_driver import DRIVERS, KEEP, driver_of, is_driver, make_driver
from .oracle import Oracle

__all__ = [
    "DRIVERS",
    "KEEP",
    "Choice",
    "DrivenBy",
    "Driver",
    "Mobil",
    "Oracle",
    "Preferences",
    "Situations",
    "driver_of",
    "is_driver",
    "make_driver",
    "most_wanted",
    "wanting",
]
