"""Compiled figures of merit: a flight measured while it is flown, without keeping its rows.

The sums run in the order of the frames and every formula is that of ``rtsim.measures.metrics``: a candidate flown in
a batch and the same path flown by ``rtsim fly`` give the same numbers bit for bit.
"""

from __future__ import annotations

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.kernels.compiled import inner_kernel, part
from rtsim.loop.data import Flight
from rtsim.units import STICK_HALF_TRAVEL_IN

# Places of the sums and extremes in the array of one flight.
FRAMES = 0
FLAPPING_SUM, FLAPPING_SQUARES, FLAPPING_PEAK, FLAPPING_PEAK_TIME = 1, 2, 3, 4
# Per control: first value, last value, sums of deviation from the first value and of its square, least, largest,
# sums of rate, of its square and of its magnitude.
STICK, LEVER = 5, 14
FIRST, LAST, SUM, SQUARES, LEAST, LARGEST, RATE_SUM, RATE_SQUARES, TRAVELLED = 0, 1, 2, 3, 4, 5, 6, 7, 8
MARGIN_LEAST, MARGIN_SUM, OUTSIDE_FRAMES = 23, 24, 25
ALTITUDE_DEVIATION, PITCH_LEAST, PITCH_LARGEST = 26, 27, 28
AIRSPEED_SQUARES, AIRSPEED_LARGEST, AIRSPEED_FINAL = 29, 30, 31
NACELLE_FINAL, NACELLE_RATE_LARGEST = 32, 33
STOP_FRAMES, ENGINE_POWER_SUM, ENGINE_POWER_LARGEST, END_CODE = 34, 35, 36, 37
TORQUE_LARGEST, PITCH_RATE_SQUARES = 38, 39
MERIT_SIZE = 40

OUTSIDE_MARGIN_KT = -0.5
"""A corridor margin below this counts as outside [kn]."""


@inner_kernel
def _control_step(merit: FloatArray, place: int, value: float, first: bool, dt: float) -> None:
    if first:
        merit[place + FIRST] = value
        merit[place + LEAST] = value
        merit[place + LARGEST] = value
    else:
        rate = (value - merit[place + LAST]) / dt
        merit[place + RATE_SUM] += rate
        merit[place + RATE_SQUARES] += rate * rate
        merit[place + TRAVELLED] += abs(value - merit[place + LAST])
        merit[place + LEAST] = min(merit[place + LEAST], value)
        merit[place + LARGEST] = max(merit[place + LARGEST], value)
    deviation = value - merit[place + FIRST]
    merit[place + SUM] += deviation
    merit[place + SQUARES] += deviation * deviation
    merit[place + LAST] = value


@inner_kernel
def merit_step(merit: FloatArray, row: FloatArray, dt: float) -> None:
    """Add one frame to the sums and extremes.

    Args:
        merit: Sums and extremes, zeros before the first frame; shape (MERIT_SIZE,).
        row: The finished frame.
        dt: Length of the frame [s].
    """
    first = merit[FRAMES] == 0.0
    flapping = row[COLUMN.flapping_deg]
    margin = row[COLUMN.margin_kt]
    pitch = row[COLUMN.pitch_deg]
    power = row[COLUMN.engine_power_shp]
    torque = row[COLUMN.mast_torque_inlb]
    if first:
        merit[FLAPPING_PEAK] = flapping
        merit[FLAPPING_PEAK_TIME] = row[COLUMN.time_s]
        merit[MARGIN_LEAST] = margin
        merit[PITCH_LEAST] = pitch
        merit[PITCH_LARGEST] = pitch
        merit[ENGINE_POWER_LARGEST] = power
        merit[TORQUE_LARGEST] = torque
    elif flapping > merit[FLAPPING_PEAK]:
        merit[FLAPPING_PEAK] = flapping
        merit[FLAPPING_PEAK_TIME] = row[COLUMN.time_s]
    merit[FLAPPING_SUM] += flapping
    merit[FLAPPING_SQUARES] += flapping * flapping
    _control_step(merit, STICK, row[COLUMN.stick] * STICK_HALF_TRAVEL_IN, first, dt)
    _control_step(merit, LEVER, row[COLUMN.lever], first, dt)
    merit[MARGIN_LEAST] = min(merit[MARGIN_LEAST], margin)
    merit[MARGIN_SUM] += margin
    if margin < OUTSIDE_MARGIN_KT:
        merit[OUTSIDE_FRAMES] += 1.0
    deviation = abs(row[COLUMN.altitude_m] - row[COLUMN.altitude_reference_m])
    merit[ALTITUDE_DEVIATION] = max(merit[ALTITUDE_DEVIATION], deviation)
    merit[PITCH_LEAST] = min(merit[PITCH_LEAST], pitch)
    merit[PITCH_LARGEST] = max(merit[PITCH_LARGEST], pitch)
    error = row[COLUMN.airspeed_kt] - row[COLUMN.airspeed_reference_kt]
    merit[AIRSPEED_SQUARES] += error * error
    merit[AIRSPEED_LARGEST] = max(merit[AIRSPEED_LARGEST], abs(error))
    merit[AIRSPEED_FINAL] = row[COLUMN.airspeed_kt]
    merit[NACELLE_FINAL] = row[COLUMN.nacelle_deg]
    merit[NACELLE_RATE_LARGEST] = max(merit[NACELLE_RATE_LARGEST], abs(row[COLUMN.nacelle_rate_deg_s]))
    if row[COLUMN.control_on_stop] > 0.5:
        merit[STOP_FRAMES] += 1.0
    merit[ENGINE_POWER_SUM] += power
    merit[ENGINE_POWER_LARGEST] = max(merit[ENGINE_POWER_LARGEST], power)
    merit[TORQUE_LARGEST] = max(merit[TORQUE_LARGEST], torque)
    pitch_rate = row[COLUMN.pitch_rate_deg_s]
    merit[PITCH_RATE_SQUARES] += pitch_rate * pitch_rate
    merit[FRAMES] += 1.0


@part
def add_merit(flight: Flight) -> float:
    """Add the frame that was flown to the sums and extremes in ``flight.measures``; a part of the frame.

    Args:
        flight: The flight.
    """
    merit_step(flight.measures, flight.scratch.row, flight.tables.dt)
    return 0.0


@part
def measure_rows(rows: FloatArray, dt: float, merit: FloatArray) -> float:
    """Measure a flight that was recorded.

    Args:
        rows: The frame history, shape (frames, signals).
        dt: Length of a frame [s].
        merit: Sums and extremes, updated in place, shape (MERIT_SIZE,).
    """
    for k in range(rows.shape[0]):
        merit_step(merit, rows[k], dt)
    return 0.0
