"""Compiled margin monitor: distance to every limit, levels with hysteresis, normalized distance to the corridor."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rtsim.arrays import FloatArray, IntArray
from rtsim.command import SENSOR
from rtsim.corridor.corridor_kernels import CorridorTables, boundary_speed, turn_excess
from rtsim.frame import COLUMN, NACELLES_JAMMED
from rtsim.kernels.compiled import inner_kernel, kernel
from rtsim.places import Places
from rtsim.protection.law_data import (
    LAW,
    LAW_MONITOR,
    WORK_SIZE,
    ProtectionTables,
    SidewaysLimits,
    SinkTables,
    TorqueTables,
)
from rtsim.protection.law_kernels import law_start, protect
from rtsim.protection.limiter_kernels import allowed_sink, torque_limit
from rtsim.protection.prediction_kernels import BoundaryTables, speed_range
from rtsim.protection.sideways_limiter_kernels import (
    bank_limit,
    sideward_limit,
    sideward_speed,
    worst_flapping,
    worst_torque,
)
from rtsim.units import DEGREE, KNOT

LIMIT_WORDS = {
    "stall_attitude": "low-speed side of the corridor",
    "load_torque": "high-speed side of the corridor",
    "downstop_gate": "downstop gate",
    "nacelle_range": "nacelle range",
    "nacelle_rate": "nacelle rate",
    "flap_stop": "flapping",
    "mast_torque": "mast torque",
    "load_factor": "load factor",
    "pitch_attitude": "pitch attitude",
    "consistency": "aircraft's own trims",
    "sink": "sink rate",
    "engine_power": "engine power",
    "transmission": "helicopter transmission",
    "rotor_endurance": "rotor endurance",
    "bank_attitude": "bank attitude",
    "sideslip": "sideslip",
    "time_to_limit": "time to the corridor's boundary",
}
"""Limits in words for people, in the order of the recorded reasons (a reason is a limit's place plus one), and last the
time to the corridor's boundary. A new limit, before the last, has its margin in ``limit_margins``, a number in
``LIMIT_NUMBERS``, and in an aircraft's ``protection`` that number and its levels."""
KIND = Places(*LIMIT_WORDS)
"""Places of the margins and levels."""
LIMIT_NUMBERS = {
    "flapping": ("flapping_deg", 0.1, 60.0),
    "load_factor_max": ("load_factor_max", 1.0, 20.0),
    "load_factor_min": ("load_factor_min", -20.0, 1.0),
    "pitch": ("pitch_deg", 1.0, 80.0),
    "nacelle_forward": ("nacelle_forward_deg", 0.0, 95.0),
    "nacelle_aft": ("nacelle_aft_deg", 0.0, 95.0),
    "nacelle_rate": ("nacelle_rate_deg_s", 0.1, 60.0),
}
"""Limits that are numbers: key under ``[limits]`` of an aircraft's profile, least and largest value allowed there."""
LIMIT = Places(*LIMIT_NUMBERS)
"""Their places; SI and radians."""
LEVEL_STATE_SIZE = KIND.size * 6
FAR = 1e3
"""A margin where the limit does not apply."""
DRIVEN = Places("engine_power", "engine_power_available", "power", "thrust_coefficient_over_solidity", "advance_ratio")
"""What the frame knows of engines and rotors besides the sensors, SI; NaN where only the sensors are known."""


class RotorTables(NamedTuple):
    """What rotors and transmission bear for long. SI and radians."""

    transmission: float
    """Rotor shaft power of all engines that the transmission bears in helicopter mode [W]; infinite: any."""
    helicopter: float
    """Nacelle angle above which that holds [rad]."""
    nacelle: FloatArray
    """Nacelle angles of the endurance limit, ascending, held beyond both ends [rad]; none: no limit is known."""
    advance_ratio: FloatArray
    """Its advance ratios, ascending from 0, the last held beyond."""
    endurance: FloatArray
    """Largest CT/sigma for endurance, shape (nacelle angles, advance ratios)."""


class MonitorTables(NamedTuple):
    """Limits and levels; SI and radians, read-only."""

    chart: BoundaryTables
    """The corridor that is watched."""
    corners: CorridorTables
    """The same with its corners, for the normalized distance."""
    plant: BoundaryTables
    """The corridor that the plant's level trims allow."""
    torque: TorqueTables
    """Mast torque."""
    sink: SinkTables
    """Sink rate."""
    rotor: RotorTables
    """Transmission and rotor endurance."""
    sideways: SidewaysLimits
    """Bank and sideslip."""
    alpha_speed: float
    """Added to the airspeed where sideslip is an angle [m/s]."""
    numbers: FloatArray
    """Limits that are numbers, places ``LIMIT``."""
    threshold: FloatArray
    """Margins below which caution, warning, exceedance begin (KIND.size, 3)."""
    hysteresis: FloatArray
    """How far above its threshold a margin must rise before a level ends (KIND.size,)."""
    rise: float
    """How long a margin must be below a threshold [s]."""
    fall: float
    """How long it must be above threshold plus hysteresis [s]."""


@inner_kernel
def _segment(nodes: FloatArray, value: float) -> tuple[int, float]:
    """Where a value lies between ascending nodes: number of the node before it and share of the way, ends held."""
    last, k = nodes.shape[0] - 1, 0
    while k < last - 1 and nodes[k + 1] <= value:
        k += 1
    return k, min(max((value - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0), 1.0)


@inner_kernel
def endurance_limit(tables: RotorTables, advance_ratio: float, nacelle: float) -> float:
    """Largest CT/sigma that rotors bear for long [-], linear between the published points.

    Args:
        tables: The limit, with points.
        advance_ratio: Speed of the air across the disc over tip speed.
        nacelle: Nacelle angle [rad].
    """
    i, s = _segment(tables.nacelle, nacelle)
    j, t = _segment(tables.advance_ratio, advance_ratio)
    z = tables.endurance
    near = z[i, j] + t * (z[i, j + 1] - z[i, j])
    return near + s * (z[i + 1, j] + t * (z[i + 1, j + 1] - z[i + 1, j]) - near)


@inner_kernel
def _rotor_margins(tables: RotorTables, driven: FloatArray, angle: float, out: FloatArray) -> None:
    """Margins of engines, transmission and rotors; ``FAR`` where nothing is known of them."""
    out[KIND.engine_power] = out[KIND.transmission] = out[KIND.rotor_endurance] = FAR
    available = driven[DRIVEN.engine_power_available]
    if available > 0.0:
        out[KIND.engine_power] = 1.0 - driven[DRIVEN.engine_power] / available
    power = driven[DRIVEN.power]
    if angle > tables.helicopter and math.isfinite(tables.transmission) and not math.isnan(power):
        out[KIND.transmission] = 1.0 - power / tables.transmission
    load = driven[DRIVEN.thrust_coefficient_over_solidity]
    if tables.nacelle.shape[0] > 0 and not math.isnan(load) and load != 0.0:
        limit = endurance_limit(tables, driven[DRIVEN.advance_ratio], angle)
        out[KIND.rotor_endurance] = 1.0 - abs(load) / limit


@inner_kernel
def limit_margins(
    tables: MonitorTables, sensors: FloatArray, driven: FloatArray, time_to_limit: float, out: FloatArray
) -> None:
    """Signed distance to every limit, positive inside.

    Args:
        sensors: What is known, order of ``rtsim.command.Sensors``.
        driven: What is known besides, places ``DRIVEN``.
        time_to_limit: Predicted time to the corridor's boundary [s].
        out: Written, shape (KIND.size,): m/s for speeds, rad and rad/s for angles, share of the limit for torque, power
            and rotor load.
    """
    airspeed, angle, numbers = sensors[SENSOR.airspeed], sensors[SENSOR.nacelle_angle], tables.numbers
    excess = turn_excess(sensors[SENSOR.bank])
    low, high = speed_range(tables.chart, angle, excess)
    out[KIND.stall_attitude] = airspeed - low
    out[KIND.load_torque] = high - airspeed
    # On the downstop the gate is closed, margin negative, while leaving it would be over the limit off it.
    out[KIND.downstop_gate] = tables.chart.high[0] - airspeed if sensors[SENSOR.on_downstop] != 0.0 else FAR
    out[KIND.nacelle_range] = min(angle - numbers[LIMIT.nacelle_forward], numbers[LIMIT.nacelle_aft] - angle)
    out[KIND.nacelle_rate] = numbers[LIMIT.nacelle_rate] - abs(sensors[SENSOR.nacelle_rate])
    out[KIND.flap_stop] = numbers[LIMIT.flapping] - worst_flapping(sensors)
    out[KIND.mast_torque] = 1.0 - worst_torque(sensors) / torque_limit(tables.torque, airspeed, angle)
    nz = sensors[SENSOR.load_factor]
    out[KIND.load_factor] = min(numbers[LIMIT.load_factor_max] - nz, nz - numbers[LIMIT.load_factor_min])
    out[KIND.pitch_attitude] = numbers[LIMIT.pitch] - abs(sensors[SENSOR.pitch])
    low, high = speed_range(tables.plant, angle, excess)
    out[KIND.consistency] = min(airspeed - low, high - airspeed)
    out[KIND.sink] = allowed_sink(tables.sink, airspeed, sensors[SENSOR.altitude]) + sensors[SENSOR.climb_rate]
    _rotor_margins(tables.rotor, driven, angle, out)
    out[KIND.bank_attitude] = min(bank_limit(tables.sideways, angle) - abs(sensors[SENSOR.bank]), FAR)
    sideward = sideward_speed(sensors, tables.alpha_speed)
    out[KIND.sideslip] = min(sideward_limit(tables.sideways, airspeed) - abs(sideward), FAR)
    out[KIND.time_to_limit] = time_to_limit


@inner_kernel
def levels_step(tables: MonitorTables, margins: FloatArray, dt: float, state: FloatArray, levels: FloatArray) -> None:
    """Advance the warning level of every limit by one frame.

    Each threshold has its own timer, as in ``rtsim.corridor``.

    Args:
        margins: From ``limit_margins``.
        state: Updated in place, zeros at the start, shape (LEVEL_STATE_SIZE,).
        levels: Written: 0 clear, 1 caution, 2 warning, 3 exceedance, shape (KIND.size,).
    """
    tolerance = 0.5 * dt
    for kind in range(KIND.size):
        level = 0.0
        for k in range(3):
            active = 6 * kind + 2 * k
            timer = active + 1
            if state[active] == 0.0:
                waiting, hold = margins[kind] < tables.threshold[kind, k], tables.rise
            else:
                waiting = margins[kind] > tables.threshold[kind, k] + tables.hysteresis[kind]
                hold = tables.fall
            state[timer] = state[timer] + dt if waiting else 0.0
            if state[timer] > hold - tolerance:
                state[active] = 1.0 - state[active]
                state[timer] = 0.0
            if state[active] != 0.0:
                level = k + 1.0
        levels[kind] = level


@inner_kernel
def _segment_distance(x: float, y: float, x0: float, y0: float, x1: float, y1: float) -> float:
    dx, dy = x1 - x0, y1 - y0
    square = dx * dx + dy * dy
    t = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return math.hypot(x - x0 - t * dx, y - y0 - t * dy)


@inner_kernel
def normalized_distance(tables: MonitorTables, airspeed: float, angle: float, excess: float) -> float:
    """Signed distance to the nearer boundary in the plane of airspeed / 10 kn and nacelle angle / 10 deg.

    For displays and ranking; laws use the speed margins.

    Args:
        angle: Nacelle angle [rad].
        excess: Load factor of the turn less 1, which moves the sides.

    Returns:
        The distance [-], positive inside.
    """
    x, y = airspeed / (10.0 * KNOT), angle / (10.0 * DEGREE)
    best = FAR
    for side in range(2):
        nacelle = tables.corners.low_nacelle if side == 0 else tables.corners.high_nacelle
        speed = tables.corners.low_speed if side == 0 else tables.corners.high_speed
        turned = tables.corners.turn_low if side == 0 else tables.corners.turn_high
        for i in range(nacelle.shape[0] - 1):
            first = speed[i] + excess * boundary_speed(tables.corners.turn_nacelle, turned, nacelle[i])
            second = speed[i + 1] + excess * boundary_speed(tables.corners.turn_nacelle, turned, nacelle[i + 1])
            x0, y0 = first / (10.0 * KNOT), nacelle[i] / (10.0 * DEGREE)
            x1, y1 = second / (10.0 * KNOT), nacelle[i + 1] / (10.0 * DEGREE)
            best = min(best, _segment_distance(x, y, x0, y0, x1, y1))
    low, high = speed_range(tables.chart, angle, excess)
    if angle <= tables.chart.downstop_nacelle and airspeed > tables.corners.high_speed[0]:
        # On the downstop the flap-extended limit is no boundary; the end of the downstop's own range is.
        best = abs(high - airspeed) / (10.0 * KNOT)
    return best if low <= airspeed <= high else -best


@kernel
def watch(
    tables: MonitorTables,
    sensors: FloatArray,
    driven: FloatArray,
    time_to_limit: FloatArray,
    dt: float,
    state: FloatArray,
    margins: FloatArray,
    levels: FloatArray,
) -> None:
    """Monitor consecutive frames.

    Args:
        sensors: One row per frame, shape (frames, SENSOR.size).
        driven: The same of what is known besides, shape (frames, DRIVEN.size).
        time_to_limit: One per frame (frames,) [s].
        state: Of the levels, updated in place, zeros at the start of a flight (LEVEL_STATE_SIZE,).
        margins: Written (frames, KIND.size).
        levels: Written (frames, KIND.size).
    """
    for k in range(sensors.shape[0]):
        limit_margins(tables, sensors[k], driven[k], time_to_limit[k], margins[k])
        levels_step(tables, margins[k], dt, state, levels[k])


@kernel
def sensors_of(rows: FloatArray, columns: IntArray, scales: FloatArray, sensors: FloatArray) -> None:
    """Read the sensors of consecutive frames back out of their rows.

    Args:
        rows: The frames' rows, shape (frames, signals).
        columns: Column of each sensor; ``nacelle_ok`` stands in the bits of the failures.
        scales: One unit of these columns in SI.
        sensors: Written, shape (frames, SENSOR.size).
    """
    for k in range(rows.shape[0]):
        for sensor in range(columns.shape[0]):
            sensors[k, sensor] = rows[k, columns[sensor]] * scales[sensor]
        sensors[k, SENSOR.nacelle_ok] = 0.0 if int(rows[k, COLUMN.failures]) & NACELLES_JAMMED else 1.0


@kernel
def distances(tables: MonitorTables, sensors: FloatArray, distance: FloatArray) -> None:
    """Normalized distance over a whole flight.

    Args:
        sensors: One row per frame, shape (frames, SENSOR.size).
        distance: Written (frames,).
    """
    for k in range(sensors.shape[0]):
        excess = turn_excess(sensors[k, SENSOR.bank])
        airspeed, angle = sensors[k, SENSOR.airspeed], sensors[k, SENSOR.nacelle_angle]
        distance[k] = normalized_distance(tables, airspeed, angle, excess)


@kernel
def predict(
    tables: ProtectionTables, sensors: FloatArray, acting: FloatArray, time_to_limit: FloatArray, side: FloatArray
) -> None:
    """Time to the corridor's boundary over a whole flight, as the laws see it in flight.

    Args:
        tables: A law's tables; whatever the law, nothing is limited here.
        sensors: One row per frame, shape (frames, SENSOR.size).
        acting: Stick, lever, nacelle rate [rad/s], lateral stick, pedals that acted (frames, 5).
        time_to_limit: Written (frames,) [s].
        side: Written: -1 low, 1 high, 0 none within the horizon (frames,).
    """
    watching = ProtectionTables(
        LAW_MONITOR,
        tables.every,
        tables.model,
        tables.corridor,
        tables.torque,
        tables.sink,
        tables.sideways,
        tables.settings,
    )
    state = np.empty(LAW.size)
    law_start(watching, state)
    work, applied = np.empty(WORK_SIZE), np.empty(acting.shape[1])
    for k in range(sensors.shape[0]):
        protect(watching, state, k, sensors[k], acting[k], applied, work)
        time_to_limit[k], side[k] = state[LAW.time], state[LAW.side]
