"""One frame of the closed loop, compiled: observe, command, record, advance.

``observe`` fills what can be known at the start of a frame, ``pilot_command`` asks the built-in MOCM, ``advance``
passes the command through aids and protection, records it and moves everything to the next frame. ``run_frames`` is the
same three calls in a compiled loop, so that a flight stepped from Python and one run in a batch are equal bit for bit.
"""

from __future__ import annotations

import math

from rtsim.aids.aids_kernels import AUTOMATIC_FLAPS, GOVERNOR, LAST_SWITCHES, aids_airspeed, aids_step
from rtsim.aircraft.variables import INPUT, OUTPUT, STATE
from rtsim.aircraft.xv15.dynamics_kernels import flap_schedule
from rtsim.atmosphere.gust_kernels import G_AHEAD, G_BUSY, gust_step
from rtsim.corridor.corridor_kernels import corridor_level_step
from rtsim.faults.fault_kernels import (
    F_ENGINE,
    F_POWER,
    fault_actuators_begin,
    fault_actuators_end,
    fault_nacelle_rate,
    fault_update,
)
from rtsim.frame import COLUMN, FloatArray
from rtsim.kernels.compiled import inner_kernel, kernel
from rtsim.kernels.ramp_filter_kernels import critically_damped_ramp
from rtsim.loop.data import (
    CLOCK_DISTANCE,
    CLOCK_END,
    CLOCK_FLAGS,
    CLOCK_FRAME,
    CLOCK_MODE,
    CLOCK_SINK,
    END_ATTITUDE,
    END_CRASH,
    END_GENTLE_LANDING,
    END_HARD_LANDING,
    END_NONE,
    END_NOT_FINITE,
    END_ROTORS_FAST,
    END_ROTORS_SLOW,
    MODE_EXTERNAL,
    MODE_MOCM,
    Scratch,
    SimulationState,
    SimulationTables,
)
from rtsim.loop.observe_kernels import observe, programme_at, sense
from rtsim.loop.plant_kernels import plant_step
from rtsim.nacelle.automatic_kernels import automatic_advance
from rtsim.nacelle.nacelle_kernels import nacelle_advance, nacelle_assigned_rate, nacelle_effective_rate, nacelle_path
from rtsim.pilot.pilot_kernels import mocm_advance_in, mocm_engage, mocm_output_in
from rtsim.protection import law_data as law
from rtsim.protection.law_kernels import law_due, protect
from rtsim.systems.drive_kernels import DEVIATION, DriveTables, drive_advance, governor_power
from rtsim.systems.flap_kernels import FlapTables, flap_advance, flap_now, flap_parts
from rtsim.units import DEGREE, KNOT

GENTLE_SINK_RATE, HARD_SINK_RATE = 1.5, 3.0
"""Sink rates at touchdown up to which a landing counts as gentle or as hard [m/s]; beyond it is a crash. Ours: about
300 and 600 ft/min, the usual normal and limit touchdown rates of helicopters (14 CFR 29.725 drops at 6.5 ft/s)."""
LANDING_PITCH = 15.0 * DEGREE
LANDING_NACELLE = 60.0 * DEGREE
"""Below this nacelle angle the proprotors (12.5 ft radius) would strike the ground."""
LANDING_SPEED = 60.0 * KNOT
LARGEST_PITCH = 80.0 * DEGREE


@inner_kernel
def pilot_command(tables: SimulationTables, state: SimulationState, scratch: Scratch, out: FloatArray) -> None:
    """The built-in MOCM's command for the frame just observed; changes no state.

    Args:
        tables: The simulation.
        state: Its state at the start of the frame.
        scratch: Work space as ``observe`` left it.
        out: Written: stick, lever, nacelle rate [rad/s].
    """
    mocm_output_in(tables.pilot, state.pilot, scratch.motion[0], scratch.target, scratch.command, scratch.pilot)
    out[0] = scratch.command[0]
    out[1] = scratch.command[1]
    out[2] = scratch.target[4]


@inner_kernel
def _end_code(drive: DriveTables, wind: float, state: SimulationState) -> int:
    """Whether the flight is over, and how; a landing is judged by sink rate, attitude, speed and rotor clearance."""
    x = state.x
    for i in range(x.shape[0]):
        if not math.isfinite(x[i]):
            return END_NOT_FINITE
    pitch = x[STATE.pitch]
    if x[STATE.altitude] < 0.0:
        st, ct = math.sin(pitch), math.cos(pitch)
        sink = x[STATE.w] * ct - x[STATE.u] * st
        state.clock[CLOCK_SINK] = sink
        ground_speed = x[STATE.u] * ct + x[STATE.w] * st + wind
        upright = (
            abs(pitch) <= LANDING_PITCH and state.nacelle[1] >= LANDING_NACELLE and abs(ground_speed) <= LANDING_SPEED
        )
        if upright and sink <= GENTLE_SINK_RATE:
            return END_GENTLE_LANDING
        if upright and sink <= HARD_SINK_RATE:
            return END_HARD_LANDING
        return END_CRASH
    rotor_speed = drive.governed_speed + state.drive[DEVIATION]
    if rotor_speed > drive.highest:
        return END_ROTORS_FAST
    if not rotor_speed >= drive.lowest:
        return END_ROTORS_SLOW
    return END_ATTITUDE if abs(pitch) > LARGEST_PITCH else END_NONE


@inner_kernel
def shape(tables: SimulationTables, state: SimulationState, scratch: Scratch, applied: FloatArray) -> None:
    """Turn the pilot's command into what would act without protection: limited to the travel, with the aids.

    Args:
        tables: The simulation.
        state: Its state; the aids' part is updated.
        scratch: Work space as ``observe`` left it; afterwards its ``command`` holds stick, lever, nacelle rate.
        applied: The pilot's stick, lever, nacelle rate [rad/s].
    """
    acting = scratch.command
    scratch.hands[0] = min(max(applied[0], -1.0), 1.0)
    scratch.hands[1] = min(max(applied[1], 0.0), 1.0)
    if state.clock[CLOCK_MODE] != MODE_EXTERNAL:
        # Held controls are what acted last, aids included: a second helping would run them away.
        acting[0], acting[1] = scratch.hands[0], scratch.hands[1]
        # Whoever takes over later finds the aids to be engaged anew.
        state.aids[LAST_SWITCHES] = -1.0
    else:
        acting[0], acting[1] = state.u[INPUT.stick], state.u[INPUT.lever]
        angle, dt = scratch.motion[0], tables.dt
        airspeed = aids_airspeed(state.aids, state.switches, scratch.seen)
        expected = flap_schedule(tables.aircraft.controls, airspeed, angle)
        flap_parts(tables.flaps, flap_now(state.flaps, scratch.scheduled[0]), expected, scratch.flaps)
        aids_step(
            tables.aids, state.aids, state.switches, scratch.seen, angle, scratch.hands, scratch.flaps, acting, dt
        )
    if tables.automatic.active != 0:
        acting[2] = scratch.target[4]
    else:
        acting[2] = nacelle_assigned_rate(tables.nacelle, applied[2])


@inner_kernel
def limit(tables: SimulationTables, state: SimulationState, scratch: Scratch, row: FloatArray) -> None:
    """Let the compiled law limit what ``shape`` left in the work space's ``command``, and record what it did.

    Args:
        tables: The simulation.
        state: Its state; the law's part is updated.
        scratch: Work space as ``shape`` left it.
        row: The frame's row; the columns of the protection are written.
    """
    acting, limited = scratch.command, scratch.limited
    frame = int(state.clock[CLOCK_FRAME])
    if law_due(tables.protection, state.protection, frame):
        sense(state, scratch, row, scratch.sensors)
    protect(tables.protection, state.protection, frame, scratch.sensors, acting, limited, scratch.law)
    row[COLUMN.protection_stick] = limited[0] - acting[0]
    row[COLUMN.protection_lever] = limited[1] - acting[1]
    row[COLUMN.protection_nacelle_rate_deg_s] = (limited[2] - acting[2]) / DEGREE
    row[COLUMN.protection_stick_reason] = state.protection[law.L_STICK_CAUSE]
    row[COLUMN.protection_lever_reason] = state.protection[law.L_LEVER_CAUSE]
    row[COLUMN.protection_nacelle_reason] = state.protection[law.L_RATE_CAUSE]
    row[COLUMN.time_to_limit_s] = state.protection[law.L_TIME]
    acting[0], acting[1], acting[2] = limited[0], limited[1], limited[2]


@inner_kernel
def advance(
    tables: SimulationTables,
    state: SimulationState,
    scratch: Scratch,
    row: FloatArray,
    commands: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
) -> None:
    """Aids, protection, and the rest of the frame: the whole simulation moves to the start of the next.

    Args:
        tables: The simulation.
        state: Its state, updated in place.
        scratch: Work space as ``observe`` left it.
        row: The frame row, completed.
        commands: The pilot's command, the command that goes to aids and law in its place, and this frame's standard
            normals of the pilot and of the air (empty where there is no noise and no turbulence).
    """
    shape(tables, state, scratch, commands[1])
    limit(tables, state, scratch, row)
    complete(tables, state, scratch, row, (commands[0], commands[2], commands[3]))


@inner_kernel
def complete(
    tables: SimulationTables,
    state: SimulationState,
    scratch: Scratch,
    row: FloatArray,
    commands: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Record the command and move the whole simulation to the start of the next frame.

    Args:
        tables: The simulation.
        state: Its state, updated in place.
        scratch: Work space as ``observe`` left it.
        row: The frame row, completed.
        commands: The pilot's command, and this frame's standard normals of the pilot and of the air.
    """
    asked, noise, air_noise = commands
    dt = tables.dt
    x, u = state.x, state.u
    angle = scratch.motion[0]
    acting = scratch.command
    stick, lever = acting[0], acting[1]
    rate = fault_nacelle_rate(state.faults, acting[2])
    rate = nacelle_effective_rate(tables.nacelle, state.nacelle, rate, dt)
    margin = min(scratch.margins[0], scratch.margins[1])
    controls = tables.aircraft.controls
    cyclic_stop = abs(x[STATE.cyclic_1s]) >= controls.cyclic_limit * (1.0 - 1e-9)
    elevator_stop = abs(x[STATE.elevator]) >= controls.elevator_limit * (1.0 - 1e-9)
    stick_stop = abs(stick) >= 1.0
    lever_stop = lever <= 0.0 or lever >= 1.0
    row[COLUMN.stick] = stick
    row[COLUMN.lever] = lever
    row[COLUMN.pilot_stick] = asked[0]
    row[COLUMN.pilot_lever] = asked[1]
    row[COLUMN.pilot_nacelle_rate_rad_s] = asked[2]
    row[COLUMN.nacelle_command_rate_deg_s] = rate / DEGREE
    row[COLUMN.corridor_level] = float(corridor_level_step(tables.corridor, margin, dt, state.level))
    row[COLUMN.control_on_stop] = 1.0 if stick_stop or lever_stop or cyclic_stop or elevator_stop else 0.0

    if state.clock[CLOCK_MODE] == MODE_MOCM:
        scalars = (angle, scratch.motion[1], dt)
        mocm_advance_in(tables.pilot, state.pilot, scratch.seen, scalars, scratch.target, acting, noise, scratch.pilot)
    if tables.automatic.active != 0:
        speed_rate = scratch.y[OUTPUT.airspeed_rate]
        automatic_advance(tables.automatic, state.automatic, scratch.shown[0], speed_rate, rate, dt)
    nacelle_path(tables.nacelle, state.nacelle, rate, dt, scratch.path)
    u[INPUT.stick] = stick
    u[INPUT.lever] = lever
    before = x[STATE.u] * math.cos(x[STATE.pitch]) + x[STATE.w] * math.sin(x[STATE.pitch])
    governed = state.switches[GOVERNOR] != 0.0
    torque = 2.0 * scratch.y[OUTPUT.torque]
    power = torque * (tables.drive.governed_speed + state.drive[DEVIATION])
    # Where an engine fails, collective is taken off until the power suffices to bring the rotors back too.
    power = governor_power(tables.drive, state.drive, power)
    fault_actuators_begin(
        tables.faults,
        state.faults,
        controls,
        x,
        (stick, lever),
        scratch.path[1, 0],
        (power, governed),
        dt,
        scratch.planned,
    )
    turn_systems((tables.flaps, tables.drive), state, scratch.scheduled[0], torque, lever, dt)
    state.clock[CLOCK_FLAGS] = plant_step(tables.aircraft, tables.lpv, x, u, scratch.path, dt, scratch.work)
    fault_actuators_end(scratch.planned, x)
    after = x[STATE.u] * math.cos(x[STATE.pitch]) + x[STATE.w] * math.sin(x[STATE.pitch])
    state.clock[CLOCK_DISTANCE] += dt * (0.5 * (before + after) + tables.wind)
    nacelle_advance(tables.nacelle, state.nacelle, rate, dt)

    time = state.clock[CLOCK_FRAME] * dt
    wanted = programme_at(tables.programme, 1, time)
    slope = (programme_at(tables.programme, 1, time + dt) - wanted) / dt
    value, value_rate, _ = critically_damped_ramp(
        tables.reference_frequency, wanted, slope, state.reference[0], state.reference[1], dt
    )
    state.reference[0] = value
    state.reference[1] = value_rate
    state.clock[CLOCK_FRAME] += 1.0
    disturb(tables, state, scratch, dt, air_noise)
    state.clock[CLOCK_END] = _end_code(tables.drive, tables.wind, state)


@inner_kernel
def turn_systems(
    systems: tuple[FlapTables, DriveTables],
    state: SimulationState,
    scheduled: float,
    torque: float,
    lever: float,
    dt: float,
) -> None:
    """Move flaps and rotor speed to the start of the next frame; the inputs of this one stay as ``observe`` set them.

    Args:
        systems: Flaps and rotor drive.
        state: The simulation's state at the start of the frame.
        scheduled: Flap deflection of the schedule [rad].
        torque: Torque of both masts together [N m].
        lever: Power lever that acts.
        dt: Length of the frame [s].
    """
    flaps, drive = systems
    automatic, governed = state.switches[AUTOMATIC_FLAPS] != 0.0, state.switches[GOVERNOR] != 0.0
    flap_advance(flaps, state.flaps, automatic, scheduled, dt)
    available = state.faults[F_POWER] if state.faults[F_ENGINE] != 0.0 else drive.power[-1]
    drive_advance(drive, state.drive, governed, torque, lever, available, dt)


@inner_kernel
def disturb(
    tables: SimulationTables, state: SimulationState, scratch: Scratch, elapsed: float, air_noise: FloatArray
) -> None:
    """Bring gusts and failures to the start of the present frame.

    Args:
        tables: The simulation.
        state: Its state; gusts and failures are changed, and by a jam the conversion actuator's command.
        scratch: Work space.
        elapsed: Length of the frame before; 0 at the start of the flight [s].
        air_noise: Standard normals of the air; empty where there is no turbulence.
    """
    x = state.x
    time = state.clock[CLOCK_FRAME] * tables.dt
    pitch = x[STATE.pitch]
    if state.gusts[G_BUSY] != 0.0:
        speed = math.sqrt(x[STATE.u] ** 2 + x[STATE.w] ** 2)
        gust_step(tables.gusts, state.gusts, speed, x[STATE.altitude], pitch, time, elapsed, air_noise, scratch.gust)
    airspeed = x[STATE.u] * math.cos(pitch) + x[STATE.w] * math.sin(pitch) + state.gusts[G_AHEAD]
    fault_update(tables.faults, state.faults, time, x, state.nacelle, tables.nacelle.frequency, airspeed)


@inner_kernel
def run_frames(
    tables: SimulationTables,
    state: SimulationState,
    scratch: Scratch,
    noise: FloatArray,
    air_noise: FloatArray,
    rows: FloatArray,
) -> int:
    """Fly frames with the built-in pilot (or the held command) until the rows are full or the flight ends.

    Args:
        tables: The simulation.
        state: Its state, updated in place.
        scratch: Work space.
        noise: Standard normals of the pilot, one row per frame; shape (frames, 0) where the noise is off.
        air_noise: Standard normals of the air, one row per frame; shape (frames, 0) without turbulence.
        rows: Written: the frame rows, shape (frames, signals).

    Returns:
        The number of frames flown.
    """
    command = scratch.asked
    for k in range(rows.shape[0]):
        if state.clock[CLOCK_END] != END_NONE:
            return k
        observe(tables, state, scratch, rows[k])
        if state.clock[CLOCK_MODE] == MODE_MOCM:
            pilot_command(tables, state, scratch, command)
        else:
            command[0] = state.u[INPUT.stick]
            command[1] = state.u[INPUT.lever]
            command[2] = 0.0
        advance(tables, state, scratch, rows[k], (command, command, noise[k], air_noise[k]))
    return rows.shape[0]


@kernel
def engage_pilot(tables: SimulationTables, state: SimulationState, scratch: Scratch) -> None:
    """Let the MOCM take the controls as they are: its state is set so that its first output equals them.

    Args:
        tables: The simulation.
        state: Its state; the pilot's part is overwritten.
        scratch: Work space as ``observe`` left it.
    """
    scratch.command[0] = state.u[INPUT.stick]
    scratch.command[1] = state.u[INPUT.lever]
    mocm_engage(
        tables.pilot, state.pilot, scratch.seen, scratch.motion[0], scratch.motion[1], scratch.target, scratch.command
    )
