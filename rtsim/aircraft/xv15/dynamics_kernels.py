"""The nonlinear aircraft in six degrees of freedom: state derivative and outputs from the loads of its parts.

The state holds the two rotors as mean and half difference (``rtsim.aircraft.variables``); here they are reckoned side
by side. Where nothing moves or acts sideways the left half is the right one, which then serves for both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.aircraft.motion_kernels import advanced, euler_of, moves_sideways, quaternion_of, quaternion_rate
from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.variables import INPUT, OUTPUT, SCHEDULING_SPEED, STATE
from rtsim.aircraft.xv15.airframe_kernels import (
    drag_load,
    fuselage_load,
    jet_load,
    moment_arm,
    wing_angle_of_attack,
    wing_load,
)
from rtsim.aircraft.xv15.flow import Air, Blades, Frame, Motion
from rtsim.aircraft.xv15.half_kernels import HALF, half_loads, half_rates
from rtsim.aircraft.xv15.lateral_kernels import (
    commanded_differences,
    fuselage_sideslip_load,
    sidewash_share,
    table_sideslip,
    wing_side_load,
)
from rtsim.aircraft.xv15.rotor_kernels import FLOW_COUNT, FORWARD_FORCE, THRUST, TORQUE
from rtsim.aircraft.xv15.tables import AircraftTables, Configuration, ControlTables, MassTables
from rtsim.aircraft.xv15.tail_kernels import pressure_left, tail_load
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places
from rtsim.units import GRAVITY

COMPONENTS = ("rotors", "spinners", "wing", "fuselage", "pylons", "jets", "fins", "tail")
AXES = 6
"""Loads of a component: force along x and z, pitching moment, force along y, rolling and yawing moment."""
MOST_STATIONS = 64
WORK = Places(
    ("right", HALF.size),
    ("left", HALF.size),
    "wing_alpha",
    "force_z",
    "force_y",
    ("component", AXES * len(COMPONENTS)),
    ("flow", FLOW_COUNT * MOST_STATIONS),  # the blade sections' flow and forces
)
"""The work array: what the last derivative found."""
WORK_COUNT = WORK.size
STEP_SIZE = 6 * STATE.size
"""What a step needs besides."""


@inner_kernel
def flap_schedule(controls: ControlTables, airspeed: float, nacelle: float) -> float:
    """Flap deflection: the default off the downstop; on it, retracted linearly between two airspeeds [rad].

    Args:
        controls: The schedule.
    """
    start, end = controls.flap_retraction[0], controls.flap_retraction[1]
    retracted = min(max((airspeed - start) / (end - start), 0.0), 1.0)
    on_stop = min(max(1.0 - nacelle / controls.downstop_nacelle, 0.0), 1.0)
    return controls.default_flap * (1.0 - retracted * on_stop)


@inner_kernel
def flap_deflection(scheduled: float, nodes: FloatArray, u: FloatArray) -> float:
    """Flap deflection that acts: the scheduled one, moved by the flap inputs within the travel [rad].

    Args:
        scheduled: Deflection of the configuration or of the schedule [rad].
        nodes: Published settings, ascending [rad].
    """
    flap = scheduled + (u[INPUT.flap_0_20] + u[INPUT.flap_20_40] + u[INPUT.flap_40_75])
    return min(max(flap, nodes[0]), nodes[nodes.shape[0] - 1])


@inner_kernel
def gravity_centre(mass: MassTables, nacelle: float) -> tuple[float, float]:
    """Stationline and waterline of the centre of gravity [m] (NASA CR-166536 shift law).

    Args:
        mass: The law's constants.
    """
    s, c = math.cos(nacelle), math.sin(nacelle)
    x, z = mass.gravity_shift[0], mass.gravity_shift[1]
    return (
        mass.gravity_centre_helicopter[0] + z * s + x * (1.0 - c),
        mass.gravity_centre_helicopter[1] + z * (1.0 - c) - x * s,
    )


@inner_kernel
def commanded_controls(
    controls: ControlTables, stick: float, lever: float, nacelle: float
) -> tuple[float, float, float]:
    """Collective at 75 % radius, longitudinal cyclic, elevator asked for by stick and lever [rad], within their limits.

    Args:
        controls: Gearing and limits.
        stick: Stick, -1 to 1 forward.
        lever: Lever, 0 to 1.
    """
    low = curve(controls.collective_range, 0, nacelle)
    high = curve(controls.collective_range, 1, nacelle)
    cyclic = -stick * curve(controls.cyclic_per_stick, 0, nacelle)
    elevator = stick * controls.elevator_per_stick
    cyclic = min(max(cyclic, -controls.cyclic_limit), controls.cyclic_limit)
    elevator = min(max(elevator, -controls.elevator_limit), controls.elevator_limit)
    return low + lever * (high - low), cyclic, elevator


@inner_kernel
def _blades(x: FloatArray, sign: float) -> Blades:
    """The rotor of one side.

    Args:
        x: State.
        sign: 1 right, -1 left.
    """
    inflow = x[STATE.inflow_0], x[STATE.inflow_0_difference]
    return Blades(
        (
            x[STATE.coning] + sign * x[STATE.coning_difference],
            x[STATE.coning_rate] + sign * x[STATE.coning_rate_difference],
            x[STATE.flap_1c] + sign * x[STATE.flap_1c_difference],
            x[STATE.flap_1c_rate] + sign * x[STATE.flap_1c_rate_difference],
            x[STATE.flap_1s] + sign * x[STATE.flap_1s_difference],
            x[STATE.flap_1s_rate] + sign * x[STATE.flap_1s_rate_difference],
        ),
        (
            inflow[0] + sign * inflow[1],
            x[STATE.inflow_1c] + sign * x[STATE.inflow_1c_difference],
            x[STATE.inflow_1s] + sign * x[STATE.inflow_1s_difference],
        ),
        (
            x[STATE.collective_75] + sign * x[STATE.collective_difference],
            x[STATE.cyclic_1s] + sign * x[STATE.cyclic_difference],
        ),
        inflow[0] - sign * inflow[1],
    )


class _Situation(NamedTuple):
    """What all loads of one derivative go by."""

    air: Configuration
    wind: tuple[float, float, float, float, float, float]
    """Velocity and rates through the air, gusts included."""
    centre: tuple[float, float]
    frame: Frame
    shared: Air
    nacelle_rate: float
    sideslip: float
    sideways: bool


@inner_kernel
def _situation(tables: AircraftTables, x: FloatArray, u: FloatArray, nacelle: float) -> _Situation:
    mass, own = tables.mass, tables.configuration
    air = Configuration(own.mass, own.density, own.sound_speed, own.rotor_speed + u[INPUT.rotor_speed], own.flap)
    wind = (
        x[STATE.u] + u[INPUT.gust_u],
        x[STATE.v] + u[INPUT.gust_v],
        x[STATE.w] + u[INPUT.gust_w],
        x[STATE.p] + u[INPUT.gust_p],
        x[STATE.q] + u[INPUT.gust_q],
        x[STATE.r] + u[INPUT.gust_r],
    )
    ua, wa = wind[0], wind[2]
    sn, cn = math.sin(nacelle), math.cos(nacelle)
    centre = gravity_centre(mass, nacelle)
    pivot = moment_arm((mass.pivot[0], mass.pivot[1]), centre)
    fin = tables.lateral.fin
    # The hub's own motion: tilting mast, and the centre of gravity moving the other way.
    shift_x, shift_z = mass.gravity_shift[0], mass.gravity_shift[1]
    frame = Frame(
        pivot,
        (pivot[0] + mass.mast_length * cn, pivot[1] - mass.mast_length * sn),
        moment_arm((fin.position[0], fin.position[1]), centre),
        (-mass.mast_length * sn - shift_z * sn - shift_x * cn, -mass.mast_length * cn - shift_z * cn + shift_x * sn),
    )
    speed = math.sqrt(ua * ua + wa * wa)
    flap = own.flap
    if flap < 0.0:
        flap = flap_schedule(tables.controls, speed, nacelle)
    flap = flap_deflection(flap, tables.wing.flap_nodes, u)
    # At rest the free stream has no direction; there it counts as coming from ahead.
    incidence = abs(nacelle + math.atan2(wa, math.sqrt(ua * ua + SCHEDULING_SPEED * SCHEDULING_SPEED)))
    wing_arm = moment_arm((tables.wing.position[0], tables.wing.position[1]), centre)
    wing_speed = math.sqrt((ua + wind[4] * wing_arm[1]) ** 2 + (wa - wind[4] * wing_arm[0]) ** 2)
    sideways = moves_sideways(x, u)
    slip, share = 0.0, 1.0
    if sideways:
        slip = table_sideslip((ua, wind[1], wa))
        forward = math.sqrt(max(ua * abs(ua) + wa * wa, 0.0))
        alpha = math.atan2(wa, ua)
        share = sidewash_share(fin, alpha, slip, (nacelle, flap), tables.wing.flap_nodes, forward)
    shared = Air(nacelle, flap, incidence, wing_speed, share, pressure_left(slip))
    return _Situation(air, wind, centre, frame, shared, u[INPUT.nacelle_rate], slip, sideways)


@inner_kernel
def _load_halves(tables: AircraftTables, x: FloatArray, now: _Situation, work: FloatArray) -> None:
    """Write the loads of both halves."""
    stations = tables.rotor.stations.shape[0]
    flow = work[WORK.flow : WORK.flow + FLOW_COUNT * stations].reshape((FLOW_COUNT, stations))
    ua, va, wa, pa, qa, ra = now.wind
    for side in range(2):
        out = work[WORK.right + side * HALF.size : WORK.right + (side + 1) * HALF.size]
        if side == 1 and not now.sideways:
            for k in range(HALF.size):
                out[k] = work[WORK.right + k]
        else:
            sign = 1.0 - 2.0 * side
            motion = Motion(ua, sign * va, wa, sign * pa, qa, sign * ra, now.nacelle_rate)
            rudder = sign * x[STATE.rudder]
            half_loads(tables, now.air, motion, _blades(x, sign), now.frame, now.shared, rudder, out, flow)


@inner_kernel
def _both(work: FloatArray, place: int) -> tuple[float, float, float, float, float, float]:
    """A load of both halves: what is symmetric adds up, what is not is the right less the left."""
    right, left = WORK.right + place, WORK.left + place
    return (
        work[right] + work[left],
        work[right + 1] + work[left + 1],
        work[right + 2] + work[left + 2],
        work[right + 3] - work[left + 3],
        work[right + 4] - work[left + 4],
        work[right + 5] - work[left + 5],
    )


@inner_kernel
def _sum_loads(
    tables: AircraftTables, x: FloatArray, now: _Situation, work: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Add up the loads of all components, and note each."""
    rotor, wing, body, tail = tables.rotor, tables.wing, tables.body, tables.tail
    air, shared, centre = now.air, now.shared, now.centre
    ua, va, wa, pa, qa, ra = now.wind
    nacelle, flap = shared.nacelle, shared.flap
    thrust = work[WORK.right + THRUST] + work[WORK.left + THRUST]
    forward = work[WORK.right + FORWARD_FORCE] + work[WORK.left + FORWARD_FORCE]
    tip = air.rotor_speed * rotor.radius
    speed = math.sqrt(ua * ua + wa * wa)
    induced = x[STATE.inflow_0] * tip
    force_coefficient = math.sqrt(thrust * thrust + forward * forward) / (
        air.density * math.pi * rotor.radius**2 * tip * tip
    )
    alpha = wing_angle_of_attack(wing, math.atan2(wa, ua), nacelle, speed / tip, force_coefficient)
    work[WORK.wing_alpha] = alpha
    wing_arm = moment_arm((wing.position[0], wing.position[1]), centre)
    wake_arm = moment_arm((wing.immersed_position[0], wing.immersed_position[1]), centre)
    body_arm = moment_arm((body.position[0], body.position[1]), centre)
    tail_arm = moment_arm((tail.position[0], tail.position[1]), centre)
    wing_x, wing_z, wing_m = wing_load(wing, air, (ua, wa, qa), (nacelle, flap, alpha), wing_arm)
    right, left = WORK.right + HALF.wake, WORK.left + HALF.wake
    wake_x, wake_z = work[right] + work[left], work[right + 1] + work[left + 1]
    beside = tables.lateral.half.wake
    fuselage = fuselage_load(body, air, (ua, wa), body_arm)
    torque = work[WORK.right + TORQUE] + work[WORK.left + TORQUE]
    jets = jet_load(body, torque * air.rotor_speed, speed, nacelle, now.frame.pivot)
    fins = drag_load(body.fin_area, air, (ua, wa), tail_arm)
    rear = tail_load(
        tail,
        air,
        (ua, wa, qa),
        (nacelle, flap, x[STATE.elevator]),
        induced,
        tail_arm,
        tables.lateral.sideslip,
        now.sideslip,
    )
    slipping = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    banking = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if now.sideways:
        slipping = fuselage_sideslip_load(tables.lateral.sideslip, air, (ua, va, wa), body_arm)
        flow = (ua, va, wa, pa, ra)
        setting = (nacelle, flap, alpha, x[STATE.aileron])
        banking = wing_side_load(tables.lateral.wing, wing, air, flow, setting, wing_arm)
    fin = _both(work, HALF.fins)
    loads = (
        _both(work, HALF.rotors),
        _both(work, HALF.spinners),
        (
            wing_x + wake_x + banking[0],
            wing_z + wake_z + banking[1],
            wing_m + wake_arm[1] * wake_x - wake_arm[0] * wake_z + banking[2],
            banking[3],
            banking[4] + beside * (work[right + 1] - work[left + 1]),
            banking[5] - beside * (work[right] - work[left]),
        ),
        (
            fuselage[0] + slipping[0],
            fuselage[1] + slipping[1],
            fuselage[2] + slipping[2],
            slipping[3],
            slipping[4],
            slipping[5],
        ),
        _both(work, HALF.pylons),
        (jets[0], jets[1], jets[2], 0.0, 0.0, 0.0),
        (fins[0] + fin[0], fins[1] + fin[1], fins[2] + fin[2], fin[3], fin[4], fin[5]),
        (rear[0], rear[1], rear[2], 0.0, 0.0, 0.0),
    )
    for i in range(len(loads)):
        for axis in range(AXES):
            work[WORK.component + AXES * i + axis] = loads[i][axis]
    total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(len(loads)):
        load = loads[i]
        total = (
            total[0] + load[0],
            total[1] + load[1],
            total[2] + load[2],
            total[3] + load[3],
            total[4] + load[4],
            total[5] + load[5],
        )
    return total


@inner_kernel
def _move_body(
    tables: AircraftTables,
    x: FloatArray,
    u: FloatArray,
    nacelle: float,
    load: tuple[float, float, float, float, float, float],
    xdot: FloatArray,
) -> None:
    """Write the rates of velocities, body rates, attitude and place."""
    mass, lateral, weight = tables.mass, tables.lateral.mass, tables.configuration.mass
    force_x, force_z, moment, force_y, roll, yaw = load
    nacelle_rate, nacelle_acceleration = u[INPUT.nacelle_rate], u[INPUT.nacelle_acceleration]
    p, q, r = x[STATE.p], x[STATE.q], x[STATE.r]
    xx = lateral.roll[0] + lateral.roll[1] * nacelle
    zz = lateral.yaw[0] + lateral.yaw[1] * nacelle
    xz = lateral.product[0] + lateral.product[1] * nacelle
    yy = mass.pitch_inertia_airplane + mass.pitch_inertia_slope * nacelle
    # Tilting nacelles change the moments of inertia and turn with a momentum of their own.
    momentum = mass.nacelle_inertia * nacelle_rate
    moment -= mass.nacelle_inertia * nacelle_acceleration + mass.pitch_inertia_slope * nacelle_rate * q
    moment -= (xx - zz) * p * r + xz * (p * p - r * r)
    roll += (yy - zz) * q * r + xz * p * q + momentum * r
    roll -= nacelle_rate * (lateral.roll[1] * p - lateral.product[1] * r)
    yaw += (xx - yy) * p * q - xz * q * r - momentum * p
    yaw -= nacelle_rate * (lateral.yaw[1] * r - lateral.product[1] * p)
    both = xx * zz - xz * xz
    xdot[STATE.p] = (zz * roll + xz * yaw) / both + u[INPUT.contact_roll]
    xdot[STATE.r] = (xz * roll + xx * yaw) / both + u[INPUT.contact_yaw]
    xdot[STATE.q] = moment / yy + u[INPUT.contact_pitch]

    # The ground's forces come as accelerations: whoever reckons them knows mass and inertia.
    force_x += weight * u[INPUT.contact_x]
    force_z += weight * u[INPUT.contact_z]
    force_y += weight * u[INPUT.contact_y]
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    sb, cb = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
    ub, vb, wb = x[STATE.u], x[STATE.v], x[STATE.w]
    xdot[STATE.u] = force_x / weight - q * wb - GRAVITY * st + r * vb
    xdot[STATE.v] = force_y / weight - r * ub + p * wb + GRAVITY * ct * sb
    xdot[STATE.w] = force_z / weight + q * ub + GRAVITY * ct * cb - p * vb
    turning = q * sb + r * cb
    xdot[STATE.pitch] = q * cb - r * sb
    xdot[STATE.bank] = p + turning * st / ct
    xdot[STATE.heading] = turning / ct
    across, down = vb * cb - wb * sb, vb * sb + wb * cb
    ahead = ub * ct + down * st
    sh, ch = math.sin(x[STATE.heading]), math.cos(x[STATE.heading])
    xdot[STATE.altitude] = ub * st - down * ct
    xdot[STATE.north] = ahead * ch - across * sh
    xdot[STATE.east] = ahead * sh + across * ch


@inner_kernel
def _move_rotors(
    tables: AircraftTables, x: FloatArray, u: FloatArray, now: _Situation, xdot: FloatArray, work: FloatArray
) -> None:
    """Write the rates of flapping and inflow, mean and half difference."""
    sn, cn = math.sin(now.shared.nacelle), math.cos(now.shared.nacelle)
    half = tables.lateral.half
    about_f = half.rotation * (x[STATE.p] * sn + x[STATE.r] * cn)
    about_f_dot = half.rotation * (xdot[STATE.p] * sn + xdot[STATE.r] * cn)
    # The masts turn with the nacelles.
    about_f_dot += half.rotation * now.nacelle_rate * (x[STATE.p] * cn - x[STATE.r] * sn)
    about_o = x[STATE.q] + now.nacelle_rate
    about_o_dot = xdot[STATE.q] + u[INPUT.nacelle_acceleration]
    near = u[INPUT.ground_effect]
    right_out, left_out = work[WORK.right : WORK.right + HALF.size], work[WORK.left : WORK.left + HALF.size]
    mast = (about_o, about_o_dot, about_f, about_f_dot)
    right = half_rates(tables, now.air, _blades(x, 1.0), mast, near, right_out)
    left = right
    if now.sideways:
        mirrored = (about_o, about_o_dot, -about_f, -about_f_dot)
        left = half_rates(tables, now.air, _blades(x, -1.0), mirrored, near, left_out)
    xdot[STATE.coning] = x[STATE.coning_rate]
    xdot[STATE.flap_1c] = x[STATE.flap_1c_rate]
    xdot[STATE.flap_1s] = x[STATE.flap_1s_rate]
    xdot[STATE.coning_difference] = x[STATE.coning_rate_difference]
    xdot[STATE.flap_1c_difference] = x[STATE.flap_1c_rate_difference]
    xdot[STATE.flap_1s_difference] = x[STATE.flap_1s_rate_difference]
    for k in range(3):
        xdot[STATE.coning_rate + 2 * k] = 0.5 * (right[k] + left[k])
        xdot[STATE.coning_rate_difference + 2 * k] = 0.5 * (right[k] - left[k])
        xdot[STATE.inflow_0 + k] = 0.5 * (right[3 + k] + left[3 + k])
        xdot[STATE.inflow_0_difference + k] = 0.5 * (right[3 + k] - left[3 + k])


@inner_kernel
def _move_controls(tables: AircraftTables, x: FloatArray, u: FloatArray, now: _Situation, xdot: FloatArray) -> None:
    """Write the rates of the actuators."""
    controls, lateral = tables.controls, tables.lateral.controls
    nacelle = now.shared.nacelle
    collective, cyclic, elevator = commanded_controls(controls, u[INPUT.stick], u[INPUT.lever], nacelle)
    rates, rate = controls.actuator_rate, lateral.actuator_rate
    ua, wa = now.wind[0], now.wind[2]
    speed = math.sqrt(ua * ua + wa * wa)
    differences = commanded_differences(lateral, u[INPUT.lateral_stick], u[INPUT.pedal], nacelle, speed)
    # Each swashplate has its own stops.
    limit = controls.cyclic_limit
    right = min(max(cyclic + differences[1], -limit), limit)
    left = min(max(cyclic - differences[1], -limit), limit)
    xdot[STATE.collective_75] = rates[0] * (collective - x[STATE.collective_75])
    xdot[STATE.cyclic_1s] = rates[1] * (0.5 * (right + left) - x[STATE.cyclic_1s])
    xdot[STATE.elevator] = rates[2] * (elevator - x[STATE.elevator])
    xdot[STATE.collective_difference] = rate * (differences[0] - x[STATE.collective_difference])
    xdot[STATE.cyclic_difference] = rate * (0.5 * (right - left) - x[STATE.cyclic_difference])
    xdot[STATE.aileron] = rate * (differences[2] - x[STATE.aileron])
    xdot[STATE.rudder] = rate * (differences[3] - x[STATE.rudder])


@inner_kernel
def derivative(
    tables: AircraftTables, x: FloatArray, u: FloatArray, nacelle: float, xdot: FloatArray, work: FloatArray
) -> None:
    """State derivative of the nonlinear model; north and east go by the motion through the air.

    Args:
        x: State, order of ``variables.ALL_STATES``.
        u: Inputs, order of ``variables.ALL_INPUTS``.
        xdot: Written: state derivative.
        work: Scratch of WORK_COUNT numbers; afterwards holds rotor loads and component loads.
    """
    now = _situation(tables, x, u, nacelle)
    _load_halves(tables, x, now, work)
    load = _sum_loads(tables, x, now, work)
    work[WORK.force_z] = load[1] + tables.configuration.mass * u[INPUT.contact_z]
    work[WORK.force_y] = load[3] + tables.configuration.mass * u[INPUT.contact_y]
    _move_body(tables, x, u, nacelle, load, xdot)
    _move_rotors(tables, x, u, now, xdot, work)
    _move_controls(tables, x, u, now, xdot)


@inner_kernel
def outputs(
    tables: AircraftTables,
    x: FloatArray,
    u: FloatArray,
    nacelle: float,
    y: FloatArray,
    xdot: FloatArray,
    work: FloatArray,
) -> None:
    """Outputs, order of ``variables.ALL_OUTPUTS``.

    Args:
        y: Written: outputs.
        xdot: Written: state derivative.
        work: Scratch of WORK_COUNT numbers.
    """
    derivative(tables, x, u, nacelle, xdot, work)
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    sb, cb = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
    weight = tables.configuration.mass * GRAVITY
    right, left = WORK.right, WORK.left
    y[OUTPUT.thrust] = 0.5 * (work[right + THRUST] + work[left + THRUST])
    y[OUTPUT.torque] = 0.5 * (work[right + TORQUE] + work[left + TORQUE])
    y[OUTPUT.power] = 2.0 * y[OUTPUT.torque] * (tables.configuration.rotor_speed + u[INPUT.rotor_speed])
    y[OUTPUT.load_factor] = -work[WORK.force_z] / weight
    down, down_dot = x[STATE.v] * sb + x[STATE.w] * cb, xdot[STATE.v] * sb + xdot[STATE.w] * cb
    y[OUTPUT.airspeed_rate] = (
        xdot[STATE.u] * ct
        + down_dot * st
        + (down * ct - x[STATE.u] * st) * xdot[STATE.pitch]
        + (x[STATE.v] * cb - x[STATE.w] * sb) * st * xdot[STATE.bank]
    )
    # The angle of attack is undefined at rest: SCHEDULING_SPEED along the horizon makes the output smooth there and
    # leaves level flight as it is.
    ua, wa = x[STATE.u] + u[INPUT.gust_u], x[STATE.w] + u[INPUT.gust_w]
    smooth_alpha = math.atan2(wa + SCHEDULING_SPEED * st * cb, ua + SCHEDULING_SPEED * ct)
    y[OUTPUT.wing_angle_of_attack] = work[WORK.wing_alpha] - math.atan2(wa, ua) + smooth_alpha
    y[OUTPUT.flapping] = math.sqrt(x[STATE.flap_1c] ** 2 + x[STATE.flap_1s] ** 2)
    y[OUTPUT.thrust_difference] = 0.5 * (work[right + THRUST] - work[left + THRUST])
    y[OUTPUT.torque_difference] = 0.5 * (work[right + TORQUE] - work[left + TORQUE])
    y[OUTPUT.side_force] = work[WORK.force_y] / weight


@inner_kernel
def step(
    tables: AircraftTables, x: FloatArray, u: FloatArray, nacelle_path: FloatArray, dt: float, work: FloatArray
) -> None:
    """Advance the state by one fixed Runge-Kutta 4 step, in place; where it is over the ground is the caller's.

    Args:
        x: State, overwritten.
        u: Inputs; nacelle rate and acceleration are taken from the path.
        nacelle_path: Nacelle angle, rate, acceleration at start, middle and end of the step, shape (3, 3).
        work: Scratch of WORK_COUNT + STEP_SIZE numbers.
    """
    n = x.shape[0]
    slopes = work[WORK_COUNT : WORK_COUNT + 4 * n].reshape((4, n))
    point = work[WORK_COUNT + 4 * n : WORK_COUNT + 5 * n]
    sideways = moves_sideways(x, u)
    heading = x[STATE.heading]
    start = quaternion_of(x[STATE.bank], x[STATE.pitch], heading)
    rate, total = (0.0, 0.0, 0.0, 0.0), start
    for stage in range(4):
        row = (stage + 1) // 2
        fraction = 0.5 * dt if stage < 3 else dt
        for i in range(n):
            point[i] = x[i] if stage == 0 else x[i] + fraction * slopes[stage - 1, i]
        if sideways:
            attitude = advanced(start, rate, fraction) if stage > 0 else start
            point[STATE.bank], point[STATE.pitch], point[STATE.heading] = euler_of(attitude, heading)
            rate = quaternion_rate(attitude, point[STATE.p], point[STATE.q], point[STATE.r])
            total = advanced(total, rate, dt / 6.0 if stage in (0, 3) else dt / 3.0)
        u[INPUT.nacelle_rate] = nacelle_path[row, 1]
        u[INPUT.nacelle_acceleration] = nacelle_path[row, 2]
        derivative(tables, point, u, nacelle_path[row, 0], slopes[stage], work)
    for i in range(STATE.north):
        x[i] += dt / 6.0 * (slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i])
    if sideways:
        x[STATE.bank], x[STATE.pitch], x[STATE.heading] = euler_of(total, heading)
