"""Compiled failures: what breaks when, and how it changes commands, actuators and sensors of a frame.

A frame uses them in this order: ``fault_update`` switches failures on and off at the start of the frame;
``fault_airspeed_error`` and ``fault_nacelle_ok`` give what the sensors show; ``fault_nacelle_rate`` limits the nacelle
command; ``fault_actuators_begin`` and ``fault_actuators_end`` stand around the plant's step, which knows nothing of
failures. They work on the states that every plant has (``rtsim.aircraft.variables``). Equations: docs/faults.md.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.variables import STATE
from rtsim.aircraft.xv15.dynamics_kernels import commanded_controls
from rtsim.aircraft.xv15.tables import ControlTables
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places

# Kinds, as numbers in the schedule.
KIND_NACELLE_JAMMED = 0
KIND_NACELLE_SLOW = 1
KIND_STUCK = 2
KIND_SLOW = 3
KIND_HARD_OVER = 4
KIND_AIRSPEED_BIAS = 5
KIND_AIRSPEED_FROZEN = 6
KIND_ENGINE_LIMIT = 7

EVENT = Places(
    "time",
    "kind",
    "channel",  # actuator: 0 collective, 1 cyclic, 2 elevator; else unused
    "value",  # rate limit [rad/s], bias [m/s], shaft power available [W], or -1 / 1 for the lower / upper stop; by kind
    "rate",  # rate towards the stop of a hard-over [rad/s]
    "on",  # 1: begins; 0: ends
)
"""Columns of the schedule of failures."""

ACTUATOR = Places(
    "mode",  # 0 sound, else KIND_STUCK, KIND_SLOW or KIND_HARD_OVER
    "value",  # held angle [rad] when stuck, rate limit [rad/s] when slow, -1 or 1 for the stop of a hard-over
    "rate",  # rate of a hard-over [rad/s]
)
"""Places in the block of one actuator."""
FAULT = Places(
    "next",  # next row of the schedule
    "jammed",  # 1 while the nacelles are jammed
    "nacelle_slow",  # 1 while the nacelle rate is limited
    "nacelle_rate",  # its limit [rad/s]
    ("actuators", 3 * ACTUATOR.size),  # collective, cyclic, elevator
    "frozen",  # 1 while the airspeed indication stands still
    "held",  # the airspeed it stands at [m/s]
    "bias",  # added to the indicated airspeed [m/s]
    "engine",  # 1 while the power is limited
    "power",  # shaft power of both rotors that the engines can give [W]
)
"""Places in the state."""

ACTUATOR_STATES = (STATE.collective_75, STATE.cyclic_1s, STATE.elevator)
"""State of each actuator channel."""

MASK_JAMMED, MASK_NACELLE_SLOW, MASK_COLLECTIVE, MASK_CYCLIC, MASK_ELEVATOR, MASK_AIRSPEED, MASK_ENGINE = (
    1,
    2,
    4,
    8,
    16,
    32,
    64,
)
"""Bits of the mask of active failures."""

_SAME_TIME = 1e-9
"""A failure due this little after the start of a frame begins with that frame [s]; far below any frame."""


class FaultTables(NamedTuple):
    """Parameters of the failures; read-only."""

    schedule: FloatArray
    """Changes in the order of their times, shape (changes, SCHEDULE_COLUMNS)."""
    governor_frequency: float
    """How fast the governor takes collective off when the power does not suffice [rad/s]."""
    power_per_collective: float
    """Shaft power of both rotors per collective angle without axial flow [W/rad]."""
    power_per_collective_speed: float
    """Its growth with the airspeed along the mast [W s/(rad m)]."""


@inner_kernel
def fault_apply(
    state: FloatArray, change: FloatArray, x: FloatArray, nacelle: FloatArray, frequency: float, airspeed: float
) -> None:
    """Let one failure begin or end.

    Args:
        state: Fault state, changed in place.
        change: Row of a schedule, shape (SCHEDULE_COLUMNS,).
        nacelle: Conversion actuator: command angle, angle, rate; a jam sets the command angle.
        frequency: Natural frequency of the conversion actuator [rad/s].
        airspeed: What a sound airspeed indicator shows [m/s].
    """
    kind = int(change[EVENT.kind])
    on = change[EVENT.on]
    value = change[EVENT.value]
    if kind == KIND_NACELLE_JAMMED:
        if on != 0.0 and state[FAULT.jammed] == 0.0:
            # From here the critically damped actuator runs out as one exponential: it never turns back.
            nacelle[0] = nacelle[1] + nacelle[2] / frequency
        state[FAULT.jammed] = on
    elif kind == KIND_NACELLE_SLOW:
        state[FAULT.nacelle_slow] = on
        state[FAULT.nacelle_rate] = value
    elif KIND_STUCK <= kind <= KIND_HARD_OVER:
        channel = int(change[EVENT.channel])
        place = FAULT.actuators + ACTUATOR.size * channel
        if on != 0.0:
            state[place + ACTUATOR.mode] = kind
            state[place + ACTUATOR.value] = x[ACTUATOR_STATES[channel]] if kind == KIND_STUCK else value
            state[place + ACTUATOR.rate] = change[EVENT.rate]
        elif state[place + ACTUATOR.mode] == kind:
            state[place + ACTUATOR.mode] = 0.0
    elif kind == KIND_AIRSPEED_BIAS:
        state[FAULT.bias] = value if on != 0.0 else 0.0
    elif kind == KIND_AIRSPEED_FROZEN:
        if on != 0.0 and state[FAULT.frozen] == 0.0:
            state[FAULT.held] = airspeed + state[FAULT.bias]
        state[FAULT.frozen] = on
    elif kind == KIND_ENGINE_LIMIT:
        state[FAULT.engine] = on
        state[FAULT.power] = value


@inner_kernel
def fault_update(
    tables: FaultTables,
    state: FloatArray,
    time: float,
    x: FloatArray,
    nacelle: FloatArray,
    frequency: float,
    airspeed: float,
) -> None:
    """Let every scheduled failure begin or end that is due at the start of this frame.

    Args:
        state: Fault state, changed in place.
        time: Time at the start of the frame [s].
        nacelle: Conversion actuator; a jam sets its command angle.
        frequency: Natural frequency of the conversion actuator [rad/s].
        airspeed: What a sound airspeed indicator shows [m/s].
    """
    number = int(state[FAULT.next])
    while number < tables.schedule.shape[0] and tables.schedule[number, EVENT.time] <= time + _SAME_TIME:
        fault_apply(state, tables.schedule[number], x, nacelle, frequency, airspeed)
        number += 1
    state[FAULT.next] = number


@inner_kernel
def fault_mask(state: FloatArray) -> int:
    """Give the active failures as a sum of ``MASK_*``."""
    mask = 0
    if state[FAULT.jammed] != 0.0:
        mask |= MASK_JAMMED
    if state[FAULT.nacelle_slow] != 0.0:
        mask |= MASK_NACELLE_SLOW
    for channel in range(3):
        if state[FAULT.actuators + ACTUATOR.size * channel] != 0.0:
            mask |= MASK_COLLECTIVE << channel
    if state[FAULT.frozen] != 0.0 or state[FAULT.bias] != 0.0:
        mask |= MASK_AIRSPEED
    if state[FAULT.engine] != 0.0:
        mask |= MASK_ENGINE
    return mask


@inner_kernel
def fault_nacelle_ok(state: FloatArray) -> bool:
    """Tell whether the conversion actuator follows its commands, however slowly."""
    return state[FAULT.jammed] == 0.0


@inner_kernel
def fault_airspeed_error(state: FloatArray, airspeed: float) -> float:
    """Give what the airspeed indication is wrong by [m/s]; exactly 0.0 where it is sound.

    Args:
        airspeed: What a sound indicator shows [m/s].
    """
    if state[FAULT.frozen] != 0.0:
        return state[FAULT.held] - airspeed
    return state[FAULT.bias]


@inner_kernel
def fault_nacelle_rate(state: FloatArray, rate: float) -> float:
    """Limit the nacelle rate to what the failed conversion actuator can do.

    Args:
        rate: Rate commanded [rad/s].

    Returns:
        The rate that acts [rad/s]; the commanded one where nothing has failed.
    """
    if state[FAULT.jammed] != 0.0:
        return 0.0
    if state[FAULT.nacelle_slow] != 0.0:
        limit = state[FAULT.nacelle_rate]
        return min(max(rate, -limit), limit)
    return rate


@inner_kernel
def collective_rate_limit(
    tables: FaultTables, state: FloatArray, x: FloatArray, nacelle_angle: float, power: float
) -> float:
    """Fastest rise of the collective that the governor allows with the power at hand [rad/s]; negative: it must fall.

    Args:
        state: Fault state with a limited engine.
        power: Shaft power of both rotors now [W].
    """
    along_mast = x[STATE.u] * math.cos(nacelle_angle) - x[STATE.w] * math.sin(nacelle_angle)
    slope = tables.power_per_collective + tables.power_per_collective_speed * max(along_mast, 0.0)
    return tables.governor_frequency * (state[FAULT.power] - power) / slope


@inner_kernel
def fault_actuators_begin(
    tables: FaultTables,
    state: FloatArray,
    controls: ControlTables,
    x: FloatArray,
    commands: tuple[float, float],
    nacelle_angle: float,
    drive: tuple[float, bool],
    dt: float,
    planned: FloatArray,
) -> None:
    """Prepare the plant's step: decide where failed actuators will stand after it and make their mean over it right.

    The plant moves an actuator by its own lag. A failed one is set, for the step alone, to the start from which that
    motion has the mean of the failed motion; ``fault_actuators_end`` then puts it where the failure leaves it. What the
    plant feels differs from the failed motion only by a ripple of zero mean within the frame.

    Args:
        controls: Gearing, limits and lags of the actuators.
        x: Aircraft state at the start of the step; failed actuators are changed.
        commands: Stick and lever of the step.
        nacelle_angle: Nacelle angle in the middle of the step [rad].
        drive: Shaft power that the rotor-speed governor asks for [W], and whether it is on.
        planned: Written: angles of the actuators after the step; NaN where the plant's own are right, shape (3,).
    """
    planned[0] = planned[1] = planned[2] = math.nan
    power, governed = drive
    # Without its governor the rotor slows where the power is short; nothing takes the collective back.
    limited = governed and state[FAULT.engine] != 0.0
    failed = state[FAULT.actuators] != 0.0 or state[FAULT.actuators + ACTUATOR.size] != 0.0
    failed = failed or state[FAULT.actuators + 2 * ACTUATOR.size] != 0.0
    if not (limited or failed):
        return
    collective, cyclic, elevator = commanded_controls(controls, commands[0], commands[1], nacelle_angle)
    low = curve(controls.collective_range, 0, nacelle_angle)
    high = curve(controls.collective_range, 1, nacelle_angle)
    for channel in range(3):
        place = FAULT.actuators + ACTUATOR.size * channel
        mode = state[place + ACTUATOR.mode]
        begin = x[ACTUATOR_STATES[channel]]
        command, lower, upper = collective, low, high
        if channel == 1:
            command, lower, upper = cyclic, -controls.cyclic_limit, controls.cyclic_limit
        elif channel == 2:
            command, lower, upper = elevator, -controls.elevator_limit, controls.elevator_limit
        gone = -math.expm1(-controls.actuator_rate[channel] * dt)
        own = begin + gone * (command - begin)
        end = own
        if mode == KIND_STUCK:
            end = state[place + ACTUATOR.value]
        elif mode == KIND_SLOW:
            most = state[place + ACTUATOR.value] * dt
            end = min(max(own, begin - most), begin + most)
        elif mode == KIND_HARD_OVER:
            most = state[place + ACTUATOR.rate] * dt
            stop = upper if state[place + ACTUATOR.value] > 0.0 else lower
            end = begin + min(max(stop - begin, -most), most)
        # A stuck or run-away collective is beyond the governor's reach.
        if channel == 0 and limited and mode != KIND_STUCK and mode != KIND_HARD_OVER:  # noqa: PLR1714
            rise = collective_rate_limit(tables, state, x, nacelle_angle, power) * dt
            end = min(end, max(begin + rise, min(lower, begin)))
        if end != own:
            planned[channel] = end
            mean = 0.5 * (begin + end)
            x[ACTUATOR_STATES[channel]] = (mean - 0.5 * gone * command) / (1.0 - 0.5 * gone)


@inner_kernel
def fault_actuators_end(planned: FloatArray, x: FloatArray) -> None:
    """Put the failed actuators where they are after the plant's step.

    Args:
        planned: From ``fault_actuators_begin``.
        x: Aircraft state after the step; failed actuators are changed.
    """
    for channel in range(3):
        if not math.isnan(planned[channel]):
            x[ACTUATOR_STATES[channel]] = planned[channel]
