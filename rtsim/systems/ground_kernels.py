"""Compiled flat ground: what it takes off the induced velocity, and what it does to the wheels.

Altitude is zero where the aircraft stands on its wheels with its whole weight. The gear is springs with dampers, at the
nose and at the main wheels left and right; wheels are braked. Forces are held over a frame and reach the aircraft as
accelerations (inputs ``contact_x`` to ``contact_yaw``), the same for every plant.

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

FORWARD, DOWN, STIFFNESS, DAMPING, ASIDE = 0, 1, 2, 3, 4
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
    """Nose and main wheels: arm forward and down to the tyre's foot, extended [m], stiffness [N/m], damping [N s/m]
    of both sides together, arm to either side [m]."""
    friction: float
    """Friction coefficient of the braked wheels."""
    most_sink: float
    """Sink rate that the gear is made for [m/s]."""
    mass: float
    """Mass [kg]."""
    inertia: float
    """Moment of inertia in pitch with the nacelles upright [kg m^2]."""
    roll_inertia: float
    """The same in roll [kg m^2]."""
    yaw_inertia: float
    """The same in yaw [kg m^2]."""
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
    sb, cb = abs(math.sin(x[STATE.bank])), math.cos(x[STATE.bank])
    height = x[STATE.altitude] + tables.standing
    touching = False
    for wheel in range(tables.wheels.shape[0]):
        down = tables.wheels[wheel, DOWN] * cb + tables.wheels[wheel, ASIDE] * sb
        touching = touching or down * ct - tables.wheels[wheel, FORWARD] * st > height
    return touching


@inner_kernel
def _brakes(ahead: float, right: float) -> tuple[float, float]:
    """Shares of the full friction that hold against a foot sliding with a velocity [m/s]."""
    if right == 0.0:
        return -math.tanh(ahead / _CREEP), 0.0
    speed = math.sqrt(ahead * ahead + right * right)
    full = -math.tanh(speed / _CREEP) / speed
    return full * ahead, full * right


@inner_kernel
def _foot(
    tables: GroundTables, x: FloatArray, wheel: int, side: float, ground: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Force of the ground on one side of a wheel: load [N], and its components along body x, y, z [N].

    Args:
        wheel: Number of the wheel, or pair.
        side: 1 right, -1 left; each has half of spring and damper.
    """
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    sb, cb = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
    p, q, r = x[STATE.p], x[STATE.q], x[STATE.r]
    forward, down = tables.wheels[wheel, FORWARD], tables.wheels[wheel, DOWN]
    aside = side * tables.wheels[wheel, ASIDE]
    pressed = (down * cb + aside * sb) * ct - forward * st - (x[STATE.altitude] + tables.standing)
    if pressed <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    climb = x[STATE.u] * st - (x[STATE.v] * sb + x[STATE.w] * cb) * ct
    rate = -climb - q * (down * st + forward * cb * ct)
    rate += r * aside * st + ((r * forward - p * down) * sb + p * aside * cb) * ct
    load = 0.5 * max(tables.wheels[wheel, STIFFNESS] * pressed + tables.wheels[wheel, DAMPING] * rate, 0.0)
    ahead, right = _brakes(ground[0] - r * aside, ground[1] + r * forward - p * down)
    drag, grip = tables.friction * load * ahead, tables.friction * load * right
    upright = -load * ct + drag * st
    return load, load * st + drag * ct, grip * cb + upright * sb, upright * cb - grip * sb


@inner_kernel
def ground_contact(tables: GroundTables, x: FloatArray, ground: tuple[float, float], u: FloatArray) -> float:
    """Write what the ground does to the wheels.

    Args:
        ground: Motion over the ground along the heading and to the right of it [m/s].
        u: Inputs of the aircraft; those of the contact are written.

    Returns:
        Force of the ground over the weight.
    """
    total, force_x, force_y, force_z, pitching, rolling, yawing = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for wheel in range(tables.wheels.shape[0]):
        forward, down = tables.wheels[wheel, FORWARD], tables.wheels[wheel, DOWN]
        left, left_x, left_y, left_z = _foot(tables, x, wheel, -1.0, ground)
        right, right_x, right_y, right_z = _foot(tables, x, wheel, 1.0, ground)
        # Both sides together first: in symmetric flight twice the half, so that the sums are those of a single foot.
        push_x, push_y, push_z = left_x + right_x, left_y + right_y, left_z + right_z
        total += left + right
        force_x += push_x
        force_y += push_y
        force_z += push_z
        pitching += down * push_x - forward * push_z
        rolling += tables.wheels[wheel, ASIDE] * (right_z - left_z) - down * push_y
        yawing += forward * push_y - tables.wheels[wheel, ASIDE] * (right_x - left_x)
    u[INPUT.contact_x] = force_x / tables.mass
    u[INPUT.contact_y] = force_y / tables.mass + 0.0
    u[INPUT.contact_z] = force_z / tables.mass
    u[INPUT.contact_roll] = rolling / tables.roll_inertia + 0.0
    u[INPUT.contact_pitch] = pitching / tables.inertia
    u[INPUT.contact_yaw] = yawing / tables.yaw_inertia + 0.0
    return total / (tables.mass * GRAVITY)
