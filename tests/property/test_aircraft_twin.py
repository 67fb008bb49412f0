"""A plain numpy twin of every aircraft kernel, written from the equations of docs/model.md, against the compiled ones.

The twin shares only the tables with the kernels. It is vectorized over the disc, looks tables up with scipy's Hermite
splines and uses numpy's arctan2, so an error of the kernels' own arithmetic cannot hide in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, NdBSpline

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import FLAP_INPUTS, INPUT, INPUTS, SCHEDULING_SPEED, STATE, STATES
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15 import rotor_kernels
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import GRAVITY, KNOT, deg

AIRCRAFT = Xv15.load()
ANGLE = np.pi / 2.0


def curve(table, row, argument):
    grid = table.start + table.step * np.arange(table.values.shape[1])
    return float(CubicHermiteSpline(grid, table.values[row], table.slopes[row])(np.clip(argument, grid[0], grid[-1])))


def surface(table, number, x, y):
    nodes = table.nodes[number]
    xs = table.x_start + table.x_step * np.arange(nodes.shape[0])
    ys = table.y_start + table.y_step * np.arange(nodes.shape[1])
    x, y = np.clip(x, xs[0], xs[-1]), np.clip(y, ys[0], ys[-1])
    value = CubicHermiteSpline(xs, nodes[..., 0], nodes[..., 1])(x)
    slope = CubicHermiteSpline(xs, nodes[..., 2], nodes[..., 3])(x)
    return float(CubicHermiteSpline(ys, value, slope)(y))


def folded(alpha):
    return np.pi - alpha if alpha > ANGLE else -np.pi - alpha if alpha < -ANGLE else alpha


def resolve(lift, drag, flow, arm, moment):
    """Lift normal to the flow, drag along it, as a vector in body axes; moment = z X - x Z."""
    direction = np.array(flow) / max(np.hypot(*flow), 1e-9)
    force = -drag * direction + lift * np.array([direction[1], -direction[0]])
    return np.array([force[0], force[1], moment + arm[1] * force[0] - arm[0] * force[1]])


@dataclass
class Disc:
    """Section quantities over the disc, azimuth down, radius across."""

    normal: np.ndarray
    tangential: np.ndarray
    profile_power: float
    induced_power: float
    flap_power: float


def section_coefficients(rotor, alpha, mach):
    """Quadratic B-splines in angle of attack and Mach number, by scipy."""
    tables = rotor.section
    found = np.empty((2, *alpha.shape))
    position = [
        (alpha - rotor.section_start) / rotor.section_step,
        np.minimum((mach - rotor.mach_start) / rotor.mach_step, tables.shape[2] - 2.0),
    ]
    knots = [np.arange(n + 3) - 1.5 for n in tables.shape[1:3]]
    for i in range(alpha.shape[1]):
        spline = NdBSpline(tuple(knots), tables[i], k=2)
        found[..., i] = np.moveaxis(spline(np.column_stack([p[:, i] for p in position])), -1, 0)
    return found[0], found[1] + rotor.root_drag


def rotor_twin(rotor, air, hub, flapping, inflow, pitch):
    vf, vt, p, vo, wf, wt = hub
    b0, b0d, b1c, b1cd, b1s, b1sd = flapping
    om = air.rotor_speed
    tip = om * rotor.radius
    psi = 2.0 * np.pi * np.arange(rotor.cos_azimuth.size) / rotor.cos_azimuth.size
    c, s = np.cos(psi)[:, None], np.sin(psi)[:, None]
    r = rotor.stations[None, :]
    beta = b0 + b1c * c + b1s * s
    # d(beta)/dt in the rotating frame, d(psi)/dt = om.
    beta_rate = b0d + b1cd * c + b1sd * s + om * (-b1c * s + b1s * c)
    theta = pitch[0] + pitch[1] * s + rotor.pitch_flap * (beta - rotor.precone) + rotor.twist
    induced = tip * (inflow[0] + (inflow[1] * c + inflow[2] * s) * r / rotor.radius)
    # The blade's place and its velocity as vectors along o (outboard), f (nose), t (mast): what meets it is the hub's
    # velocity, the hub's turning, and its own turning and flapping.
    ut, up = np.empty_like(beta * r), np.empty_like(beta * r)
    for k, azimuth in enumerate(psi):
        radial = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        ahead = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        turning = np.cross(np.array([p, wf, om + wt]), radial)
        for i, radius in enumerate(rotor.stations):
            velocity = np.array([vo, vf, vt]) + radius * turning + np.array([0.0, 0.0, radius * beta_rate[k, 0]])
            ut[k, i] = velocity @ ahead
            up[k, i] = velocity[2] + induced[k, i] - beta[k, 0] * (np.array([vo, vf, 0.0]) @ radial)
    alpha = theta - np.arctan2(up, ut)
    alpha = np.angle(np.exp(1j * alpha))
    speed = np.hypot(ut, up)
    lift_coefficient, drag_coefficient = section_coefficients(rotor, alpha, speed / air.sound_speed)
    pressure_area = 0.5 * air.density * speed**2 * rotor.chord * rotor.widths
    lift, drag = pressure_area * lift_coefficient * rotor.lifting, pressure_area * drag_coefficient
    normal = (lift * ut - drag * up) / speed
    tangential = (lift * up + drag * ut) / speed
    mean = rotor.blades / psi.size
    moment = (normal * r).sum(axis=1)
    loads = np.array(
        [
            mean * normal.sum(),
            mean * (normal * beta * c - tangential * s).sum(),
            mean * (tangential * r).sum(),
            moment.mean(),
            2.0 * (moment * c[:, 0]).mean(),
            2.0 * (moment * s[:, 0]).mean(),
            mean * (-normal * beta * s - tangential * c).sum(),
        ]
    )
    return loads, Disc(
        normal,
        tangential,
        mean * (drag * speed).sum(),
        mean * (normal * induced).sum(),
        mean * (normal * r * (beta_rate - p * c)).sum(),
    )


def wing_rows(wing, flap):
    nodes = wing.flap_nodes
    k = int(np.clip(np.searchsorted(nodes, flap, side="left") - 1, 0, 2))
    return k, float(np.clip((flap - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0, 1.0))


def wing_twin(wing, air, flow, setting, wake, arms):
    u, w, q = flow
    nacelle, flap, alpha = setting
    local = (u + q * arms[0][1], w - q * arms[0][0])
    speed = np.hypot(*local)
    k, part = wing_rows(wing, flap)
    airplane = np.clip(1.0 - nacelle / ANGLE, 0.0, 1.0)
    angle = folded(alpha)

    def mix(table, argument, end):
        return (1.0 - part) * curve(table, 4 * end + k, argument) + part * curve(table, 4 * end + k + 1, argument)

    lift = airplane * mix(wing.lift, angle, 0) + (1.0 - airplane) * mix(wing.lift, angle, 1)
    drag = airplane * mix(wing.drag, angle, 0) + (1.0 - airplane) * mix(wing.drag, angle, 1)
    lift *= -1.0 if abs(alpha) > ANGLE else 1.0
    lift *= 1.0 + wing.mach_gain * airplane * np.clip((speed / air.sound_speed - 0.2) / 0.2, 0.0, 1.0)
    immersed = curve(wing.immersed_area, 0, nacelle) * (1.0 - min(speed / wing.immersed_fade_speed, 1.0) ** 2) ** 2
    pressure = 0.5 * air.density * speed**2
    free = pressure * (wing.area - immersed)
    load = resolve(
        free * lift, free * drag, local, arms[0], pressure * wing.area * wing.chord * mix(wing.moment, nacelle, 0)
    )
    wake_speed = wing.immersed_velocity_factor * wake[0] + wake[1]
    size = 0.5 * air.density * wake_speed * abs(wake_speed) * immersed * mix(wing.drag, -ANGLE, 1)
    force = size * np.array([-np.cos(nacelle), np.sin(nacelle)])
    return load + np.array([*force, arms[1][1] * force[0] - arms[1][0] * force[1]])


def fuselage_twin(body, air, flow, arm):
    speed = np.hypot(*flow)
    pressure = 0.5 * air.density * speed**2
    alpha = np.arctan2(flow[1], flow[0])
    angle = folded(alpha)
    lift = curve(body.fuselage, 0, angle) if abs(alpha) <= ANGLE else 0.0
    drag, moment = curve(body.fuselage, 1, angle), curve(body.fuselage, 2, angle)
    return resolve(pressure * lift, pressure * drag, flow, arm, pressure * moment)


def drag_twin(area, air, flow, arm):
    return resolve(0.0, 0.5 * air.density * area * np.hypot(*flow) ** 2, flow, arm, 0.0)


def small_parts_twin(tables, air, motion, nacelle, rotor_state, arms):
    """Spinners, pylons, jets and fins."""
    body = tables.body
    (ua, wa, qa), (hub_velocity, induced, power) = motion, rotor_state
    hub, pivot, fins = arms
    mast = np.array([np.cos(nacelle), -np.sin(nacelle)])
    at_hub = hub_velocity + induced * mast
    sine = np.sin(np.arccos(np.clip(at_hub @ mast / max(np.hypot(*at_hub), 1e-9), -1.0, 1.0)))
    load = drag_twin(body.spinner_area + body.spinner_incidence_area * sine**3, air, at_hub, hub)
    incidence = abs(nacelle + np.arctan2(wa, np.hypot(ua, SCHEDULING_SPEED)))
    area = curve(body.pylon_area, 0, nacelle) * curve(body.pylon_incidence_factor, 0, incidence)
    at_pivot = np.array([ua + qa * pivot[1], wa - qa * pivot[0]])
    load = load + drag_twin(area, air, at_pivot + tables.wing.immersed_velocity_factor * induced * mast, pivot)
    thrust = max(body.jet_static + body.jet_per_power * power, 0.0) - body.jet_ram * np.hypot(ua, wa)
    force = thrust * mast
    load = load + np.array([*force, pivot[1] * force[0] - pivot[0] * force[1]])
    return load + drag_twin(body.fin_area, air, (ua, wa), fins)


def between(nodes, nacelle):
    """Interval and weight in descending nodes."""
    k = int(np.clip(np.searchsorted(-nodes, -nacelle, side="left") - 1, 0, nodes.size - 2))
    return k, float(np.clip((nodes[k] - nacelle) / (nodes[k] - nodes[k + 1]), 0.0, 1.0))


def tail_twin(tail, air, flow, setting, induced, arm):
    u, w, q = flow
    nacelle, flap, elevator = setting
    speed, alpha = np.hypot(u, w), np.arctan2(w, u)
    forward = np.sqrt(max(np.sign(u) * u * u + w * w, 0.0))
    k, part = between(tail.wake_nacelle, nacelle)
    wakes = [surface(tail.rotor_wake, i, alpha, forward) for i in range(3)] + [0.0]
    wake = induced * ((1.0 - part) * wakes[k] + part * wakes[k + 1])
    k, part = between(tail.downwash_nacelle, nacelle)
    ratio = (1.0 - part) * surface(tail.pressure_ratio, k, alpha, forward)
    ratio += part * surface(tail.pressure_ratio, k + 1, alpha, forward)
    f, g = divmod(min(flap / deg(20.0), 2.0), 1.0)
    f, g = (1, 1.0) if f == 2.0 else (int(f), g)
    rows = [[curve(tail.downwash, 3 * (k + a) + f + b, alpha) for b in (0, 1)] for a in (0, 1)]
    downwash = np.array([1.0 - part, part]) @ np.array(rows) @ np.array([1.0 - g, g])
    downwash /= np.sqrt(1.0 - min(speed / air.sound_speed, 0.7) ** 2)
    mast_angle = ANGLE - nacelle
    local = np.array([u + q * arm[1], w - q * arm[0]]) + wake * np.array([np.sin(mast_angle), -np.cos(mast_angle)])
    angle = np.angle(np.exp(1j * (np.arctan2(local[1], local[0]) - downwash)))
    lift = surface(tail.lift, 0, folded(angle), elevator) if abs(angle) <= ANGLE else 0.0
    pressure = 0.5 * air.density * tail.pressure_factor * ratio * (local @ local) * tail.area
    return resolve(
        pressure * lift, pressure * curve(tail.drag, 0, folded(angle)), (np.cos(angle), np.sin(angle)), arm, 0.0
    )


def inflow_twin(rotor, air, hub, inflow, loads, nearness=0.0):
    """Pitt and Peters with White and Blake's gradient, each gradient a first-order lag towards its static value."""
    om, tip = air.rotor_speed, air.rotor_speed * rotor.radius
    scale = air.density * np.pi * rotor.radius**2 * tip**2
    mu = np.hypot(hub[0], hub[3]) / tip
    ideal = inflow[0] / rotor.induced_factor / (1.0 + curve(rotor.side_by_side, 0, abs(hub[0] / tip)))
    ideal /= 1.0 - rotor.ground_relief * nearness
    axial = hub[1] / tip + ideal
    resultant = max(np.hypot(mu, axial), 0.01)
    flow = max((mu**2 + axial * (axial + ideal)) / resultant, 0.02)
    cosine = abs(axial) / resultant
    gain = 4.0 / ((1.0 + cosine) * flow)
    gradient = rotor.skew_gradient * (1.0 - np.exp(-((mu / rotor.skew_gradient_onset) ** 2)))
    moments = rotor.blades / 2.0 * loads[4:6] / (scale * rotor.radius)
    # In the wind's own axes: azimuth 0 where the wake goes, turned by the wind's direction in the disc.
    direction = np.arctan2(hub[3], hub[0])
    turn = np.array([[np.cos(direction), -np.sin(direction)], [np.sin(direction), np.cos(direction)]])
    in_wind = turn @ moments
    along = gain * cosine * in_wind[0] + gradient * mu / resultant * inflow[0]
    target = turn.T @ np.array([along, gain * in_wind[1]])
    mean = om / rotor.apparent_mass * (loads[0] / scale - 2.0 * ideal * resultant)
    return np.array([mean, *(om / (rotor.gradient_apparent_mass * gain) * (target - np.array(inflow[1:])))])


def flapping_twin(rotor, om, mast, flapping, loads):
    """Blade equation in the rotating frame, projected on 1, cos, sin by quadrature over 8 azimuths."""
    b0, _, b1c, b1cd, b1s, b1sd = flapping
    p, p_dot, wf, wf_dot = mast
    psi = 2.0 * np.pi * np.arange(8) / 8.0
    c, s = np.cos(psi), np.sin(psi)
    tilt, cone = b1c * c + b1s * s, b0
    aerodynamic = loads[3] + loads[4] * c + loads[5] * s
    spring = 2.0 / rotor.blades * rotor.hub_spring * tilt
    cone_stiffness = (rotor.coning_frequency_squared - 1.0) * om**2 * (cone - rotor.precone) * np.ones_like(psi)
    # beta'' = M/I - om^2 beta - springs + (hub pitching: p_dot cos psi - 2 om p sin psi)
    second = aerodynamic / rotor.blade_inertia - om**2 * (cone + tilt) - spring / rotor.blade_inertia - cone_stiffness
    second += p_dot * c - 2.0 * om * p * s + wf_dot * s + 2.0 * om * wf * c
    # beta'' of b1c cos + b1s sin in the non-rotating variables.
    known = 2.0 * om * (-b1cd * s + b1sd * c) - om**2 * tilt
    left = second - known
    return np.array([left.mean(), 2.0 * (left * c).mean(), 2.0 * (left * s).mean()])


def derivative_twin(tables, x, u, nacelle):
    """The whole state derivative."""
    mass, rotor = tables.mass, tables.rotor
    state = dict(zip([v.name for v in STATES], x, strict=True))
    inputs = dict(zip([v.name for v in INPUTS], u, strict=True))
    own = tables.configuration
    air = own._replace(rotor_speed=own.rotor_speed + inputs["rotor_speed"])
    mast = ANGLE - nacelle
    ua, wa = state["u"] + inputs["gust_u"], state["w"] + inputs["gust_w"]
    qa, q, rate = state["q"] + inputs["gust_q"], state["q"], inputs["nacelle_rate"]

    def hub_and_arms(angle):
        m = ANGLE - angle
        shift_x, shift_z = mass.gravity_shift
        station = mass.gravity_centre_helicopter[0] + shift_z * np.sin(m) + shift_x * (1.0 - np.cos(m))
        water = mass.gravity_centre_helicopter[1] + shift_z * (1.0 - np.cos(m)) - shift_x * np.sin(m)

        def arm(position):
            return np.array([station - position[0], water - position[1]])

        pivot = arm(mass.pivot)
        return pivot + mass.mast_length * np.array([np.sin(m), -np.cos(m)]), arm, pivot

    hub, arm, pivot = hub_and_arms(nacelle)
    step = 1e-6
    hub_rate = rate * (hub_and_arms(nacelle + step)[0] - hub_and_arms(nacelle - step)[0]) / (2.0 * step)
    velocity = np.array([ua + qa * hub[1], wa - qa * hub[0]]) + hub_rate
    along_mast = np.array([np.sin(mast), -np.cos(mast)])
    in_disc = np.array([np.cos(mast), np.sin(mast)])
    hub_motion = (velocity @ in_disc, velocity @ along_mast, qa + rate, 0.0, 0.0, 0.0)
    flapping = tuple(x[STATE.coning : STATE.coning + 6])
    inflow = tuple(x[STATE.inflow_0 : STATE.inflow_0 + 3])
    loads, _ = rotor_twin(rotor, air, hub_motion, flapping, inflow, (state["collective_75"], state["cyclic_1s"]))
    force = 2.0 * (loads[0] * along_mast + loads[1] * in_disc)
    total = np.array([*force, hub[1] * force[0] - hub[0] * force[1] - 2.0 * rotor.hub_spring * state["flap_1c"]])
    tip = air.rotor_speed * rotor.radius
    speed = np.hypot(ua, wa)
    flap = air.flap if air.flap >= 0.0 else kernels.flap_schedule(tables.controls, speed, nacelle)
    flap += sum(inputs[name] for name in FLAP_INPUTS)
    flap = float(np.clip(flap, tables.wing.flap_nodes[0], tables.wing.flap_nodes[-1]))
    induced = state["inflow_0"] * tip
    coefficient = np.hypot(*force) / (air.density * np.pi * rotor.radius**2 * tip**2)
    upwash = np.polynomial.polynomial.polyval(mast, tables.wing.upwash)
    wing_alpha = np.arctan2(wa, ua) - upwash * coefficient / max(0.15, speed / tip) ** 2
    tail_arm = arm(tables.tail.position)
    total = total + wing_twin(
        tables.wing,
        air,
        (ua, wa, qa),
        (nacelle, flap, wing_alpha),
        (induced, hub_motion[1]),
        (arm(tables.wing.position), arm(tables.wing.immersed_position)),
    )
    total = total + fuselage_twin(tables.body, air, (ua, wa), arm(tables.body.position))
    power = 2.0 * loads[2] * air.rotor_speed
    total = total + small_parts_twin(
        tables, air, (ua, wa, qa), nacelle, (velocity, induced, power), (hub, pivot, tail_arm)
    )
    total = total + tail_twin(tables.tail, air, (ua, wa, qa), (nacelle, flap, state["elevator"]), induced, tail_arm)
    inertia = mass.pitch_inertia_airplane + mass.pitch_inertia_slope * nacelle
    reaction = mass.nacelle_inertia * inputs["nacelle_acceleration"] + mass.pitch_inertia_slope * rate * q
    q_dot = (total[2] - reaction) / inertia + inputs["contact_pitch"]
    total[:2] += air.mass * np.array([inputs["contact_x"], inputs["contact_z"]])
    theta = state["pitch"]
    out = np.zeros(len(STATES))
    out[STATE.u] = total[0] / air.mass - q * state["w"] - GRAVITY * np.sin(theta)
    out[STATE.w] = total[1] / air.mass + q * state["u"] + GRAVITY * np.cos(theta)
    out[STATE.q], out[STATE.pitch] = q_dot, q
    out[STATE.altitude] = state["u"] * np.sin(theta) - state["w"] * np.cos(theta)
    accelerations = flapping_twin(
        rotor, air.rotor_speed, (q + rate, q_dot + inputs["nacelle_acceleration"], 0.0, 0.0), flapping, loads
    )
    for k, name in enumerate(("coning", "flap_1c", "flap_1s")):
        out[getattr(STATE, name)] = state[name + "_rate"]
        out[getattr(STATE, name + "_rate")] = accelerations[k]
    out[STATE.inflow_0 : STATE.inflow_0 + 3] = inflow_twin(
        rotor, air, hub_motion, inflow, loads, inputs["ground_effect"]
    )
    controls = tables.controls
    low, high = curve(controls.collective_range, 0, nacelle), curve(controls.collective_range, 1, nacelle)
    gearing = curve(controls.cyclic_per_stick, 0, nacelle)
    wanted = np.array(
        [
            low + inputs["lever"] * (high - low),
            np.clip(-inputs["stick"] * gearing, -controls.cyclic_limit, controls.cyclic_limit),
            np.clip(inputs["stick"] * controls.elevator_per_stick, -controls.elevator_limit, controls.elevator_limit),
        ]
    )
    out[STATE.collective_75 :] = controls.actuator_rate * (wanted - x[STATE.collective_75 :])
    return out


def size(low, high):
    return st.floats(low, high, allow_nan=False)


FLAPPING = st.tuples(
    size(-0.1, 0.25), size(-1.0, 1.0), size(-0.2, 0.2), size(-1.0, 1.0), size(-0.2, 0.2), size(-1.0, 1.0)
)
INFLOW = st.tuples(size(-0.03, 0.12), size(-0.1, 0.1), size(-0.05, 0.05))


@settings(max_examples=25)
@given(
    hub=st.tuples(
        size(-40.0, 130.0), size(-40.0, 130.0), size(-0.5, 0.5), size(-30.0, 30.0), size(-1.0, 1.0), size(-1.0, 1.0)
    ),
    flapping=FLAPPING,
    inflow=INFLOW,
    pitch=st.tuples(size(-0.05, 0.8), size(-0.18, 0.18)),
)
def test_rotor_loads_inflow_and_flapping_match_the_twin(hub, flapping, inflow, pitch):
    rotor, air = AIRCRAFT.tables.rotor, AIRCRAFT.tables.configuration
    tip = air.rotor_speed * rotor.radius
    # Below this flow through and across the disc the kernels hold the skew; there it has no direction.
    assume(np.hypot(np.hypot(hub[0], hub[3]), hub[1] + 0.9 * tip * inflow[0]) > 0.02 * tip)
    loads = np.zeros(rotor_kernels.LOAD_COUNT)
    rotor_kernels.rotor_loads(rotor, air, hub, flapping, inflow, pitch, loads)
    expected, _ = rotor_twin(rotor, air, hub, flapping, inflow, pitch)
    np.testing.assert_allclose(loads, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
    rates = rotor_kernels.inflow_rates(rotor, air, hub, inflow, loads)
    np.testing.assert_allclose(rates, inflow_twin(rotor, air, hub, inflow, loads), rtol=1e-10, atol=1e-9)
    mast = (hub[2], 0.3, hub[4], -0.2)
    found = rotor_kernels.flapping_accelerations(rotor, air.rotor_speed, mast, flapping, loads)
    wanted = flapping_twin(rotor, air.rotor_speed, mast, flapping, loads)
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-7)


STATE_SPAN = np.array(
    [
        *([-20.0, 130.0], [-25.0, 25.0], [-0.5, 0.5], [-0.6, 0.6], [0.0, 500.0]),
        *([0.0, 0.2], [-0.5, 0.5], [-0.2, 0.2], [-1.0, 1.0], [-0.2, 0.2], [-1.0, 1.0]),
        *([-0.02, 0.1], [-0.06, 0.06], [-0.03, 0.03], [-0.05, 0.75], [-0.17, 0.17], [-0.35, 0.35]),
    ]
)
INPUT_SPAN = np.array(
    [
        *([-1.2, 1.2], [-0.1, 1.1], [-0.2, 0.2], [-0.5, 0.5], [-10.0, 10.0], [-10.0, 10.0], [-0.2, 0.2]),
        *([-0.4, 0.4], [-0.4, 0.4], [-0.7, 0.7], [-9.0, 9.0]),
        *([0.0, 1.0], [-5.0, 5.0], [-30.0, 0.0], [-3.0, 3.0]),
    ]
)


@settings(max_examples=40)
@given(
    shares=st.lists(size(0.0, 1.0), min_size=32, max_size=32),
    nacelle=size(0.0, 95.0),
    flap=st.sampled_from([-1.0, 0.0, deg(10.0), deg(20.0), deg(40.0), deg(75.0)]),
    height=size(0.0, 6000.0),
)
def test_state_derivative_matches_the_twin(shares, nacelle, flap, height):
    tables = AIRCRAFT.at(
        Condition(airspeed=0.0, nacelle_angle=0.0, flap=None if flap < 0.0 else flap, pressure_altitude=height)
    ).tables
    x = STATE_SPAN[:, 0] + np.array(shares[:17]) * np.ptp(STATE_SPAN, axis=1)
    u = INPUT_SPAN[:, 0] + np.array(shares[17:]) * np.ptp(INPUT_SPAN, axis=1)
    aircraft = Xv15(tables)
    xdot = aircraft.derivative(x, u, deg(nacelle))
    expected = derivative_twin(tables, x, u, deg(nacelle))
    scale = np.maximum(np.abs(expected), 1.0)
    # The twin differentiates the hub's path numerically (1e-9 of it), hence not 1e-10 while the nacelles turn.
    assert np.max(np.abs(xdot - expected) / scale) < (1e-10 if abs(u[INPUT.nacelle_rate]) < 1e-12 else 1e-7)
    u[INPUT.nacelle_rate] = 0.0
    xdot = aircraft.derivative(x, u, deg(nacelle))
    expected = derivative_twin(tables, x, u, deg(nacelle))
    assert np.max(np.abs(xdot - expected) / np.maximum(np.abs(expected), 1.0)) < 1e-10


@settings(max_examples=60)
@given(shares=st.lists(size(0.0, 1.0), min_size=32, max_size=32), nacelle=size(-1.0, 96.0))
def test_everything_is_finite_over_the_whole_input_range(shares, nacelle):
    """Rearward flight, deep stall, vertical descent: wrong perhaps, but finite and within what an aircraft can do."""
    span = STATE_SPAN.copy()
    span[STATE.u], span[STATE.w] = (-40.0, 160.0), (-80.0, 80.0)
    x = span[:, 0] + np.array(shares[:17]) * np.ptp(span, axis=1)
    u = INPUT_SPAN[:, 0] + np.array(shares[17:]) * np.ptp(INPUT_SPAN, axis=1)
    xdot = AIRCRAFT.derivative(x, u, deg(nacelle))
    y = AIRCRAFT.outputs(x, u, deg(nacelle))
    assert np.all(np.isfinite(xdot))
    assert np.all(np.isfinite(y))
    assert np.max(np.abs(xdot[[STATE.u, STATE.w]])) < 40.0 * GRAVITY


@pytest.mark.parametrize("airspeed", [0.0, 1e-12, -1e-12])
def test_standing_still_is_not_a_special_case(airspeed):
    """At zero airspeed the angle of attack is undefined; the derivative is continuous through it."""
    point = AIRCRAFT.trim(Condition(airspeed=0.0, nacelle_angle=ANGLE))
    x = point.x.copy()
    x[STATE.u], x[STATE.w] = airspeed, 0.0
    moved = x.copy()
    moved[STATE.u] += 1e-6 * KNOT
    difference = AIRCRAFT.derivative(moved, point.u, ANGLE) - AIRCRAFT.derivative(x, point.u, ANGLE)
    assert np.max(np.abs(difference)) < 1e-4
