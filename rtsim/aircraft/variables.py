"""States, inputs and outputs as data: name, unit, meaning and role; and those of the XV-15.

Whoever needs a group of them selects by role, never by "all but" and never by where they stand.

Motion in the plane of symmetry and out of it are two lists. What the two rotors do is told as the mean of both, which
is symmetric, and as half the difference right less left, each rotor seen in its own mirrored frame, which is lateral:
every lateral variable changes its sign in a mirror, so that the two halves of a linear model do not meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.places import Places

ROLES: dict[str, dict[str, str]] = {
    "state": {
        "rigid": "motion of the rigid body",
        "navigation": "where it is; acts on nothing",
        "rotor": "blades; they settle within a tenth of a second",
        "inflow": "air through the rotors; it settles as fast",
        "actuator": "moves towards what a control asks for",
    },
    "input": {
        "pilot": "the pilot's hands",
        "nacelle": "driven by the motion of the nacelles",
        "gust": "motion of the air",
        "flap": "flaps less their schedule",
        "drive": "rotor speed less the one that is held",
        "ground": "nearness of the ground, and what its contact does",
    },
    "output": {"rotor": "loads and motion of the rotors", "body": "what the whole aircraft does"},
}
"""What a state, an input or an output can be, in words."""


@dataclass(frozen=True, slots=True)
class Variable:
    """One entry of a state, input or output vector."""

    name: str
    """Name, as used by the database and by ``control.StateSpace``."""
    unit: str
    """SI unit; empty where dimensionless."""
    description: str
    """One sentence for people."""
    role: str = ""
    """One of ``ROLES``; empty only until a database gives the known names their known roles."""


SCHEDULING_SPEED = 4.5
"""Added along the horizon before an angle of attack is taken for scheduling or output: defined in hover too [m/s]."""

STATES: tuple[Variable, ...] = (
    Variable("u", "m/s", "Air-relative velocity along the body x axis (forward)", "rigid"),
    Variable("w", "m/s", "Air-relative velocity along the body z axis (down)", "rigid"),
    Variable("q", "rad/s", "Body pitch rate, nose up positive", "rigid"),
    Variable("pitch", "rad", "Pitch attitude, nose up positive", "rigid"),
    Variable("altitude", "m", "Height above the ground", "navigation"),
    Variable("coning", "rad", "Coning angle, precone included", "rotor"),
    Variable("coning_rate", "rad/s", "Rate of the coning angle", "rotor"),
    Variable("flap_1c", "rad", "Cosine gimbal flapping; positive tilts the disc forward", "rotor"),
    Variable("flap_1c_rate", "rad/s", "Rate of the cosine gimbal flapping", "rotor"),
    Variable("flap_1s", "rad", "Sine gimbal flapping", "rotor"),
    Variable("flap_1s_rate", "rad/s", "Rate of the sine gimbal flapping", "rotor"),
    Variable("inflow_0", "", "Mean induced velocity over tip speed", "inflow"),
    Variable("inflow_1c", "", "Fore-aft gradient of the induced velocity over tip speed", "inflow"),
    Variable("inflow_1s", "", "Lateral gradient of the induced velocity over tip speed", "inflow"),
    Variable("collective_75", "rad", "Collective pitch at 75 % radius (after its actuator)", "actuator"),
    Variable(
        "cyclic_1s",
        "rad",
        "Longitudinal cyclic pitch (after its actuator); negative tilts the disc forward",
        "actuator",
    ),
    Variable("elevator", "rad", "Elevator (after its actuator), trailing edge down positive", "actuator"),
)
INPUTS: tuple[Variable, ...] = (
    Variable("stick", "", "Longitudinal stick, -1 aft to 1 forward", "pilot"),
    Variable("lever", "", "Power lever, 0 to 1", "pilot"),
    Variable("nacelle_rate", "rad/s", "Rate of the nacelle angle", "nacelle"),
    Variable("nacelle_acceleration", "rad/s^2", "Angular acceleration of the nacelles", "nacelle"),
    Variable("gust_u", "m/s", "Gust added to the air-relative velocity along body x", "gust"),
    Variable("gust_w", "m/s", "Gust added to the air-relative velocity along body z", "gust"),
    Variable("gust_q", "rad/s", "Gust added to the air-relative pitch rate", "gust"),
    Variable("flap_0_20", "rad", "Flap deflection between 0 and 20 deg, less that of the flap schedule", "flap"),
    Variable("flap_20_40", "rad", "Flap deflection between 20 and 40 deg, less that of the flap schedule", "flap"),
    Variable("flap_40_75", "rad", "Flap deflection between 40 and 75 deg, less that of the flap schedule", "flap"),
    Variable("rotor_speed", "rad/s", "Rotor speed less the one that is held", "drive"),
    Variable("ground_effect", "", "Ground effect: 0 far from the ground, 1 hovering on the wheels", "ground"),
    Variable("contact_x", "m/s^2", "Force of the ground on the wheels along body x over mass", "ground"),
    Variable("contact_z", "m/s^2", "The same along body z", "ground"),
    Variable("contact_pitch", "rad/s^2", "Its pitching moment over the moment of inertia", "ground"),
)
OUTPUTS: tuple[Variable, ...] = (
    Variable("thrust", "N", "Thrust of one rotor along its mast", "rotor"),
    Variable("torque", "N m", "Torque of one mast", "rotor"),
    Variable("power", "W", "Shaft power of both rotors", "rotor"),
    Variable("load_factor", "", "Normal load factor: specific force along -z body over g", "body"),
    Variable("airspeed_rate", "m/s^2", "Rate of the horizontal airspeed", "body"),
    Variable("wing_angle_of_attack", "rad", "Angle of attack at which the wing tables are entered", "body"),
    Variable("flapping", "rad", "Magnitude of the gimbal flapping relative to the mast", "rotor"),
)

_HALF_DIFFERENCE = "Half difference right less left: "
LATERAL_STATES: tuple[Variable, ...] = (
    Variable("v", "m/s", "Air-relative velocity along the body y axis (right)", "rigid"),
    Variable("p", "rad/s", "Body roll rate, right positive", "rigid"),
    Variable("r", "rad/s", "Body yaw rate, nose right positive", "rigid"),
    Variable("bank", "rad", "Bank angle, right positive", "rigid"),
    Variable("heading", "rad", "Heading, clockwise from north, not wrapped", "navigation"),
    Variable("coning_difference", "rad", _HALF_DIFFERENCE + "coning", "rotor"),
    Variable("coning_rate_difference", "rad/s", _HALF_DIFFERENCE + "rate of the coning", "rotor"),
    Variable("flap_1c_difference", "rad", _HALF_DIFFERENCE + "cosine flapping", "rotor"),
    Variable("flap_1c_rate_difference", "rad/s", _HALF_DIFFERENCE + "rate of the cosine flapping", "rotor"),
    Variable(
        "flap_1s_difference", "rad", _HALF_DIFFERENCE + "sine flapping; positive lifts the outboard edge", "rotor"
    ),
    Variable("flap_1s_rate_difference", "rad/s", _HALF_DIFFERENCE + "rate of the sine flapping", "rotor"),
    Variable("inflow_0_difference", "", _HALF_DIFFERENCE + "mean induced velocity over tip speed", "inflow"),
    Variable("inflow_1c_difference", "", _HALF_DIFFERENCE + "fore-aft gradient of the induced velocity", "inflow"),
    Variable("inflow_1s_difference", "", _HALF_DIFFERENCE + "lateral gradient of the induced velocity", "inflow"),
    Variable("collective_difference", "rad", _HALF_DIFFERENCE + "collective pitch", "actuator"),
    Variable("cyclic_difference", "rad", _HALF_DIFFERENCE + "longitudinal cyclic pitch", "actuator"),
    Variable("aileron", "rad", "Aileron (half difference of the flaperons), right one up positive", "actuator"),
    Variable("rudder", "rad", "Rudder, positive turns the nose right", "actuator"),
)
"""States of the motion out of the plane of symmetry; all zero in symmetric flight."""
PLACE_STATES: tuple[Variable, ...] = (
    Variable("north", "m", "Place north of the start", "navigation"),
    Variable("east", "m", "Place east of the start", "navigation"),
)
"""Where the aircraft is over the ground: moved by the motion over the ground and acting on nothing."""
LATERAL_INPUTS: tuple[Variable, ...] = (
    Variable("lateral_stick", "", "Lateral stick, -1 left to 1 right", "pilot"),
    Variable("pedal", "", "Pedals, -1 left to 1 right", "pilot"),
    Variable("gust_v", "m/s", "Gust added to the air-relative velocity along body y", "gust"),
    Variable("gust_p", "rad/s", "Gust added to the air-relative roll rate", "gust"),
    Variable("gust_r", "rad/s", "Gust added to the air-relative yaw rate", "gust"),
    Variable("contact_y", "m/s^2", "Force of the ground on the wheels along body y over mass", "ground"),
    Variable("contact_roll", "rad/s^2", "Roll acceleration by it", "ground"),
    Variable("contact_yaw", "rad/s^2", "Yaw acceleration by it", "ground"),
)
"""Inputs that act out of the plane of symmetry."""
LATERAL_OUTPUTS: tuple[Variable, ...] = (
    Variable("thrust_difference", "N", _HALF_DIFFERENCE + "thrust of a rotor", "rotor"),
    Variable("torque_difference", "N m", _HALF_DIFFERENCE + "torque of a mast", "rotor"),
    Variable("side_force", "", "Lateral load factor: specific force along body y over g", "body"),
)
"""Outputs that are zero in symmetric flight."""
ALL_STATES = (*STATES, *LATERAL_STATES, *PLACE_STATES)
"""What a flight carries: the symmetric states first."""
ALL_INPUTS = (*INPUTS, *LATERAL_INPUTS)
ALL_OUTPUTS = (*OUTPUTS, *LATERAL_OUTPUTS)


def whole(vector: FloatArray, variables: Sequence[Variable]) -> FloatArray:
    """A vector of the symmetric variables, with zeros for the others; one that is whole already is copied.

    Args:
        vector: The vector.
        variables: ``ALL_STATES`` or ``ALL_INPUTS``.
    """
    return np.concatenate([vector, np.zeros(len(variables) - len(vector))])


def of_role(variables: Sequence[Variable], *roles: str) -> tuple[int, ...]:
    """Positions of the variables that have one of some roles.

    Args:
        variables: The states, inputs or outputs of an aircraft.
        roles: Roles sought.
    """
    return tuple(place for place, variable in enumerate(variables) if variable.role in roles)


def position(variables: Sequence[Variable], name: str) -> int:
    """Position of a variable by name; -1 where there is none.

    Args:
        variables: The states, inputs or outputs of an aircraft.
        name: The variable sought.
    """
    return next((place for place, variable in enumerate(variables) if variable.name == name), -1)


def required_position(variables: Sequence[Variable], name: str, purpose: str) -> int:
    """Position of a variable that must be there.

    Args:
        variables: The states, inputs or outputs of an aircraft.
        name: The variable sought.
        purpose: What it is needed for, for the message.

    Raises:
        InputError: There is no variable of that name.
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


def with_roles(kind: str, variables: Sequence[Variable]) -> tuple[Variable, ...]:
    """Give variables without a role that of the known name.

    Args:
        kind: ``state``, ``input`` or ``output``.
        variables: The variables.

    Raises:
        InputError: A name is not known and has no role, or a role does not exist.
    """
    allowed = ", ".join(ROLES[kind])
    found = []
    for variable in variables:
        role = variable.role or _KNOWN_ROLES[kind].get(variable.name, "")
        if role not in ROLES[kind]:
            problem = f"the {kind} '{variable.name}' has a role that does not exist"
            if not role:
                problem = f"the {kind} '{variable.name}' is not known and says no role"
            raise InputError(
                problem, key=f"{kind}_role", value=role or None, allowed=allowed,
                mend=f"say what it is in {kind}_role (docs/lpv.md)",
            )  # fmt: skip
        found.append(variable if variable.role else replace(variable, role=role))
    return tuple(found)


_KNOWN_ROLES = {
    kind: {variable.name: variable.role for variable in variables}
    for kind, variables in (("state", ALL_STATES), ("input", ALL_INPUTS), ("output", ALL_OUTPUTS))
}


def _names(variables: Sequence[Variable], *roles: str) -> tuple[str, ...]:
    return tuple(variables[place].name for place in of_role(variables, *roles))


SCHEDULING_STATES = ("u", "w", "pitch")
"""States that every database must have: airspeed and angle of attack are computed from them."""
RIGID_BODY_STATES = _names(STATES, "rigid", "navigation")
"""States that the stitched forms need besides: their gravity, Coriolis and kinematic terms are nonlinear."""
NACELLE_INPUTS = _names(INPUTS, "nacelle")
"""Inputs that the step fills from the nacelle path where the database has them."""
GUST_INPUTS = ("gust_u", "gust_w")
"""Inputs that add to u and w in the aerodynamics, and so in the scheduling of the forms where these stand alone."""
FLAP_INPUTS = _names(INPUTS, "flap")
"""Inputs that move the flaps: one for each interval between published settings, in which the aerodynamics are linear
in the deflection. Together they are the flap deflection less that of the schedule."""
GROUND_INPUTS = _names(INPUTS, "ground")
"""Inputs through which a ground acts."""
AUXILIARY_INPUTS = _names(INPUTS, "flap", "drive", "ground")
"""Inputs that are zero while flaps and rotor speed are where schedule and governor have them, away from the ground."""

STATE = Places(*(variable.name for variable in ALL_STATES))
"""Index of a state by name, usable in compiled kernels."""
INPUT = Places(*(variable.name for variable in ALL_INPUTS))
"""Index of an input by name."""
OUTPUT = Places(*(variable.name for variable in ALL_OUTPUTS))
"""Index of an output by name."""
