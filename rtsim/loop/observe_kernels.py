"""The start of a frame, compiled: what the row can say before the command, what pilots and laws are shown and asked."""

from __future__ import annotations

import math

from rtsim.aircraft.variables import INPUT, OUTPUT, STATE
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.arrays import FloatArray
from rtsim.atmosphere.gust_kernels import GUST
from rtsim.atmosphere.wind_kernels import level_motion, level_speed, wind_along, wind_gradient, wind_share
from rtsim.command import SENSOR
from rtsim.corridor.corridor_kernels import corridor_margins, turn_excess
from rtsim.faults.fault_kernels import FAULT, fault_airspeed_error, fault_mask, fault_nacelle_ok
from rtsim.frame import QUANTITY
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.grid_kernels import cell_below
from rtsim.kernels.parts import call_at
from rtsim.loop.data import CHANNEL, CLOCK, KNOWN, MOTION, PART, PROGRAMME, REFERENCE, Flight
from rtsim.loop.lateral_reference_kernels import ON_LINE, beside_line, fill_wanted, from_point, turn_wanted
from rtsim.lpv.schedule_kernels import scheduling_alpha
from rtsim.nacelle.nacelle_kernels import nacelle_assigned_rate, nacelle_at, on_downstop
from rtsim.pilot.lateral_kernels import WANTED
from rtsim.pilot.layout_kernels import TARGET
from rtsim.protection.law_data import LAW
from rtsim.systems.drive_kernels import DEVIATION, HELD_OFFSET, engine_power, rotor_speed_now, schedule_angle
from rtsim.systems.engine_kernels import TANK, advance_ratio, fuel_flow, takeoff_power, thrust_over_solidity
from rtsim.systems.flap_kernels import flap_inputs, flap_now
from rtsim.systems.ground_kernels import ground_contact, ground_effect
from rtsim.units import GRAVITY

STANDSTILL = 0.05
"""Motion over the ground that has no course [m/s]."""
LARGEST_TURN = 1.2
"""Bank up to which a turn rate is reckoned from it [rad]."""


@inner_kernel
def programme_at(programme: FloatArray, time: float) -> tuple[int, float]:
    """Find a time in the programme, which is linear between its points and held before the first and after the last.

    Args:
        programme: The programme's points, shape (``PROGRAMME.size``, points).
        time: Time [s].

    Returns:
        Number of the point before it, and the share of the way to the next.
    """
    last = programme.shape[1] - 1
    if last == 0 or time >= programme[PROGRAMME.time, last]:
        return last, 0.0
    low = cell_below(programme[PROGRAMME.time], time)
    before, after = programme[PROGRAMME.time, low], programme[PROGRAMME.time, low + 1]
    return low, (time - before) / (after - before)


@inner_kernel
def programmed(programme: FloatArray, row: int, low: int, share: float) -> float:
    """Value of one row of the programme at what ``programme_at`` found.

    Args:
        programme: The programme's points.
        row: One of ``PROGRAMME``.
        low: Number of the point before the time.
        share: Share of the way to the next.
    """
    if share == 0.0:
        return programme[row, low]
    return programme[row, low] + share * (programme[row, low + 1] - programme[row, low])


@inner_kernel
def observe(flight: Flight) -> None:
    """Find all that is known before the command of this frame; changes no state.

    Args:
        flight: The flight; afterwards its work space holds outputs, margins, the pilot's target and the quantities of
            the row, commands excepted.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    si = scratch.si
    x = state.x
    gusts = state.gusts
    frame = state.clock[CLOCK.frame]
    time = frame * tables.dt
    nacelle_at(tables.nacelle, state.nacelle, 0.0, 0.0, scratch.motion)
    angle, rate = scratch.motion[MOTION.angle], scratch.motion[MOTION.rate]
    state.u[INPUT.nacelle_rate] = rate
    state.u[INPUT.nacelle_acceleration] = scratch.motion[MOTION.acceleration]
    state.u[INPUT.gust_u] = gusts[GUST.u]
    state.u[INPUT.gust_w] = gusts[GUST.w]
    state.u[INPUT.gust_q] = gusts[GUST.q]
    state.u[INPUT.gust_v] = gusts[GUST.v]
    state.u[INPUT.gust_p] = gusts[GUST.p]
    state.u[INPUT.gust_r] = gusts[GUST.r]
    speed = math.sqrt((x[STATE.u] + gusts[GUST.u]) ** 2 + (x[STATE.w] + gusts[GUST.w]) ** 2)
    flap_scheduled = nonlinear.flap_schedule(tables.plant.controls, speed, angle)
    scratch.known[KNOWN.flap] = flap_scheduled
    flap_inputs(tables.flaps, state.flaps, flap_scheduled, state.u)
    drive = state.drive
    place = schedule_angle(tables.drive, drive, angle)
    scratch.known[KNOWN.place] = place
    state.u[INPUT.rotor_speed] = drive[DEVIATION] + tables.drive.held_acts * drive[HELD_OFFSET]
    on_wheels = 0.0
    through, sideways, climb = level_motion(x)
    share = wind_share(tables.wind, x[STATE.altitude])
    wind_ahead, wind_right = wind_along(tables.wind, x[STATE.heading])
    ground_ahead, ground_right = through + share * wind_ahead, sideways + share * wind_right
    scratch.known[KNOWN.airspeed_in_air] = through
    scratch.known[KNOWN.wind] = share * wind_ahead
    scratch.known[KNOWN.wind_right] = share * wind_right
    scratch.known[KNOWN.ground_ahead], scratch.known[KNOWN.ground_right] = ground_ahead, ground_right
    if tables.ground.active != 0.0:
        total = math.sqrt(speed**2 + (x[STATE.v] + gusts[GUST.v]) ** 2) if x[STATE.v] + gusts[GUST.v] != 0.0 else speed
        state.u[INPUT.ground_effect] = ground_effect(tables.ground, x[STATE.altitude], angle, total)
        on_wheels = ground_contact(tables.ground, x, (ground_ahead, ground_right), state.u)
    where = place if tables.drive.held_acts == 0.0 else angle
    aircraft = tables.plant.aircraft
    # Left at zero by an aircraft that knows no motion out of its plane of symmetry.
    scratch.y[OUTPUT.thrust_difference] = scratch.y[OUTPUT.torque_difference] = scratch.y[OUTPUT.side_force] = 0.0
    call_at(flight.parts[PART.outputs], aircraft, x, state.u, where, scratch.y, scratch.xdot, scratch.work)
    scratch.y[OUTPUT.airspeed_rate] -= wind_gradient(tables.wind, x[STATE.altitude]) * climb * wind_ahead
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    airspeed = through + gusts[GUST.ahead]
    corridor_margins(tables.corridor, airspeed, angle, turn_excess(x[STATE.bank]), scratch.margins)
    _see(flight, airspeed)
    y = scratch.y
    rotor_speed = rotor_speed_now(tables.drive, state.drive)
    power = 2.0 * y[OUTPUT.torque] * rotor_speed

    _ask(flight, time)

    si[QUANTITY.frame] = frame
    si[QUANTITY.time] = time
    si[QUANTITY.airspeed] = airspeed
    si[QUANTITY.airspeed_reference] = scratch.target[TARGET.airspeed]
    si[QUANTITY.nacelle] = angle
    si[QUANTITY.nacelle_reference] = state.nacelle[0]
    si[QUANTITY.altitude] = x[STATE.altitude]
    si[QUANTITY.pitch] = x[STATE.pitch]
    si[QUANTITY.flapping] = math.sqrt(x[STATE.flap_1c] ** 2 + x[STATE.flap_1s] ** 2)
    si[QUANTITY.nacelle_rate] = rate
    si[QUANTITY.altitude_reference] = scratch.target[TARGET.altitude]
    si[QUANTITY.airspeed_rate] = y[OUTPUT.airspeed_rate]
    si[QUANTITY.ground_speed] = level_speed(ground_ahead, ground_right)
    si[QUANTITY.climb_rate] = climb
    si[QUANTITY.distance] = state.clock[CLOCK.distance]
    si[QUANTITY.flight_path] = math.atan2(climb, max(abs(level_speed(through, sideways)), 1.0))
    ahead, below = x[STATE.u] + gusts[GUST.u], x[STATE.w] + gusts[GUST.w]
    si[QUANTITY.angle_of_attack] = scheduling_alpha(ahead, below, st, ct, tables.plant.alpha_speed)
    si[QUANTITY.pitch_rate] = x[STATE.q]
    si[QUANTITY.body_u] = x[STATE.u]
    si[QUANTITY.body_w] = x[STATE.w]
    si[QUANTITY.load_factor] = y[OUTPUT.load_factor]
    si[QUANTITY.coning] = x[STATE.coning]
    si[QUANTITY.longitudinal_flapping] = x[STATE.flap_1c]
    si[QUANTITY.lateral_flapping] = x[STATE.flap_1s]
    si[QUANTITY.collective_75] = x[STATE.collective_75]
    si[QUANTITY.cyclic] = x[STATE.cyclic_1s]
    si[QUANTITY.elevator] = x[STATE.elevator]
    si[QUANTITY.flap] = flap_now(state.flaps, flap_scheduled)
    si[QUANTITY.thrust_per_rotor] = y[OUTPUT.thrust]
    si[QUANTITY.power] = power
    si[QUANTITY.engine_power] = engine_power(state.drive, power) / tables.drive.efficiency
    si[QUANTITY.mast_torque] = y[OUTPUT.torque]
    si[QUANTITY.rotor_speed] = rotor_speed
    si[QUANTITY.margin] = min(scratch.margins[0], scratch.margins[1])
    si[QUANTITY.margin_low] = scratch.margins[0]
    si[QUANTITY.margin_high] = scratch.margins[1]
    si[QUANTITY.nacelle_forward] = scratch.margins[2]
    si[QUANTITY.nacelle_aft] = scratch.margins[3]
    si[QUANTITY.on_downstop] = 1.0 if on_downstop(tables.nacelle, angle) else 0.0
    si[QUANTITY.pilot_mode] = state.clock[CLOCK.mode]
    si[QUANTITY.airspeed_indicated] = scratch.shown[0]
    si[QUANTITY.gust_u] = gusts[GUST.u]
    si[QUANTITY.gust_w] = gusts[GUST.w]
    si[QUANTITY.gust_q] = gusts[GUST.q]
    si[QUANTITY.failures] = float(fault_mask(state.faults))
    si[QUANTITY.weight_on_wheels] = on_wheels
    si[QUANTITY.ground_effect] = state.u[INPUT.ground_effect]
    across = ahead * math.sin(angle) + below * math.cos(angle)
    si[QUANTITY.advance_ratio] = advance_ratio(tables.engine, across, rotor_speed)
    si[QUANTITY.thrust_coefficient_over_solidity] = thrust_over_solidity(tables.engine, y[OUTPUT.thrust], rotor_speed)
    _reckon_engines(flight, engine_power(state.drive, power))
    _note_lateral(flight, sideways)


@inner_kernel
def _wrapped(angle: float) -> float:
    """An angle between 0 and 2 pi."""
    turn = 2.0 * math.pi
    angle %= turn
    return angle if angle < turn else 0.0


@inner_kernel
def _note_lateral(flight: Flight, sideways: float) -> None:
    """Fill the quantities of the motion out of the plane of symmetry, and where the aircraft is.

    Args:
        sideways: Sideways airspeed, gusts excepted [m/s].
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    x, y, si, gusts, known = state.x, scratch.y, scratch.si, state.gusts, scratch.known
    heading, bank = x[STATE.heading], x[STATE.bank]
    si[QUANTITY.bank] = bank
    si[QUANTITY.heading] = _wrapped(heading)
    si[QUANTITY.roll_rate] = x[STATE.p]
    si[QUANTITY.yaw_rate] = x[STATE.r]
    turning = x[STATE.q] * math.sin(bank) + x[STATE.r] * math.cos(bank)
    si[QUANTITY.turn_rate] = turning / math.cos(x[STATE.pitch]) + 0.0
    u, v, w = x[STATE.u] + gusts[GUST.u], x[STATE.v] + gusts[GUST.v], x[STATE.w] + gusts[GUST.w]
    si[QUANTITY.sideslip] = math.atan2(v, math.sqrt(u * u + w * w + tables.plant.alpha_speed**2))
    si[QUANTITY.lateral] = sideways + gusts[GUST.right]
    si[QUANTITY.lateral_acceleration] = y[OUTPUT.side_force]
    si[QUANTITY.north], si[QUANTITY.east] = x[STATE.north], x[STATE.east]
    ahead, right = known[KNOWN.ground_ahead], known[KNOWN.ground_right]
    moves = abs(ahead) > STANDSTILL or abs(right) > STANDSTILL
    si[QUANTITY.track] = _wrapped(heading + math.atan2(right, ahead)) if moves else si[QUANTITY.heading]
    si[QUANTITY.flapping_right] = _flapping(x, 1.0)
    si[QUANTITY.flapping_left] = _flapping(x, -1.0)
    si[QUANTITY.differential_longitudinal_flapping] = x[STATE.flap_1c_difference]
    si[QUANTITY.differential_lateral_flapping] = x[STATE.flap_1s_difference]
    si[QUANTITY.mast_torque_right] = y[OUTPUT.torque] + y[OUTPUT.torque_difference]
    si[QUANTITY.mast_torque_left] = y[OUTPUT.torque] - y[OUTPUT.torque_difference]
    si[QUANTITY.aileron] = x[STATE.aileron]
    si[QUANTITY.rudder] = x[STATE.rudder]
    si[QUANTITY.differential_collective] = x[STATE.collective_difference]
    si[QUANTITY.differential_cyclic] = x[STATE.cyclic_difference]
    si[QUANTITY.gust_v] = gusts[GUST.v]
    si[QUANTITY.gust_p] = gusts[GUST.p]
    si[QUANTITY.gust_r] = gusts[GUST.r]
    share = wind_share(tables.wind, x[STATE.altitude])
    towards_north, towards_east = wind_along(tables.wind, 0.0)
    si[QUANTITY.wind_north] = share * towards_north
    si[QUANTITY.wind_east] = share * towards_east
    reference = state.reference
    speed = max(reference[REFERENCE.airspeed], 0.0)
    si[QUANTITY.bank_reference] = math.atan(speed * reference[REFERENCE.turn_rate] / GRAVITY)
    si[QUANTITY.heading_reference] = _wrapped(reference[REFERENCE.heading])
    si[QUANTITY.lateral_reference] = reference[REFERENCE.lateral]
    si[QUANTITY.track_error] = beside_line(reference, x) if reference[REFERENCE.on_track] == ON_LINE else 0.0
    si[QUANTITY.point_error] = from_point(reference, x) if reference[REFERENCE.standing] != 0.0 else 0.0


@inner_kernel
def _flapping(x: FloatArray, side: float) -> float:
    """Magnitude of one rotor's flapping: 1 right, -1 left [rad]."""
    along = x[STATE.flap_1c] + side * x[STATE.flap_1c_difference]
    across = x[STATE.flap_1s] + side * x[STATE.flap_1s_difference]
    return math.sqrt(along**2 + across**2)


@inner_kernel
def _reckon_engines(flight: Flight, shaft: float) -> None:
    """Find the fuel left, what the engines burn, and what power they have.

    Args:
        shaft: Shaft power that they give [W].
    """
    tables, state, si = flight.tables, flight.state, flight.scratch.si
    engine, fuel = tables.engine, state.tank[TANK.fuel]
    altitude = engine.ground + state.x[STATE.altitude]
    available = takeoff_power(engine, altitude)
    if state.faults[FAULT.engine] != 0.0:
        available = min(available, state.faults[FAULT.power])
    si[QUANTITY.fuel] = fuel
    si[QUANTITY.fuel_flow] = fuel_flow(engine, shaft, altitude) if fuel > 0.0 else 0.0
    si[QUANTITY.engine_power_available] = available / tables.drive.efficiency


@inner_kernel
def _ask(flight: Flight, time: float) -> None:
    """Fill what the pilot is asked for: filtered airspeed and its rate, altitude and climb rate, nacelle rate."""
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    target, programme = scratch.target, tables.programme
    now, now_share = programme_at(programme, time)
    end, end_share = programme_at(programme, time + tables.dt)
    scratch.si[QUANTITY.airspeed_command] = programmed(programme, PROGRAMME.airspeed, now, now_share)
    scratch.known[KNOWN.airspeed_ahead] = programmed(programme, PROGRAMME.airspeed, end, end_share)
    target[TARGET.airspeed] = state.reference[REFERENCE.airspeed]
    target[TARGET.airspeed_rate] = state.reference[REFERENCE.rate]
    target[TARGET.altitude] = programmed(programme, PROGRAMME.altitude, now, now_share)
    ahead = programmed(programme, PROGRAMME.altitude, end, end_share)
    target[TARGET.climb_rate] = (ahead - target[TARGET.altitude]) / tables.dt
    wanted = programmed(programme, PROGRAMME.nacelle, end, end_share)
    wanted_rate = (wanted - state.nacelle[0]) / tables.dt
    if tables.automatic.active != 0:
        wanted_rate = call_at(flight.parts[PART.automatic_rate], flight)
    target[TARGET.nacelle_rate] = nacelle_assigned_rate(tables.nacelle, wanted_rate)
    if tables.plant.lateral != 0:
        _ask_sideways(flight, now, now_share)


@inner_kernel
def _ask_sideways(flight: Flight, low: int, share: float) -> None:
    """Fill what the pilot's lateral half is asked for, and the load factor of the turn for the other half."""
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    asked = turn_wanted(tables.programme, low, share)
    for k in range(len(asked)):
        scratch.known[KNOWN.asked + k] = asked[k]
    fill_wanted(state.reference, asked, state.x, scratch.known[KNOWN.wind_right], scratch.wanted)
    slope = max(scratch.wanted[WANTED.airspeed], 0.0) * _turn_flown(flight) / GRAVITY
    scratch.target[TARGET.turn_excess] = math.sqrt(1.0 + slope * slope) - 1.0


@inner_kernel
def _turn_flown(flight: Flight) -> float:
    """Turn rate that the pilot's symmetric half reckons with [rad/s]: the one asked for.

    Where a law takes the lateral stick, he feels it, and reckons with no more than that of the bank he sees.
    """
    state = flight.state
    asked = state.reference[REFERENCE.turn_rate]
    limited = state.protection[LAW.lateral_cause] != 0.0 or not math.isnan(state.held[CHANNEL.lateral_stick])
    if not limited or asked == 0.0:
        return float(asked)
    speed = max(state.reference[REFERENCE.airspeed], 1.0)
    there = GRAVITY * math.tan(min(max(state.x[STATE.bank], -LARGEST_TURN), LARGEST_TURN)) / speed
    return float(min(max(there, 0.0), asked) if asked > 0.0 else max(min(there, 0.0), asked))


@inner_kernel
def _see(flight: Flight, airspeed: float) -> None:
    """Fill what pilots and laws are shown: indicated airspeed, its margins, and the state shifted to agree with it.

    The shift, gusts from ahead and from the side among it, is along the horizon, so that the climb rate computed from
    the seen state stays the true one.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    x, seen, shown = state.x, scratch.seen, scratch.shown
    error = fault_airspeed_error(state.faults, airspeed)
    shown[0] = airspeed + error
    if error == 0.0:
        for k in range(scratch.margins.shape[0]):
            shown[1 + k] = scratch.margins[k]
    else:
        excess = turn_excess(x[STATE.bank])
        corridor_margins(tables.corridor, shown[0], scratch.motion[MOTION.angle], excess, shown[1:])
    for k in range(x.shape[0]):
        seen[k] = x[k]
    shift = state.gusts[GUST.ahead] + error
    right = state.gusts[GUST.right]
    if shift != 0.0 or right != 0.0:
        upright = shift * math.sin(x[STATE.pitch])
        sine, cosine = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
        seen[STATE.u] += shift * math.cos(x[STATE.pitch])
        seen[STATE.v] += upright * sine + right * cosine
        seen[STATE.w] += upright * cosine - right * sine
    if x[STATE.bank] != 0.0:
        # Airspeed and climb are read in the vertical plane, whatever the bank; of the pitch rate what the turn that is
        # asked for does not need.
        sine, cosine = math.sin(x[STATE.bank]), math.cos(x[STATE.bank])
        seen[STATE.w] = seen[STATE.v] * sine + seen[STATE.w] * cosine
        seen[STATE.q] = x[STATE.q] - _turn_flown(flight) * math.cos(x[STATE.pitch]) * sine


@inner_kernel
def sense(flight: Flight) -> None:
    """Give what pilots and laws may know, as the work space's ``sensors``. SI.

    Args:
        flight: The flight as ``observe`` left it.
    """
    si, sensors = flight.scratch.si, flight.scratch.sensors
    sensors[SENSOR.time] = si[QUANTITY.time]
    sensors[SENSOR.airspeed] = si[QUANTITY.airspeed_indicated]
    sensors[SENSOR.airspeed_rate] = si[QUANTITY.airspeed_rate]
    sensors[SENSOR.nacelle_angle] = si[QUANTITY.nacelle]
    sensors[SENSOR.nacelle_rate] = si[QUANTITY.nacelle_rate]
    sensors[SENSOR.pitch] = si[QUANTITY.pitch]
    sensors[SENSOR.pitch_rate] = si[QUANTITY.pitch_rate]
    sensors[SENSOR.flight_path_angle] = si[QUANTITY.flight_path]
    sensors[SENSOR.altitude] = si[QUANTITY.altitude]
    sensors[SENSOR.climb_rate] = si[QUANTITY.climb_rate]
    sensors[SENSOR.load_factor] = si[QUANTITY.load_factor]
    sensors[SENSOR.mast_torque] = si[QUANTITY.mast_torque]
    sensors[SENSOR.flapping] = si[QUANTITY.flapping]
    sensors[SENSOR.on_downstop] = si[QUANTITY.on_downstop]
    sensors[SENSOR.nacelle_ok] = 1.0 if fault_nacelle_ok(flight.state.faults) else 0.0
    sensors[SENSOR.bank] = si[QUANTITY.bank]
    sensors[SENSOR.roll_rate] = si[QUANTITY.roll_rate]
    sensors[SENSOR.yaw_rate] = si[QUANTITY.yaw_rate]
    sensors[SENSOR.heading] = si[QUANTITY.heading]
    sensors[SENSOR.sideslip] = si[QUANTITY.sideslip]
    sensors[SENSOR.lateral_velocity] = si[QUANTITY.lateral]
    sensors[SENSOR.lateral_acceleration] = si[QUANTITY.lateral_acceleration]
    sensors[SENSOR.north] = si[QUANTITY.north]
    sensors[SENSOR.east] = si[QUANTITY.east]
    sensors[SENSOR.flapping_left] = si[QUANTITY.flapping_left]
    sensors[SENSOR.flapping_right] = si[QUANTITY.flapping_right]
    sensors[SENSOR.mast_torque_left] = si[QUANTITY.mast_torque_left]
    sensors[SENSOR.mast_torque_right] = si[QUANTITY.mast_torque_right]
