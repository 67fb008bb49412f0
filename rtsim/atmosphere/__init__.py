"""Gusts and turbulence as inputs of the plant: discrete gusts and the Dryden forms of MIL-F-8785C."""

from rtsim.atmosphere.air import (
    SEVERITY_WIND,
    AirSpecification,
    Gust,
    Turbulence,
    add_gust,
    new_gust_state,
    normals_needed,
    set_turbulence,
)

__all__ = [
    "SEVERITY_WIND",
    "AirSpecification",
    "Gust",
    "Turbulence",
    "add_gust",
    "new_gust_state",
    "normals_needed",
    "set_turbulence",
]
