"""Flaps and rotor drive: what moves the flaps, and what the rotor speed does with and without its governor."""

from rtsim.systems.drive_kernels import DriveTables
from rtsim.systems.flap_kernels import FlapTables
from rtsim.systems.settings import load_drive_tables, load_flap_tables

__all__ = ["DriveTables", "FlapTables", "load_drive_tables", "load_flap_tables"]
