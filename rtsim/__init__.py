"""rtsim: a real-time, pilot-in-the-loop simulator of the Bell XV-15 tiltrotor.

The names below are loaded when first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rtsim.aircraft.xv15.model import Xv15
    from rtsim.command import Command, Margins, Reference, Sensors
    from rtsim.corridor import Corridor, load_corridor
    from rtsim.errors import InputError, RtsimError
    from rtsim.loop.options import FlightOptions
    from rtsim.loop.simulation import FlightSetup, Simulation
    from rtsim.lpv.aircraft import LpvAircraft, load_aircraft
    from rtsim.pilot import MocmError, design_mocm
    from rtsim.programme import Programme

_HOME = {
    "Command": "rtsim.command",
    "Corridor": "rtsim.corridor",
    "FlightOptions": "rtsim.loop.options",
    "FlightSetup": "rtsim.loop.simulation",
    "InputError": "rtsim.errors",
    "LpvAircraft": "rtsim.lpv.aircraft",
    "Margins": "rtsim.command",
    "MocmError": "rtsim.pilot",
    "Programme": "rtsim.programme",
    "Reference": "rtsim.command",
    "RtsimError": "rtsim.errors",
    "Sensors": "rtsim.command",
    "Simulation": "rtsim.loop.simulation",
    "Xv15": "rtsim.aircraft.xv15.model",
    "design_mocm": "rtsim.pilot",
    "load_aircraft": "rtsim.lpv.aircraft",
    "load_corridor": "rtsim.corridor",
}

__all__ = [
    "Command",
    "Corridor",
    "FlightOptions",
    "FlightSetup",
    "InputError",
    "LpvAircraft",
    "Margins",
    "MocmError",
    "Programme",
    "Reference",
    "RtsimError",
    "Sensors",
    "Simulation",
    "Xv15",
    "__version__",
    "design_mocm",
    "load_aircraft",
    "load_corridor",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'rtsim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
