"""Everything a flight is measured by: declared in one table, summed up frame by frame.

A new metric is a line of ``METRICS``, and a place in ``SUM`` with what ``metrics_step`` adds to it in every frame;
names in scenarios, campaigns, searches, JSON and reports follow. A flight is measured while it is flown
(``add_metrics``) or from its rows (``measure_rows``), by the same step: the same to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.kernels.compiled import inner_kernel, part
from rtsim.loop.data import Flight
from rtsim.places import Places
from rtsim.protection import law_data as law
from rtsim.protection.law_data import SidewaysLimits, TorqueTables
from rtsim.protection.limiter_kernels import torque_limit
from rtsim.protection.sideways_limiter_kernels import bank_limit, sideward_limit, slip_speed
from rtsim.units import DEGREE, HORSEPOWER, INCH_POUND, KNOT, PEDAL_HALF_TRAVEL_IN, STICK_HALF_TRAVEL_IN

OUTSIDE_MARGIN_KT, PERSISTENCE_S, MERGE_S = -0.5, 0.1, 0.5
"""An exceedance: margin below this [kn], for this long [s]; events closer than the last are one [s]."""
ARRIVED_AIRSPEED_KT, ARRIVED_NACELLE_DEG = 1.0, 0.5
"""How near the programme's end counts as arrived [kn, deg]."""
TORQUE_EXCESS = 1.02
"""Share of the torque limit above which it counts as exceeded [-]."""
NACELLE_FILTER_FREQUENCY = 3.0
"""Natural frequency of the critically damped nacelle filter [rad/s] (design decision: it is the actuator)."""
LATE_PHASE_S = 30.0
"""Start of the phase in which flapping must have come down [s]."""
EPSILON = 1e-9
"""Times that differ by less are the same [s]."""

FLIGHT, TRIAL, SEARCH = "flight", "trial", "search"
ALL = (FLIGHT, TRIAL, SEARCH)


@dataclass(frozen=True, slots=True)
class Metric:
    """One number that is measured of a flight."""

    name: str
    """Its place, and its name where no other is given; with its unit."""
    unit: str
    """Unit as people write it; empty for a number."""
    words: str
    """What it is."""
    value: Callable[[Any], float]
    """From what was summed up, by the names of ``SUM``, and the length of a frame, ``dt``."""
    views: tuple[str, ...] = ALL
    """Where it is shown: ``rtsim fly`` and ``[[expect]]``; trials, ``[[trial.expect]]`` and campaigns; searches."""
    flight: str = ""
    """Name in ``rtsim fly --json`` where it is another; groups before the dot."""
    search: str = ""
    """Name among the figures of a search where it is another."""
    objective: str = ""
    """Name under which a search can minimize it; empty where it cannot."""
    campaign: tuple[str, ...] = ()
    """Statistics in a campaign's report: ``p50`` or another quantile, ``max``, ``rms``; ``p50 outside`` is that of the
    flights that left the corridor."""
    kind: type = float
    """What it is shown as: float, int or bool."""

    @property
    def text(self) -> str:
        """What it is, with its unit."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words


def _deviation(total: float, squares: float, count: float) -> float:
    """Standard deviation from the sums of values near 0 and of their squares; 0 of none."""
    mean = total / count if count else 0.0
    return math.sqrt(max(squares / count - mean * mean, 0.0)) if count else 0.0


METRICS = (
    Metric("exceedances", "",
           "excursions with a corridor margin below -0.5 kn for at least 0.1 s, those within 0.5 s merged",
           lambda s: s.exceedances, (FLIGHT, TRIAL), flight="corridor.exceedances", kind=int),
    Metric("worst_margin_kt", "kn", "smallest corridor margin, negative outside", lambda s: s.margin_least,
           flight="corridor.worst_margin_kt"),
    Metric("time_outside_s", "s", "time with a corridor margin below -0.5 kn", lambda s: s.outside_frames * s.dt,
           flight="corridor.time_outside_s", campaign=("p50 outside",)),
    Metric("depth_kt", "kn", "deepest airspeed outside the corridor", lambda s: max(-s.margin_least, 0.0), (TRIAL,),
           campaign=("p50 outside", "p95 outside")),
    Metric("area_kt_s", "kn s", "integral of the airspeed outside the corridor", lambda s: s.area, (TRIAL,)),
    Metric("mean_margin_kt", "kn", "mean corridor margin", lambda s: s.margin / s.frames, (SEARCH,)),
    Metric("proximity_kt", "kn", "smallest corridor margin, negated", lambda s: -s.margin_least, (),
           objective="corridor_proximity"),
    Metric("flapping_peak_deg", "deg",
           "largest cyclic flapping relative to the mast, √(b1c² + b1s²), of the rotor that flaps more",
           lambda s: s.flapping_peak, flight="flapping_deg.peak", objective="flapping_peak",
           campaign=("max",)),
    Metric("flapping_peak_time_s", "s", "time of the largest flapping", lambda s: s.flapping_peak_time,
           (FLIGHT, SEARCH), flight="flapping_deg.peak_time_s"),
    Metric("flapping_late_peak_deg", "deg", "largest flapping from 30 s on; null for shorter flights",
           lambda s: s.flapping_late_peak, (FLIGHT,), flight="flapping_deg.peak_after_30_s"),
    Metric("flapping_rms_deg", "deg", "root mean square of cyclic flapping",
           lambda s: math.sqrt(s.flapping_squares / s.frames), (FLIGHT, SEARCH), flight="flapping_deg.rms",
           objective="flapping_rms"),
    Metric("flapping_integral_deg_s", "deg s", "integral of cyclic flapping", lambda s: s.flapping * s.dt,
           (FLIGHT, SEARCH), flight="flapping_deg.integral_deg_s", objective="flapping_integral"),
    Metric("flapping_over_s", "s", "time with flapping beyond its stop", lambda s: s.flapping_over, (TRIAL,)),
    Metric("airspeed_final_kt", "kn", "airspeed of the last frame", lambda s: s.airspeed, flight="airspeed_kt.final"),
    Metric("airspeed_rms_error_kt", "kn",
           "root mean square, over all frames, of true airspeed minus its reference behind a 1.5 rad/s filter",
           lambda s: math.sqrt(s.airspeed_squares / s.frames), (FLIGHT, SEARCH), flight="airspeed_kt.rms_error"),
    Metric("airspeed_max_error_kt", "kn", "largest magnitude of that difference", lambda s: s.airspeed_error,
           (FLIGHT, SEARCH), flight="airspeed_kt.max_error"),
    Metric("nacelle_final_deg", "deg", "nacelle angle of the last frame", lambda s: s.nacelle,
           flight="nacelle_deg.final"),
    Metric("nacelle_max_error_deg", "deg",
           "largest magnitude of nacelle angle minus the programme behind a 3 rad/s filter, in closed form",
           lambda s: s.nacelle_error, (FLIGHT,), flight="nacelle_deg.max_error"),
    Metric("nacelle_max_rate_deg_s", "deg/s", "largest magnitude of the nacelle rate", lambda s: s.nacelle_rate,
           (FLIGHT, SEARCH), flight="nacelle_deg.max_rate_deg_s"),
    Metric("altitude_deviation_m", "m", "largest magnitude of altitude minus its reference",
           lambda s: max(s.height_lost, s.height_gained), (FLIGHT, SEARCH), flight="altitude_m.max_deviation",
           objective="altitude_excursion"),
    Metric("altitude_final_m", "m", "altitude of the last frame", lambda s: s.altitude, (FLIGHT,),
           flight="altitude_m.final"),
    Metric("height_lost_m", "m", "largest height below the altitude to hold", lambda s: s.height_lost, (TRIAL,),
           campaign=("p90", "max")),
    Metric("height_gained_m", "m", "largest height above the altitude to hold", lambda s: s.height_gained, (TRIAL,)),
    Metric("pitch_min_deg", "deg", "smallest pitch attitude", lambda s: s.pitch_least, (FLIGHT, SEARCH),
           flight="pitch_deg.min"),
    Metric("pitch_max_deg", "deg", "largest pitch attitude", lambda s: s.pitch_largest, (FLIGHT, SEARCH),
           flight="pitch_deg.max"),
    Metric("pitch_peak_deg", "deg", "largest pitch attitude, up or down",
           lambda s: max(abs(s.pitch_least), abs(s.pitch_largest)), (TRIAL,)),
    Metric("pitch_beyond_deg", "deg", "largest pitch attitude beyond its limit, negative inside",
           lambda s: max(abs(s.pitch_least), abs(s.pitch_largest)) - s.pitch_limit, ()),
    Metric("pitch_excursion_deg", "deg", "largest minus smallest pitch attitude",
           lambda s: s.pitch_largest - s.pitch_least, (), objective="pitch_excursion"),
    Metric("pitch_rate_rms_deg_s", "deg/s", "root mean square of the pitch rate",
           lambda s: math.sqrt(s.pitch_rate_squares / s.frames), (SEARCH,)),
    Metric("stick_rms_in", "in", "standard deviation of the stick that acted (±4.8 in)",
           lambda s: _deviation(s.stick.sum, s.stick.squares, s.frames), (FLIGHT, SEARCH), flight="stick.rms_in",
           search="stick.rms"),
    Metric("stick_rms_rate_in_s", "in/s", "standard deviation of the stick's rate",
           lambda s: _deviation(s.stick.rate_sum, s.stick.rate_squares, s.stick.rates), (FLIGHT, SEARCH),
           flight="stick.rms_rate_in_s", search="stick.rms_rate", objective="stick_effort"),
    Metric("stick_travel_in", "in", "largest minus smallest position of the stick",
           lambda s: s.stick.largest - s.stick.least, (FLIGHT, SEARCH), flight="stick.travel_in",
           search="stick.travel"),
    Metric("stick_path_in", "in", "distance moved by the stick", lambda s: s.stick.travelled, (SEARCH,),
           search="stick.path", objective="stick_travel"),
    Metric("lever_rms", "", "standard deviation of the power lever, 0 to 1",
           lambda s: _deviation(s.lever.sum, s.lever.squares, s.frames), (FLIGHT, SEARCH), flight="lever.rms",
           search="lever.rms"),
    Metric("lever_rms_rate_per_s", "1/s", "standard deviation of the lever's rate",
           lambda s: _deviation(s.lever.rate_sum, s.lever.rate_squares, s.lever.rates), (FLIGHT, SEARCH),
           flight="lever.rms_rate_per_s", search="lever.rms_rate", objective="lever_effort"),
    Metric("lever_travel", "", "largest minus smallest position of the lever",
           lambda s: s.lever.largest - s.lever.least, (FLIGHT, SEARCH), flight="lever.travel", search="lever.travel"),
    Metric("lever_path", "", "distance moved by the lever", lambda s: s.lever.travelled, (SEARCH,),
           search="lever.path"),
    Metric("bank_beyond_deg", "deg", "largest bank beyond its limit, either way, negative inside",
           lambda s: s.bank_beyond, ()),
    Metric("bank_peak_deg", "deg", "largest bank, either way",
           lambda s: max(abs(s.bank_least), abs(s.bank_largest)), (TRIAL,), campaign=("max",)),
    Metric("bank_over_s", "s", "time with bank beyond its limit", lambda s: s.bank_over, (TRIAL,)),
    Metric("bank_min_deg", "deg", "smallest bank angle, left negative", lambda s: s.bank_least, (FLIGHT,),
           flight="bank_deg.min"),
    Metric("bank_max_deg", "deg", "largest bank angle, right positive", lambda s: s.bank_largest, (FLIGHT,),
           flight="bank_deg.max"),
    Metric("bank_rms_error_deg", "deg",
           "root mean square, over all frames, of bank minus that of the coordinated turn asked for, behind its filter",
           lambda s: math.sqrt(s.bank_squares / s.frames), (FLIGHT,), flight="bank_deg.rms_error"),
    Metric("bank_max_error_deg", "deg", "largest magnitude of that difference", lambda s: s.bank_error, (FLIGHT,),
           flight="bank_deg.max_error"),
    Metric("heading_final_deg", "deg", "heading of the last frame, 0 to 360", lambda s: s.heading, (FLIGHT,),
           flight="heading_deg.final"),
    Metric("heading_rms_error_deg", "deg",
           "root mean square, over all frames, of heading minus the one asked for, behind its filter",
           lambda s: math.sqrt(s.heading_squares / s.frames), (FLIGHT,), flight="heading_deg.rms_error"),
    Metric("heading_max_error_deg", "deg", "largest magnitude of that difference", lambda s: s.heading_error,
           (FLIGHT,), flight="heading_deg.max_error"),
    Metric("sideslip_max_deg", "deg", "largest magnitude of the sideslip", lambda s: s.sideslip, (FLIGHT,),
           flight="sideslip_deg.max"),
    Metric("sideslip_beyond_kt", "kn", "largest sideward airspeed beyond its limit, either way, negative inside",
           lambda s: s.sideslip_beyond, ()),
    Metric("sideslip_over_s", "s", "time with sideward airspeed along body y beyond its limit",
           lambda s: s.sideslip_over, (TRIAL,)),
    Metric("lateral_max_kt", "kn", "largest magnitude of the sideways airspeed", lambda s: s.lateral, (FLIGHT,),
           flight="lateral_kt.max"),
    Metric("point_max_error_m", "m", "largest distance from the point over the ground that is held; 0 without one",
           lambda s: s.point_error, (FLIGHT,), flight="track_m.point_max_error"),
    Metric("track_max_error_m", "m", "largest distance beside the line over the ground that is held; 0 without a line",
           lambda s: s.track_error, (FLIGHT,), flight="track_m.max_error"),
    Metric("position_north_m", "m", "place of the last frame north of the start", lambda s: s.north, (FLIGHT,),
           flight="position_m.north"),
    Metric("position_east_m", "m", "place of the last frame east of the start", lambda s: s.east, (FLIGHT,),
           flight="position_m.east"),
    Metric("position_north_min_m", "m", "least place north of the start", lambda s: s.north_least, (FLIGHT,),
           flight="position_m.north_min"),
    Metric("position_north_max_m", "m", "greatest place north of the start", lambda s: s.north_largest, (FLIGHT,),
           flight="position_m.north_max"),
    Metric("position_east_min_m", "m", "least place east of the start", lambda s: s.east_least, (FLIGHT,),
           flight="position_m.east_min"),
    Metric("position_east_max_m", "m", "greatest place east of the start", lambda s: s.east_largest, (FLIGHT,),
           flight="position_m.east_max"),
    Metric("position_max_distance_m", "m", "largest distance from the start, over the ground",
           lambda s: math.sqrt(s.away), (FLIGHT,), flight="position_m.max_distance"),
    Metric("lateral_stick_rms_in", "in", "standard deviation of the lateral stick that acted (±4.8 in)",
           lambda s: _deviation(s.lateral_stick.sum, s.lateral_stick.squares, s.frames), (FLIGHT,),
           flight="lateral_stick.rms_in"),
    Metric("lateral_stick_rms_rate_in_s", "in/s", "standard deviation of the rate of the lateral stick",
           lambda s: _deviation(s.lateral_stick.rate_sum, s.lateral_stick.rate_squares, s.lateral_stick.rates),
           (FLIGHT,), flight="lateral_stick.rms_rate_in_s"),
    Metric("lateral_stick_travel_in", "in", "largest minus smallest position of the lateral stick",
           lambda s: s.lateral_stick.largest - s.lateral_stick.least, (FLIGHT,), flight="lateral_stick.travel_in"),
    Metric("lateral_stick_peak_in", "in", "farthest position of the lateral stick from neutral",
           lambda s: max(abs(s.lateral_stick.least), abs(s.lateral_stick.largest)), (FLIGHT,),
           flight="lateral_stick.peak_in"),
    Metric("pedal_rms_in", "in", "standard deviation of the pedals that acted (±2.5 in)",
           lambda s: _deviation(s.pedal.sum, s.pedal.squares, s.frames), (FLIGHT,),
           flight="pedal.rms_in"),
    Metric("pedal_rms_rate_in_s", "in/s", "standard deviation of the rate of the pedals",
           lambda s: _deviation(s.pedal.rate_sum, s.pedal.rate_squares, s.pedal.rates),
           (FLIGHT,), flight="pedal.rms_rate_in_s"),
    Metric("pedal_travel_in", "in", "largest minus smallest position of the pedals",
           lambda s: s.pedal.largest - s.pedal.least, (FLIGHT,), flight="pedal.travel_in"),
    Metric("pedal_peak_in", "in", "farthest position of the pedals from neutral",
           lambda s: max(abs(s.pedal.least), abs(s.pedal.largest)), (FLIGHT,),
           flight="pedal.peak_in"),
    Metric("controls_on_stop_frames", "", "frames with a stick, lever, pedals, cyclic or elevator on a stop",
           lambda s: s.stop_frames, (FLIGHT, SEARCH), kind=int),
    Metric("torque_ratio_peak", "", "largest mast torque as a share of its limit", lambda s: s.torque_share, (TRIAL,),
           campaign=("max",)),
    Metric("torque_over_s", "s", "time with mast torque above 1.02 of its limit", lambda s: s.torque_over, (TRIAL,)),
    Metric("mast_torque_max_inlb", "in lb", "largest torque of one mast", lambda s: s.torque, (SEARCH,)),
    Metric("engine_power_max_shp", "shp", "largest engine power", lambda s: s.power_largest, (SEARCH,)),
    Metric("energy_mj", "MJ", "energy of the engines", lambda s: s.power * s.dt * HORSEPOWER / 1e6, (SEARCH,),
           objective="energy"),
    Metric("fuel_used_lb", "lb", "fuel burned", lambda s: s.fuel_flow * s.dt / 3600.0, (FLIGHT, SEARCH),
           flight="fuel_lb.used"),
    Metric("load_factor_max", "", "largest load factor", lambda s: s.load_largest, (TRIAL,)),
    Metric("load_factor_min", "", "smallest load factor", lambda s: s.load_least, (TRIAL,)),
    Metric("load_factor_beyond", "", "largest load factor beyond its limits, negative inside",
           lambda s: max(s.load_largest - s.load_limit_max, s.load_limit_min - s.load_least), ()),
    Metric("corridor_activations", "", "times the law acted for the corridor's sake, those within 0.5 s merged",
           lambda s: s.activations, (TRIAL,)),
    Metric("corridor_active_s", "s", "time the law acted for the corridor's sake", lambda s: s.corridor_active,
           (TRIAL,)),
    Metric("other_active_s", "s", "time the law acted for another limit (torque, flapping, pitch, sink)",
           lambda s: s.other_active, (TRIAL,)),
    Metric("stick_authority_rms", "", "RMS of what the law added to the stick, -1 to 1",
           lambda s: math.sqrt(s.share_stick_squares / s.frames), (TRIAL,), campaign=("rms",)),
    Metric("lever_authority_rms", "", "RMS of what the law added to the lever, 0 to 1",
           lambda s: math.sqrt(s.share_lever_squares / s.frames), (TRIAL,), campaign=("rms",)),
    Metric("nacelle_removed_deg", "deg", "nacelle motion the law took from or added to what was asked",
           lambda s: s.nacelle_removed, (TRIAL,)),
    Metric("stick_step_max", "", "largest change of the law's share of the stick from frame to frame, -1 to 1",
           lambda s: s.share_stick_step, (TRIAL,)),
    Metric("lever_step_max", "", "largest change of the law's share of the lever from frame to frame, 0 to 1",
           lambda s: s.share_lever_step, (TRIAL,)),
    Metric("completed", "", "1 where the flight was flown to its end, 0 where it ended by itself",
           lambda s: 1.0 if s.ended == 0.0 else 0.0, (TRIAL, SEARCH), kind=bool),
    Metric("yielded", "", "1 where the pilot gave up his plan", lambda s: s.yielded, (TRIAL,)),
    Metric("arrival_s", "s", "time at which airspeed and nacelles are where the programme ends, to stay",
           lambda s: s.arrival, (TRIAL,)),
    Metric("conversion_s", "s", "time at which nacelles and airspeed are where the programme's nacelle motion ends",
           lambda s: s.conversion if s.conversion >= 0.0 else s.frames * s.dt, (TRIAL,)),
    Metric("flown_s", "s", "length of the flight as flown", lambda s: s.frames * s.dt, (TRIAL, SEARCH),
           search="duration_s", objective="duration"),
    Metric("frames", "", "frames flown", lambda s: s.frames, (SEARCH,), kind=int),
)  # fmt: skip
"""All metrics."""
VALUE = Places(*(metric.name for metric in METRICS))
"""Places of the finished metrics of a flight."""

CONTROL = Places(
    "first", "last", "sum", "squares", "least", "largest", "rates", "rate_sum", "rate_squares", "travelled"
)
"""Places of one control: first and last value, sums of the deviation from the first, extremes; sums of the rate."""
SUM = Places(
    # What the flight is judged by, set before it.
    "flapping_limit", "torque_cruise", "torque_takeoff", "takeoff_nacelle", "takeoff_airspeed",
    "load_limit_max", "load_limit_min", "pitch_limit", ("sideways", len(SidewaysLimits._fields)), "alpha_speed",
    # How it ended, set after it.
    "ended", "yielded",
    "frames", "time",
    "margin_least", "margin", "outside_frames", "outside_run", "quiet_frames", "exceedances", "area",
    "flapping", "flapping_squares", "flapping_peak", "flapping_peak_time", "flapping_late_peak", "flapping_over",
    "airspeed_squares", "airspeed_error", "airspeed", "nacelle", "nacelle_error", "nacelle_rate",
    "altitude", "height_lost", "height_gained", "pitch_least", "pitch_largest", "pitch_rate_squares",
    ("stick", CONTROL.size), ("lever", CONTROL.size), ("lateral_stick", CONTROL.size), ("pedal", CONTROL.size),
    "stop_frames", "bank_least", "bank_largest", "bank_beyond", "bank_over", "sideslip_beyond",
    "sideslip_over", "bank_squares", "bank_error", "heading", "heading_squares",
    "heading_error", "sideslip", "lateral", "track_error", "point_error", "north", "north_least", "north_largest",
    "east", "east_least", "east_largest", "away",
    "torque_share", "torque_over", "torque", "power", "power_largest", "fuel_flow", "load_largest", "load_least",
    "unacted", "activations", "corridor_active", "other_active", "nacelle_removed",
    "share_stick", "share_stick_squares", "share_stick_step", "share_lever", "share_lever_squares", "share_lever_step",
    "arrival", "conversion", "goal_airspeed", "goal_way",
)  # fmt: skip
"""Places of what is summed up over a flight, zeros before the first frame but for what it is judged by."""


@inner_kernel
def _control_step(sums: FloatArray, place: int, value: float, first: bool, running: bool, dt: float) -> None:
    if first:
        sums[place + CONTROL.first] = value
        sums[place + CONTROL.least] = value
        sums[place + CONTROL.largest] = value
    elif running:
        moved = value - sums[place + CONTROL.last]
        rate = moved / dt
        sums[place + CONTROL.rates] += 1.0
        sums[place + CONTROL.rate_sum] += rate
        sums[place + CONTROL.rate_squares] += rate * rate
        sums[place + CONTROL.travelled] += abs(moved)
    sums[place + CONTROL.least] = min(sums[place + CONTROL.least], value)
    sums[place + CONTROL.largest] = max(sums[place + CONTROL.largest], value)
    deviation = value - sums[place + CONTROL.first]
    sums[place + CONTROL.sum] += deviation
    sums[place + CONTROL.squares] += deviation * deviation
    sums[place + CONTROL.last] = value


@inner_kernel
def _exceedance_step(sums: FloatArray, margin: float, dt: float) -> None:
    """Count excursions: one that is too short neither counts nor bridges the gap between two others."""
    if margin < OUTSIDE_MARGIN_KT:
        sums[SUM.outside_frames] += 1.0
        sums[SUM.outside_run] += 1.0
        if sums[SUM.outside_run] == math.ceil(PERSISTENCE_S / dt - EPSILON):
            if sums[SUM.exceedances] == 0.0 or sums[SUM.quiet_frames] * dt > MERGE_S + EPSILON:
                sums[SUM.exceedances] += 1.0
            sums[SUM.quiet_frames] = 0.0
        return
    if sums[SUM.outside_run] < math.ceil(PERSISTENCE_S / dt - EPSILON):
        sums[SUM.quiet_frames] += sums[SUM.outside_run]
    sums[SUM.outside_run] = 0.0
    sums[SUM.quiet_frames] += 1.0


@inner_kernel
def nacelle_reference(programme: FloatArray, time: float) -> float:
    """The programme's nacelle angle behind a critically damped 3 rad/s filter, in closed form [deg].

    The programme is a sum of ramps that start at its corners; the answer of w^2 / (s + w)^2 to a unit ramp is
    ``t - 2/w + (t + 2/w) exp(-w t)``. The filter starts at rest on the first nacelle angle.

    Args:
        programme: Time, airspeed, nacelle angle, altitude of the points, shape (4, points), SI and radians.
        time: Time since the start [s].
    """
    w = NACELLE_FILTER_FREQUENCY
    angle, slope, last = float(programme[2, 0]), 0.0, programme.shape[1] - 1
    for corner in range(last + 1):
        since = time - programme[0, corner]
        if last == 0 or since <= 0.0:
            break
        before = slope
        slope = 0.0
        if corner < last:
            slope = (programme[2, corner + 1] - programme[2, corner]) / (
                programme[0, corner + 1] - programme[0, corner]
            )
        angle += (slope - before) * (since - 2.0 / w + (since + 2.0 / w) * math.exp(-w * since))
    return angle * (1.0 / DEGREE)


@inner_kernel
def _programme_step(sums: FloatArray, row: FloatArray, programme: FloatArray, elapsed: float, first: bool) -> None:
    """Hold the flight against its programme: nacelle error, arrival at the end, end of the conversion."""
    last = programme.shape[1] - 1
    airspeed, nacelle = row[COLUMN.airspeed_kt], row[COLUMN.nacelle_deg]
    if first:
        # Where the programme's nacelle motion ends, and the airspeed it has there.
        turned = last
        while turned > 0 and programme[2, turned - 1] == programme[2, last]:
            turned -= 1
        sums[SUM.goal_airspeed] = programme[1, turned] / KNOT
        sums[SUM.goal_way] = programme[1, turned] - programme[1, 0]
        sums[SUM.conversion] = -1.0
    error = abs(nacelle - nacelle_reference(programme, row[COLUMN.time_s]))
    sums[SUM.nacelle_error] = max(sums[SUM.nacelle_error], error)
    turned_out = abs(nacelle - programme[2, last] / DEGREE) <= ARRIVED_NACELLE_DEG
    if sums[SUM.conversion] < 0.0 and turned_out:
        short = sums[SUM.goal_airspeed] - airspeed
        way = sums[SUM.goal_way]
        if way == 0.0 or (short if way > 0.0 else -short) <= ARRIVED_AIRSPEED_KT:
            sums[SUM.conversion] = elapsed
    if not turned_out or abs(airspeed - programme[1, last] / KNOT) > ARRIVED_AIRSPEED_KT:
        sums[SUM.arrival] = elapsed


@inner_kernel
def _law_step(sums: FloatArray, row: FloatArray, first: bool, dt: float) -> None:
    """What a protection law did."""
    corridor = other = False
    for reason in (
        row[COLUMN.protection_stick_reason],
        row[COLUMN.protection_lever_reason],
        row[COLUMN.protection_nacelle_reason],
        row[COLUMN.protection_lateral_stick_reason],
        row[COLUMN.protection_pedal_reason],
    ):
        if reason in (law.REASON_LOW, law.REASON_HIGH, law.REASON_GATE):
            corridor = True
        elif reason != 0.0:
            other = True
    sums[SUM.unacted] += dt
    if corridor:
        if sums[SUM.activations] == 0.0 or sums[SUM.unacted] > MERGE_S + EPSILON:
            sums[SUM.activations] += 1.0
        sums[SUM.unacted] = 0.0
        sums[SUM.corridor_active] += dt
    if other:
        sums[SUM.other_active] += dt
    stick, lever = row[COLUMN.protection_stick], row[COLUMN.protection_lever]
    sums[SUM.share_stick_squares] += stick**2
    sums[SUM.share_lever_squares] += lever**2
    sums[SUM.nacelle_removed] += abs(row[COLUMN.protection_nacelle_rate_deg_s]) * dt
    if not first:
        sums[SUM.share_stick_step] = max(sums[SUM.share_stick_step], abs(stick - sums[SUM.share_stick]))
        sums[SUM.share_lever_step] = max(sums[SUM.share_lever_step], abs(lever - sums[SUM.share_lever]))
    sums[SUM.share_stick], sums[SUM.share_lever] = stick, lever


@inner_kernel
def _load_step(sums: FloatArray, row: FloatArray, first: bool, dt: float) -> None:
    """Loads on rotors, masts and engines."""
    flapping = max(row[COLUMN.flapping_deg], row[COLUMN.flapping_left_deg], row[COLUMN.flapping_right_deg])
    torque = max(row[COLUMN.mast_torque_inlb], row[COLUMN.mast_torque_left_inlb], row[COLUMN.mast_torque_right_inlb])
    time, power, load = row[COLUMN.time_s], row[COLUMN.engine_power_shp], row[COLUMN.load_factor]
    if first:
        sums[SUM.flapping_late_peak] = math.nan
        sums[SUM.torque], sums[SUM.power_largest] = torque, power
        sums[SUM.load_least] = sums[SUM.load_largest] = load
    if first or flapping > sums[SUM.flapping_peak]:
        sums[SUM.flapping_peak], sums[SUM.flapping_peak_time] = flapping, time
    if time >= LATE_PHASE_S - EPSILON and not flapping <= sums[SUM.flapping_late_peak]:
        sums[SUM.flapping_late_peak] = flapping
    sums[SUM.flapping] += flapping
    sums[SUM.flapping_squares] += flapping * flapping
    if flapping > sums[SUM.flapping_limit]:
        sums[SUM.flapping_over] += dt
    limits = TorqueTables(
        sums[SUM.torque_cruise], sums[SUM.torque_takeoff], sums[SUM.takeoff_nacelle], sums[SUM.takeoff_airspeed]
    )
    bound = torque_limit(limits, row[COLUMN.airspeed_kt] * KNOT, row[COLUMN.nacelle_deg] * DEGREE)
    share = torque * INCH_POUND / bound
    sums[SUM.torque_share] = max(sums[SUM.torque_share], share)
    if share > TORQUE_EXCESS:
        sums[SUM.torque_over] += dt
    sums[SUM.torque] = max(sums[SUM.torque], torque)
    sums[SUM.power] += power
    sums[SUM.fuel_flow] += row[COLUMN.fuel_flow_lb_h]
    sums[SUM.power_largest] = max(sums[SUM.power_largest], power)
    sums[SUM.load_largest] = max(sums[SUM.load_largest], load)
    sums[SUM.load_least] = min(sums[SUM.load_least], load)


@inner_kernel
def _beyond_step(sums: FloatArray, row: FloatArray, first: bool, dt: float) -> None:
    """Bank and sideslip against their limits."""
    place = SUM.sideways
    limits = SidewaysLimits(
        sums[place], sums[place + 1], sums[place + 2], sums[place + 3], sums[place + 4], sums[place + 5],
        sums[place + 6],
    )  # fmt: skip
    airspeed, climb = row[COLUMN.airspeed_kt] * KNOT, row[COLUMN.climb_rate_m_s]
    beyond = abs(row[COLUMN.bank_deg]) - bank_limit(limits, row[COLUMN.nacelle_deg] * DEGREE) / DEGREE
    if first or beyond > sums[SUM.bank_beyond]:
        sums[SUM.bank_beyond] = beyond
    if beyond > 0.0:
        sums[SUM.bank_over] += dt
    slip = row[COLUMN.sideslip_deg] * DEGREE
    sideward = slip_speed(slip, airspeed, climb, sums[SUM.alpha_speed])
    beyond = (abs(sideward) - sideward_limit(limits, airspeed)) / KNOT
    if first or beyond > sums[SUM.sideslip_beyond]:
        sums[SUM.sideslip_beyond] = beyond
    if beyond > 0.0:
        sums[SUM.sideslip_over] += dt


@inner_kernel
def _lateral_step(sums: FloatArray, row: FloatArray, first: bool, dt: float) -> None:
    """The motion out of the plane of symmetry, and where the aircraft is."""
    bank, heading = row[COLUMN.bank_deg], row[COLUMN.heading_deg]
    if first:
        sums[SUM.bank_least] = sums[SUM.bank_largest] = bank
    sums[SUM.bank_least] = min(sums[SUM.bank_least], bank)
    sums[SUM.bank_largest] = max(sums[SUM.bank_largest], bank)
    _beyond_step(sums, row, first, dt)
    error = bank - row[COLUMN.bank_reference_deg]
    sums[SUM.bank_squares] += error * error
    sums[SUM.bank_error] = max(sums[SUM.bank_error], abs(error))
    error = heading - row[COLUMN.heading_reference_deg]
    error -= 360.0 * math.floor(error / 360.0 + 0.5)
    sums[SUM.heading_squares] += error * error
    sums[SUM.heading_error] = max(sums[SUM.heading_error], abs(error))
    sums[SUM.heading] = heading
    sums[SUM.sideslip] = max(sums[SUM.sideslip], abs(row[COLUMN.sideslip_deg]))
    sums[SUM.lateral] = max(sums[SUM.lateral], abs(row[COLUMN.lateral_kt]))
    sums[SUM.track_error] = max(sums[SUM.track_error], abs(row[COLUMN.track_error_m]))
    sums[SUM.point_error] = max(sums[SUM.point_error], row[COLUMN.point_error_m])
    north, east = row[COLUMN.north_m], row[COLUMN.east_m]
    if first:
        sums[SUM.north_least] = sums[SUM.north_largest] = north
        sums[SUM.east_least] = sums[SUM.east_largest] = east
    sums[SUM.north], sums[SUM.east] = north, east
    sums[SUM.north_least] = min(sums[SUM.north_least], north)
    sums[SUM.north_largest] = max(sums[SUM.north_largest], north)
    sums[SUM.east_least] = min(sums[SUM.east_least], east)
    sums[SUM.east_largest] = max(sums[SUM.east_largest], east)
    sums[SUM.away] = max(sums[SUM.away], north**2 + east**2)


@inner_kernel
def metrics_step(sums: FloatArray, row: FloatArray, programme: FloatArray, dt: float) -> None:
    """Add one frame.

    Args:
        sums: Places ``SUM``, as ``rtsim.measures.metrics.new_sums`` makes them before the first frame.
        row: The finished frame.
        programme: Time, airspeed, nacelle angle, altitude of the programme's points, shape (4, points).
    """
    first = sums[SUM.frames] == 0.0
    # A reset puts the clock back: the jump there is not a motion of the controls.
    running = row[COLUMN.time_s] > sums[SUM.time]
    sums[SUM.time] = row[COLUMN.time_s]
    margin, pitch, pitch_rate = row[COLUMN.margin_kt], row[COLUMN.pitch_deg], row[COLUMN.pitch_rate_deg_s]
    if first:
        sums[SUM.margin_least] = margin
        sums[SUM.pitch_least] = sums[SUM.pitch_largest] = pitch
    sums[SUM.margin_least] = min(sums[SUM.margin_least], margin)
    sums[SUM.margin] += margin
    sums[SUM.area] += max(-margin, 0.0) * dt
    _exceedance_step(sums, margin, dt)
    _load_step(sums, row, first, dt)
    _control_step(sums, SUM.stick, row[COLUMN.stick] * STICK_HALF_TRAVEL_IN, first, running, dt)
    _control_step(sums, SUM.lever, row[COLUMN.lever], first, running, dt)
    lateral_stick, pedal = row[COLUMN.lateral_stick] * STICK_HALF_TRAVEL_IN, row[COLUMN.pedal] * PEDAL_HALF_TRAVEL_IN
    _control_step(sums, SUM.lateral_stick, lateral_stick, first, running, dt)
    _control_step(sums, SUM.pedal, pedal, first, running, dt)
    _lateral_step(sums, row, first, dt)
    if row[COLUMN.control_on_stop] > 0.5:
        sums[SUM.stop_frames] += 1.0
    height = row[COLUMN.altitude_m] - row[COLUMN.altitude_reference_m]
    sums[SUM.height_lost] = max(sums[SUM.height_lost], -height)
    sums[SUM.height_gained] = max(sums[SUM.height_gained], height)
    sums[SUM.altitude] = row[COLUMN.altitude_m]
    sums[SUM.pitch_least] = min(sums[SUM.pitch_least], pitch)
    sums[SUM.pitch_largest] = max(sums[SUM.pitch_largest], pitch)
    sums[SUM.pitch_rate_squares] += pitch_rate * pitch_rate
    error = row[COLUMN.airspeed_kt] - row[COLUMN.airspeed_reference_kt]
    sums[SUM.airspeed_squares] += error * error
    sums[SUM.airspeed_error] = max(sums[SUM.airspeed_error], abs(error))
    sums[SUM.airspeed] = row[COLUMN.airspeed_kt]
    sums[SUM.nacelle] = row[COLUMN.nacelle_deg]
    sums[SUM.nacelle_rate] = max(sums[SUM.nacelle_rate], abs(row[COLUMN.nacelle_rate_deg_s]))
    _law_step(sums, row, first, dt)
    _programme_step(sums, row, programme, (sums[SUM.frames] + 1.0) * dt, first)
    sums[SUM.frames] += 1.0


@part
def add_metrics(flight: Flight) -> float:
    """Add the frame that was flown to ``flight.measures``, places ``SUM``; a part of the frame."""
    metrics_step(flight.measures, flight.scratch.row, flight.tables.programme, flight.tables.dt)
    return 0.0


@part
def measure_rows(rows: FloatArray, programme: FloatArray, dt: float, sums: FloatArray) -> float:
    """Add the frames of a flight that was recorded.

    Args:
        programme: As for ``metrics_step``.
        sums: Updated in place, places ``SUM``.
    """
    for k in range(rows.shape[0]):
        metrics_step(sums, rows[k], programme, dt)
    return 0.0
