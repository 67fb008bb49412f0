"""What acts out of the plane of symmetry and belongs to no half: fuselage and wing in sideslip, ailerons, mixing.

Legend:
    wind: Velocity through the air along body x, y, z [m/s].
"""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve, surface
from rtsim.aircraft.variables import SCHEDULING_SPEED
from rtsim.aircraft.xv15.airframe_kernels import HalfLoad, flap_bracket, wind_to_body, wing_coefficients
from rtsim.aircraft.xv15.lateral_tables import FinTables, LateralControlTables, SideslipTables, WingSideTables
from rtsim.aircraft.xv15.tables import Configuration, WingTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel


@inner_kernel
def rounded_size(angle: float, rounding: float) -> float:
    """The size of an angle, rounded about 0 so that it has a slope there.

    Args:
        angle: Angle [rad].
        rounding: Angle over which it is rounded [rad].
    """
    return math.sqrt(angle * angle + rounding * rounding) - rounding


@inner_kernel
def table_sideslip(wind: tuple[float, float, float]) -> float:
    """Sideslip as it enters tables: as if with SCHEDULING_SPEED besides, so that it is small in hover [rad]."""
    u, v, w = wind
    return math.atan2(v, math.sqrt(u * u + w * w + SCHEDULING_SPEED * SCHEDULING_SPEED))


@inner_kernel
def sidewash_share(
    fin: FinTables, alpha: float, sideslip: float, setting: tuple[float, float], flap_nodes: FloatArray, speed: float
) -> float:
    """Share of its sideslip that a fin feels in the sidewash of wing and rotors.

    Args:
        fin: The fins.
        alpha: Fuselage angle of attack [rad].
        sideslip: Sideslip as it enters tables [rad].
        setting: Nacelle angle, flap [rad].
        flap_nodes: Published flap settings [rad].
        speed: Forward airspeed [m/s].
    """
    nacelle, flap = setting
    size = abs(sideslip)
    nodes = fin.sidewash_nacelle
    row = 0
    while row < 2 and nacelle < nodes[row + 1]:
        row += 1
    lower = min(max((nodes[row] - nacelle) / (nodes[row] - nodes[row + 1]), 0.0), 1.0)
    k, upper = flap_bracket(flap_nodes, flap)
    share = 0.0
    for a in range(2):
        for b in range(2):
            weight = (lower if a == 1 else 1.0 - lower) * (upper if b == 1 else 1.0 - upper)
            if weight != 0.0:
                share += weight * surface(fin.sidewash, 4 * (row + a) + k + b, alpha, size)
    none, full = fin.rotor_sidewash_nacelle[0], fin.rotor_sidewash_nacelle[1]
    acts = min(max((nacelle - none) / (full - none), 0.0), 1.0)
    if acts > 0.0:
        share *= 1.0 + acts * (surface(fin.rotor_sidewash, 0, speed, size) - 1.0)
    return share


@inner_kernel
def fuselage_sideslip_load(
    slip: SideslipTables, air: Configuration, wind: tuple[float, float, float], arm: tuple[float, float]
) -> HalfLoad:
    """What sideslip adds to the fuselage's load of symmetric flow.

    Forces along and across the wind; moments about the stability axes (x along the wind's projection into the plane of
    symmetry). The printed tables fold at 90 deg, which these axes do by themselves.

    Args:
        slip: The tables.
        air: Density.
        arm: Arm of the reference point along body x and z [m].
    """
    u, v, w = wind
    plane_squared = u * u + w * w
    plane, speed_squared = math.sqrt(plane_squared), plane_squared + v * v
    speed = max(math.sqrt(speed_squared), 1e-9)
    size = math.atan2(abs(v), plane)
    pressure = 0.5 * air.density * speed_squared
    side = pressure if v >= 0.0 else -pressure
    across = side * curve(slip.fuselage, 0, size)
    roll, yaw = side * curve(slip.fuselage, 1, size), side * curve(slip.fuselage, 2, size)
    lift, drag = pressure * curve(slip.fuselage, 3, size), pressure * curve(slip.fuselage, 4, size) / speed
    c, s = u / max(plane, 1e-9), w / max(plane, 1e-9)
    # In sideward flight the plane's own wind has no direction: lift then counts as along -z.
    tilt = math.atan2(w, math.sqrt(u * u + SCHEDULING_SPEED * SCHEDULING_SPEED))
    slant = v / speed
    x = lift * math.sin(tilt) - drag * u - across * slant * c
    z = -lift * math.cos(tilt) - drag * w - across * slant * s
    y = across * plane / speed - drag * v
    pitch = pressure * curve(slip.fuselage, 5, size) + arm[1] * x - arm[0] * z
    return x, z, pitch, y, roll * c - yaw * s - arm[1] * y, roll * s + yaw * c + arm[0] * y


@inner_kernel
def wing_side_load(
    side: WingSideTables,
    wing: WingTables,
    air: Configuration,
    flow: tuple[float, float, float, float, float],
    setting: tuple[float, float, float, float],
    arm: tuple[float, float],
) -> HalfLoad:
    """Roll and yaw moments of the wing in sideslip, roll and yaw, and what the ailerons do.

    Moments go with the speed in the plane of symmetry times sideward velocity or rate: they vanish in sideward flight,
    where coefficients linear in the sideslip mean nothing.

    Args:
        side: Lateral coefficients.
        wing: Lift and drag.
        air: Density and speed of sound.
        flow: u, v, w [m/s], roll and yaw rate [rad/s].
        setting: Nacelle angle, flap, wing angle of attack, aileron [rad].
        arm: Arm of the aerodynamic centre along body x and z [m].
    """
    u, v, w, p, r = flow
    nacelle, flap, alpha, aileron = setting
    plane = math.sqrt(u * u + w * w)
    c, s = u / max(plane, 1e-9), w / max(plane, 1e-9)
    mach = plane / air.sound_speed
    fraction = min(max(1.0 - nacelle / (0.5 * math.pi), 0.0), 1.0)
    cl, cd = wing_coefficients(wing, alpha, fraction, flap, mach)
    reach = math.radians(0.5)
    above, _ = wing_coefficients(wing, alpha + reach, fraction, flap, mach)
    below, _ = wing_coefficients(wing, alpha - reach, fraction, flap, mach)
    k, part = flap_bracket(wing.flap_nodes, flap)
    found = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for end in range(2):
        weight = part if end == 1 else 1.0 - part
        row = k + end
        found = (
            found[0]
            + weight * (curve(side.roll_sideslip, row, nacelle) + cl * curve(side.roll_sideslip, 4 + row, nacelle)),
            found[1] + weight * curve(side.lift_slope, row, nacelle),
            found[2] + weight * curve(side.profile_drag, row, nacelle),
            found[3] + weight * curve(side.aileron_roll, row, nacelle),
            found[4] + weight * curve(side.aileron_yaw, row, nacelle),
            found[5] + weight * curve(side.aileron_yaw, 4 + row, nacelle),
            found[6] + weight * side.aileron_lift[row],
        )
    roll_sideslip, slope, profile, aileron_roll, yaw_constant, yaw_lift, lost = found
    ratio = (above - below) / (2.0 * reach) / slope
    cosine = math.cos(side.sweep)
    straight = math.sqrt(1.0 - min(mach * cosine, 0.9) ** 2)
    compressed = (side.aspect_ratio + 4.0 * cosine) / (side.aspect_ratio * straight + 4.0 * cosine)
    roll_roll = side.roll_roll * compressed * ratio - (cd - cl * cl / (math.pi * side.aspect_ratio)) / 8.0
    roll_yaw = side.roll_yaw[0] * cl + side.roll_yaw[1] * flap
    yaw_sideslip = side.yaw_sideslip[0] + side.yaw_sideslip[1] * cl * cl
    yaw_yaw = side.yaw_yaw[0] * cl * cl + side.yaw_yaw[1] * profile
    # Rates about the stability axes.
    half_span = 0.5 * side.span
    ps, rs = half_span * (p * c + r * s), half_span * (r * c - p * s)
    scale = 0.5 * air.density * plane * wing.area * side.span
    roll = scale * (roll_sideslip * v + roll_roll * ps + roll_yaw * rs)
    yaw = scale * (yaw_sideslip * v + side.yaw_roll * cl * ps + yaw_yaw * rs)
    # Ailerons, in the free stream, as long as the wing is not stalled.
    start, end_ = side.aileron_fade[0], side.aileron_fade[1]
    acts = min(max((end_ - abs(alpha)) / (end_ - start), 0.0), 1.0)
    pressure = 0.5 * air.density * plane * plane * wing.area
    turning = acts * aileron_roll * aileron
    roll += pressure * side.span * turning
    yaw += pressure * side.span * acts * (yaw_constant + yaw_lift * cl * aileron_roll) * aileron
    lift = -pressure * lost * rounded_size(aileron, side.rounding)
    x, z, m = wind_to_body(lift, 0.0, u, w, arm, 0.0)
    return x, z, m, 0.0, roll * c - yaw * s, roll * s + yaw * c


@inner_kernel
def commanded_differences(
    controls: LateralControlTables, stick: float, pedal: float, nacelle: float, speed: float
) -> tuple[float, float, float, float]:
    """Half differences of collective and cyclic, aileron and rudder that stick and pedals ask for [rad].

    Args:
        controls: Gearing.
        stick: Lateral stick, -1 to 1 right.
        pedal: Pedals, -1 to 1 right.
        nacelle: Nacelle angle [rad].
        speed: Airspeed in the plane of symmetry [m/s].
    """
    return (
        -stick * curve(controls.collective_per_stick, 0, nacelle),
        pedal * surface(controls.cyclic_per_pedal, 0, speed, nacelle),
        stick * controls.aileron_per_stick,
        pedal * controls.rudder_per_pedal,
    )
