"""Attitude and motion over the ground of a rigid body, compiled: quaternions, and when a motion is symmetric.

A quaternion (e0, e1, e2, e3) turns north, east and down into the body axes. The state holds bank, pitch and heading,
which is what people read; a step takes the quaternion from them, moves it, and gives them back.
"""

from __future__ import annotations

import math

from rtsim.aircraft.variables import INPUT, STATE
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel

Quaternion = tuple[float, float, float, float]


@inner_kernel
def moves_sideways(x: FloatArray, u: FloatArray) -> bool:
    """Whether anything moves or acts out of the plane of symmetry; a heading is no motion.

    Args:
        x: State.
        u: Inputs.
    """
    moves = False
    for k in range(STATE.v, STATE.rudder + 1):
        moves = moves or (x[k] != 0.0 and k != STATE.heading)
    for k in range(INPUT.lateral_stick, INPUT.contact_yaw + 1):
        moves = moves or u[k] != 0.0
    return moves


@inner_kernel
def quaternion_of(bank: float, pitch: float, heading: float) -> Quaternion:
    """Attitude as a quaternion.

    Args:
        bank: Bank angle [rad].
        pitch: Pitch attitude [rad].
        heading: Heading [rad].
    """
    sb, cb = math.sin(0.5 * bank), math.cos(0.5 * bank)
    st, ct = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sh, ch = math.sin(0.5 * heading), math.cos(0.5 * heading)
    return (
        cb * ct * ch + sb * st * sh,
        sb * ct * ch - cb * st * sh,
        cb * st * ch + sb * ct * sh,
        cb * ct * sh - sb * st * ch,
    )


@inner_kernel
def down_of(e: Quaternion) -> tuple[float, float, float]:
    """Direction of gravity in body axes: -sin(pitch), cos(pitch) sin(bank), cos(pitch) cos(bank) at unit length.

    Args:
        e: Attitude.
    """
    e0, e1, e2, e3 = e
    return 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3


@inner_kernel
def quaternion_rate(e: Quaternion, p: float, q: float, r: float) -> Quaternion:
    """Rate of the attitude.

    Args:
        e: Attitude.
        p: Roll rate [rad/s].
        q: Pitch rate.
        r: Yaw rate.
    """
    e0, e1, e2, e3 = e
    return (
        -0.5 * (e1 * p + e2 * q + e3 * r),
        0.5 * (e0 * p + e2 * r - e3 * q),
        0.5 * (e0 * q - e1 * r + e3 * p),
        0.5 * (e0 * r + e1 * q - e2 * p),
    )


@inner_kernel
def advanced(e: Quaternion, rate: Quaternion, dt: float) -> Quaternion:
    """Attitude moved along a rate, not normalised.

    Args:
        e: Attitude.
        rate: Its rate [1/s].
    """
    return e[0] + dt * rate[0], e[1] + dt * rate[1], e[2] + dt * rate[2], e[3] + dt * rate[3]


@inner_kernel
def euler_of(e: Quaternion, last_heading: float) -> tuple[float, float, float]:
    """Bank, pitch and heading of an attitude of any length [rad].

    Args:
        e: Attitude.
        last_heading: Heading before [rad]: the new one is the nearest to it, so that turns add up.
    """
    e0, e1, e2, e3 = e
    scale = 1.0 / math.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
    e0, e1, e2, e3 = scale * e0, scale * e1, scale * e2, scale * e3
    gx, gy, gz = down_of((e0, e1, e2, e3))
    heading = math.atan2(2.0 * (e1 * e2 + e0 * e3), e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3)
    turns = math.floor((last_heading - heading) / (2.0 * math.pi) + 0.5)
    return math.atan2(gy, gz), math.asin(min(max(-gx, -1.0), 1.0)), heading + 2.0 * math.pi * turns
