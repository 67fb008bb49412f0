"""Compiled conversion actuator and pilot's switch.

The nacelle angle follows its command angle through a critically damped second-order filter (the paper's filter *is* the
actuator). Within a frame the command angle is a ramp, for which the filter has a closed form: no integration error,
and the angle, rate and acceleration at any time within the frame for the stages of an integrator.

Legend:
    rate: Rate of the command angle over the frame [rad/s].
    angle: Nacelle angle [rad].
    command_angle: Command angle of the actuator [rad].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.ramp_filter_kernels import critically_damped_ramp

COMMAND_ANGLE, ANGLE, RATE = 0, 1, 2
"""Places in the actuator's state [rad, rad, rad/s]."""
SWITCH_RUNNING, SWITCH_TARGET, SWITCH_HELD, SWITCH_BLOCKED = 0, 1, 2, 3
"""Places in the switch's state: running to a detent (0, 1), its angle [rad], direction held in the last frame
(-1, 0, 1), waiting for a new press (0, 1)."""
SWITCH_STATE_SIZE = 4

_ANGLE_TOLERANCE = 1e-9
"""Two nacelle angles closer than this are the same detent or stop [rad]; far below any frame's travel."""


class NacelleTables(NamedTuple):
    """What the kernels know of the nacelles. SI and radians."""

    frequency: float
    """Natural frequency of the critically damped filter [rad/s]."""
    forward_stop: float
    """Smallest command angle [rad]."""
    aft_stop: float
    """Largest command angle [rad]."""
    downstop: float
    """At and below this angle the nacelles count as resting on the airplane-mode stop [rad]."""
    assigned_rate: float
    """Largest rate a scenario or an automatic law may command [rad/s]."""
    switch_rate: float
    """Rate of the pilot's switch [rad/s]."""
    slow_zone: float
    """Distance from either stop within which the switch moves the nacelles slowly [rad]."""
    slow_rate_forward: float
    """Switch rate near the forward stop [rad/s]."""
    slow_rate_aft: float
    """Switch rate near the aft stop [rad/s]."""
    detents: FloatArray
    """Angles at which the switch stops the nacelles, ascending, shape (n,) [rad]."""


@inner_kernel
def nacelle_effective_rate(tables: NacelleTables, state: FloatArray, rate: float, dt: float) -> float:
    """Ramp rate of the command angle over one frame that keeps it within the stops.

    Args:
        state: Actuator state, shape (3,).
        rate: Wanted rate, aft positive [rad/s].

    Returns:
        The rate that acts [rad/s]: the wanted one, or what still fits before the stop.
    """
    end = state[0] + rate * dt
    if end < tables.forward_stop:
        return (tables.forward_stop - state[0]) / dt
    if end > tables.aft_stop:
        return (tables.aft_stop - state[0]) / dt
    return rate


@inner_kernel
def nacelle_at(tables: NacelleTables, state: FloatArray, rate: float, elapsed: float, out: FloatArray) -> None:
    """Motion of the nacelle at a time within the frame, exact for a command ramp.

    Args:
        state: Actuator state at the start of the frame, shape (3,).
        elapsed: Time since the start of the frame [s].
        out: Filled with angle [rad], rate [rad/s] and acceleration [rad/s^2]; shape (3,).
    """
    out[0], out[1], out[2] = critically_damped_ramp(tables.frequency, state[0], rate, state[1], state[2], elapsed)


@inner_kernel
def nacelle_path(tables: NacelleTables, state: FloatArray, rate: float, dt: float, path: FloatArray) -> None:
    """Motion at the start, middle and end of a frame, for the stages of a Runge-Kutta step.

    Args:
        state: Actuator state at the start of the frame, shape (3,).
        path: Filled with rows start, middle, end of angle [rad], rate [rad/s], acceleration [rad/s^2]; shape (3, 3).
    """
    nacelle_at(tables, state, rate, 0.0, path[0])
    nacelle_at(tables, state, rate, 0.5 * dt, path[1])
    nacelle_at(tables, state, rate, dt, path[2])


@inner_kernel
def nacelle_advance(tables: NacelleTables, state: FloatArray, rate: float, dt: float) -> None:
    """Advance the actuator by one frame.

    Args:
        state: Actuator state, updated in place, shape (3,).
        rate: Rate of the command angle over the frame, from ``nacelle_effective_rate`` [rad/s].
    """
    state[1], state[2], _ = critically_damped_ramp(tables.frequency, state[0], rate, state[1], state[2], dt)
    state[0] += rate * dt
    # The mechanical stops. A command that began at rest never overshoots, so this only meets rounding and a state
    # that was set moving towards a stop.
    if state[1] < tables.forward_stop:
        state[1] = tables.forward_stop
        state[2] = max(state[2], 0.0)
    elif state[1] > tables.aft_stop:
        state[1] = tables.aft_stop
        state[2] = min(state[2], 0.0)


@inner_kernel
def on_downstop(tables: NacelleTables, angle: float) -> bool:
    """Tell whether the nacelles rest on the airplane-mode stop."""
    return angle <= tables.downstop


@inner_kernel
def nacelle_assigned_rate(tables: NacelleTables, wanted: float) -> float:
    """Limit the rate that a scenario or an automatic law asks for.

    Args:
        wanted: Rate asked for, aft positive [rad/s].

    Returns:
        The limited rate [rad/s].
    """
    return min(max(wanted, -tables.assigned_rate), tables.assigned_rate)


@inner_kernel
def switch_rate_limit(tables: NacelleTables, command_angle: float) -> float:
    """Rate at which the pilot's switch moves the nacelles here; slow near the stops.

    Returns:
        The rate, positive [rad/s].
    """
    if command_angle - tables.forward_stop < tables.slow_zone:
        return tables.slow_rate_forward
    if tables.aft_stop - command_angle < tables.slow_zone:
        return tables.slow_rate_aft
    return tables.switch_rate


@inner_kernel
def next_detent(tables: NacelleTables, command_angle: float, direction: float) -> float:
    """The next angle at which a run in this direction ends: a detent, or the forward stop.

    Args:
        direction: -1 forward, 1 aft.

    Returns:
        The angle [rad]. Aft of the last detent there is none: the aft stop.
    """
    count = tables.detents.shape[0]
    if direction > 0.0:
        for i in range(count):
            if tables.detents[i] > command_angle + _ANGLE_TOLERANCE:
                return tables.detents[i]
        return tables.aft_stop
    for j in range(count):
        i = count - 1 - j
        if tables.detents[i] < command_angle - _ANGLE_TOLERANCE:
            return tables.detents[i]
    return tables.forward_stop


@inner_kernel
def nacelle_switch_step(
    tables: NacelleTables, switch: FloatArray, pressed: float, command_angle: float, dt: float
) -> float:
    """Rate that the pilot's three-position switch commands in this frame.

    Between the aft stop and the last detent (90 to 75 deg) the nacelles move while the switch is held and stop where
    it is let go; moving forward they stop at the detent. From there on each press runs them at constant rate to the
    next detent and no further, held or not; pressing the other way during a run turns it round.

    Args:
        switch: Switch state, updated in place, zeros at the start, shape (4,).
        pressed: Below 0 forward, above 0 aft, 0 let go.
        command_angle: Command angle of the actuator at the start of the frame [rad].

    Returns:
        The rate of the command angle over the frame, ending exactly on a detent or stop [rad/s].
    """
    direction = 0.0
    if pressed > 0.0:
        direction = 1.0
    elif pressed < 0.0:
        direction = -1.0
    new_press = direction != 0.0 and direction != switch[2]
    if new_press or direction == 0.0:
        switch[3] = 0.0
    switch[2] = direction

    free_from = tables.detents[tables.detents.shape[0] - 1]
    free = command_angle > free_from + _ANGLE_TOLERANCE or (
        direction > 0.0 and command_angle > free_from - _ANGLE_TOLERANCE
    )
    if free:
        switch[0] = 0.0
        if direction == 0.0 or switch[3] != 0.0:
            return 0.0
        target = next_detent(tables, command_angle, direction)
    else:
        if new_press:
            switch[0] = 1.0
            switch[1] = next_detent(tables, command_angle, direction)
        if switch[0] == 0.0:
            return 0.0
        target = switch[1]

    travel = target - command_angle
    limit = switch_rate_limit(tables, command_angle)
    if abs(travel) <= limit * dt + _ANGLE_TOLERANCE:
        switch[0] = 0.0
        switch[3] = 1.0
        return travel / dt
    return limit if travel > 0.0 else -limit


def new_actuator_state(angle: float) -> FloatArray:
    """Give the actuator's state at rest, shape (3,)."""
    return np.array([angle, angle, 0.0])


def new_switch_state() -> FloatArray:
    """Give the switch's state before any press, shape (4,)."""
    return np.zeros(SWITCH_STATE_SIZE)
