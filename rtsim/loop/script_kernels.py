"""Compiled hands of a scripted pilot: pulses on controls and nacelle switch, and a pilot who yields to warnings.

The built-in pilot flies the programme; the script changes what it asks for. From the first use of the nacelle switch on
the programme's nacelle motion is over: whoever has the switch in his hand moves the nacelles himself.
"""

from __future__ import annotations

import math

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.kernels.compiled import inner_kernel
from rtsim.units import KNOT

WARNING_MARGIN = 4.0 * KNOT
"""Corridor margin at which the monitor warns and a pilot who yields begins to react [m/s]."""
CHANNEL_SWITCH = 2
"""Place of the nacelle rate in a command; pulses move the other places as they are."""
SHAPE_STEP, SHAPE_DOUBLET, SHAPE_SINE = 0, 1, 2

# Places in a row of pulses.
P_CHANNEL, P_START, P_END, P_AMOUNT, P_SHAPE, P_PERIOD, P_SET = 0, 1, 2, 3, 4, 5, 6
"""P_AMOUNT: added to the control, or the nacelle rate [rad/s]; P_SET 1: it replaces what the pilot gives."""

# Places in the script's state.
S_WARNED_SINCE, S_YIELDED, S_SWITCHED, S_HELD_AIRSPEED = 0, 1, 2, 3
"""Time since when there is a warning [s] (negative: none); 1 after yielding; 1 after the first use of the switch;
airspeed held after yielding [m/s]."""
SCRIPT_STATE_SIZE = 4
PULSE_SIZE = 7
"""Numbers of a pulse."""


def new_script_state() -> FloatArray:
    """Give the script's state before the first frame, shape (SCRIPT_STATE_SIZE,)."""
    state = np.zeros(SCRIPT_STATE_SIZE)
    state[S_WARNED_SINCE] = -1.0
    return state


@inner_kernel
def script_command(pulses: FloatArray, state: FloatArray, time: float, command: FloatArray) -> None:
    """Change the pilot's command to what the script's hands do.

    Args:
        pulses: The script, shape (pulses, PULSE_SIZE).
        state: Script state; notes the first use of the switch.
        time: Time at the start of the frame [s].
        command: Stick, lever, nacelle rate [rad/s], lateral stick, pedals; changed in place, limited to the travel of
            the controls.
    """
    if state[S_YIELDED] != 0.0:
        command[2] = 0.0
        return
    pressed = 0.0
    for k in range(pulses.shape[0]):
        start = pulses[k, P_START]
        if time < start:
            continue
        channel = int(pulses[k, P_CHANNEL])
        if channel == CHANNEL_SWITCH:
            state[S_SWITCHED] = 1.0
        if time >= pulses[k, P_END]:
            continue
        amount = pulses[k, P_AMOUNT]
        if pulses[k, P_SHAPE] == SHAPE_DOUBLET and time >= 0.5 * (start + pulses[k, P_END]):
            amount = -amount
        elif pulses[k, P_SHAPE] == SHAPE_SINE:
            amount *= math.sin(2.0 * math.pi * (time - start) / pulses[k, P_PERIOD])
        if channel == CHANNEL_SWITCH:
            pressed = amount
        elif pulses[k, P_SET] != 0.0:
            command[channel] = amount
        else:
            command[channel] += amount
    command[0] = min(max(command[0], -1.0), 1.0)
    command[1] = min(max(command[1], 0.0), 1.0)
    command[3] = min(max(command[3], -1.0), 1.0)
    command[4] = min(max(command[4], -1.0), 1.0)
    if state[S_SWITCHED] != 0.0:
        command[2] = pressed


@inner_kernel
def warns(shown: FloatArray, row: FloatArray) -> bool:
    """Whether a pilot is warned: the margin shown is small, or the protection acts.

    Args:
        shown: What the airspeed indicator shows, then the margins that go with it [m/s].
    """
    warned = min(shown[1], shown[2]) < WARNING_MARGIN
    warned = warned or row[COLUMN.protection_stick_reason] != 0.0
    warned = warned or row[COLUMN.protection_lever_reason] != 0.0
    warned = warned or row[COLUMN.protection_lateral_stick_reason] != 0.0
    warned = warned or row[COLUMN.protection_pedal_reason] != 0.0
    return warned or row[COLUMN.protection_nacelle_reason] != 0.0


@inner_kernel
def script_notice(
    state: FloatArray, reaction: float, time: float, warned: bool, airspeed: float, reference: FloatArray
) -> None:
    """Let a pilot who yields give up his plan when he has been warned for as long as he needs to react.

    He lets go of stick, lever and switch pulses and holds the airspeed of that moment.

    Args:
        state: Script state, updated in place.
        reaction: Time the warning must last [s]; negative for a pilot who never yields.
        time: Time at the start of the coming frame [s].
        warned: Whether there is a warning, or the protection acts.
        airspeed: Indicated airspeed [m/s].
        reference: The simulation's airspeed reference and its rate; held after yielding.
    """
    if reaction < 0.0:
        return
    if state[S_YIELDED] == 0.0:
        if not warned:
            state[S_WARNED_SINCE] = -1.0
        elif state[S_WARNED_SINCE] < 0.0:
            state[S_WARNED_SINCE] = time
        if state[S_WARNED_SINCE] >= 0.0 and time - state[S_WARNED_SINCE] >= reaction:
            state[S_YIELDED] = 1.0
            state[S_HELD_AIRSPEED] = airspeed
    if state[S_YIELDED] != 0.0:
        reference[0] = state[S_HELD_AIRSPEED]
        reference[1] = 0.0
