"""What a trial flight is judged by, measured from its rows."""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.kernels.compiled import inner_kernel
from rtsim.protection import law_data as law
from rtsim.protection.limiter_kernels import torque_limit
from rtsim.units import DEGREE, INCH_POUND, KNOT

OUTSIDE_MARGIN, PERSISTENCE, MERGE = -0.5, 0.1, 0.5
"""An exceedance: margin below this [kn], for this long [s]; events closer than the last are one [s]."""
ARRIVED_AIRSPEED, ARRIVED_NACELLE = 1.0, 0.5
"""How near the programme's end counts as arrived [kn, deg]."""

# Places in the metrics of a trial, in the order of ``rtsim.measures.trial_metrics.TRIAL_METRICS``.
(
    M_EXCEEDANCES, M_DEPTH, M_OUTSIDE, M_AREA, M_MARGIN,
    M_HEIGHT_LOST, M_HEIGHT_GAINED, M_FLAPPING, M_FLAPPING_OVER, M_TORQUE, M_TORQUE_OVER,
    M_LOAD_MAX, M_LOAD_MIN, M_PITCH,
    M_CORRIDOR_ACTIVATIONS, M_CORRIDOR_ACTIVE, M_OTHER_ACTIVE, M_STICK_AUTHORITY, M_LEVER_AUTHORITY,
    M_NACELLE_REMOVED, M_STICK_STEP, M_LEVER_STEP,
    M_COMPLETED, M_YIELDED, M_ARRIVAL, M_AIRSPEED_END, M_NACELLE_END, M_FLOWN, M_CONVERSION,
) = range(29)  # fmt: skip
METRIC_COUNT = 29


class TrialLimits(NamedTuple):
    """Secondary limits that a trial is judged by. SI and radians."""

    flapping: float
    """Flapping stop [deg]."""
    torque: law.TorqueTables
    """Mast torque."""
    torque_excess: float
    """Share of the torque limit that counts as over it [-]."""


@inner_kernel
def _is_corridor(reason: float) -> bool:
    return reason in (law.REASON_LOW, law.REASON_HIGH, law.REASON_GATE)


@inner_kernel
def measure_trial(
    rows: FloatArray,
    programme: FloatArray,
    limits: TrialLimits,
    dt: float,
    out: FloatArray,
) -> None:
    """Measure a trial; whether it was completed and yielded is left to the caller.

    Args:
        rows: The frames flown.
        programme: The simulation's programme, whose last point is where the flight should arrive.
        limits: Secondary limits.
        dt: Length of a frame [s].
        out: Written: ``M_*``, shape (METRIC_COUNT,).
    """
    frames = rows.shape[0]
    out[:] = 0.0
    out[M_MARGIN], out[M_LOAD_MIN], out[M_LOAD_MAX] = 1e9, 1e9, -1e9
    run = 0  # frames of the present excursion
    quiet = 1e9  # time since the last exceedance
    unacted = 1e9  # time since the law's last corridor action
    last = programme.shape[1] - 1
    # Where the programme's nacelle motion ends, and the airspeed it has there.
    turned = last
    while turned > 0 and programme[2, turned - 1] == programme[2, last]:
        turned -= 1
    goal, way = programme[1, turned], programme[1, turned] - programme[1, 0]
    converted = -1.0
    stick_square = lever_square = 0.0
    for k in range(frames):
        row = rows[k]
        margin = row[COLUMN.margin_kt]
        out[M_MARGIN] = min(out[M_MARGIN], margin)
        if margin < OUTSIDE_MARGIN:
            run += 1
            out[M_OUTSIDE] += dt
            if run == math.ceil(PERSISTENCE / dt - 1e-9):
                # Merged where the gap before the whole excursion is short.
                if quiet > MERGE + 1e-9:
                    out[M_EXCEEDANCES] += 1.0
                quiet = 0.0
        else:
            if run * dt >= PERSISTENCE - 1e-9:
                quiet = 0.0
            elif run > 0:
                quiet += run * dt
            run = 0
            quiet += dt
        out[M_AREA] += max(-margin, 0.0) * dt
        height = row[COLUMN.altitude_m] - row[COLUMN.altitude_reference_m]
        out[M_HEIGHT_LOST] = max(out[M_HEIGHT_LOST], -height)
        out[M_HEIGHT_GAINED] = max(out[M_HEIGHT_GAINED], height)
        flapping = row[COLUMN.flapping_deg]
        out[M_FLAPPING] = max(out[M_FLAPPING], flapping)
        if flapping > limits.flapping:
            out[M_FLAPPING_OVER] += dt
        bound = torque_limit(limits.torque, row[COLUMN.airspeed_kt] * KNOT, row[COLUMN.nacelle_deg] * DEGREE)
        share = row[COLUMN.mast_torque_inlb] * INCH_POUND / bound
        out[M_TORQUE] = max(out[M_TORQUE], share)
        if share > limits.torque_excess:
            out[M_TORQUE_OVER] += dt
        out[M_LOAD_MAX] = max(out[M_LOAD_MAX], row[COLUMN.load_factor])
        out[M_LOAD_MIN] = min(out[M_LOAD_MIN], row[COLUMN.load_factor])
        out[M_PITCH] = max(out[M_PITCH], abs(row[COLUMN.pitch_deg]))

        corridor = other = False
        for reason in (
            row[COLUMN.protection_stick_reason],
            row[COLUMN.protection_lever_reason],
            row[COLUMN.protection_nacelle_reason],
        ):
            if reason != 0.0:
                if _is_corridor(reason):
                    corridor = True
                else:
                    other = True
        unacted += dt
        if corridor:
            if unacted > MERGE + 1e-9:
                out[M_CORRIDOR_ACTIVATIONS] += 1.0
            unacted = 0.0
            out[M_CORRIDOR_ACTIVE] += dt
        if other:
            out[M_OTHER_ACTIVE] += dt
        stick_square += row[COLUMN.protection_stick] ** 2
        lever_square += row[COLUMN.protection_lever] ** 2
        out[M_NACELLE_REMOVED] += abs(row[COLUMN.protection_nacelle_rate_deg_s]) * dt
        if k > 0:
            before = rows[k - 1]
            step = abs(row[COLUMN.protection_stick] - before[COLUMN.protection_stick])
            out[M_STICK_STEP] = max(out[M_STICK_STEP], step)
            step = abs(row[COLUMN.protection_lever] - before[COLUMN.protection_lever])
            out[M_LEVER_STEP] = max(out[M_LEVER_STEP], step)
        if converted < 0.0 and abs(row[COLUMN.nacelle_deg] - programme[2, last] / DEGREE) <= ARRIVED_NACELLE:
            short = goal / KNOT - row[COLUMN.airspeed_kt]
            if way == 0.0 or (short if way > 0.0 else -short) <= ARRIVED_AIRSPEED:
                converted = (k + 1) * dt
        away = abs(row[COLUMN.airspeed_kt] - programme[1, last] / KNOT) > ARRIVED_AIRSPEED
        if away or abs(row[COLUMN.nacelle_deg] - programme[2, last] / DEGREE) > ARRIVED_NACELLE:
            out[M_ARRIVAL] = (k + 1) * dt
    out[M_DEPTH] = max(-out[M_MARGIN], 0.0)
    out[M_STICK_AUTHORITY] = math.sqrt(stick_square / frames)
    out[M_LEVER_AUTHORITY] = math.sqrt(lever_square / frames)
    out[M_AIRSPEED_END] = rows[frames - 1, COLUMN.airspeed_kt]
    out[M_NACELLE_END] = rows[frames - 1, COLUMN.nacelle_deg]
    out[M_FLOWN] = frames * dt
    out[M_CONVERSION] = converted if converted >= 0.0 else frames * dt
