"""Compiled failures of actuators: where they stand after a step that knows nothing of them, and their mean over it.

The plant moves an actuator by its own lag. A failed one is set, for the step alone, to the start from which that motion
has the mean of the failed motion; afterwards it is put where the failure leaves it. What the plant feels differs from
the failed motion only by a ripple of zero mean within the frame.

One side's actuator is the symmetric one plus or minus the half difference. What the lateral controls ask of a half
difference is not computed but seen: a lag that went from one angle to another tells what it followed. So any aircraft
with a lateral half can lose one side, whatever its gearing; the first frame of a failure takes the half difference to
stand where it is asked to.
"""

from __future__ import annotations

import math

from rtsim.aircraft.table_kernels import curve
from rtsim.aircraft.variables import STATE
from rtsim.aircraft.xv15.dynamics_kernels import commanded_controls
from rtsim.aircraft.xv15.tables import ControlTables
from rtsim.arrays import FloatArray
from rtsim.faults.fault_kernels import (
    ACTUATOR,
    CHANNELS_COUNT,
    FAULT,
    KIND_HARD_OVER,
    KIND_SLOW,
    KIND_STUCK,
    LATERAL,
    ONE_SIDED,
    SYMMETRIC,
    FaultTables,
)
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places

PLANNED = Places(
    ("angle", 3),  # of the symmetric actuators after the step [rad]; NaN where the plant's own are right
    ("begin", 3),  # where they were before it
    ("own", 3),  # where they are to be after it
    ("asked", 3),  # what stick and lever ask for
    ("share", 3),  # of the way to it that is gone in the step
    ("lower", 3),
    ("upper", 3),  # their stops
    "one_sided",  # 1: something failed that the lateral controls move
    ("difference", 4),  # where these stood before the step
    ("start", 4),  # what the step started from
)
"""What is known of failed actuators between the start of a step and its end."""


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
    return float(tables.governor_frequency * (state[FAULT.power] - power) / slope)


@inner_kernel
def failed_end(
    state: FloatArray, channel: int, begin: float, own: float, stops: tuple[float, float], dt: float
) -> float:
    """Where an actuator is at the end of a frame [rad].

    Args:
        state: Fault state.
        channel: The actuator's place among ``fault.ACTUATORS``.
        begin: Where it is at the start of the frame [rad].
        own: Where a sound one would be at its end [rad].
        stops: Its smallest and largest angle [rad].
    """
    place = FAULT.actuators + ACTUATOR.size * channel
    mode = state[place + ACTUATOR.mode]
    if mode == KIND_STUCK:
        return float(state[place + ACTUATOR.value])
    if mode == KIND_SLOW:
        most = state[place + ACTUATOR.value] * dt
        return float(min(max(own, begin - most), begin + most))
    if mode == KIND_HARD_OVER:
        most = state[place + ACTUATOR.rate] * dt
        stop = stops[1] if state[place + ACTUATOR.value] > 0.0 else stops[0]
        return float(begin + min(max(stop - begin, -most), most))
    return own


@inner_kernel
def start_for(begin: float, end: float, command: float, gone: float) -> float:
    """Where an actuator must start so that its own lag has the mean of another motion [rad].

    Args:
        begin: Start of the other motion [rad].
        end: Its end [rad].
        command: What the actuator follows [rad].
        gone: Share of the way to its command that it goes in the frame.
    """
    mean = 0.5 * (begin + end)
    return (mean - 0.5 * gone * command) / (1.0 - 0.5 * gone)


@inner_kernel
def fails(state: FloatArray, channel: int) -> bool:
    """Whether an actuator is not sound.

    Args:
        channel: Its place among ``fault.ACTUATORS``.
    """
    return bool(state[FAULT.actuators + ACTUATOR.size * channel + ACTUATOR.mode] != 0.0)


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

    Args:
        controls: Gearing, limits and lags of the actuators.
        x: Aircraft state at the start of the step; failed actuators are changed.
        commands: Stick and lever of the step.
        nacelle_angle: Nacelle angle in the middle of the step [rad].
        drive: Shaft power that the rotor-speed governor asks for [W], and whether it is on.
        planned: Written: ``PLANNED``.
    """
    planned[0] = planned[1] = planned[2] = math.nan
    planned[PLANNED.one_sided] = 0.0
    power, governed = drive
    # Without its governor the rotor slows where the power is short; nothing takes the collective back.
    limited = governed and state[FAULT.engine] != 0.0
    failed = False
    for channel in range(CHANNELS_COUNT):
        if fails(state, channel):
            failed = True
            if channel >= ONE_SIDED:
                planned[PLANNED.one_sided] = 1.0
    if not (limited or failed):
        return
    collective, cyclic, elevator = commanded_controls(controls, commands[0], commands[1], nacelle_angle)
    low = curve(controls.collective_range, 0, nacelle_angle)
    high = curve(controls.collective_range, 1, nacelle_angle)
    for channel in range(3):
        mode = state[FAULT.actuators + ACTUATOR.size * channel + ACTUATOR.mode]
        begin = x[SYMMETRIC[channel]]
        command, lower, upper = collective, low, high
        if channel == 1:
            command, lower, upper = cyclic, -controls.cyclic_limit, controls.cyclic_limit
        elif channel == 2:
            command, lower, upper = elevator, -controls.elevator_limit, controls.elevator_limit
        gone = gone_in(controls.actuator_rate[channel], dt)
        own = begin + gone * (command - begin)
        end = failed_end(state, channel, begin, own, (lower, upper), dt)
        # A stuck or run-away collective is beyond the governor's reach.
        if channel == 0 and limited and mode != KIND_STUCK and mode != KIND_HARD_OVER:  # noqa: PLR1714
            rise = collective_rate_limit(tables, state, x, nacelle_angle, power) * dt
            end = min(end, max(begin + rise, min(lower, begin)))
        planned[PLANNED.begin + channel], planned[PLANNED.own + channel] = begin, end
        planned[PLANNED.lower + channel], planned[PLANNED.upper + channel] = lower, upper
        planned[PLANNED.asked + channel], planned[PLANNED.share + channel] = command, gone
        if end != own:
            planned[channel] = end
            x[SYMMETRIC[channel]] = start_for(begin, end, command, gone)
    if planned[PLANNED.one_sided] != 0.0:
        _sides_begin(tables, state, x, dt, planned)


@inner_kernel
def gone_in(rate: float, dt: float) -> float:
    """Share of the way to its command that an actuator goes in a frame.

    Args:
        rate: Inverse of its lag [1/s].
    """
    return -math.expm1(-rate * dt)


@inner_kernel
def _failed_sides(
    state: FloatArray, pair: int, sound: tuple[float, float], planned: FloatArray, dt: float
) -> tuple[float, float]:
    """Mean and half difference of the two sides of a swashplate control after the step [rad].

    Args:
        pair: 0 collective, 1 cyclic.
        sound: Mean and half difference of two sound sides then [rad].
    """
    mean, half = sound
    begin, before = planned[PLANNED.begin + pair], planned[PLANNED.difference + pair]
    stops = (planned[PLANNED.lower + pair], planned[PLANNED.upper + pair])
    channel = ONE_SIDED + 2 * pair
    right = failed_end(state, channel, begin + before, mean + half, stops, dt)
    left = failed_end(state, channel + 1, begin - before, mean - half, stops, dt)
    return 0.5 * (right + left), 0.5 * (right - left)


@inner_kernel
def _sound_sides(
    state: FloatArray, pair: int, difference: float, gone: float, planned: FloatArray
) -> tuple[float, float]:
    """Mean and half difference that two sound sides would have after the step [rad].

    Mean and half difference lag on their own (the governor is slow, the swashplates are quick), so a sound side is
    known by both, not by where it stands.

    Args:
        pair: 0 collective, 1 cyclic.
        difference: Half difference that the lateral controls ask for [rad].
        gone: Share of the way to it that is gone in the step.
    """
    mean, half = state[FAULT.mean + pair], state[FAULT.half + pair]
    if math.isnan(planned[pair]):
        mean += planned[PLANNED.share + pair] * (planned[PLANNED.asked + pair] - mean)
    else:  # a short engine, or both sides have failed
        mean += planned[PLANNED.own + pair] - planned[PLANNED.begin + pair]
    return mean, half + gone * (difference - half)


@inner_kernel
def _pair_fails(state: FloatArray, pair: int) -> bool:
    return fails(state, ONE_SIDED + 2 * pair) or fails(state, ONE_SIDED + 2 * pair + 1)


@inner_kernel
def _surface_end(tables: FaultTables, state: FloatArray, k: int, begin: float, own: float, dt: float) -> float:
    """Where aileron (2) or rudder (3) is after the step [rad]."""
    stop = tables.aileron_stop if k == 2 else tables.rudder_stop
    return failed_end(state, ONE_SIDED + 2 + k, begin, own, (-stop, stop), dt)


@inner_kernel
def _sides_begin(tables: FaultTables, state: FloatArray, x: FloatArray, dt: float, planned: FloatArray) -> None:
    """Do what ``fault_actuators_begin`` does, for what the lateral controls move."""
    gone = gone_in(tables.difference_rate, dt)
    for k in range(4):
        begin = x[LATERAL[k]]
        planned[PLANNED.difference + k] = begin
        command = state[FAULT.differences + k] if state[FAULT.seen] != 0.0 else begin
        if k < 2:
            if state[FAULT.seen] == 0.0:
                state[FAULT.mean + k], state[FAULT.half + k] = planned[PLANNED.begin + k], begin
            if _pair_fails(state, k):
                sound = _sound_sides(state, k, command, gone, planned)
                mean, half = _failed_sides(state, k, sound, planned, dt)
                asked, share = planned[PLANNED.asked + k], planned[PLANNED.share + k]
                x[SYMMETRIC[k]] = start_for(planned[PLANNED.begin + k], mean, asked, share)
                x[LATERAL[k]] = start_for(begin, half, command, gone)
        elif fails(state, ONE_SIDED + 2 + k):
            own = begin + gone * (command - begin)
            end = _surface_end(tables, state, k, begin, own, dt)
            x[LATERAL[k]] = start_for(begin, end, command, gone)
        planned[PLANNED.start + k] = x[LATERAL[k]]


@inner_kernel
def fault_actuators_end(tables: FaultTables, state: FloatArray, x: FloatArray, dt: float, planned: FloatArray) -> None:
    """Put the failed actuators where they are after the plant's step.

    Args:
        state: Fault state; learns what the lateral controls asked for.
        x: Aircraft state after the step; failed actuators are changed.
        planned: From ``fault_actuators_begin``.
    """
    for channel in range(3):
        if not math.isnan(planned[channel]):
            x[SYMMETRIC[channel]] = planned[channel]
    if planned[PLANNED.one_sided] == 0.0:
        state[FAULT.seen] = 0.0
        return
    state[FAULT.seen] = 1.0
    gone = gone_in(tables.difference_rate, dt)
    for k in range(4):
        start = planned[PLANNED.start + k]
        command = start + (x[LATERAL[k]] - start) / gone
        state[FAULT.differences + k] = command
        begin = planned[PLANNED.difference + k]
        if k < 2:
            sound = (x[SYMMETRIC[k]], x[LATERAL[k]])
            if _pair_fails(state, k):
                sound = _sound_sides(state, k, command, gone, planned)
                x[SYMMETRIC[k]], x[LATERAL[k]] = _failed_sides(state, k, sound, planned, dt)
            state[FAULT.mean + k], state[FAULT.half + k] = sound
        elif fails(state, ONE_SIDED + 2 + k):
            own = begin + gone * (command - begin)
            x[LATERAL[k]] = _surface_end(tables, state, k, begin, own, dt)
