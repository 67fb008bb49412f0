"""The frame after its observation, stage by stage in the order it runs; ``frame_kernels.advance`` lists them.

Each stage takes the whole flight and reads and writes what its first line says. A command passes the stations
``pilot``, ``hands``, ``aided``, ``protected`` and ``acting`` (``STATION``); each stage moves it on by one.
"""

from __future__ import annotations

import math

from rtsim.aids.aids_kernels import AUTOMATIC_FLAPS, AUTOMATIC_ROTOR_SPEED, GOVERNOR, MEMORY
from rtsim.aircraft.motion_kernels import moves_sideways
from rtsim.aircraft.variables import INPUT, OUTPUT, STATE
from rtsim.arrays import FloatArray
from rtsim.atmosphere.gust_kernels import GUST
from rtsim.atmosphere.wind_kernels import level_motion, level_speed, meet_wind, over_ground, wind_along, wind_share
from rtsim.corridor.corridor_kernels import corridor_level_step
from rtsim.faults.fault_kernels import FAULT, fault_controls, fault_nacelle_rate
from rtsim.frame import COLUMN, QUANTITY
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.parts import call_at
from rtsim.kernels.ramp_filter_kernels import critically_damped_ramp
from rtsim.loop.data import CHANNEL, CLOCK, END, HELD, KNOWN, MODE, MOTION, PART, PROGRAMME, REFERENCE, STATION, Flight
from rtsim.loop.lateral_reference_kernels import move_lateral_reference, stand_still
from rtsim.loop.observe_kernels import programme_at, programmed
from rtsim.nacelle.automatic_kernels import scheduled_angle
from rtsim.nacelle.nacelle_kernels import nacelle_advance, nacelle_assigned_rate, nacelle_effective_rate, nacelle_path
from rtsim.pilot.lateral_kernels import WANTED
from rtsim.pilot.layout_kernels import S_FILTERED, TARGET
from rtsim.protection import law_data as law
from rtsim.protection.law_kernels import law_apply, law_due
from rtsim.systems.drive_kernels import (
    HELD_OFFSET,
    LOCKED,
    drive_advance,
    engine_power,
    held_advance,
    held_moves,
    rotor_speed_now,
)
from rtsim.systems.engine_kernels import burn
from rtsim.systems.flap_kernels import flap_advance
from rtsim.systems.ground_kernels import touches
from rtsim.units import DEGREE, HORSEPOWER, KNOT

GENTLE_SINK_RATE, HARD_SINK_RATE = 1.5, 3.0
"""Sink rates at touchdown up to which a landing counts as gentle or as hard [m/s]; beyond it is a crash. Ours: about
300 and 600 ft/min, the usual normal and limit touchdown rates of helicopters (14 CFR 29.725 drops at 6.5 ft/s)."""
LANDING_PITCH = LANDING_BANK = 15.0 * DEGREE
LANDING_NACELLE = 60.0 * DEGREE
"""Below this nacelle angle the proprotors (12.5 ft radius) would strike the ground."""
LANDING_SPEED = 60.0 * KNOT
LARGEST_PITCH = 80.0 * DEGREE
LARGEST_BANK = 120.0 * DEGREE
"""Ours: on its side it still flies; the model knows nothing of flight on the back."""
_SPARE_S = 1.0
"""The rotors are back at full speed this long before the programme moves the nacelles [s]."""


@inner_kernel
def ask(flight: Flight) -> None:
    """Let the pilot give a command: the MOCM, or else the controls stay as they are. Writes ``pilot`` and ``hands``.

    Args:
        flight: The flight as ``observe`` left it; its state does not change.
    """
    tables, state, command = flight.tables, flight.state, flight.scratch.command
    pilot = command[STATION.pilot]
    if state.clock[CLOCK.mode] == MODE.mocm:
        call_at(flight.parts[PART.ask], flight)
        if flight.parts[PART.ask_lateral] != 0 and lateral_awake(flight):
            call_at(flight.parts[PART.ask_lateral], flight, tables.lateral_pilot)
    else:
        pilot[CHANNEL.stick] = state.u[INPUT.stick]
        pilot[CHANNEL.lever] = state.u[INPUT.lever]
        pilot[CHANNEL.nacelle_rate] = 0.0
        pilot[CHANNEL.lateral_stick] = state.u[INPUT.lateral_stick]
        pilot[CHANNEL.pedal] = state.u[INPUT.pedal]
    for channel in range(CHANNEL.size):
        command[STATION.hands, channel] = pilot[channel]


@inner_kernel
def lateral_wakes(flight: Flight) -> bool:
    """Whether the pilot's lateral half may have something to do in the frame that begins.

    Args:
        flight: The flight at the start of a frame.
    """
    tables, state = flight.tables, flight.state
    if tables.plant.lateral == 0:
        return False
    return tables.lateral_noise != 0 or tables.lateral_asked != 0 or moves_sideways(state.x, state.u)


@inner_kernel
def lateral_awake(flight: Flight) -> bool:
    """Whether the pilot's lateral half has anything to do: else it gives zero, as it would, without being asked.

    Args:
        flight: The flight as ``observe`` left it.
    """
    state, scratch = flight.state, flight.scratch
    if flight.tables.lateral_noise != 0 or moves_sideways(state.x, state.u):
        return True
    wanted = scratch.wanted
    if wanted[WANTED.turn_rate] != 0.0 or wanted[WANTED.turn_jerk] != 0.0 or wanted[WANTED.lateral_velocity] != 0.0:
        return True
    if wanted[WANTED.lateral_acceleration] != 0.0 or wanted[WANTED.heading] != state.x[STATE.heading]:
        return True
    awake = wanted[WANTED.turn_acceleration] != 0.0
    for k in range(S_FILTERED + 1, state.lateral_pilot.shape[0]):
        awake = awake or state.lateral_pilot[k] != 0.0
    return awake


@inner_kernel
def follow_script(flight: Flight) -> None:
    """Let scripted hands change the pilot's command, where there are any. Writes ``pilot`` and ``hands``.

    Args:
        flight: The flight as ``ask`` left it.
    """
    if flight.parts[PART.script] != 0:
        command = flight.scratch.command
        call_at(flight.parts[PART.script], flight)
        for channel in range(CHANNEL.size):
            command[STATION.hands, channel] = command[STATION.pilot, channel]


@inner_kernel
def aid(flight: Flight) -> None:
    """Limit ``hands`` to the travel and let the pilot aids act on them. Writes ``aided``.

    Args:
        flight: The flight as ``observe`` left it.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    hands, aided = scratch.command[STATION.hands], scratch.command[STATION.aided]
    hands[CHANNEL.stick] = min(max(hands[CHANNEL.stick], -1.0), 1.0)
    hands[CHANNEL.lever] = min(max(hands[CHANNEL.lever], 0.0), 1.0)
    hands[CHANNEL.lateral_stick] = min(max(hands[CHANNEL.lateral_stick], -1.0), 1.0)
    hands[CHANNEL.pedal] = min(max(hands[CHANNEL.pedal], -1.0), 1.0)
    if state.clock[CLOCK.mode] != MODE.external:
        # Held controls are what acted last, aids included: a second helping would run them away.
        aided[CHANNEL.stick], aided[CHANNEL.lever] = hands[CHANNEL.stick], hands[CHANNEL.lever]
        _take_over(flight, CHANNEL.lateral_stick, INPUT.lateral_stick, MEMORY.lateral_offset)
        _take_over(flight, CHANNEL.pedal, INPUT.pedal, MEMORY.pedal_offset)
        # Whoever takes over later finds the aids to be engaged anew.
        state.aids[MEMORY.last_switches] = -1.0
    else:
        aided[CHANNEL.stick], aided[CHANNEL.lever] = state.u[INPUT.stick], state.u[INPUT.lever]
        aided[CHANNEL.lateral_stick], aided[CHANNEL.pedal] = state.u[INPUT.lateral_stick], state.u[INPUT.pedal]
        call_at(flight.parts[PART.aids], flight)
    if tables.automatic.active != 0:
        aided[CHANNEL.nacelle_rate] = scratch.target[TARGET.nacelle_rate]
    else:
        aided[CHANNEL.nacelle_rate] = nacelle_assigned_rate(tables.nacelle, hands[CHANNEL.nacelle_rate])


@inner_kernel
def _take_over(flight: Flight, channel: int, place: int, memory: int) -> None:
    """Pass a lateral channel on; what acted when its pilot took over fades into what this pilot gives."""
    state, command = flight.state, flight.scratch.command
    given = command[STATION.hands, channel]
    if math.isnan(state.aids[memory]):
        state.aids[memory] = state.u[place] - given
    offset = state.aids[memory]
    if state.clock[CLOCK.mode] == MODE.hold:
        offset = 0.0
    command[STATION.aided, channel] = min(max(given + offset, -1.0), 1.0)
    state.aids[memory] = offset - flight.tables.dt / flight.tables.aids.fade_time * offset


@inner_kernel
def protect(flight: Flight) -> None:
    """Let the compiled law limit ``aided``. Writes ``protected``, and notes what was changed.

    Args:
        flight: The flight; the law's state is updated.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    aided, limited = scratch.command[STATION.aided], scratch.command[STATION.protected]
    if law_due(tables.protection, state.protection, int(state.clock[CLOCK.frame])):
        call_at(flight.parts[PART.decide], flight)
    law_apply(tables.protection, state.protection, aided, limited)
    law_state, si = state.protection, scratch.si
    causes = (law_state[law.LAW.stick_cause], law_state[law.LAW.lever_cause], law_state[law.LAW.rate_cause])
    _note_change(flight, causes, (law_state[law.LAW.lateral_cause], law_state[law.LAW.pedal_cause]))
    si[QUANTITY.time_to_limit] = law_state[law.LAW.time]


@inner_kernel
def _note_change(flight: Flight, causes: tuple[float, float, float], lateral: tuple[float, float]) -> None:
    """Note what the protection changed, and the limits behind it."""
    si, command = flight.scratch.si, flight.scratch.command
    aided, limited = command[STATION.aided], command[STATION.protected]
    si[QUANTITY.protection_stick] = limited[CHANNEL.stick] - aided[CHANNEL.stick]
    si[QUANTITY.protection_lever] = limited[CHANNEL.lever] - aided[CHANNEL.lever]
    si[QUANTITY.protection_nacelle_rate] = limited[CHANNEL.nacelle_rate] - aided[CHANNEL.nacelle_rate]
    si[QUANTITY.protection_lateral_stick] = limited[CHANNEL.lateral_stick] - aided[CHANNEL.lateral_stick]
    si[QUANTITY.protection_pedal] = limited[CHANNEL.pedal] - aided[CHANNEL.pedal]
    si[QUANTITY.protection_stick_reason] = causes[0]
    si[QUANTITY.protection_lever_reason] = causes[1]
    si[QUANTITY.protection_nacelle_reason] = causes[2]
    si[QUANTITY.protection_lateral_stick_reason] = lateral[0]
    si[QUANTITY.protection_pedal_reason] = lateral[1]


@inner_kernel
def hold(flight: Flight) -> None:
    """Put what laws in Python hold in the place of ``protected``, and note it.

    Args:
        flight: The flight as ``protect`` left it.
    """
    state, scratch = flight.state, flight.scratch
    held = state.held
    if state.protection[law.LAW.override] != 0.0:
        return
    limited = scratch.command[STATION.protected]
    holds = False
    for channel in range(CHANNEL.size):
        if not math.isnan(held[channel]):
            limited[channel] = held[channel]
            holds = True
    if holds:
        reasons = held[HELD.reason :]
        _note_change(flight, (reasons[0], reasons[1], reasons[2]), (reasons[3], reasons[4]))


@inner_kernel
def fail(flight: Flight) -> None:
    """Let ``protected`` act as far as failed and limited nacelles, and jammed controls, let it. Writes ``acting``.

    Args:
        flight: The flight as ``protect`` left it.
    """
    tables, state = flight.tables, flight.state
    protected, acting = flight.scratch.command[STATION.protected], flight.scratch.command[STATION.acting]
    acting[CHANNEL.stick], acting[CHANNEL.lever] = protected[CHANNEL.stick], protected[CHANNEL.lever]
    acting[CHANNEL.lateral_stick], acting[CHANNEL.pedal] = protected[CHANNEL.lateral_stick], protected[CHANNEL.pedal]
    wanted = protected[CHANNEL.nacelle_rate]
    if state.drive[HELD_OFFSET] != 0.0:  # the nacelles stay on the downstop until the rotors are back at full speed
        wanted = min(wanted, 0.0)
    rate = fault_nacelle_rate(state.faults, wanted)
    acting[CHANNEL.nacelle_rate] = nacelle_effective_rate(tables.nacelle, state.nacelle, rate, tables.dt)
    if faults_act(flight):
        fault_controls(state.faults, acting)


@inner_kernel
def record(flight: Flight) -> None:
    """Add the command and what came of it, and write the row: the one place where SI ends.

    Args:
        flight: The flight with its command at all stations; the corridor's levels are advanced.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    si, row = scratch.si, scratch.row
    pilot, acting = scratch.command[STATION.pilot], scratch.command[STATION.acting]
    margin = min(scratch.margins[0], scratch.margins[1])
    controls = tables.plant.controls
    stick, lever = acting[CHANNEL.stick], acting[CHANNEL.lever]
    cyclic_stop = abs(state.x[STATE.cyclic_1s]) >= controls.cyclic_limit * (1.0 - 1e-9)
    elevator_stop = abs(state.x[STATE.elevator]) >= controls.elevator_limit * (1.0 - 1e-9)
    stick_stop = abs(stick) >= 1.0 or abs(acting[CHANNEL.lateral_stick]) >= 1.0 or abs(acting[CHANNEL.pedal]) >= 1.0
    lever_stop = lever <= 0.0 or lever >= 1.0
    si[QUANTITY.stick] = stick
    si[QUANTITY.lever] = lever
    si[QUANTITY.pilot_stick] = pilot[CHANNEL.stick]
    si[QUANTITY.pilot_lever] = pilot[CHANNEL.lever]
    si[QUANTITY.pilot_nacelle_rate] = pilot[CHANNEL.nacelle_rate]
    si[QUANTITY.lateral_stick] = acting[CHANNEL.lateral_stick]
    si[QUANTITY.pedal] = acting[CHANNEL.pedal]
    si[QUANTITY.pilot_lateral_stick] = pilot[CHANNEL.lateral_stick]
    si[QUANTITY.pilot_pedal] = pilot[CHANNEL.pedal]
    si[QUANTITY.nacelle_command_rate] = acting[CHANNEL.nacelle_rate]
    si[QUANTITY.corridor_level] = float(corridor_level_step(tables.corridor, margin, tables.dt, state.level))
    si[QUANTITY.control_on_stop] = 1.0 if stick_stop or lever_stop or cyclic_stop or elevator_stop else 0.0
    for column in range(row.shape[0]):
        row[column] = si[column] / tables.units[column]
    # Divided in this order since the first history; the other order differs in the last bit.
    shaft = engine_power(state.drive, si[QUANTITY.power])
    row[COLUMN.engine_power_shp] = shaft / HORSEPOWER / tables.drive.efficiency


@inner_kernel
def move_pilot(flight: Flight, normals: FloatArray) -> None:
    """Move the MOCM and the automatic nacelles to the next frame, knowing the controls that act.

    Args:
        flight: The flight with its command at all stations.
        normals: Standard normals of the pilot's noise; none: no noise.
    """
    if flight.state.clock[CLOCK.mode] == MODE.mocm:
        tables, state = flight.tables, flight.state
        own = tables.pilot.roles.displays + tables.pilot.roles.hands
        noisy = normals.shape[0] > 0
        call_at(flight.parts[PART.advance], flight, normals[:own] if noisy else normals)
        if tables.plant.lateral != 0:
            if flight.parts[PART.advance_lateral] != 0 and lateral_awake(flight):
                rest = normals[own:] if noisy else normals
                call_at(flight.parts[PART.advance_lateral], flight, tables.lateral_pilot, rest)
            else:
                state.lateral_pilot[S_FILTERED] = flight.scratch.shown[0]
    if flight.tables.automatic.active != 0:
        call_at(flight.parts[PART.automatic_advance], flight)


@inner_kernel
def move_plant(flight: Flight) -> None:
    """Move flaps, rotor drive, aircraft, nacelles and the place over the ground over the frame.

    Args:
        flight: The flight with its command at all stations.
    """
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    x, u, dt = state.x, state.u, tables.dt
    acting = scratch.command[STATION.acting]
    rate = acting[CHANNEL.nacelle_rate]
    nacelle_path(tables.nacelle, state.nacelle, rate, dt, scratch.path)
    u[INPUT.stick] = acting[CHANNEL.stick]
    u[INPUT.lever] = acting[CHANNEL.lever]
    u[INPUT.lateral_stick] = acting[CHANNEL.lateral_stick]
    u[INPUT.pedal] = acting[CHANNEL.pedal]
    failing = faults_act(flight)
    if failing:
        call_at(flight.parts[PART.fail], flight)
    if state.drive[HELD_OFFSET] != 0.0 and tables.drive.held_acts == 0.0:
        for row in range(3):
            scratch.path[row, 0] = scratch.known[KNOWN.place]
    _turn_systems(flight)
    heading = x[STATE.heading]  # not that of the row, to a whole turn: flights mirror to the last bit
    state.clock[CLOCK.flags] = call_at(
        flight.parts[PART.step], tables.plant.aircraft, x, u, scratch.path, dt, scratch.work
    )
    if failing:
        call_at(flight.parts[PART.failed], flight)
    if tables.wind.reference_height != 0.0:
        meet_wind(tables.wind, x, scratch.si[QUANTITY.altitude])
    _move_place(flight, heading)
    nacelle_advance(tables.nacelle, state.nacelle, rate, dt)


@inner_kernel
def _move_place(flight: Flight, heading: float) -> None:
    """Move the place over the ground and the distance flown, by the mean of the motion before and after the step.

    Args:
        flight: The flight after the step of its plant.
        heading: Heading before it [rad].
    """
    tables, state, known = flight.tables, flight.state, flight.scratch.known
    x, dt = state.x, tables.dt
    through, sideways, _ = level_motion(x)
    share = wind_share(tables.wind, x[STATE.altitude])
    along, across = wind_along(tables.wind, x[STATE.heading])
    wind, right = share * along, sideways + share * across
    before_ahead, before_right = known[KNOWN.ground_ahead], known[KNOWN.ground_right]
    if before_right == 0.0 and right == 0.0:
        # Air and wind apart: so the distance of straight flights is what it has always been to the last bit.
        mean = 0.5 * (known[KNOWN.airspeed_in_air] + through) + 0.5 * (known[KNOWN.wind] + wind)
    else:
        mean = 0.5 * (level_speed(before_ahead, before_right) + level_speed(through + wind, right))
    state.clock[CLOCK.distance] += dt * mean
    sine, cosine = math.sin(heading), math.cos(heading)
    north, east = before_ahead * cosine - before_right * sine, before_ahead * sine + before_right * cosine
    sine, cosine = math.sin(x[STATE.heading]), math.cos(x[STATE.heading])
    north += (through + wind) * cosine - right * sine
    east += (through + wind) * sine + right * cosine
    x[STATE.north] += dt * 0.5 * north
    x[STATE.east] += dt * 0.5 * east


@inner_kernel
def _turn_systems(flight: Flight) -> None:
    """Move flaps and rotor speed to the next frame; the inputs of this one stay as ``observe`` set them."""
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    automatic, governed = state.switches[AUTOMATIC_FLAPS] != 0.0, state.switches[GOVERNOR] != 0.0
    flap_advance(tables.flaps, state.flaps, automatic, scratch.known[KNOWN.flap], tables.dt)
    torque = 2.0 * scratch.y[OUTPUT.torque]
    lever = scratch.command[STATION.acting, CHANNEL.lever]
    available = state.faults[FAULT.power] if state.faults[FAULT.engine] != 0.0 else tables.drive.power[-1]
    drive_advance(tables.drive, state.drive, governed, torque, lever, available, tables.dt)
    lowers = state.switches[AUTOMATIC_ROTOR_SPEED] != 0.0
    if tables.drive.slow_offset != 0.0 and (lowers or held_moves(state.drive)):
        angle = scratch.motion[MOTION.angle]
        held_advance(tables.drive, state.drive, lowers, angle, _nacelles_leave(flight), tables.dt)


@inner_kernel
def _nacelles_leave(flight: Flight) -> bool:
    """Whether somebody asks the nacelles off the downstop, or is to do so before the rotors would be back up."""
    tables, state, scratch = flight.tables, flight.state, flight.scratch
    if scratch.command[STATION.protected, CHANNEL.nacelle_rate] > 0.0:
        return True
    drive = tables.drive
    ahead = -drive.slow_offset / drive.change_rate + _SPARE_S
    if tables.automatic.active != 0:
        airspeed = scratch.shown[0] + ahead * min(scratch.y[OUTPUT.airspeed_rate], 0.0)
        return scheduled_angle(tables.automatic, airspeed) > LOCKED
    if state.clock[CLOCK.mode] != MODE.mocm:
        return False
    programme, now = tables.programme, state.clock[CLOCK.frame] * tables.dt
    low, share = programme_at(programme, now + ahead)
    leaves = programmed(programme, PROGRAMME.nacelle, low, share) > LOCKED
    for point in range(programme.shape[1]):
        within = now <= programme[PROGRAMME.time, point] <= now + ahead
        leaves = leaves or (within and programme[PROGRAMME.nacelle, point] > LOCKED)
    return leaves


@inner_kernel
def move_reference(flight: Flight) -> None:
    """Move the filtered airspeed reference and the frame number on."""
    tables, state, scratch, dt = flight.tables, flight.state, flight.scratch, flight.tables.dt
    wanted = scratch.si[QUANTITY.airspeed_command]
    slope = (scratch.known[KNOWN.airspeed_ahead] - wanted) / dt
    known = scratch.known
    if tables.plant.lateral != 0:
        wanted += stand_still(state.reference, known[KNOWN.asked + 3], state.x, wanted + known[KNOWN.wind])
    value, value_rate, _ = critically_damped_ramp(
        tables.reference_frequency,
        wanted,
        slope,
        state.reference[REFERENCE.airspeed],
        state.reference[REFERENCE.rate],
        dt,
    )
    state.reference[REFERENCE.airspeed] = value
    state.reference[REFERENCE.rate] = value_rate
    if tables.plant.lateral != 0:
        asked = known[KNOWN.asked], known[KNOWN.asked + 1], known[KNOWN.asked + 2], known[KNOWN.asked + 3]
        move_lateral_reference(state.reference, asked, state.x, known[KNOWN.wind_right], dt)
    state.clock[CLOCK.frame] += 1.0


@inner_kernel
def faults_act(flight: Flight) -> bool:
    """Whether this flight has failures, scheduled or thrown in."""
    return flight.tables.faults.schedule.shape[0] > 0 or flight.state.clock[CLOCK.faults] != 0.0


@inner_kernel
def disturb(flight: Flight, elapsed: float, normals: FloatArray) -> None:
    """Bring gusts and failures to the start of the present frame.

    Args:
        flight: The flight; gusts and failures are changed, and by a jam the conversion actuator's command.
        elapsed: Length of the frame before; 0 at the start of the flight [s].
        normals: Standard normals of the air; not read where there is no turbulence.
    """
    if flight.state.gusts[GUST.busy] != 0.0:
        call_at(flight.parts[PART.air], flight, elapsed, normals)
    if faults_act(flight):
        call_at(flight.parts[PART.faults], flight)


@inner_kernel
def burn_fuel(flight: Flight) -> None:
    """Take what the engines burned in this frame from the tanks; with nothing left they stop, for good.

    Args:
        flight: The flight with the failures of the next frame, which mend no engine that has no fuel.
    """
    state = flight.state
    if burn(state.tank, flight.scratch.si[QUANTITY.fuel_flow], flight.tables.dt):
        state.faults[FAULT.engine], state.faults[FAULT.power] = 1.0, 0.0
        state.clock[CLOCK.faults] = 1.0


@inner_kernel
def judge_end(flight: Flight) -> None:
    """Note whether the flight is over, and how; a landing is judged by sink rate, attitude, speed and rotor clearance.

    Args:
        flight: The flight at the start of the next frame.
    """
    flight.state.clock[CLOCK.end] = _end_code(flight)


@inner_kernel
def _end_code(flight: Flight) -> int:
    tables, state = flight.tables, flight.state
    x, drive = state.x, tables.drive
    for i in range(x.shape[0]):
        if not math.isfinite(x[i]):
            return END.not_finite
    pitch, bank = x[STATE.pitch], x[STATE.bank]
    stands = tables.ground.active != 0.0
    if touches(tables.ground, x) if stands else x[STATE.altitude] < 0.0:
        sink = -level_motion(x)[2]
        state.clock[CLOCK.sink] = sink
        ahead, right = over_ground(tables.wind, x)
        level = abs(pitch) <= LANDING_PITCH and abs(bank) <= LANDING_BANK
        slow = abs(level_speed(ahead, right)) <= LANDING_SPEED
        upright = level and slow and state.nacelle[1] >= LANDING_NACELLE
        if sink > (tables.ground.most_sink if stands else HARD_SINK_RATE) or not (upright or stands):
            return END.crash
        if not upright:
            return END.aground
        if not stands:
            return END.gentle_landing if sink <= GENTLE_SINK_RATE else END.hard_landing
    rotor_speed = rotor_speed_now(drive, state.drive)
    if rotor_speed > drive.highest:
        return END.rotors_fast
    if not rotor_speed >= drive.lowest:
        return END.rotors_slow
    if abs(bank) > LARGEST_BANK:
        return END.bank
    return END.attitude if abs(pitch) > LARGEST_PITCH else END.none
