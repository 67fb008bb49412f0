"""Horizontal tail: local flow from pitch rate, rotor wake and wing downwash; lift table with elevator."""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve, surface
from rtsim.aircraft.xv15.airframe_kernels import fold, wind_to_body
from rtsim.aircraft.xv15.lateral_kernels import rounded_size
from rtsim.aircraft.xv15.lateral_tables import SideslipTables
from rtsim.aircraft.xv15.tables import Configuration, TailTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel


@inner_kernel
def _bracket(nodes: FloatArray, nacelle: float) -> tuple[int, float]:
    """Interval and weight of the upper end in descending nacelle angles."""
    last = nodes.shape[0] - 1
    k = 0
    while k < last - 1 and nacelle < nodes[k + 1]:
        k += 1
    return k, min(max((nodes[k] - nacelle) / (nodes[k] - nodes[k + 1]), 0.0), 1.0)


@inner_kernel
def downwash_angle(tail: TailTables, alpha: float, nacelle: float, flap: float) -> float:
    """Wing downwash at the tail before compressibility [rad]; linear in nacelle angle and flap between the tables.

    Args:
        tail: The tables.
        alpha: Fuselage angle of attack [rad].
        flap: Flap deflection [rad].
    """
    k, part = _bracket(tail.downwash_nacelle, nacelle)
    position = min(flap / math.radians(20.0), 2.0)
    f = min(int(position), 1)
    g = position - f
    total = 0.0
    for a in range(2):
        for b in range(2):
            weight = (part if a == 1 else 1.0 - part) * (g if b == 1 else 1.0 - g)
            if weight != 0.0:
                total += weight * curve(tail.downwash, 3 * (k + a) + f + b, alpha)
    return total


@inner_kernel
def pressure_left(sideslip: float) -> float:
    """Share of the dynamic pressure that sideslip leaves to tail and fins (K_betaHS and K_betaVS).

    Args:
        sideslip: Sideslip as it enters tables [rad].
    """
    return max(math.cos(sideslip), 0.5)


@inner_kernel
def tail_load(
    tail: TailTables,
    air: Configuration,
    flow: tuple[float, float, float],
    setting: tuple[float, float, float],
    induced: float,
    arm: tuple[float, float],
    slip: SideslipTables,
    sideslip: float,
) -> tuple[float, float, float]:
    """Force [N] and pitching moment about the centre of gravity [N m].

    Args:
        tail: The tables.
        air: Density and speed of sound.
        flow: u, w, pitch rate.
        setting: Nacelle angle, flap, elevator [rad].
        induced: Mean induced velocity of the rotors [m/s].
        arm: Arm of the tail from the centre of gravity [m].
        slip: What sideslip changes.
        sideslip: Sideslip as it enters tables [rad].
    """
    u, w, q = flow
    nacelle, flap, elevator = setting
    speed = math.sqrt(u * u + w * w)
    alpha = math.atan2(w, u)
    # The tables know forward flight only: in rearward flight (low confidence) the airspeed entry is zero.
    forward_speed = math.sqrt(max(u * abs(u) + w * w, 0.0))
    k, part = _bracket(tail.wake_nacelle, nacelle)
    wake = 0.0
    for a in range(2):
        weight = part if a == 1 else 1.0 - part
        if weight != 0.0 and k + a < 3:
            met = curve(slip.tail_wake, k + a, abs(sideslip))
            wake += weight * surface(tail.rotor_wake, k + a, alpha, forward_speed) * met
    k, part = _bracket(tail.downwash_nacelle, nacelle)
    ratio = (1.0 - part) * surface(tail.pressure_ratio, k, alpha, forward_speed) + part * surface(
        tail.pressure_ratio, k + 1, alpha, forward_speed
    )
    # Wi_H [sin(mast), 0, -cos(mast)]: an upwash (negative) raises the tail's angle of attack.
    wake_velocity = wake * induced
    u_tail = u + q * arm[1] + wake_velocity * math.cos(nacelle)
    w_tail = w - q * arm[0] - wake_velocity * math.sin(nacelle)
    mach = min(speed / air.sound_speed, 0.7)
    downwash = downwash_angle(tail, alpha, nacelle, flap) / math.sqrt(1.0 - mach * mach)
    tail_alpha = math.atan2(w_tail, u_tail) - downwash
    tail_alpha = math.atan2(math.sin(tail_alpha), math.cos(tail_alpha))
    folded = fold(tail_alpha)
    cl = surface(tail.lift, 0, folded, elevator)
    if abs(tail_alpha) > 0.5 * math.pi:
        cl = 0.0
    cl += slip.tail_lift * rounded_size(sideslip, slip.rounding)
    cd = curve(tail.drag, 0, folded)
    pressure = (
        0.5 * air.density * tail.pressure_factor * ratio * pressure_left(sideslip) * (u_tail * u_tail + w_tail * w_tail)
    )
    return wind_to_body(
        pressure * tail.area * cl, pressure * tail.area * cd, math.cos(tail_alpha), math.sin(tail_alpha), arm, 0.0
    )
