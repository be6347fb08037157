from .driver import Choice, Driver, Preferences, Situations, most_wanted, wanting
from .mobil import Mobil
from .named_driver import DRIVERS, KEEP, driver_of, is_driver, make_driver

__all__ = [
    "DRIVERS",
    "KEEP",
    "Choice",
    "Driver",
    "Mobil",
    "Preferences",
    "Situations",
    "driver_of",
    "is_driver",
    "make_driver",
    "most_wanted",
    "wanting",
]
