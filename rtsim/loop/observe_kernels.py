"""The start of a frame, compiled: what the row can say before the command, what pilots and laws are shown and asked."""

from __future__ import annotations

import math

from rtsim.aircraft.variables import INPUT, OUTPUT, STATE
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.atmosphere.gust_kernels import G_AHEAD, G_Q, G_U, G_W
from rtsim.corridor.corridor_kernels import corridor_margins
from rtsim.faults.fault import TRANSMISSION_EFFICIENCY
from rtsim.faults.fault_kernels import fault_airspeed_error, fault_mask, fault_nacelle_ok
from rtsim.frame import COLUMN, FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.parts import call_at
from rtsim.loop.data import CLOCK, MOTION, PART, PROGRAMME, REFERENCE, TARGET, Flight
from rtsim.nacelle.nacelle_kernels import nacelle_assigned_rate, nacelle_at, on_downstop
from rtsim.protection import law_data as law
from rtsim.systems.drive_kernels import DEVIATION, engine_power
from rtsim.systems.flap_kernels import flap_inputs, flap_now
from rtsim.units import DEGREE, HORSEPOWER, INCH_POUND, KNOT, POUND_FORCE, RPM


@inner_kernel
def programme_at(programme: FloatArray, row: int, time: float) -> float:
    """Value of one row of the programme, linear between its points and held after the last.

    Args:
        programme: The programme's points, shape (4, points).
        row: 1 airspeed, 2 nacelle angle, 3 altitude.
        time: Time [s].
    """
    last = programme.shape[1] - 1
    if time >= programme[0, last]:
        return programme[row, last]
    low = 0
    high = last
    while high - low > 1:
        middle = (low + high) >> 1
        if programme[0, middle] <= time:
            low = middle
        else:
            high = middle
    if last == 0:
        return programme[row, 0]
    share = (time - programme[0, low]) / (programme[0, high] - programme[0, low])
    return programme[row, low] + share * (programme[row, high] - programme[row, low])


@inner_kernel
def observe(flight: Flight) -> None:
    """Fill the row with all that is known before the command of this frame; changes no state.

    Args:
        flight: The flight; afterwards its work space holds outputs, margins, the pilot's target and the row, commands
            excepted.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    row = scratch.row
    x = state.x
    gusts = state.gusts
    frame = state.clock[CLOCK.frame]
    time = frame * tables.dt
    nacelle_at(tables.nacelle, state.nacelle, 0.0, 0.0, scratch.motion)
    angle, rate = scratch.motion[MOTION.angle], scratch.motion[MOTION.rate]
    state.u[INPUT.nacelle_rate] = rate
    state.u[INPUT.nacelle_acceleration] = scratch.motion[MOTION.acceleration]
    state.u[INPUT.gust_u] = gusts[G_U]
    state.u[INPUT.gust_w] = gusts[G_W]
    state.u[INPUT.gust_q] = gusts[G_Q]
    speed = math.sqrt((x[STATE.u] + gusts[G_U]) ** 2 + (x[STATE.w] + gusts[G_W]) ** 2)
    flap_scheduled = nonlinear.flap_schedule(tables.plant.controls, speed, angle)
    scratch.scheduled[0] = flap_scheduled
    flap_inputs(tables.flaps, state.flaps, flap_scheduled, state.u)
    state.u[INPUT.rotor_speed] = state.drive[DEVIATION]
    aircraft = tables.plant.aircraft
    call_at(flight.parts[PART.outputs], aircraft, x, state.u, angle, scratch.y, scratch.xdot, scratch.work)
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    through = x[STATE.u] * ct + x[STATE.w] * st
    airspeed = through + gusts[G_AHEAD]
    climb = x[STATE.u] * st - x[STATE.w] * ct
    corridor_margins(tables.corridor, airspeed, angle, scratch.margins)
    _see(flight, airspeed)
    y = scratch.y
    rotor_speed = tables.drive.governed_speed + state.drive[DEVIATION]
    power = 2.0 * y[OUTPUT.torque] * rotor_speed

    _ask(flight, time)

    row[COLUMN.frame] = frame
    row[COLUMN.time_s] = time
    row[COLUMN.airspeed_kt] = airspeed / KNOT
    row[COLUMN.airspeed_reference_kt] = scratch.target[TARGET.airspeed] / KNOT
    row[COLUMN.nacelle_deg] = angle / DEGREE
    row[COLUMN.nacelle_reference_deg] = state.nacelle[0] / DEGREE
    row[COLUMN.altitude_m] = x[STATE.altitude]
    row[COLUMN.pitch_deg] = x[STATE.pitch] / DEGREE
    row[COLUMN.flapping_deg] = math.sqrt(x[STATE.flap_1c] ** 2 + x[STATE.flap_1s] ** 2) / DEGREE
    row[COLUMN.nacelle_rate_deg_s] = rate / DEGREE
    row[COLUMN.airspeed_command_kt] = programme_at(tables.programme, PROGRAMME.airspeed, time) / KNOT
    row[COLUMN.altitude_reference_m] = scratch.target[TARGET.altitude]
    row[COLUMN.airspeed_rate_kt_s] = y[OUTPUT.airspeed_rate] / KNOT
    row[COLUMN.ground_speed_kt] = (through + tables.wind) / KNOT
    row[COLUMN.climb_rate_m_s] = climb
    row[COLUMN.distance_m] = state.clock[CLOCK.distance]
    row[COLUMN.flight_path_deg] = math.atan2(climb, max(abs(through), 1.0)) / DEGREE
    row[COLUMN.angle_of_attack_deg] = (
        math.atan2(x[STATE.w] + gusts[G_W] + 4.5 * st, x[STATE.u] + gusts[G_U] + 4.5 * ct) / DEGREE
    )
    row[COLUMN.pitch_rate_deg_s] = x[STATE.q] / DEGREE
    row[COLUMN.body_u_m_s] = x[STATE.u]
    row[COLUMN.body_w_m_s] = x[STATE.w]
    row[COLUMN.load_factor] = y[OUTPUT.load_factor]
    row[COLUMN.coning_deg] = x[STATE.coning] / DEGREE
    row[COLUMN.longitudinal_flapping_deg] = x[STATE.flap_1c] / DEGREE
    row[COLUMN.lateral_flapping_deg] = x[STATE.flap_1s] / DEGREE
    row[COLUMN.collective_75_deg] = x[STATE.collective_75] / DEGREE
    row[COLUMN.cyclic_deg] = x[STATE.cyclic_1s] / DEGREE
    row[COLUMN.elevator_deg] = x[STATE.elevator] / DEGREE
    row[COLUMN.flap_deg] = flap_now(state.flaps, flap_scheduled) / DEGREE
    row[COLUMN.thrust_per_rotor_lb] = y[OUTPUT.thrust] / POUND_FORCE
    row[COLUMN.power_shp] = power / HORSEPOWER
    row[COLUMN.engine_power_shp] = engine_power(state.drive, power) / HORSEPOWER / TRANSMISSION_EFFICIENCY
    row[COLUMN.mast_torque_inlb] = y[OUTPUT.torque] / INCH_POUND
    row[COLUMN.rotor_speed_rpm] = rotor_speed / RPM
    row[COLUMN.margin_kt] = min(scratch.margins[0], scratch.margins[1]) / KNOT
    row[COLUMN.margin_low_kt] = scratch.margins[0] / KNOT
    row[COLUMN.margin_high_kt] = scratch.margins[1] / KNOT
    row[COLUMN.nacelle_forward_deg] = scratch.margins[2] / DEGREE
    row[COLUMN.nacelle_aft_deg] = scratch.margins[3] / DEGREE
    row[COLUMN.on_downstop] = 1.0 if on_downstop(tables.nacelle, angle) else 0.0
    row[COLUMN.pilot_mode] = state.clock[CLOCK.mode]
    row[COLUMN.airspeed_indicated_kt] = scratch.shown[0] / KNOT
    row[COLUMN.gust_u_m_s] = gusts[G_U]
    row[COLUMN.gust_w_m_s] = gusts[G_W]
    row[COLUMN.gust_q_deg_s] = gusts[G_Q] / DEGREE
    row[COLUMN.failures] = float(fault_mask(state.faults))


@inner_kernel
def _ask(flight: Flight, time: float) -> None:
    """Fill what the pilot is asked for: filtered airspeed and its rate, altitude and climb rate, nacelle rate."""
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    target = scratch.target
    target[TARGET.airspeed] = state.reference[REFERENCE.airspeed]
    target[TARGET.airspeed_rate] = state.reference[REFERENCE.rate]
    target[TARGET.altitude] = programme_at(tables.programme, PROGRAMME.altitude, time)
    ahead = programme_at(tables.programme, PROGRAMME.altitude, time + tables.dt)
    target[TARGET.climb_rate] = (ahead - target[TARGET.altitude]) / tables.dt
    wanted = programme_at(tables.programme, PROGRAMME.nacelle, time + tables.dt)
    wanted_rate = (wanted - state.nacelle[0]) / tables.dt
    if tables.automatic.active != 0:
        wanted_rate = call_at(flight.parts[PART.automatic_rate], flight)
    target[TARGET.nacelle_rate] = nacelle_assigned_rate(tables.nacelle, wanted_rate)


@inner_kernel
def _see(flight: Flight, airspeed: float) -> None:
    """Fill what pilots and laws are shown: indicated airspeed, its margins, and the state shifted to agree with it.

    The shift is along the horizon, so that the climb rate computed from the seen state stays the true one.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    x, seen, shown = state.x, scratch.seen, scratch.shown
    error = fault_airspeed_error(state.faults, airspeed)
    shown[0] = airspeed + error
    if error == 0.0:
        for k in range(scratch.margins.shape[0]):
            shown[1 + k] = scratch.margins[k]
    else:
        corridor_margins(tables.corridor, shown[0], scratch.motion[MOTION.angle], shown[1:])
    for k in range(x.shape[0]):
        seen[k] = x[k]
    shift = state.gusts[G_AHEAD] + error
    if shift != 0.0:
        seen[STATE.u] += shift * math.cos(x[STATE.pitch])
        seen[STATE.w] += shift * math.sin(x[STATE.pitch])


@inner_kernel
def sense(flight: Flight) -> None:
    """Give what pilots and laws may know, as the work space's ``sensors``. SI.

    Args:
        flight: The flight as ``observe`` left it.
    """
    state, scratch = flight.state, flight.scratch
    x, row, sensors = state.x, scratch.row, scratch.sensors
    sensors[law.SENSE_TIME] = row[COLUMN.time_s]
    sensors[law.SENSE_AIRSPEED] = row[COLUMN.airspeed_indicated_kt] * KNOT
    sensors[law.SENSE_AIRSPEED_RATE] = row[COLUMN.airspeed_rate_kt_s] * KNOT
    sensors[law.SENSE_NACELLE] = scratch.motion[MOTION.angle]
    sensors[law.SENSE_NACELLE_RATE] = scratch.motion[MOTION.rate]
    sensors[law.SENSE_PITCH] = x[STATE.pitch]
    sensors[law.SENSE_PITCH_RATE] = x[STATE.q]
    sensors[law.SENSE_FLIGHT_PATH] = row[COLUMN.flight_path_deg] * DEGREE
    sensors[law.SENSE_ALTITUDE] = x[STATE.altitude]
    sensors[law.SENSE_CLIMB_RATE] = row[COLUMN.climb_rate_m_s]
    sensors[law.SENSE_LOAD_FACTOR] = row[COLUMN.load_factor]
    sensors[law.SENSE_TORQUE] = row[COLUMN.mast_torque_inlb] * INCH_POUND
    sensors[law.SENSE_FLAPPING] = row[COLUMN.flapping_deg] * DEGREE
    sensors[law.SENSE_DOWNSTOP] = row[COLUMN.on_downstop]
    sensors[law.SENSE_NACELLE_OK] = 1.0 if fault_nacelle_ok(state.faults) else 0.0
