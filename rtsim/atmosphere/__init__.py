"""Gusts and turbulence as inputs of the plant: discrete gusts and the Dryden forms of MIL-F-8785C.

The package itself hands out the data types only; tables and state are in ``rtsim.atmosphere.air``.
"""

from rtsim.atmosphere.specification import CALM, SEVERITY_WIND, AirSpecification, Gust, Turbulence

__all__ = ["CALM", "SEVERITY_WIND", "AirSpecification", "Gust", "Turbulence"]
