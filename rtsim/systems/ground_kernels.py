"""Compiled flat ground: what it takes off the induced velocity, and what it does to the wheels.

Altitude is zero where the aircraft stands on its wheels with its whole weight. The gear is two springs with dampers, at
the nose and at the main wheels; wheels are braked. Forces are held over a frame and reach the aircraft as accelerations
(inputs ``contact_x``, ``contact_z``, ``contact_pitch``), the same for every plant.

Legend:
    tables: The ground and what the aircraft has to meet it.
    altitude: Height above standing [m].
    nacelle: Nacelle angle [rad].
    x: Aircraft state.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.aircraft.variables import INPUT, STATE
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.units import GRAVITY

FORWARD, DOWN, STIFFNESS, DAMPING = 0, 1, 2, 3
"""Columns of the wheels."""
_HAYDEN_OFFSET, _HAYDEN_GROWTH = 0.9926, 0.0379
_CREEP = 0.2
"""Brakes hold with full friction above about this speed [m/s]; below, they creep."""


class GroundTables(NamedTuple):
    """What the kernels know of ground and gear. SI."""

    active: float
    """1 where there is a ground to stand on, else 0."""
    standing: float
    """Height of the centre of gravity when standing [m]."""
    wheels: FloatArray
    """Nose and main wheels: arm forward and down to the tyre's foot, extended [m], stiffness [N/m], damping [N s/m]."""
    friction: float
    """Friction coefficient of the braked wheels."""
    most_sink: float
    """Sink rate that the gear is made for [m/s]."""
    mass: float
    """Mass [kg]."""
    inertia: float
    """Moment of inertia in pitch with the nacelles upright [kg m^2]."""
    radius: float
    """Rotor radius [m]."""
    pivot_up: float
    """Nacelle pivot above the centre of gravity [m]."""
    mast: float
    """Pivot to hub [m]."""
    fade_speed: float
    """Airspeed at which half of the ground effect is left [m/s]."""


@inner_kernel
def _hayden(height: float) -> float:
    """Share of its power that a rotor saves at a hub height over its radius (Hayden 1976)."""
    near = 2.0 / height
    return max(1.0 - 1.0 / (_HAYDEN_OFFSET + _HAYDEN_GROWTH * near * near), 0.0)


@inner_kernel
def ground_effect(tables: GroundTables, altitude: float, nacelle: float, airspeed: float) -> float:
    """Ground effect, 1 hovering on the wheels: Hayden's height law, fading with speed (Cheeseman and Bennett) and tilt.

    Args:
        airspeed: Airspeed [m/s].
    """
    upright = max(math.sin(nacelle), 0.0)
    on_wheels = (tables.standing + tables.pivot_up + tables.mast) / tables.radius
    height = (
        max(altitude, -tables.standing) + tables.standing + tables.pivot_up + tables.mast * upright
    ) / tables.radius
    ratio = airspeed / tables.fade_speed
    return upright * upright * _hayden(max(height, 0.5 * on_wheels)) / _hayden(on_wheels) / (1.0 + ratio * ratio)


@inner_kernel
def touches(tables: GroundTables, x: FloatArray) -> bool:
    """Whether a wheel is on the ground."""
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    height = x[STATE.altitude] + tables.standing
    touching = False
    for wheel in range(tables.wheels.shape[0]):
        touching = touching or tables.wheels[wheel, DOWN] * ct - tables.wheels[wheel, FORWARD] * st > height
    return touching


@inner_kernel
def ground_contact(tables: GroundTables, x: FloatArray, wind: float, u: FloatArray) -> float:
    """Write what the ground does to the wheels.

    Args:
        wind: Tailwind [m/s].
        u: Inputs of the aircraft; those of the contact are written.

    Returns:
        Force of the ground over the weight.
    """
    pitch, q = x[STATE.pitch], x[STATE.q]
    st, ct = math.sin(pitch), math.cos(pitch)
    height = x[STATE.altitude] + tables.standing
    climb = x[STATE.u] * st - x[STATE.w] * ct
    slide = math.tanh((x[STATE.u] * ct + x[STATE.w] * st + wind) / _CREEP)
    total, force_x, force_z, moment = 0.0, 0.0, 0.0, 0.0
    for wheel in range(tables.wheels.shape[0]):
        forward, down = tables.wheels[wheel, FORWARD], tables.wheels[wheel, DOWN]
        pressed = down * ct - forward * st - height
        if pressed <= 0.0:
            continue
        rate = -climb - q * (down * st + forward * ct)
        load = max(tables.wheels[wheel, STIFFNESS] * pressed + tables.wheels[wheel, DAMPING] * rate, 0.0)
        drag = -tables.friction * load * slide
        push_x, push_z = load * st + drag * ct, -load * ct + drag * st
        total += load
        force_x += push_x
        force_z += push_z
        moment += down * push_x - forward * push_z
    u[INPUT.contact_x] = force_x / tables.mass
    u[INPUT.contact_z] = force_z / tables.mass
    u[INPUT.contact_pitch] = moment / tables.inertia
    return total / (tables.mass * GRAVITY)
