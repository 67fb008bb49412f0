"""The nonlinear symmetric-plane aircraft: state derivative and outputs from the components' loads."""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.variables import INPUT, OUTPUT, SCHEDULING_SPEED, STATE
from rtsim.aircraft.xv15.airframe_kernels import (
    drag_load,
    fuselage_load,
    jet_load,
    moment_arm,
    pylon_load,
    spinner_load,
    wing_angle_of_attack,
    wing_load,
)
from rtsim.aircraft.xv15.rotor_kernels import (
    FLOW_COUNT,
    FORWARD_FORCE,
    LOAD_COUNT,
    THRUST,
    TORQUE,
    flapping_accelerations,
    inflow_rates_near_ground,
    rotor_loads_in,
)
from rtsim.aircraft.xv15.tables import AircraftTables, Configuration, ControlTables, MassTables
from rtsim.aircraft.xv15.tail_kernels import tail_load
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.units import GRAVITY

# The work array: rotor loads, then what `outputs` needs.
WORK_WING_ALPHA = LOAD_COUNT
WORK_FORCE_Z = LOAD_COUNT + 1
COMPONENT = LOAD_COUNT + 2
"""Loads X, Z, M of the COMPONENTS follow from here in the work array."""
COMPONENTS = ("rotors", "spinners", "wing", "fuselage", "pylons", "jets", "fins", "tail")
FLOW = COMPONENT + 3 * len(COMPONENTS)
"""The blade sections' flow and forces follow from here in the work array."""
MOST_STATIONS = 64
WORK_COUNT = FLOW + FLOW_COUNT * MOST_STATIONS


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
def derivative(
    tables: AircraftTables, x: FloatArray, u: FloatArray, nacelle: float, xdot: FloatArray, work: FloatArray
) -> None:
    """State derivative of the nonlinear model.

    Args:
        x: State, order of ``signals.STATES``.
        u: Inputs, order of ``signals.INPUTS``.
        xdot: Written: state derivative.
        work: Scratch of WORK_COUNT numbers; afterwards holds rotor loads and component loads.
    """
    rotor, mass = tables.rotor, tables.mass
    own = tables.configuration
    rotor_speed = own.rotor_speed + u[INPUT.rotor_speed]
    air = Configuration(own.mass, own.density, own.sound_speed, rotor_speed, own.flap)
    nacelle_rate = u[INPUT.nacelle_rate]
    nacelle_acceleration = u[INPUT.nacelle_acceleration]
    ua = x[STATE.u] + u[INPUT.gust_u]
    wa = x[STATE.w] + u[INPUT.gust_w]
    qa = x[STATE.q] + u[INPUT.gust_q]
    q = x[STATE.q]
    sn, cn = math.sin(nacelle), math.cos(nacelle)

    centre = gravity_centre(mass, nacelle)
    pivot = moment_arm((mass.pivot[0], mass.pivot[1]), centre)
    hub_x = pivot[0] + mass.mast_length * cn
    hub_z = pivot[1] - mass.mast_length * sn
    # The hub's own motion: tilting mast, and the centre of gravity moving the other way.
    shift_x, shift_z = mass.gravity_shift[0], mass.gravity_shift[1]
    hub_u = ua + qa * hub_z + nacelle_rate * (-mass.mast_length * sn - shift_z * sn - shift_x * cn)
    hub_w = wa - qa * hub_x + nacelle_rate * (-mass.mast_length * cn - shift_z * cn + shift_x * sn)
    hub = (hub_u * sn + hub_w * cn, hub_u * cn - hub_w * sn, qa + nacelle_rate)
    flapping = (
        x[STATE.coning],
        x[STATE.coning_rate],
        x[STATE.flap_1c],
        x[STATE.flap_1c_rate],
        x[STATE.flap_1s],
        x[STATE.flap_1s_rate],
    )
    inflow = (x[STATE.inflow_0], x[STATE.inflow_1c], x[STATE.inflow_1s])
    flow = work[FLOW : FLOW + FLOW_COUNT * rotor.stations.shape[0]].reshape((FLOW_COUNT, rotor.stations.shape[0]))
    rotor_loads_in(rotor, air, hub, flapping, inflow, (x[STATE.collective_75], x[STATE.cyclic_1s]), work, flow)
    thrust, forward = 2.0 * work[THRUST], 2.0 * work[FORWARD_FORCE]
    rotor_x = thrust * cn + forward * sn
    rotor_z = -thrust * sn + forward * cn
    rotor_m = hub_z * rotor_x - hub_x * rotor_z - 2.0 * rotor.hub_spring * x[STATE.flap_1c]

    tip = air.rotor_speed * rotor.radius
    speed = math.sqrt(ua * ua + wa * wa)
    flap = air.flap
    if flap < 0.0:
        flap = flap_schedule(tables.controls, speed, nacelle)
    flap = flap_deflection(flap, tables.wing.flap_nodes, u)
    induced = x[STATE.inflow_0] * tip
    force_coefficient = math.sqrt(thrust * thrust + forward * forward) / (
        air.density * math.pi * rotor.radius**2 * tip * tip
    )
    wing_alpha = wing_angle_of_attack(tables.wing, math.atan2(wa, ua), nacelle, speed / tip, force_coefficient)
    wing, body, tail = tables.wing, tables.body, tables.tail
    wing_x, wing_z, wing_m = wing_load(
        wing,
        air,
        (ua, wa, qa),
        (nacelle, flap, wing_alpha),
        (induced, hub[1]),
        (
            moment_arm((wing.position[0], wing.position[1]), centre),
            moment_arm((wing.immersed_position[0], wing.immersed_position[1]), centre),
        ),
    )
    tail_arm = moment_arm((tail.position[0], tail.position[1]), centre)
    # At rest the free stream has no direction; there it counts as coming from ahead.
    incidence = abs(nacelle + math.atan2(wa, math.sqrt(ua * ua + SCHEDULING_SPEED * SCHEDULING_SPEED)))
    loads = (
        (rotor_x, rotor_z, rotor_m),
        spinner_load(body, air, (hub[0], hub[1] + induced), nacelle, (hub_x, hub_z)),
        (wing_x, wing_z, wing_m),
        fuselage_load(body, air, (ua, wa), moment_arm((body.position[0], body.position[1]), centre)),
        pylon_load(
            body,
            air,
            (ua + qa * pivot[1], wa - qa * pivot[0]),
            nacelle,
            incidence,
            wing.immersed_velocity_factor * induced,
            pivot,
        ),
        jet_load(body, 2.0 * work[TORQUE] * air.rotor_speed, speed, nacelle, pivot),
        drag_load(body.fin_area, air, (ua, wa), tail_arm),
        tail_load(tail, air, (ua, wa, qa), (nacelle, flap, x[STATE.elevator]), induced, tail_arm),
    )
    force_x, force_z, moment = 0.0, 0.0, 0.0
    for i in range(len(loads)):
        load = loads[i]
        force_x += load[0]
        force_z += load[1]
        moment += load[2]
        for axis in range(3):
            work[COMPONENT + 3 * i + axis] = load[axis]
    inertia = mass.pitch_inertia_airplane + mass.pitch_inertia_slope * nacelle
    moment -= mass.nacelle_inertia * nacelle_acceleration + mass.pitch_inertia_slope * nacelle_rate * q

    pitch = x[STATE.pitch]
    st, ct = math.sin(pitch), math.cos(pitch)
    q_dot = moment / inertia + u[INPUT.contact_pitch]
    # The ground's forces come as accelerations: whoever reckons them knows mass and inertia.
    force_x += air.mass * u[INPUT.contact_x]
    force_z += air.mass * u[INPUT.contact_z]
    xdot[STATE.u] = force_x / air.mass - q * x[STATE.w] - GRAVITY * st
    xdot[STATE.w] = force_z / air.mass + q * x[STATE.u] + GRAVITY * ct
    xdot[STATE.q] = q_dot
    xdot[STATE.pitch] = q
    xdot[STATE.altitude] = x[STATE.u] * st - x[STATE.w] * ct
    b0dd, b1cdd, b1sdd = flapping_accelerations(
        rotor, air.rotor_speed, (hub[2], q_dot + nacelle_acceleration), flapping, work
    )
    xdot[STATE.coning] = x[STATE.coning_rate]
    xdot[STATE.coning_rate] = b0dd
    xdot[STATE.flap_1c] = x[STATE.flap_1c_rate]
    xdot[STATE.flap_1c_rate] = b1cdd
    xdot[STATE.flap_1s] = x[STATE.flap_1s_rate]
    xdot[STATE.flap_1s_rate] = b1sdd
    l0_rate, l1c_rate, l1s_rate = inflow_rates_near_ground(rotor, air, hub, inflow, work, u[INPUT.ground_effect])
    xdot[STATE.inflow_0] = l0_rate
    xdot[STATE.inflow_1c] = l1c_rate
    xdot[STATE.inflow_1s] = l1s_rate
    collective, cyclic, elevator = commanded_controls(tables.controls, u[INPUT.stick], u[INPUT.lever], nacelle)
    rates = tables.controls.actuator_rate
    xdot[STATE.collective_75] = rates[0] * (collective - x[STATE.collective_75])
    xdot[STATE.cyclic_1s] = rates[1] * (cyclic - x[STATE.cyclic_1s])
    xdot[STATE.elevator] = rates[2] * (elevator - x[STATE.elevator])

    work[WORK_WING_ALPHA] = wing_alpha
    work[WORK_FORCE_Z] = force_z


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
    """Outputs, order of ``signals.OUTPUTS``.

    Args:
        y: Written: outputs.
        xdot: Written: state derivative.
        work: Scratch of WORK_COUNT numbers.
    """
    derivative(tables, x, u, nacelle, xdot, work)
    pitch = x[STATE.pitch]
    st, ct = math.sin(pitch), math.cos(pitch)
    y[OUTPUT.thrust] = work[THRUST]
    y[OUTPUT.torque] = work[TORQUE]
    y[OUTPUT.power] = 2.0 * work[TORQUE] * (tables.configuration.rotor_speed + u[INPUT.rotor_speed])
    y[OUTPUT.load_factor] = -work[WORK_FORCE_Z] / (tables.configuration.mass * GRAVITY)
    y[OUTPUT.airspeed_rate] = xdot[STATE.u] * ct + xdot[STATE.w] * st + (x[STATE.w] * ct - x[STATE.u] * st) * x[STATE.q]
    # The angle of attack is undefined at rest: SCHEDULING_SPEED along the horizon makes the output smooth there and
    # leaves level flight as it is.
    ua, wa = x[STATE.u] + u[INPUT.gust_u], x[STATE.w] + u[INPUT.gust_w]
    smooth_alpha = math.atan2(wa + SCHEDULING_SPEED * st, ua + SCHEDULING_SPEED * ct)
    y[OUTPUT.wing_angle_of_attack] = work[WORK_WING_ALPHA] - math.atan2(wa, ua) + smooth_alpha
    y[OUTPUT.flapping] = math.sqrt(x[STATE.flap_1c] ** 2 + x[STATE.flap_1s] ** 2)


@inner_kernel
def step(
    tables: AircraftTables, x: FloatArray, u: FloatArray, nacelle_path: FloatArray, dt: float, work: FloatArray
) -> None:
    """Advance the state by one fixed Runge-Kutta 4 step, in place.

    Args:
        x: State, overwritten.
        u: Inputs; nacelle rate and acceleration are taken from the path.
        nacelle_path: Nacelle angle, rate, acceleration at start, middle and end of the step, shape (3, 3).
        work: Scratch of WORK_COUNT + 6 * states numbers.
    """
    n = x.shape[0]
    slopes = work[WORK_COUNT : WORK_COUNT + 4 * n].reshape((4, n))
    point = work[WORK_COUNT + 4 * n : WORK_COUNT + 5 * n]
    for stage in range(4):
        row = (stage + 1) // 2
        fraction = 0.5 * dt if stage < 3 else dt
        for i in range(n):
            point[i] = x[i] if stage == 0 else x[i] + fraction * slopes[stage - 1, i]
        u[INPUT.nacelle_rate] = nacelle_path[row, 1]
        u[INPUT.nacelle_acceleration] = nacelle_path[row, 2]
        derivative(tables, point, u, nacelle_path[row, 0], slopes[stage], work)
    for i in range(n):
        x[i] += dt / 6.0 * (slopes[0, i] + 2.0 * slopes[1, i] + 2.0 * slopes[2, i] + slopes[3, i])
