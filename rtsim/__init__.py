"""rtsim: a real-time, pilot-in-the-loop simulator of the Bell XV-15 tiltrotor.

Its names (``__init__.pyi``) are loaded when first used, so that importing the package costs nothing.
"""

from rtsim.lazy import names_of

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = names_of(__name__, __file__)
