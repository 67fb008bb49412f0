"""Names, units and order of the states, inputs and outputs of the symmetric-plane XV-15."""

from __future__ import annotations

from dataclasses import dataclass

from rtsim.places import Places


@dataclass(frozen=True, slots=True)
class Variable:
    """One entry of a state, input or output vector."""

    name: str
    """Name, as used by the database and by ``control.StateSpace``."""
    unit: str
    """SI unit; empty where dimensionless."""
    description: str
    """One sentence for people."""


SCHEDULING_SPEED = 4.5
"""Added along the horizon before an angle of attack is taken for scheduling or output: defined in hover too [m/s]."""

STATES: tuple[Variable, ...] = (
    Variable("u", "m/s", "Air-relative velocity along the body x axis (forward)"),
    Variable("w", "m/s", "Air-relative velocity along the body z axis (down)"),
    Variable("q", "rad/s", "Body pitch rate, nose up positive"),
    Variable("pitch", "rad", "Pitch attitude, nose up positive"),
    Variable("altitude", "m", "Height above the ground"),
    Variable("coning", "rad", "Coning angle, precone included"),
    Variable("coning_rate", "rad/s", "Rate of the coning angle"),
    Variable("flap_1c", "rad", "Cosine gimbal flapping; positive tilts the disc forward"),
    Variable("flap_1c_rate", "rad/s", "Rate of the cosine gimbal flapping"),
    Variable("flap_1s", "rad", "Sine gimbal flapping"),
    Variable("flap_1s_rate", "rad/s", "Rate of the sine gimbal flapping"),
    Variable("inflow_0", "", "Mean induced velocity over tip speed"),
    Variable("inflow_1c", "", "Fore-aft gradient of the induced velocity over tip speed"),
    Variable("inflow_1s", "", "Lateral gradient of the induced velocity over tip speed"),
    Variable("collective_75", "rad", "Collective pitch at 75 % radius (after its actuator)"),
    Variable("cyclic_1s", "rad", "Longitudinal cyclic pitch (after its actuator); negative tilts the disc forward"),
    Variable("elevator", "rad", "Elevator (after its actuator), trailing edge down positive"),
)
INPUTS: tuple[Variable, ...] = (
    Variable("stick", "", "Longitudinal stick, -1 aft to 1 forward"),
    Variable("lever", "", "Power lever, 0 to 1"),
    Variable("nacelle_rate", "rad/s", "Rate of the nacelle angle"),
    Variable("nacelle_acceleration", "rad/s^2", "Angular acceleration of the nacelles"),
    Variable("gust_u", "m/s", "Gust added to the air-relative velocity along body x"),
    Variable("gust_w", "m/s", "Gust added to the air-relative velocity along body z"),
    Variable("gust_q", "rad/s", "Gust added to the air-relative pitch rate"),
    Variable("flap_0_20", "rad", "Flap deflection between 0 and 20 deg, less that of the flap schedule"),
    Variable("flap_20_40", "rad", "Flap deflection between 20 and 40 deg, less that of the flap schedule"),
    Variable("flap_40_75", "rad", "Flap deflection between 40 and 75 deg, less that of the flap schedule"),
    Variable("rotor_speed", "rad/s", "Rotor speed less the one that is held"),
)
OUTPUTS: tuple[Variable, ...] = (
    Variable("thrust", "N", "Thrust of one rotor along its mast"),
    Variable("torque", "N m", "Torque of one mast"),
    Variable("power", "W", "Shaft power of both rotors"),
    Variable("load_factor", "", "Normal load factor: specific force along -z body over g"),
    Variable("airspeed_rate", "m/s^2", "Rate of the horizontal airspeed"),
    Variable("wing_angle_of_attack", "rad", "Angle of attack at which the wing tables are entered"),
    Variable("flapping", "rad", "Magnitude of the gimbal flapping relative to the mast"),
)

FLAP_INPUTS = ("flap_0_20", "flap_20_40", "flap_40_75")
"""Inputs that move the flaps: one for each interval between published settings, in which the aerodynamics are linear
in the deflection. Together they are the flap deflection less that of the schedule."""

STATE = Places(*(variable.name for variable in STATES))
"""Index of a state by name, usable in compiled kernels."""
INPUT = Places(*(variable.name for variable in INPUTS))
"""Index of an input by name."""
OUTPUT = Places(*(variable.name for variable in OUTPUTS))
"""Index of an output by name."""
