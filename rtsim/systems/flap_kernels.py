"""Compiled flaps: they follow their schedule, or go to a setting and stay there.

While the flaps follow the schedule their deviation from it is exactly zero. Between schedule and setting they travel at
a constant rate.
"""

from __future__ import annotations

from typing import NamedTuple

from rtsim.aircraft.variables import INPUT
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel

FLAP, FLAP_FOLLOWS, FLAP_SETTING = 0, 1, 2
"""Places in the state: deflection [rad], whether the flaps are where the schedule has them (0, 1), setting to go to
[rad]; a setting below zero is the deflection at which the schedule was left."""
FLAP_STATE_SIZE = 3
NO_SETTING = -1.0


class FlapTables(NamedTuple):
    """What the kernels know of the flaps. SI and radians."""

    nodes: FloatArray
    """Published settings, ascending; the first and last are the ends of the travel, shape (4,) [rad]."""
    rate: float
    """Rate of travel [rad/s]."""


@inner_kernel
def _towards(value: float, goal: float, most: float) -> float:
    return value + min(max(goal - value, -most), most)


@inner_kernel
def flap_now(state: FloatArray, schedule: float) -> float:
    """Deflection at the start of the frame [rad].

    Args:
        schedule: Deflection of the schedule [rad].
    """
    return schedule if state[FLAP_FOLLOWS] != 0.0 else state[FLAP]


@inner_kernel
def flap_advance(tables: FlapTables, state: FloatArray, automatic: bool, schedule: float, dt: float) -> None:
    """Move the flaps over one frame.

    Args:
        state: Flap state, changed in place.
        automatic: Whether they follow the schedule, or else go to their setting.
        schedule: Deflection of the schedule at the start of the frame [rad].
    """
    present = flap_now(state, schedule)
    most = tables.rate * dt
    if automatic:
        state[FLAP_SETTING] = NO_SETTING
        state[FLAP] = _towards(present, schedule, most)
        if state[FLAP] == schedule:
            state[FLAP_FOLLOWS] = 1.0
        return
    if state[FLAP_SETTING] < 0.0:
        state[FLAP_SETTING] = present
    state[FLAP_FOLLOWS] = 0.0
    state[FLAP] = _towards(present, state[FLAP_SETTING], most)


@inner_kernel
def flap_parts(tables: FlapTables, present: float, expected: float, out: FloatArray) -> None:
    """Split a difference of two deflections into its parts in the intervals between settings.

    Args:
        present: One deflection [rad].
        expected: The one it is compared with [rad].
        out: Written: the parts, shape (3,) [rad].
    """
    nodes = tables.nodes
    for k in range(3):
        low, high = nodes[k], nodes[k + 1]
        out[k] = min(max(present, low), high) - min(max(expected, low), high)


@inner_kernel
def flap_inputs(tables: FlapTables, state: FloatArray, schedule: float, u: FloatArray) -> None:
    """Write the aircraft's flap inputs: exactly zero while the flaps follow the schedule.

    Args:
        schedule: Deflection of the schedule [rad].
        u: Inputs of the aircraft; those of the flaps are written.
    """
    flap_parts(tables, flap_now(state, schedule), schedule, u[INPUT.flap_0_20 : INPUT.flap_40_75 + 1])
