"""The LPV aircraft: database, its build and checks, compiled kernels, and the aircraft object."""

from rtsim.lpv.aircraft import LpvAircraft, load_aircraft
from rtsim.lpv.database import Database, PilotArrays, load_database, save_database

__all__ = ["Database", "LpvAircraft", "PilotArrays", "load_aircraft", "load_database", "save_database"]
