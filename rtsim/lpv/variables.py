"""Names, units and meanings of states, inputs and outputs: data of a database, not of the code."""

from __future__ import annotations

from collections.abc import Sequence

from rtsim.aircraft.variables import FLAP_INPUTS, Variable
from rtsim.errors import InputError

__all__ = [
    "AUXILIARY_INPUTS",
    "FLAP_INPUTS",
    "GUST_INPUTS",
    "NACELLE_INPUTS",
    "RIGID_BODY_STATES",
    "SCHEDULING_STATES",
    "Variable",
    "position",
    "required_position",
]

SCHEDULING_STATES = ("u", "w", "pitch")
"""States that every database must have: airspeed and angle of attack are computed from them."""
RIGID_BODY_STATES = ("u", "w", "q", "pitch", "altitude")
"""States that the stitched forms need besides: their gravity, Coriolis and kinematic terms are nonlinear."""
NACELLE_INPUTS = ("nacelle_rate", "nacelle_acceleration")
"""Inputs that the step fills from the nacelle path where the database has them."""
GUST_INPUTS = ("gust_u", "gust_w")
"""Inputs that add to u and w in the aerodynamics, and so in the scheduling of the forms where these stand alone."""


AUXILIARY_INPUTS = (*FLAP_INPUTS, "rotor_speed")
"""Inputs that are zero while flaps and rotor speed are where schedule and governor have them; they stand last."""


def position(variables: Sequence[Variable], name: str) -> int:
    """Find a variable by name.

    Args:
        variables: The states, inputs or outputs of a database.
        name: The variable sought.

    Returns:
        Its position, or -1 where there is none of that name.
    """
    for index, variable in enumerate(variables):
        if variable.name == name:
            return index
    return -1


def required_position(variables: Sequence[Variable], name: str, purpose: str) -> int:
    """Find a variable that must be there.

    Args:
        variables: The states, inputs or outputs of a database.
        name: The variable sought.
        purpose: What it is needed for, for the message.

    Returns:
        Its position.

    Raises:
        InputError: The database has no variable of that name.
    """
    index = position(variables, name)
    if index < 0:
        raise InputError(
            f"the database has no variable '{name}', which {purpose} needs",
            key="name",
            allowed=", ".join(variable.name for variable in variables),
            mend=f"rename the variable that means '{name}'",
        )
    return index
