"""One frame of the closed loop, compiled: observe, command, record, advance.

``observe`` fills what can be known at the start of a frame, ``pilot_command`` asks the built-in MOCM, ``advance``
passes the command through aids and protection, records it and moves everything to the next frame. ``run_frames`` is the
same three calls in a compiled loop, so that a flight stepped from Python and one run in a batch are equal bit for bit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rtsim.aids.aids_kernels import LAST_SWITCHES, AidTables, aids_step
from rtsim.aircraft import dynamics_kernels as nonlinear
from rtsim.aircraft.signals import INPUT, OUTPUT, STATE
from rtsim.aircraft.tables import AircraftTables
from rtsim.atmosphere.gust_kernels import G_AHEAD, G_BUSY, G_Q, G_U, G_W, GustTables, gust_step
from rtsim.compiled import inner_kernel, kernel
from rtsim.corridor.corridor_kernels import CorridorTables, corridor_level_step, corridor_margins
from rtsim.faults.fault import TRANSMISSION_EFFICIENCY
from rtsim.faults.fault_kernels import (
    FaultTables,
    fault_actuators_begin,
    fault_actuators_end,
    fault_airspeed_error,
    fault_mask,
    fault_nacelle_ok,
    fault_nacelle_rate,
    fault_update,
)
from rtsim.frame import COLUMN
from rtsim.lpv.lpv_kernels import LpvTables
from rtsim.nacelle.automatic_kernels import AutomaticTables, automatic_advance, automatic_rate
from rtsim.nacelle.nacelle_kernels import (
    NacelleTables,
    nacelle_advance,
    nacelle_assigned_rate,
    nacelle_at,
    nacelle_effective_rate,
    nacelle_path,
    on_downstop,
)
from rtsim.pilot.pilot_kernels import PilotTables, mocm_advance_in, mocm_engage, mocm_output_in
from rtsim.plant_kernels import AircraftFrame, plant_outputs, plant_step
from rtsim.protection import law_data as law
from rtsim.protection.law_kernels import law_due, protect
from rtsim.ramp_filter_kernels import critically_damped_ramp
from rtsim.units import (
    DEGREE,
    HORSEPOWER,
    INCH_POUND,
    KNOT,
    POUND_FORCE,
    RPM,
)

FloatArray = npt.NDArray[np.float64]

MODE_MOCM, MODE_EXTERNAL, MODE_HOLD = 0, 1, 2

# Places in SimulationState.clock.
CLOCK_FRAME, CLOCK_MODE, CLOCK_DISTANCE, CLOCK_FLAGS, CLOCK_END, CLOCK_SINK = 0, 1, 2, 3, 4, 5
CLOCK_SIZE = 6
# Places in SimulationState.reference: unfiltered airspeed command is a function of time and not kept.
REFERENCE_AIRSPEED, REFERENCE_RATE = 0, 1
REFERENCE_SIZE = 2
# Why a flight ended by itself.
END_NONE, END_CRASH, END_ATTITUDE, END_NOT_FINITE, END_GENTLE_LANDING, END_HARD_LANDING = 0, 1, 2, 3, 4, 5
GENTLE_SINK_RATE, HARD_SINK_RATE = 1.5, 3.0
"""Sink rates at touchdown up to which a landing counts as gentle or as hard [m/s]; beyond it is a crash. Ours: about
300 and 600 ft/min, the usual normal and limit touchdown rates of helicopters (14 CFR 29.725 drops at 6.5 ft/s)."""
LANDING_PITCH = 15.0 * DEGREE
LANDING_NACELLE = 60.0 * DEGREE
"""Below this nacelle angle the proprotors (12.5 ft radius) would strike the ground."""
LANDING_SPEED = 60.0 * KNOT
LARGEST_PITCH = 80.0 * DEGREE
# The array handed to the pilot, see rtsim.pilot.pilot_kernels.
TARGET_SIZE = 5


class SimulationTables(NamedTuple):
    """Everything the frame reads and never writes."""

    dt: float
    """Length of a frame [s]."""
    wind: float
    """Tailwind [m/s]."""
    lpv: LpvTables
    """The LPV aircraft."""
    aircraft: AircraftTables | AircraftFrame
    """The nonlinear aircraft where it flies; else what the frame reads of it."""
    nacelle: NacelleTables
    """Conversion actuator."""
    automatic: AutomaticTables
    """Automatic nacelle control; where active, it sets the nacelle rate whoever flies."""
    corridor: CorridorTables
    """Boundaries and levels."""
    pilot: PilotTables
    """The MOCM's gains and references."""
    aids: AidTables
    """Schedules of the pilot aids; they act on hands and plug-ins, not on the MOCM, which is designed for the
    bare aircraft, nor on controls that are held."""
    gusts: GustTables
    """Parameters of gusts and turbulence."""
    faults: FaultTables
    """Failures and their times."""
    protection: law.ProtectionTables
    """The compiled protection law; it acts after the aids, on what would move the controls."""
    programme: FloatArray
    """Rows: time [s], airspeed [m/s], nacelle angle [rad], altitude [m] of the programme's points."""
    reference_frequency: float
    """Natural frequency of the critically damped airspeed reference filter [rad/s]."""


class SimulationState(NamedTuple):
    """Everything the frame changes; a snapshot is a copy of these arrays and of the random stream."""

    x: FloatArray
    """Aircraft state."""
    u: FloatArray
    """Inputs that acted last."""
    nacelle: FloatArray
    """Actuator: command angle, angle, rate."""
    automatic: FloatArray
    """Automatic nacelle control: filtered airspeed, rate commanded last, whether it has begun."""
    reference: FloatArray
    """Filtered airspeed reference and its rate."""
    level: FloatArray
    """Corridor level timers."""
    pilot: FloatArray
    """State of the MOCM."""
    aids: FloatArray
    """State of the pilot aids."""
    switches: FloatArray
    """Which aids are on."""
    gusts: FloatArray
    """Turbulence filters, gusts that act or are to come, and what acts now."""
    faults: FloatArray
    """Which failures are active."""
    protection: FloatArray
    """State of the protection law."""
    clock: FloatArray
    """Frame number, pilot mode, distance flown [m], LPV flags, end code, sink rate at the end [m/s]."""


class Scratch(NamedTuple):
    """Work space; holds nothing from one frame to the next."""

    work: FloatArray
    """Work array of the plant kernels."""
    y: FloatArray
    """Plant outputs."""
    xdot: FloatArray
    """Plant state derivative."""
    path: FloatArray
    """Nacelle motion over the frame, shape (3, 3)."""
    motion: FloatArray
    """Nacelle angle, rate, acceleration now."""
    margins: FloatArray
    """Corridor margins."""
    shown: FloatArray
    """What the airspeed indicator shows [m/s], then the corridor margins that go with it."""
    seen: FloatArray
    """Aircraft state as pilot and aids see it: with the indicated airspeed."""
    target: FloatArray
    """What the pilot is asked for."""
    command: FloatArray
    """Stick, lever, nacelle rate that are to act."""
    hands: FloatArray
    """The pilot's stick and lever, before the aids."""
    pilot: FloatArray
    """Work array of the pilot kernels."""
    asked: FloatArray
    """The pilot's command in a compiled run: stick, lever, nacelle rate."""
    planned: FloatArray
    """Where failed actuators stand after the frame."""
    gust: FloatArray
    """Gust of the next frame in body axes."""
    sensors: FloatArray
    """What the protection law may know."""
    limited: FloatArray
    """Stick, lever, nacelle rate as the law leaves them."""
    law: FloatArray
    """Work array of the law."""


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
def observe(tables: SimulationTables, state: SimulationState, scratch: Scratch, row: FloatArray) -> None:
    """Fill the row with all that is known before the command of this frame; changes no state.

    Args:
        tables: The simulation.
        state: Its state at the start of the frame.
        scratch: Work space; afterwards holds outputs, margins and the pilot's target.
        row: Written: the frame row, commands excepted.
    """
    x = state.x
    gusts = state.gusts
    frame = state.clock[CLOCK_FRAME]
    time = frame * tables.dt
    nacelle_at(tables.nacelle, state.nacelle, 0.0, 0.0, scratch.motion)
    angle, rate = scratch.motion[0], scratch.motion[1]
    state.u[INPUT.nacelle_rate] = rate
    state.u[INPUT.nacelle_acceleration] = scratch.motion[2]
    state.u[INPUT.gust_u] = gusts[G_U]
    state.u[INPUT.gust_w] = gusts[G_W]
    state.u[INPUT.gust_q] = gusts[G_Q]
    plant_outputs(tables.aircraft, tables.lpv, x, state.u, angle, (scratch.y, scratch.xdot, scratch.work))
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    through = x[STATE.u] * ct + x[STATE.w] * st
    airspeed = through + gusts[G_AHEAD]
    climb = x[STATE.u] * st - x[STATE.w] * ct
    corridor_margins(tables.corridor, airspeed, angle, scratch.margins)
    _see(tables, state, scratch, airspeed)
    y = scratch.y
    rotor_speed = tables.aircraft.configuration.rotor_speed
    power = 2.0 * y[OUTPUT.torque] * rotor_speed

    target = scratch.target
    target[0] = state.reference[REFERENCE_AIRSPEED]
    target[1] = state.reference[REFERENCE_RATE]
    target[2] = programme_at(tables.programme, 3, time)
    ahead = programme_at(tables.programme, 3, time + tables.dt)
    target[3] = (ahead - target[2]) / tables.dt
    wanted = programme_at(tables.programme, 2, time + tables.dt)
    wanted_rate = (wanted - state.nacelle[0]) / tables.dt
    if tables.automatic.active != 0:
        wanted_rate = automatic_rate(
            tables.automatic, state.automatic, scratch.shown[0], y[OUTPUT.airspeed_rate], state.nacelle[0], tables.dt
        )
    target[4] = nacelle_assigned_rate(tables.nacelle, wanted_rate)

    row[COLUMN.frame] = frame
    row[COLUMN.time_s] = time
    row[COLUMN.airspeed_kt] = airspeed / KNOT
    row[COLUMN.airspeed_reference_kt] = target[0] / KNOT
    row[COLUMN.nacelle_deg] = angle / DEGREE
    row[COLUMN.nacelle_reference_deg] = state.nacelle[0] / DEGREE
    row[COLUMN.altitude_m] = x[STATE.altitude]
    row[COLUMN.pitch_deg] = x[STATE.pitch] / DEGREE
    row[COLUMN.flapping_deg] = math.sqrt(x[STATE.flap_1c] ** 2 + x[STATE.flap_1s] ** 2) / DEGREE
    row[COLUMN.nacelle_rate_deg_s] = rate / DEGREE
    row[COLUMN.airspeed_command_kt] = programme_at(tables.programme, 1, time) / KNOT
    row[COLUMN.altitude_reference_m] = target[2]
    row[COLUMN.airspeed_rate_kt_s] = y[OUTPUT.airspeed_rate] / KNOT
    row[COLUMN.ground_speed_kt] = (through + tables.wind) / KNOT
    row[COLUMN.climb_rate_m_s] = climb
    row[COLUMN.distance_m] = state.clock[CLOCK_DISTANCE]
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
    speed = math.sqrt((x[STATE.u] + gusts[G_U]) ** 2 + (x[STATE.w] + gusts[G_W]) ** 2)
    row[COLUMN.flap_deg] = nonlinear.flap_schedule(tables.aircraft.controls, speed, angle) / DEGREE
    row[COLUMN.thrust_per_rotor_lb] = y[OUTPUT.thrust] / POUND_FORCE
    row[COLUMN.power_shp] = power / HORSEPOWER
    row[COLUMN.engine_power_shp] = power / HORSEPOWER / TRANSMISSION_EFFICIENCY
    row[COLUMN.mast_torque_inlb] = y[OUTPUT.torque] / INCH_POUND
    row[COLUMN.rotor_speed_rpm] = rotor_speed / RPM
    row[COLUMN.margin_kt] = min(scratch.margins[0], scratch.margins[1]) / KNOT
    row[COLUMN.margin_low_kt] = scratch.margins[0] / KNOT
    row[COLUMN.margin_high_kt] = scratch.margins[1] / KNOT
    row[COLUMN.nacelle_forward_deg] = scratch.margins[2] / DEGREE
    row[COLUMN.nacelle_aft_deg] = scratch.margins[3] / DEGREE
    row[COLUMN.on_downstop] = 1.0 if on_downstop(tables.nacelle, angle) else 0.0
    row[COLUMN.pilot_mode] = state.clock[CLOCK_MODE]
    row[COLUMN.airspeed_indicated_kt] = scratch.shown[0] / KNOT
    row[COLUMN.gust_u_m_s] = gusts[G_U]
    row[COLUMN.gust_w_m_s] = gusts[G_W]
    row[COLUMN.gust_q_deg_s] = gusts[G_Q] / DEGREE
    row[COLUMN.failures] = float(fault_mask(state.faults))


@inner_kernel
def _see(tables: SimulationTables, state: SimulationState, scratch: Scratch, airspeed: float) -> None:
    """Fill what pilots and laws are shown: indicated airspeed, its margins, and the state shifted to agree with it.

    The shift is along the horizon, so that the climb rate computed from the seen state stays the true one.
    """
    x, seen, shown = state.x, scratch.seen, scratch.shown
    error = fault_airspeed_error(state.faults, airspeed)
    shown[0] = airspeed + error
    if error == 0.0:
        for k in range(scratch.margins.shape[0]):
            shown[1 + k] = scratch.margins[k]
    else:
        corridor_margins(tables.corridor, shown[0], scratch.motion[0], shown[1:])
    for k in range(x.shape[0]):
        seen[k] = x[k]
    shift = state.gusts[G_AHEAD] + error
    if shift != 0.0:
        seen[STATE.u] += shift * math.cos(x[STATE.pitch])
        seen[STATE.w] += shift * math.sin(x[STATE.pitch])


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
def _end_code(tables: SimulationTables, state: SimulationState) -> int:
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
        ground_speed = x[STATE.u] * ct + x[STATE.w] * st + tables.wind
        upright = (
            abs(pitch) <= LANDING_PITCH and state.nacelle[1] >= LANDING_NACELLE and abs(ground_speed) <= LANDING_SPEED
        )
        if upright and sink <= GENTLE_SINK_RATE:
            return END_GENTLE_LANDING
        if upright and sink <= HARD_SINK_RATE:
            return END_HARD_LANDING
        return END_CRASH
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
        aids_step(tables.aids, state.aids, state.switches, scratch.seen, angle, scratch.hands, acting, dt)
    if tables.automatic.active != 0:
        acting[2] = scratch.target[4]
    else:
        acting[2] = nacelle_assigned_rate(tables.nacelle, applied[2])


@inner_kernel
def sense(state: SimulationState, scratch: Scratch, row: FloatArray, sensors: FloatArray) -> None:
    """Give what a protection law may know, the numbers of ``Simulation.sensors``.

    Args:
        state: The simulation's state.
        scratch: Its work space as ``observe`` left it.
        row: The frame's row as ``observe`` left it.
        sensors: Written, shape (SENSOR_COUNT,), SI.
    """
    x = state.x
    sensors[law.SENSE_TIME] = row[COLUMN.time_s]
    sensors[law.SENSE_AIRSPEED] = row[COLUMN.airspeed_indicated_kt] * KNOT
    sensors[law.SENSE_AIRSPEED_RATE] = row[COLUMN.airspeed_rate_kt_s] * KNOT
    sensors[law.SENSE_NACELLE] = scratch.motion[0]
    sensors[law.SENSE_NACELLE_RATE] = scratch.motion[1]
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
    power = 2.0 * scratch.y[OUTPUT.torque] * tables.aircraft.configuration.rotor_speed
    fault_actuators_begin(
        tables.faults, state.faults, controls, x, (stick, lever), scratch.path[1, 0], power, dt, scratch.planned
    )
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
    state.clock[CLOCK_END] = _end_code(tables, state)


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
