"""The nacelles: conversion actuator, rate limits, the pilot's switch with its detents."""

from rtsim.nacelle.nacelle_kernels import NacelleTables
from rtsim.nacelle.switch import NacelleActuator, NacelleSwitch, load_nacelle_tables

__all__ = ["NacelleActuator", "NacelleSwitch", "NacelleTables", "load_nacelle_tables"]
