"""How a half of the aircraft moves through the air and what its rotor does, as the kernels hand it on."""

from __future__ import annotations

from typing import NamedTuple


class Motion(NamedTuple):
    """The aircraft's motion through the air, as a half sees it: mirrored for the left one."""

    u: float
    """Velocity along body x, gusts included [m/s]."""
    v: float
    """Along body y."""
    w: float
    """Along body z."""
    p: float
    """Roll rate, gusts included [rad/s]."""
    q: float
    """Pitch rate."""
    r: float
    """Yaw rate."""
    nacelle_rate: float
    """Rate of the nacelle angle [rad/s]."""


class Blades(NamedTuple):
    """The half's rotor."""

    flapping: tuple[float, float, float, float, float, float]
    """Coning, cosine and sine flapping, each with its rate."""
    inflow: tuple[float, float, float]
    """Inflow over tip speed."""
    pitch: tuple[float, float]
    """Collective at 75 % radius, longitudinal cyclic [rad]."""
    other_inflow: float
    """Mean inflow of the other rotor."""


class Frame(NamedTuple):
    """Where things are from the centre of gravity along body x and z, and how it moves with the nacelles [m]."""

    pivot: tuple[float, float]
    """Nacelle pivot."""
    hub: tuple[float, float]
    """Hub."""
    fin: tuple[float, float]
    """Fin."""
    drift: tuple[float, float]
    """Velocity of the hub along x and z for each rad/s of nacelle rate."""


class Air(NamedTuple):
    """What the halves share."""

    nacelle: float
    """Nacelle angle [rad]."""
    flap: float
    """Flap deflection [rad]."""
    incidence: float
    """Angle between mast and free stream [rad]."""
    wing_speed: float
    """Airspeed of the wing in the plane of symmetry [m/s]."""
    fin_share: float
    """Share of its sideslip that a fin feels: sidewash of wing and rotors."""
    tail_pressure: float
    """Dynamic pressure that sideslip leaves to tail and fins."""
