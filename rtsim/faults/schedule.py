"""Failures as the kernels read them: the schedule and the state of a sound aircraft."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtsim.aircraft.profile import AircraftProfile, xv15_profile
from rtsim.arrays import FloatArray
from rtsim.command import CHANNELS
from rtsim.faults import fault_kernels as kernels
from rtsim.faults.fault import ACTUATORS, Fault, FaultKind, fault_changes
from rtsim.faults.fault_kernels import FaultTables
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
    "control-jammed": kernels.KIND_CONTROL_JAMMED,
}
"""Failures by name, with their number in the kernels."""
HARD_OVER_RATE = 20.0 * DEGREE
"""Rate of a hard-over that gives none [rad/s]: assumed, the XV-15's actuator rates are not published."""


def fault_change(fault: Fault, *, on: bool, time: float, profile: AircraftProfile | None = None) -> FloatArray:
    """Give the row of a schedule that lets a failure begin or end, shape (SCHEDULE_COLUMNS,).

    Args:
        fault: The failure.
        on: Begins; else ends.
        time: When [s].
    """
    channel = 0 if fault.actuator is None else ACTUATORS.index(fault.actuator)
    if fault.control is not None:
        channel = CHANNELS.index(fault.control.replace("-", "_"))
    rate = fault.rate if fault.kind == "actuator-hard-over" and fault.rate is not None else HARD_OVER_RATE
    row = np.array([time, KINDS[fault.kind], channel, fault.size(profile), rate, 1.0 if on else 0.0])
    row.setflags(write=False)  # like the rows of a schedule, so that one compiled kernel serves both
    return row


def fault_tables(faults: Sequence[Fault], profile: AircraftProfile | None = None) -> FaultTables:
    """Give the tables that the kernels read.

    Args:
        faults: The failures of a flight, in any order.

    Raises:
        InputError: A value of the aircraft's governor is missing or out of range.
    """
    systems = (xv15_profile() if profile is None else profile).systems
    governor = systems.table("governor")
    surfaces = systems.table("surfaces") if systems.has("surfaces") else xv15_profile().systems.table("surfaces")
    schedule = np.zeros((0, kernels.EVENT.size))
    changes = fault_changes(faults)
    if changes:
        schedule = np.stack([fault_change(fault, on=on, time=time, profile=profile) for time, fault, on in changes])
    schedule.setflags(write=False)
    growth = governor.number("power_per_collective_speed_hp_deg_kt", low=0.0, high=1e6)
    return FaultTables(
        schedule=schedule,
        governor_frequency=governor.number("collective_frequency_rad_s", low=0.0, high=100.0),
        power_per_collective=governor.number("power_per_collective_hp_deg", low=1e-3, high=1e6) * HORSEPOWER / DEGREE,
        power_per_collective_speed=growth * HORSEPOWER / DEGREE / KNOT,
        aileron_stop=surfaces.number("aileron_stop_deg", low=0.0, high=90.0) * DEGREE,
        rudder_stop=surfaces.number("rudder_stop_deg", low=0.0, high=90.0) * DEGREE,
        difference_rate=1.0 / surfaces.number("actuator_tau_s", low=1e-3, high=10.0),
    )


def new_fault_state() -> FloatArray:
    """Give the fault state of a sound aircraft, shape (FAULT_STATE_SIZE,)."""
    return np.zeros(kernels.FAULT.size)
