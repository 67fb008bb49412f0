"""Vertical fins and rudders (NASA CR-166536 tables 6-I to 6-VIII)."""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve, surface
from rtsim.aircraft.xv15.airframe_kernels import HalfLoad, force_at
from rtsim.aircraft.xv15.flow import Motion
from rtsim.aircraft.xv15.lateral_tables import FinTables
from rtsim.aircraft.xv15.tables import Configuration
from rtsim.kernels.compiled import inner_kernel


@inner_kernel
def fin_force_coefficient(fin: FinTables, sideslip: float, rudder: float, share: float) -> float:
    """Lift coefficient of a fin, against the sideslip: positive pushes it to the left.

    Args:
        fin: The fin.
        sideslip: Its sideslip, wind from the right positive [rad].
        rudder: Rudder angle [rad].
        share: Share of the sideslip's effect that sidewash leaves, compressibility included.
    """
    side = 1.0 if sideslip >= 0.0 else -1.0
    still = surface(fin.force, 0, abs(sideslip), 0.0)
    return side * (share * still + surface(fin.force, 0, abs(sideslip), side * rudder) - still)


@inner_kernel
def fin_load(
    fin: FinTables,
    air: Configuration,
    motion: Motion,
    arm: tuple[float, float],
    span: float,
    setting: tuple[float, float, float],
) -> HalfLoad:
    """Load of one fin beyond the drag that it has in symmetric flow.

    Args:
        fin: The fin.
        air: Density and speed of sound.
        motion: Motion through the air.
        arm: Arm of the fin along body x and z [m].
        span: Wing span [m].
        setting: Rudder [rad], share of the sideslip that sidewash leaves, share of the dynamic pressure.
    """
    y = fin.position[2]
    u = motion.u + motion.q * arm[1] - motion.r * y
    v = motion.v + motion.r * arm[0] - motion.p * arm[1]
    w = motion.w - motion.q * arm[0] + motion.p * y
    ahead = max(abs(u), fin.least_speed)
    speed_squared = u * u + v * v + w * w
    speed = math.sqrt(speed_squared)
    sideslip = math.atan2(v, ahead)
    sideslip += fin.roll_sidewash * motion.p * span / (2.0 * max(speed, fin.least_speed))
    rudder, share, pressure_share = setting
    compressed = 1.0 + fin.mach_gain * min(max((speed / air.sound_speed - 0.2) / 0.2, 0.0), 1.0)
    lift = fin_force_coefficient(fin, sideslip, rudder, share * compressed)
    drag = curve(fin.drag, 0, abs(sideslip))
    push = 0.5 * air.density * fin.pressure * pressure_share * speed_squared * fin.area
    s, c = math.sin(sideslip), math.cos(sideslip)
    # From behind the fin pushes along the wind as well; about no forward speed that fades through nothing.
    x = push * (lift * s - drag * c) * (u / ahead)
    return force_at((x, -push * (lift * c + drag * s), 0.0), (arm[0], y, arm[1]))
