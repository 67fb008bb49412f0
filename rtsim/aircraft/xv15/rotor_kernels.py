"""Blade-element rotor with gimbal flapping, coning and three-state dynamic inflow.

Axes: ``t`` along the mast (thrust), ``f`` in the disc plane towards the nose, ``o`` in the disc plane towards where the
blade is at azimuth 90 deg (outboard, as the XV-15 turns), azimuth 0 aft and counter-clockwise seen along -t. The second
rotor is the mirror image, reckoned in its own mirrored frame: there is no left-handed rotor here.

Legend of the short names:
    b0, b1c, b1s   coning and gimbal flapping [rad]     *d, *dd  their rates
    l0, l1c, l1s   inflow over tip speed                om       rotor speed [rad/s]
    vf, vt, vo     hub velocity along f, t, o [m/s]     p        pitch rate of the mast, nose up, about o [rad/s]
    wf, wt         rates of the mast about f and t [rad/s]
    ut, up         section velocity in the disc plane and down through it [m/s]
Sources: Johnson, Helicopter Theory (1980), ch. 5 (flapping, sign of each term); Pitt and Peters 1981 (inflow);
White and Blake 1979 (fore-aft gradient); gearing and data NASA CR-166536.

Legend:
    rotor: The rotor.
    air: Density, speed of sound, rotor speed.
    hub: vf, vt, p, vo, wf, wt.
    flapping: b0, b0d, b1c, b1cd, b1s, b1sd.
    inflow: l0, l1c, l1s.
    pitch: Collective at 75 % radius, longitudinal cyclic [rad].
    loads: Written: thrust [N], force along f [N], torque [N m], mean, cosine and sine flap moment of a blade [N m],
        force along o [N].
"""

from __future__ import annotations

import math

import numpy as np

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.xv15.tables import Configuration, RotorTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel, kernel

# Entries of the load vector written by rotor_loads.
THRUST, FORWARD_FORCE, TORQUE, CONING_MOMENT, COSINE_MOMENT, SINE_MOMENT, OUTBOARD_FORCE = 0, 1, 2, 3, 4, 5, 6
LOAD_COUNT = 7
# Rows of the scratch array of one blade position; LIFT and DRAG become the normal and the in-plane force.
ALPHA, SPEED, UT, UP, LIFT, DRAG = 0, 1, 2, 3, 4, 5
ANGLE_PART, MACH_PART, CELL, NODES = 6, 7, 8, 9
FLOW_COUNT = NODES + 6

Hub = tuple[float, float, float, float, float, float]


@inner_kernel
def _angle(y: float, x: float) -> float:
    """The angle atan2(y, x) [rad], written out so that the loop over the stations becomes vector instructions.

    Reduction to |t| <= tan(pi/8) and the rational approximation of the Cephes library (S. Moshier), error below 3e-16.
    """
    size_y, size_x = abs(y), abs(x)
    steep = size_y > size_x
    large = size_y if steep else size_x
    small = size_x if steep else size_y
    reduced = small > 0.41421356237309503 * large
    t = (small - large if reduced else small) / (small + large if reduced else large)
    z = t * t
    p = (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z - 7.500855792314704667340e1) * z
         - 1.228866684490136173410e2) * z - 6.485021904942025371773e1  # fmt: skip
    q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z + 4.328810604912902668951e2) * z
         + 4.853903996359136964868e2) * z + 1.945506571482613964425e2  # fmt: skip
    angle = t + t * (z * p / q) + (0.25 * math.pi if reduced else 0.0)
    angle = 0.5 * math.pi - angle if steep else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@inner_kernel
def _section_flow(
    rotor: RotorTables,
    tangential: tuple[float, float],
    axial: tuple[float, float],
    root_pitch: float,
    flow: FloatArray,
) -> None:
    """Write angle of attack, speed, ut and up at every station.

    Args:
        tangential: ut at the hub and its growth with radius.
        axial: up at the hub and its growth with radius.
        root_pitch: Blade pitch without twist [rad].
        flow: Written: rows ALPHA, SPEED, UT, UP.
    """
    for i in range(rotor.stations.shape[0]):
        r = rotor.stations[i]
        ut = tangential[0] + tangential[1] * r
        up = axial[0] + axial[1] * r
        alpha = root_pitch + rotor.twist[i] - _angle(up, ut)
        # In reversed flow the difference can leave the circle on which the section tables are printed.
        alpha = alpha - 2.0 * math.pi if alpha > math.pi else alpha
        alpha = alpha + 2.0 * math.pi if alpha < -math.pi else alpha
        flow[ALPHA, i] = alpha
        flow[SPEED, i] = math.sqrt(ut * ut + up * up)
        flow[UT, i] = ut
        flow[UP, i] = up


@inner_kernel
def _section_tables(rotor: RotorTables, air: Configuration, flow: FloatArray) -> None:
    """Look up lift and drag coefficient of every station over angle of attack and Mach number.

    Quadratic B-splines in both: smooth, and linear where the nodes are. The outermost nodes lie outside what is asked.

    Args:
        air: Speed of sound.
        flow: Rows ALPHA and SPEED are read; written: rows LIFT, DRAG.
    """
    nodes = rotor.section.reshape(-1)
    machs = rotor.section.shape[2]
    angles = rotor.section.shape[1] * 1.0
    per_angle = 1.0 / rotor.section_step
    per_speed = 1.0 / (air.sound_speed * rotor.mach_step)
    first_mach = rotor.mach_start / rotor.mach_step
    # Three loops: the first and the last become vector instructions, the one between only loads and adds.
    for i in range(rotor.stations.shape[0]):
        position = (flow[ALPHA, i] - rotor.section_start) * per_angle
        nearest = min(max(math.floor(position + 0.5), 1.0), angles - 2.0)
        flow[ANGLE_PART, i] = position - nearest
        cell = angles * i + nearest
        position = min(flow[SPEED, i] * per_speed - first_mach, machs - 2.0)
        nearest = math.floor(position + 0.5)
        flow[MACH_PART, i] = position - nearest
        flow[CELL, i] = cell * machs + nearest
    for i in range(rotor.stations.shape[0]):
        middle = 2 * int(flow[CELL, i]) - 2
        low, high = middle - 2 * machs, middle + 2 * machs
        t = flow[ANGLE_PART, i]
        a, b, c = 0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)
        flow[NODES + 0, i] = a * nodes[low + 0] + b * nodes[middle + 0] + c * nodes[high + 0]
        flow[NODES + 1, i] = a * nodes[low + 1] + b * nodes[middle + 1] + c * nodes[high + 1]
        flow[NODES + 2, i] = a * nodes[low + 2] + b * nodes[middle + 2] + c * nodes[high + 2]
        flow[NODES + 3, i] = a * nodes[low + 3] + b * nodes[middle + 3] + c * nodes[high + 3]
        flow[NODES + 4, i] = a * nodes[low + 4] + b * nodes[middle + 4] + c * nodes[high + 4]
        flow[NODES + 5, i] = a * nodes[low + 5] + b * nodes[middle + 5] + c * nodes[high + 5]
    for i in range(rotor.stations.shape[0]):
        t = flow[MACH_PART, i]
        a, b, c = 0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)
        flow[LIFT, i] = a * flow[NODES + 0, i] + b * flow[NODES + 2, i] + c * flow[NODES + 4, i]
        flow[DRAG, i] = a * flow[NODES + 1, i] + b * flow[NODES + 3, i] + c * flow[NODES + 5, i]


@inner_kernel
def _section_forces(rotor: RotorTables, air: Configuration, flow: FloatArray) -> None:
    """Turn the coefficients into forces normal to and in the disc plane (overwriting LIFT and DRAG) [N].

    Args:
        air: Density.
        flow: Rows as left by ``_section_tables``; written: LIFT becomes the normal, DRAG the in-plane force.
    """
    for i in range(rotor.stations.shape[0]):
        scale = 0.5 * air.density * flow[SPEED, i] * rotor.chord[i] * rotor.widths[i]
        lift = scale * flow[LIFT, i] * rotor.lifting[i]
        drag = scale * (flow[DRAG, i] + rotor.root_drag[i])
        flow[LIFT, i] = lift * flow[UT, i] - drag * flow[UP, i]
        flow[DRAG, i] = lift * flow[UP, i] + drag * flow[UT, i]


@kernel
def rotor_loads(
    rotor: RotorTables,
    air: Configuration,
    hub: Hub,
    flapping: tuple[float, float, float, float, float, float],
    inflow: tuple[float, float, float],
    pitch: tuple[float, float],
    loads: FloatArray,
) -> None:
    """Integrate the section loads over the disc."""
    flow = np.empty((FLOW_COUNT, rotor.stations.shape[0]))
    rotor_loads_in(rotor, air, hub, flapping, inflow, pitch, loads, flow)


@inner_kernel
def rotor_loads_in(
    rotor: RotorTables,
    air: Configuration,
    hub: Hub,
    flapping: tuple[float, float, float, float, float, float],
    inflow: tuple[float, float, float],
    pitch: tuple[float, float],
    loads: FloatArray,
    flow: FloatArray,
) -> None:
    """`rotor_loads` in given work space.

    Args:
        flow: Scratch, shape (FLOW_COUNT, stations).
    """
    vf, vt, p, vo, wf, wt = hub
    b0, b0d, b1c, b1cd, b1s, b1sd = flapping
    l0, l1c, l1s = inflow
    om = air.rotor_speed
    tip = om * rotor.radius
    azimuths = rotor.cos_azimuth.shape[0]
    stations = rotor.stations
    for i in range(LOAD_COUNT):
        loads[i] = 0.0
    for j in range(azimuths):
        c = rotor.cos_azimuth[j]
        s = rotor.sin_azimuth[j]
        beta = b0 + b1c * c + b1s * s
        beta_rate = b0d + (b1cd + om * b1s) * c + (b1sd - om * b1c) * s
        root_pitch = pitch[0] + pitch[1] * s + rotor.pitch_flap * (beta - rotor.precone)
        gradient = (l1c * c + l1s * s) / rotor.radius
        axial = (vt + tip * l0 + vf * beta * c - vo * beta * s, tip * gradient + beta_rate - p * c - wf * s)
        _section_flow(rotor, (vf * s + vo * c, om + wt), axial, root_pitch, flow)
        _section_tables(rotor, air, flow)
        _section_forces(rotor, air, flow)
        normal_sum = 0.0
        drag_sum = 0.0
        torque_sum = 0.0
        moment_sum = 0.0
        for i in range(stations.shape[0]):
            normal_sum += flow[LIFT, i]
            drag_sum += flow[DRAG, i]
            torque_sum += flow[DRAG, i] * stations[i]
            moment_sum += flow[LIFT, i] * stations[i]
        loads[THRUST] += normal_sum
        loads[FORWARD_FORCE] += normal_sum * beta * c - drag_sum * s
        loads[OUTBOARD_FORCE] -= normal_sum * beta * s + drag_sum * c
        loads[TORQUE] += torque_sum
        loads[CONING_MOMENT] += moment_sum
        loads[COSINE_MOMENT] += moment_sum * c
        loads[SINE_MOMENT] += moment_sum * s
    for i in (THRUST, FORWARD_FORCE, TORQUE, OUTBOARD_FORCE):
        loads[i] *= rotor.blades / azimuths
    loads[CONING_MOMENT] /= azimuths
    loads[COSINE_MOMENT] *= 2.0 / azimuths
    loads[SINE_MOMENT] *= 2.0 / azimuths


@inner_kernel
def flapping_accelerations(
    rotor: RotorTables,
    om: float,
    mast: tuple[float, float, float, float],
    flapping: tuple[float, float, float, float, float, float],
    loads: FloatArray,
) -> tuple[float, float, float]:
    """Accelerations of coning and gimbal in the non-rotating frame [rad/s^2].

    The mast pitching at rate p leaves the disc behind: + p_dot in the cosine and -2 om p in the sine equation; turning
    about f at rate wf it does the same a quarter turn further on.

    Args:
        om: Rotor speed [rad/s].
        mast: Pitch rate of the mast, nacelle motion included [rad/s], and its rate [rad/s^2]; wf and its rate.
        loads: From ``rotor_loads``.
    """
    b0, _, b1c, b1cd, b1s, b1sd = flapping
    p, p_dot, wf, wf_dot = mast
    inertia = rotor.blade_inertia
    blade_spring = rotor.hub_spring * 2.0 / rotor.blades
    b0dd = loads[CONING_MOMENT] / inertia - om * om * (
        b0 + (rotor.coning_frequency_squared - 1.0) * (b0 - rotor.precone)
    )
    b1cdd = (loads[COSINE_MOMENT] - blade_spring * b1c) / inertia - 2.0 * om * b1sd + p_dot + 2.0 * om * wf
    b1sdd = (loads[SINE_MOMENT] - blade_spring * b1s) / inertia + 2.0 * om * b1cd - 2.0 * om * p + wf_dot
    return b0dd, b1cdd, b1sdd


@inner_kernel
def inflow_rates(
    rotor: RotorTables,
    air: Configuration,
    hub: Hub,
    inflow: tuple[float, float, float],
    loads: FloatArray,
) -> tuple[float, float, float]:
    """Rates of the three inflow states far from the ground [1/s].

    Args:
        air: Density and rotor speed.
        loads: From ``rotor_loads``.
    """
    return inflow_rates_near_ground(rotor, air, hub, inflow, loads, 0.0)


@inner_kernel
def inflow_rates_near_ground(
    rotor: RotorTables,
    air: Configuration,
    hub: Hub,
    inflow: tuple[float, float, float],
    loads: FloatArray,
    nearness: float,
) -> tuple[float, float, float]:
    """Rates of the three inflow states [1/s].

    Args:
        air: Density and rotor speed.
        loads: From ``rotor_loads``.
        nearness: Ground effect, 0 far away to 1 hovering on the wheels.
    """
    l0, l1c, l1s = inflow
    om = air.rotor_speed
    tip = om * rotor.radius
    force_scale = air.density * math.pi * rotor.radius**2 * tip * tip
    thrust_coefficient = loads[THRUST] / force_scale
    moment_scale = 0.5 * rotor.blades / (force_scale * rotor.radius)
    mu_f, mu_o = hub[0] / tip, hub[3] / tip
    mu_squared = mu_f * mu_f + mu_o * mu_o
    # Two rotors side by side act as one wing of twice the span: less induced velocity in forward flight.
    surcharge = rotor.induced_factor * (1.0 + curve(rotor.side_by_side, 0, abs(mu_f)))
    momentum = l0 / (surcharge * (1.0 - rotor.ground_relief * nearness))
    through = hub[1] / tip + momentum
    total = max(math.sqrt(mu_squared + through * through), 0.01)
    mass_flow = max((mu_squared + through * (through + momentum)) / total, 0.02)
    # Sine of the wake's skew along f and o.
    skew_f, skew_o = mu_f / total, mu_o / total
    cos_skew = abs(through) / total
    l0_rate = om / rotor.apparent_mass * (thrust_coefficient - 2.0 * momentum * total)
    lateral_gain = 4.0 / ((1.0 + cos_skew) * mass_flow)
    # White and Blake's gradient grows with the skew alone and so with speed itself; near hover it is faded in.
    onset = math.sqrt(mu_squared) / max(rotor.skew_gradient_onset, 1e-9)
    gradient = rotor.skew_gradient * (1.0 - math.exp(-onset * onset))
    # In the wind's own axes only the gain along the wind is less by the skew; turned back without angles, so that
    # hover is an ordinary point.
    gain = lateral_gain * moment_scale
    cosine, sine = loads[COSINE_MOMENT], loads[SINE_MOMENT]
    turned = gain * skew_o / (1.0 + cos_skew)
    cosine_target = gradient * skew_f * l0 + lateral_gain * cos_skew * moment_scale * cosine
    cosine_target += turned * (skew_o * cosine + skew_f * sine)
    sine_target = gain * sine - gradient * skew_o * l0 + turned * (skew_f * cosine - skew_o * sine)
    bandwidth = om / (rotor.gradient_apparent_mass * lateral_gain)
    return l0_rate, bandwidth * (cosine_target - l1c), bandwidth * (sine_target - l1s)
