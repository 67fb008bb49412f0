"""The parts of a frame that are compiled on their own (``rtsim.loop.data.PART``), each for where it flies."""

from __future__ import annotations

import math

from rtsim.aids.aids_kernels import GOVERNOR, aids_airspeed, aids_step
from rtsim.aids.lateral_aids_kernels import lateral_aids_step
from rtsim.aircraft.variables import OUTPUT, STATE
from rtsim.aircraft.xv15.dynamics_kernels import flap_schedule
from rtsim.arrays import FloatArray
from rtsim.atmosphere.gust_kernels import GUST, gust_step
from rtsim.atmosphere.wind_kernels import level_motion
from rtsim.faults.actuator_kernels import fault_actuators_begin, fault_actuators_end
from rtsim.faults.fault_kernels import fault_update
from rtsim.kernels.compiled import part
from rtsim.loop import script_kernels as script
from rtsim.loop.data import CHANNEL, CLOCK, KNOWN, MOTION, STATION, Flight
from rtsim.nacelle.automatic_kernels import automatic_advance, automatic_rate
from rtsim.pilot.lateral_kernels import LateralPilotTables, lateral_advance_in, lateral_output_in
from rtsim.pilot.layout_kernels import TARGET
from rtsim.pilot.pilot_kernels import mocm_advance_in, mocm_output_in
from rtsim.protection.law_data import LAW
from rtsim.protection.law_kernels import law_decide, law_watch
from rtsim.systems.drive_kernels import governor_power, rotor_speed_now
from rtsim.systems.flap_kernels import flap_now, flap_parts


@part
def ask_mocm(flight: Flight) -> float:
    """The MOCM's command as the station ``pilot``; changes no state.

    Args:
        flight: The flight as ``observe`` left it.
    """
    scratch = flight.scratch
    command = scratch.command[STATION.pilot]
    angle = scratch.known[KNOWN.place]
    mocm_output_in(flight.tables.pilot, flight.state.pilot, angle, scratch.target, command, scratch.pilot)
    command[CHANNEL.nacelle_rate] = scratch.target[TARGET.nacelle_rate]
    # Its lateral half gives these, where the aircraft rolls and anything does.
    command[CHANNEL.lateral_stick] = command[CHANNEL.pedal] = 0.0
    return 0.0


@part
def advance_mocm(flight: Flight, normals: FloatArray) -> float:
    """Move the MOCM to the next frame.

    Args:
        flight: The flight with its command at all stations.
        normals: Standard normals of its noise; none: no noise.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    scalars = (scratch.known[KNOWN.place], scratch.motion[MOTION.rate], tables.dt)
    acting = scratch.command[STATION.protected]
    mocm_advance_in(tables.pilot, state.pilot, scratch.seen, scalars, scratch.target, acting, normals, scratch.pilot)
    return 0.0


@part
def ask_lateral(flight: Flight, pilot: LateralPilotTables) -> float:
    """Lateral stick and pedals of the MOCM as the station ``pilot``; changes no state.

    Args:
        flight: The flight as ``observe`` left it.
        pilot: Its lateral half.
    """
    scratch = flight.scratch
    hands = scratch.command[STATION.pilot, CHANNEL.lateral_stick : CHANNEL.pedal + 1]
    angle, pitch = scratch.known[KNOWN.place], flight.state.x[STATE.pitch]
    lateral_output_in(pilot, flight.state.lateral_pilot, scratch.wanted, angle, pitch, hands, scratch.lateral_pilot)
    return 0.0


@part
def advance_lateral(flight: Flight, pilot: LateralPilotTables, normals: FloatArray) -> float:
    """Move the MOCM's lateral half to the next frame.

    Args:
        flight: The flight with its command at all stations.
        pilot: Its lateral half.
        normals: Standard normals of its noise; none: no noise.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    seen = scratch.seen
    gust = seen[STATE.v] - state.x[STATE.v]
    scalars = (scratch.known[KNOWN.place], scratch.shown[0], gust, tables.dt)
    acting = scratch.command[STATION.protected, CHANNEL.lateral_stick : CHANNEL.pedal + 1]
    work = scratch.lateral_pilot
    lateral_advance_in(pilot, state.lateral_pilot, state.x, scalars, scratch.wanted, acting, normals, work)
    return 0.0


@part
def watch_law(flight: Flight) -> float:
    """Decide as the law ``monitor`` does: look ahead and limit nothing.

    Args:
        flight: The flight with its sensors.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    state.protection[LAW.shift] = scratch.known[KNOWN.place] - scratch.motion[MOTION.angle]
    law_watch(tables.protection, state.protection, scratch.sensors, scratch.command[STATION.aided], scratch.law)
    return 0.0


@part
def decide_law(flight: Flight) -> float:
    """Decide as the law of the flight does.

    Args:
        flight: The flight with its sensors.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    state.protection[LAW.shift] = scratch.known[KNOWN.place] - scratch.motion[MOTION.angle]
    law_decide(tables.protection, state.protection, scratch.sensors, scratch.command[STATION.aided], scratch.law)
    return 0.0


@part
def act_aids(flight: Flight) -> float:
    """Turn ``hands`` into ``aided``, which holds the controls that acted last.

    Args:
        flight: The flight as ``observe`` left it.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    hands, aided = scratch.command[STATION.hands], scratch.command[STATION.aided]
    angle = scratch.motion[MOTION.angle]
    airspeed = aids_airspeed(state.aids, state.switches, scratch.seen)
    expected = flap_schedule(tables.plant.controls, airspeed, angle)
    flap_parts(tables.flaps, flap_now(state.flaps, scratch.known[KNOWN.flap]), expected, scratch.flaps)
    place = scratch.known[KNOWN.place]
    x, bank = state.x, state.x[STATE.bank]
    if bank != 0.0:  # the pitch rate that belongs to the turn is none to be damped
        scratch.seen[STATE.q] = x[STATE.q] - x[STATE.r] * math.sin(bank) / max(math.cos(bank), 0.5)
    lateral_aids_step(
        tables.lateral_aids, state.aids, state.switches, scratch.seen, place, airspeed, hands, aided, tables.dt
    )
    aids_step(
        tables.aids, state.aids, state.switches, scratch.seen, place, hands, scratch.flaps, aided, tables.dt
    )  # fmt: skip
    return 0.0


@part
def move_air(flight: Flight, elapsed: float, normals: FloatArray) -> float:
    """Move gusts and turbulence on.

    Args:
        elapsed: Length of the frame before [s].
        normals: Standard normals of the turbulence.
    """
    tables, state, x = flight.tables, flight.state, flight.state.x
    time = state.clock[CLOCK.frame] * tables.dt
    speed = math.sqrt(x[STATE.u] ** 2 + x[STATE.w] ** 2 + x[STATE.v] ** 2)
    attitude = (x[STATE.pitch], x[STATE.bank])
    gust_step(tables.gusts, state.gusts, speed, x[STATE.altitude], attitude, time, elapsed, normals)
    return 0.0


@part
def schedule_faults(flight: Flight) -> float:
    """Let the failures begin or end that are due now.

    Args:
        flight: The flight at the start of a frame.
    """
    tables, state, x = flight.tables, flight.state, flight.state.x
    time = state.clock[CLOCK.frame] * tables.dt
    airspeed = level_motion(x)[0] + state.gusts[GUST.ahead]
    fault_update(tables.faults, state.faults, time, x, state.u, state.nacelle, tables.nacelle.frequency, airspeed)
    return 0.0


@part
def fail_actuators(flight: Flight) -> float:
    """Prepare the plant's step for failed actuators and a limited engine.

    Args:
        flight: The flight before the step.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    acting = scratch.command[STATION.acting]
    torque = 2.0 * scratch.y[OUTPUT.torque]
    power = torque * rotor_speed_now(tables.drive, state.drive)
    # Where an engine fails, collective is taken off until the power suffices to bring the rotors back too.
    power = governor_power(tables.drive, state.drive, power)
    governed = state.switches[GOVERNOR] != 0.0
    fault_actuators_begin(
        tables.faults,
        state.faults,
        tables.plant.controls,
        state.x,
        (acting[CHANNEL.stick], acting[CHANNEL.lever]),
        scratch.path[1, 0],
        (power, governed),
        tables.dt,
        scratch.planned,
    )
    return 0.0


@part
def put_failed_actuators(flight: Flight) -> float:
    """Put failed actuators where they are after the plant's step.

    Args:
        flight: The flight after the step.
    """
    tables, state = flight.tables, flight.state
    fault_actuators_end(
        tables.faults, state.faults, state.x, tables.dt, flight.scratch.planned
    )  # fmt: skip
    return 0.0


@part
def rate_of_automatic_nacelle(flight: Flight) -> float:
    """Nacelle rate that the automatic nacelle control wants in this frame [rad/s].

    Args:
        flight: The flight as being observed.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    speed_rate = scratch.y[OUTPUT.airspeed_rate]
    shown, angle = scratch.shown[0], state.nacelle[0]
    return float(automatic_rate(tables.automatic, state.automatic, shown, speed_rate, angle, tables.dt))


@part
def advance_automatic_nacelle(flight: Flight) -> float:
    """Advance the automatic nacelle control.

    Args:
        flight: The flight with its command at all stations.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    speed_rate, rate = scratch.y[OUTPUT.airspeed_rate], scratch.command[STATION.acting, CHANNEL.nacelle_rate]
    automatic_advance(tables.automatic, state.automatic, scratch.shown[0], speed_rate, rate, tables.dt)
    return 0.0


@part
def act_script(flight: Flight) -> float:
    """Let scripted hands change the pilot's command.

    Args:
        flight: The flight as its pilot was asked.
    """
    tables, scratch = flight.tables, flight.scratch
    time = flight.state.clock[CLOCK.frame] * tables.dt
    script.script_command(tables.script.pulses, flight.state.script, time, scratch.command[STATION.pilot])
    return 0.0


@part
def notice_warning(flight: Flight) -> float:
    """Let a pilot who yields take notice of what he was shown and felt in the frame that is over.

    Args:
        flight: The flight at the start of the next frame.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    time = state.clock[CLOCK.frame] * tables.dt
    warned = script.warns(scratch.shown, scratch.row)
    script.script_notice(state.script, tables.script.reaction, time, warned, scratch.shown[0], state.reference)
    return 0.0
