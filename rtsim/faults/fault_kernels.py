"""Compiled failures: what breaks when, and how it changes commands, actuators and sensors of a frame.

A frame uses them in this order: ``fault_update`` switches failures on and off at the start of the frame;
``fault_airspeed_error`` and ``fault_nacelle_ok`` give what the sensors show; ``fault_nacelle_rate`` limits the nacelle
command; ``fault_controls`` holds jammed controls; then those of ``actuator_kernels`` stand around the plant's step.
They work on the states that every plant has (``rtsim.aircraft.variables``). Equations: docs/faults.md.
"""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aircraft.variables import INPUT, STATE
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
KIND_CONTROL_JAMMED = 8

EVENT = Places(
    "time",
    "kind",
    "channel",  # actuator, its place among ``fault.ACTUATORS``, or control, its ``CHANNEL``; else unused
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
    ("actuators", 9 * ACTUATOR.size),  # in the order of ``fault.ACTUATORS``
    ("differences", 4),  # what the lateral controls ask of collective, cyclic, aileron and rudder, as last seen [rad]
    "seen",  # 1 once that was seen
    ("mean", 2),  # collective and cyclic of two sound sides: their mean
    ("half", 2),  # and half difference [rad]
    ("jam", 5),  # 1 while a control of the pilot is jammed, in the order of the channels of a command
    ("stands", 5),  # where it stands
    "frozen",  # 1 while the airspeed indication stands still
    "held",  # the airspeed it stands at [m/s]
    "bias",  # added to the indicated airspeed [m/s]
    "engine",  # 1 while the power is limited
    "power",  # shaft power of both rotors that the engines can give [W]
)
"""Places in the state."""

SYMMETRIC = (STATE.collective_75, STATE.cyclic_1s, STATE.elevator)
"""State of each actuator that acts on both sides alike: the first channels."""
CONTROL_INPUTS = (INPUT.stick, INPUT.lever, INPUT.nacelle_rate, INPUT.lateral_stick, INPUT.pedal)
"""Input of each channel of a command."""
LATERAL = (STATE.collective_difference, STATE.cyclic_difference, STATE.aileron, STATE.rudder)
"""States that the lateral controls move."""
ONE_SIDED = 3
"""First channel of one side: right and left collective, right and left cyclic, then aileron and rudder."""
CHANNELS_COUNT = 9

MASK_JAMMED, MASK_NACELLE_SLOW, MASK_COLLECTIVE, MASK_CYCLIC, MASK_ELEVATOR, MASK_AIRSPEED, MASK_ENGINE = (
    1,
    2,
    4,
    8,
    16,
    32,
    64,
)
MASK_ONE_SIDE, MASK_AILERON, MASK_RUDDER, MASK_CONTROL = 128, 256, 512, 1024
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
    aileron_stop: float
    """Largest aileron [rad]."""
    rudder_stop: float
    """Largest rudder [rad]."""
    difference_rate: float
    """Inverse lag of aileron, rudder and the half differences of collective and cyclic [1/s]."""


@inner_kernel
def actuator_angle(x: FloatArray, channel: int) -> float:
    """Angle of an actuator [rad].

    Args:
        channel: Its place among ``fault.ACTUATORS``.
    """
    if channel < ONE_SIDED:
        return float(x[SYMMETRIC[channel]])
    place = channel - ONE_SIDED
    if place < 4:
        pair = place // 2
        half = x[LATERAL[pair]]
        return float(x[SYMMETRIC[pair]] + (half if place % 2 == 0 else -half))
    return float(x[LATERAL[place - 2]])


@inner_kernel
def fault_apply(
    state: FloatArray,
    change: FloatArray,
    x: FloatArray,
    u: FloatArray,
    nacelle: FloatArray,
    frequency: float,
    airspeed: float,
) -> None:
    """Let one failure begin or end.

    Args:
        state: Fault state, changed in place.
        change: Row of a schedule, shape (SCHEDULE_COLUMNS,).
        u: Inputs that acted last; a jammed control stays there.
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
            state[place + ACTUATOR.value] = actuator_angle(x, channel) if kind == KIND_STUCK else value
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
    elif kind == KIND_CONTROL_JAMMED:
        channel = int(change[EVENT.channel])
        if on != 0.0 and state[FAULT.jam + channel] == 0.0:
            state[FAULT.stands + channel] = u[CONTROL_INPUTS[channel]]
        state[FAULT.jam + channel] = on


@inner_kernel
def fault_update(
    tables: FaultTables,
    state: FloatArray,
    time: float,
    x: FloatArray,
    u: FloatArray,
    nacelle: FloatArray,
    frequency: float,
    airspeed: float,
) -> None:
    """Let every scheduled failure begin or end that is due at the start of this frame.

    Args:
        state: Fault state, changed in place.
        time: Time at the start of the frame [s].
        u: Inputs that acted last; a jammed control stays there.
        nacelle: Conversion actuator; a jam sets its command angle.
        frequency: Natural frequency of the conversion actuator [rad/s].
        airspeed: What a sound airspeed indicator shows [m/s].
    """
    number = int(state[FAULT.next])
    while number < tables.schedule.shape[0] and tables.schedule[number, EVENT.time] <= time + _SAME_TIME:
        fault_apply(state, tables.schedule[number], x, u, nacelle, frequency, airspeed)
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
    for channel in range(ONE_SIDED, CHANNELS_COUNT):
        if state[FAULT.actuators + ACTUATOR.size * channel] != 0.0:
            mask |= MASK_ONE_SIDE << max(channel - (CHANNELS_COUNT - 3), 0)
    for channel in range(5):
        if state[FAULT.jam + channel] != 0.0:
            mask |= MASK_CONTROL
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
def fault_controls(state: FloatArray, command: FloatArray) -> None:
    """Hold the controls that are jammed where they stand.

    Args:
        state: Fault state.
        command: The command that is to act; changed.
    """
    for channel in range(5):
        if state[FAULT.jam + channel] != 0.0:
            command[channel] = state[FAULT.stands + channel]
