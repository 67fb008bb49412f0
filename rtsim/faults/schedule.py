"""Failures as the kernels read them: the schedule and the state of a sound aircraft."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtsim.faults import fault_kernels as kernels
from rtsim.faults.fault import ACTUATORS, Fault, FaultKind, fault_changes
from rtsim.faults.fault_kernels import FaultTables
from rtsim.frame import FloatArray
from rtsim.units import DEGREE, HORSEPOWER, KNOT

KINDS: dict[FaultKind, int] = {
    "nacelle-jammed": kernels.KIND_NACELLE_JAMMED,
    "nacelle-slow": kernels.KIND_NACELLE_SLOW,
    "actuator-stuck": kernels.KIND_STUCK,
    "actuator-slow": kernels.KIND_SLOW,
    "actuator-hard-over": kernels.KIND_HARD_OVER,
    "airspeed-bias": kernels.KIND_AIRSPEED_BIAS,
    "airspeed-frozen": kernels.KIND_AIRSPEED_FROZEN,
    "engine-limit": kernels.KIND_ENGINE_LIMIT,
}
"""Failures by name, with their number in the kernels."""
HARD_OVER_RATE = 20.0 * DEGREE
"""Rate of a hard-over that gives none [rad/s]: assumed, the XV-15's actuator rates are not published."""
GOVERNOR_FREQUENCY = 3.0
"""How fast the governor takes collective off [rad/s]: assumed, half the bandwidth of the collective's actuator."""
POWER_PER_COLLECTIVE = 200.0 * HORSEPOWER / DEGREE
"""Shaft power of both rotors per collective without axial flow [W/rad]; fitted to the database, docs/faults.md."""
POWER_PER_COLLECTIVE_SPEED = 7.5 * HORSEPOWER / DEGREE / KNOT
"""Its growth with the airspeed along the mast [W s/(rad m)]; fitted likewise."""


def fault_change(fault: Fault, *, on: bool, time: float) -> FloatArray:
    """Give the row of a schedule that lets a failure begin or end, shape (SCHEDULE_COLUMNS,).

    Args:
        fault: The failure.
        on: Begins; else ends.
        time: When [s].
    """
    channel = 0 if fault.actuator is None else ACTUATORS.index(fault.actuator)
    rate = fault.rate if fault.kind == "actuator-hard-over" and fault.rate is not None else HARD_OVER_RATE
    row = np.array([time, KINDS[fault.kind], channel, fault.value, rate, 1.0 if on else 0.0])
    row.setflags(write=False)  # like the rows of a schedule, so that one compiled kernel serves both
    return row


def fault_tables(faults: Sequence[Fault]) -> FaultTables:
    """Give the tables that the kernels read.

    Args:
        faults: The failures of a flight, in any order.
    """
    schedule = np.zeros((0, kernels.SCHEDULE_COLUMNS))
    changes = fault_changes(faults)
    if changes:
        schedule = np.stack([fault_change(fault, on=on, time=time) for time, fault, on in changes])
    schedule.setflags(write=False)
    return FaultTables(
        schedule=schedule,
        governor_frequency=GOVERNOR_FREQUENCY,
        power_per_collective=POWER_PER_COLLECTIVE,
        power_per_collective_speed=POWER_PER_COLLECTIVE_SPEED,
    )


def new_fault_state() -> FloatArray:
    """Give the fault state of a sound aircraft, shape (FAULT_STATE_SIZE,)."""
    return np.zeros(kernels.FAULT_STATE_SIZE)
