"""The checks, declared group by group."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from rtsim.validation.check import Check
from rtsim.validation.declared import (
    climb,
    dynamics,
    fidelity,
    flapping,
    hover,
    lateral,
    loads,
    power,
    rotor,
    stall,
    trims,
)

GROUPS: dict[str, tuple[str, Callable[[], list[Check]]]] = {
    "trims": ("Level-flight trims", trims.checks),
    "loads": ("Loads by component", loads.checks),
    "rotor": ("The isolated rotor", rotor.checks),
    "power": ("Power in level flight", power.checks),
    "flapping": ("Trim flapping", flapping.checks),
    "stall": ("Low-speed boundary and the end of level flight", stall.checks),
    "climb": ("Climb, autorotation, level speed", climb.checks),
    "hover": ("Hover", hover.checks),
    "dynamics": ("Control and identified responses", dynamics.checks),
    "lateral": ("Out of the plane of symmetry", lateral.checks),
    "fidelity": ("The LPV aircraft against the nonlinear one", fidelity.checks),
}
"""Title and checks of each group, in the order of the report."""


@cache
def checks_of(group: str) -> tuple[Check, ...]:
    """The checks of one group.

    Args:
        group: Its name.
    """
    return tuple(GROUPS[group][1]())


def all_checks() -> tuple[Check, ...]:
    """Every check, in the order of the report."""
    return tuple(check for group in GROUPS for check in checks_of(group))
