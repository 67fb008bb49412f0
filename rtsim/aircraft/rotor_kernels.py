"""Blade-element rotor with gimbal flapping, coning and three-state dynamic inflow.

Axes: ``t`` along the mast (thrust), ``f`` in the disc plane towards the nose, azimuth 0 aft and
counter-clockwise seen along -t (advancing blade at 90 deg). The second rotor is the mirror image:
in symmetric flight its thrust, forward force and pitching moment are equal and the rest cancels.

Legend of the short names:
    b0, b1c, b1s   coning and gimbal flapping [rad]     *d, *dd  their rates
    l0, l1c, l1s   inflow over tip speed                om       rotor speed [rad/s]
    vf, vt         hub velocity along f and t [m/s]     p        pitch rate of the mast, nose up [rad/s]
    ut, up         section velocity in the disc plane and down through it [m/s]
Sources: Johnson, Helicopter Theory (1980), ch. 5 (flapping, sign of each term); Pitt and Peters 1981 (inflow);
White and Blake 1979 (fore-aft gradient); gearing and data NASA CR-166536.
"""

from __future__ import annotations

import math

import numba

from rtsim.aircraft.table_kernels import FloatArray
from rtsim.aircraft.tables import Configuration, RotorTables

# Entries of the load vector written by rotor_loads.
THRUST, FORWARD_FORCE, TORQUE, CONING_MOMENT, COSINE_MOMENT, SINE_MOMENT = 0, 1, 2, 3, 4, 5
LOAD_COUNT = 6


@numba.njit(cache=True, error_model="numpy")
def _section(rotor: RotorTables, station: int, alpha: float, mach: float) -> tuple[float, float]:
    """Lift and drag coefficient: Prandtl-Glauert from the data's Mach number, Lock drag rise relative to it."""
    # Lift and drag share one grid over the whole circle: one cell and one Hermite basis serve both.
    data = rotor.section
    position = (alpha - rotor.section_start) / rotor.section_step
    i = min(max(int(position), 0), data.shape[1] - 2)
    t = position - i
    t2 = t * t
    t3 = t2 * t
    h01 = 3.0 * t2 - 2.0 * t3
    h00 = 1.0 - h01
    h10 = t3 - 2.0 * t2 + t
    h11 = t3 - t2
    lift = h00 * data[station, i, 0] + h10 * data[station, i, 1] + h01 * data[station, i + 1, 0] + h11 * data[station, i + 1, 1]
    drag = h00 * data[station, i, 2] + h10 * data[station, i, 3] + h01 * data[station, i + 1, 2] + h11 * data[station, i + 1, 3]
    mach = min(mach, 0.9)
    lift *= rotor.reference_glauert[station] / math.sqrt(1.0 - mach * mach)
    critical = rotor.drag_divergence[station] - 0.1 * abs(lift) - 0.1077
    excess = max(0.0, mach - critical)
    excess_reference = max(0.0, rotor.reference_mach[station] - critical)
    excess *= excess
    excess_reference *= excess_reference
    drag += rotor.root_drag[station] + 20.0 * (excess * excess - excess_reference * excess_reference)
    return lift, max(drag, 0.003)


@numba.njit(cache=True, error_model="numpy")
def rotor_loads(
    rotor: RotorTables,
    air: Configuration,
    hub: tuple[float, float, float],
    flapping: tuple[float, float, float, float, float, float],
    inflow: tuple[float, float, float],
    pitch: tuple[float, float],
    loads: FloatArray,
) -> None:
    """Integrate the section loads over the disc.

    Args:
        rotor: The rotor.
        air: Density, speed of sound, rotor speed.
        hub: vf, vt, p.
        flapping: b0, b0d, b1c, b1cd, b1s, b1sd.
        inflow: l0, l1c, l1s.
        pitch: Collective at 75 % radius, longitudinal cyclic [rad].
        loads: Written: thrust [N], force along f [N], torque [N m], mean, cosine and sine flap moment of one blade [N m].
    """
    vf, vt, p = hub
    b0, b0d, b1c, b1cd, b1s, b1sd = flapping
    l0, l1c, l1s = inflow
    om = air.rotor_speed
    tip = om * rotor.radius
    azimuths = rotor.cos_azimuth.shape[0]
    for i in range(LOAD_COUNT):
        loads[i] = 0.0
    for j in range(azimuths):
        c = rotor.cos_azimuth[j]
        s = rotor.sin_azimuth[j]
        beta = b0 + b1c * c + b1s * s
        beta_rate = b0d + (b1cd + om * b1s) * c + (b1sd - om * b1c) * s
        root_pitch = pitch[0] + pitch[1] * s + rotor.pitch_flap * (beta - rotor.precone)
        gradient = (l1c * c + l1s * s) / rotor.radius
        normal_sum = 0.0
        drag_sum = 0.0
        torque_sum = 0.0
        moment_sum = 0.0
        for i in range(rotor.stations.shape[0]):
            r = rotor.stations[i]
            ut = om * r + vf * s
            up = vt + tip * (l0 + gradient * r) + r * (beta_rate - p * c) + vf * beta * c
            speed_squared = ut * ut + up * up
            speed = math.sqrt(speed_squared)
            alpha = root_pitch + rotor.twist[i] - math.atan2(up, ut)
            # In reversed flow the difference can leave the circle on which the section tables are printed.
            if alpha > math.pi:
                alpha -= 2.0 * math.pi
            elif alpha < -math.pi:
                alpha += 2.0 * math.pi
            cl, cd = _section(rotor, i, alpha, speed / air.sound_speed)
            scale = 0.5 * air.density * speed * rotor.chord[i] * rotor.widths[i]
            lift = scale * cl * rotor.lifting[i]
            drag = scale * cd
            normal = lift * ut - drag * up
            tangential = lift * up + drag * ut
            normal_sum += normal
            drag_sum += tangential
            torque_sum += tangential * r
            moment_sum += normal * r
        loads[THRUST] += normal_sum
        loads[FORWARD_FORCE] += normal_sum * beta * c - drag_sum * s
        loads[TORQUE] += torque_sum
        loads[CONING_MOMENT] += moment_sum
        loads[COSINE_MOMENT] += moment_sum * c
        loads[SINE_MOMENT] += moment_sum * s
    for i in range(3):
        loads[i] *= rotor.blades / azimuths
    loads[CONING_MOMENT] /= azimuths
    loads[COSINE_MOMENT] *= 2.0 / azimuths
    loads[SINE_MOMENT] *= 2.0 / azimuths


@numba.njit(cache=True, error_model="numpy")
def flapping_accelerations(
    rotor: RotorTables,
    om: float,
    mast: tuple[float, float],
    flapping: tuple[float, float, float, float, float, float],
    loads: FloatArray,
) -> tuple[float, float, float]:
    """Accelerations of coning and gimbal in the non-rotating frame [rad/s^2].

    The mast pitching at rate p leaves the disc behind: + p_dot in the cosine and -2 om p in the sine equation.

    Args:
        rotor: The rotor.
        om: Rotor speed [rad/s].
        mast: Pitch rate of the mast, nacelle motion included [rad/s], and its rate [rad/s^2].
        flapping: b0, b0d, b1c, b1cd, b1s, b1sd.
        loads: From ``rotor_loads``.
    """
    b0, _, b1c, b1cd, b1s, b1sd = flapping
    p, p_dot = mast
    inertia = rotor.blade_inertia
    blade_spring = rotor.hub_spring * 2.0 / rotor.blades
    b0dd = loads[CONING_MOMENT] / inertia - om * om * (
        b0 + (rotor.coning_frequency_squared - 1.0) * (b0 - rotor.precone)
    )
    b1cdd = (loads[COSINE_MOMENT] - blade_spring * b1c) / inertia - 2.0 * om * b1sd + p_dot
    b1sdd = (loads[SINE_MOMENT] - blade_spring * b1s) / inertia + 2.0 * om * b1cd - 2.0 * om * p
    return b0dd, b1cdd, b1sdd


@numba.njit(cache=True, error_model="numpy")
def inflow_rates(
    rotor: RotorTables, air: Configuration, hub: tuple[float, float, float], inflow: tuple[float, float, float], loads: FloatArray
) -> tuple[float, float, float]:
    """Rates of the three inflow states [1/s].

    Args:
        rotor: The rotor.
        air: Density and rotor speed.
        hub: vf, vt, p.
        inflow: l0, l1c, l1s.
        loads: From ``rotor_loads``.
    """
    l0, l1c, l1s = inflow
    om = air.rotor_speed
    tip = om * rotor.radius
    force_scale = air.density * math.pi * rotor.radius**2 * tip * tip
    thrust_coefficient = loads[THRUST] / force_scale
    moment_scale = 0.5 * rotor.blades / (force_scale * rotor.radius)
    mu = hub[0] / tip
    momentum = l0 / rotor.induced_factor
    through = hub[1] / tip + momentum
    total = max(math.sqrt(mu * mu + through * through), 0.01)
    mass_flow = max((mu * mu + through * (through + momentum)) / total, 0.02)
    sin_skew = mu / total
    cos_skew = abs(through) / total
    l0_rate = om / rotor.apparent_mass * (thrust_coefficient - 2.0 * momentum * total)
    lateral_gain = 4.0 / ((1.0 + cos_skew) * mass_flow)
    cosine_target = (
        rotor.skew_gradient * sin_skew * l0 + lateral_gain * cos_skew * moment_scale * loads[COSINE_MOMENT]
    )
    sine_target = lateral_gain * moment_scale * loads[SINE_MOMENT]
    bandwidth = om / (rotor.gradient_apparent_mass * lateral_gain)
    return l0_rate, bandwidth * (cosine_target - l1c), bandwidth * (sine_target - l1s)
