"""The LPV aircraft: database, its build and checks, compiled kernels, and the aircraft object."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtsim.lpv.aircraft import LpvAircraft, load_aircraft
    from rtsim.lpv.database import Database, PilotArrays
    from rtsim.lpv.files.storage import load_database, save_database

__all__ = ["Database", "LpvAircraft", "PilotArrays", "load_aircraft", "load_database", "save_database"]

_HOMES = {
    "LpvAircraft": "rtsim.lpv.aircraft",
    "load_aircraft": "rtsim.lpv.aircraft",
    "Database": "rtsim.lpv.database",
    "PilotArrays": "rtsim.lpv.database",
    "load_database": "rtsim.lpv.files.storage",
    "save_database": "rtsim.lpv.files.storage",
}


def __getattr__(name: str) -> object:
    """Import a public name when it is first used: the kernels cost the start of numba."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
