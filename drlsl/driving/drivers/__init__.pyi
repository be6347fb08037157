from .driver import Choice, Driver, Preferences, Situations, most_wanted, wanting
from .mobil import Mobil
from .named_driver import DRIVERS, driver_of, is_driver, make_driver

__all__ = [
    "DRIVERS",
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
