"""The words a user chooses from, each list written once; importing them loads no compiled code."""

from __future__ import annotations

from typing import Literal, get_args

PlantName = Literal["lpv", "lpv-plain", "nonlinear"]
"""The layered LPV model (three scheduling variables), the paper's plain one, or the nonlinear model."""
OuterLoop = Literal["integrators", "pi"]
"""How the MOCM holds airspeed and altitude: integrators in its design, or the paper's PI loops."""
ChartName = Literal["design", "flight"]
"""Corridors of published charts: TM X-62407, and the stall line flown (TM 81244)."""
CorridorName = Literal[ChartName, "model"]
"""The charts, and the boundaries that follow from a database's own trims."""
PilotMode = Literal["mocm", "external", "hold"]
"""Who holds the sticks: the virtual pilot, somebody else (a person, a plug-in, a recording), or nobody."""
LateralAidName = Literal[
    "roll_damping", "yaw_damping", "bank_retention", "heading_hold", "turn_coordination", "position_hold"
]
"""Aids that need to know what the aircraft does out of its plane of symmetry."""
AidName = Literal["rate_damping", "attitude_retention", "altitude_hold", "airspeed_hold", "trim_bias", LateralAidName]
"""What acts between the pilot's hands and the control mixing."""
SwitchName = Literal[AidName, "automatic_flaps", "governor", "automatic_rotor_speed"]
"""All that can be switched in flight: the aids, and what moves flaps and rotors whoever flies."""
FalsificationMethod = Literal["mixed", "situations", "cma-es", "surrogate", "random"]
"""How a flight that breaks a law is looked for; ``mixed`` takes the others in turns, after random flights."""

OUTER_LOOPS: tuple[OuterLoop, ...] = get_args(OuterLoop)
CHART_NAMES: tuple[ChartName, ...] = get_args(ChartName)
CORRIDOR_NAMES: tuple[CorridorName, ...] = get_args(CorridorName)
BUILT_IN_PILOT = "mocm"
"""The virtual pilot, which needs no plug-in."""
HAND_PILOT = "mavlink"
"""A person behind MAVLink; the built-in pilot holds the start until the first sticks arrive."""
PASSIVE_LAWS = frozenset({"off", "monitor"})
"""Protection that changes no command."""

Leavable = Literal["corridor", "flapping", "torque", "load_factor", "pitch", "bank", "sideslip", "control", "height"]
LEAVABLE: tuple[Leavable, ...] = get_args(Leavable)
"""What a flight can be found to violate: corridor, limits besides it, keeping control to the end, height."""
