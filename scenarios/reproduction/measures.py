"""Turns a flight into the numbers that the paper's claims are about."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from rtsim.arrays import FloatArray
from rtsim.corridor.boundaries import load_corridor
from rtsim.measures.metrics import FlightMetrics, flight_metrics
from rtsim.optimization.paths import TABLE_1
from rtsim.units import STICK_HALF_TRAVEL_IN, deg, kt, to_kt
from scenarios.reproduction.flights import RATE_HZ, Flight

SETTLED_S = 3.0
"""Start of the judged part [s]: before it the aircraft pitches into its acceleration."""
EARLY_S = 30.0
"""End of the early part, in which the paper's Figures 5 and 8 differ [s]."""
COLLECTIVE_S = (1.0, 20.0)
"""The initial part of Figure 12 [s]."""
CLIMB_DEG = 0.02
"""The collective has stopped falling once it stands this far above its lowest value [deg]."""
CENTRE_S = (42.0, 58.0)
"""The seconds the paper names for Figure 14 [s]."""
LATE_NACELLE_DEG = 50.0
"""The final part of a conversion begins at this nacelle angle [deg] and lasts to two seconds after the downstop."""
HIGH_FLAPPING_DEG = 3.0
"""Flapping above this counts as high [deg]."""
FAST_RATE_DEG_S = 8.0
"""Nacelle rates above this count as fast [deg/s]."""


@dataclass(frozen=True, slots=True)
class FlightMeasures:
    """What one flight says about the claims."""

    completed: bool
    """Flown to its end."""
    end_reason: str
    """Why not; empty where it was."""
    duration_s: float
    """Planned length, final hold included [s]."""
    metrics: FlightMetrics
    """The measures every flight is judged by."""
    time_to_170_kt_s: float
    """When the airspeed first passes 169.5 kn [s]; NaN where it never does."""
    time_to_airplane_s: float
    """When the nacelles come within 0.5 deg of the downstop [s]; NaN where they never do."""
    early_peak_deg: float
    """Largest flapping between 3 and 30 s [deg]."""
    early_peak_time_s: float
    """When [s]."""
    trim_peak_deg: float
    """Largest trimmed flapping at the flown airspeed, nacelle angle and acceleration in the same time [deg]."""
    level_trim_peak_deg: float
    """The same for level trims [deg]."""
    trim_correlation: float
    """Correlation of flown and trimmed flapping over that time [-]."""
    early_mean_deg: float
    """Mean flapping between 3 and 30 s [deg]."""
    time_high_s: float
    """Time with flapping above 3 deg [s]."""
    oscillation_rms_deg: float
    """Root mean square of flown minus trimmed flapping from 3 s on [deg]."""
    oscillation_peak_deg: float
    """Its largest magnitude from 3 s on [deg]."""
    late_oscillation_rms_deg: float
    """The root mean square from nacelle 50 deg to 2 s after the downstop [deg]."""
    late_oscillation_peak_deg: float
    """Its largest magnitude in that part [deg]."""
    collective_rise_deg: float
    """How far the collective climbs above its lowest value so far between 1 and 20 s [deg]."""
    collective_fall_deg: float
    """How far it falls between 1 and 20 s [deg]."""
    collective_falls_until_s: float
    """When it first climbs 0.02 deg above its lowest value so far, from 1 s on [s]."""
    centre_acceleration_kt_s: float
    """Mean acceleration between 42 and 58 s [kn/s]; NaN for shorter flights."""
    centre_acceleration_max_kt_s: float
    """Largest acceleration between 44 and 58 s, once the change has passed [kn/s]."""
    tilt_acceleration_kt_s: float
    """Mean acceleration while the nacelles go from 50 to 2 deg [kn/s]."""
    stick_frequency_hz: float
    """Power-weighted mean frequency of the stick's rate from 3 s on [Hz]."""
    lever_frequency_hz: float
    """The same of the lever [Hz]."""
    stick_rate_in_s: float
    """Root mean square of the stick's rate from 3 s on [in/s]."""
    lever_rate_per_s: float
    """Root mean square of the lever's rate from 3 s on [1/s]."""
    time_fast_s: float
    """Time with the nacelles faster than 8 deg/s [s]."""
    corridor_position: float
    """Mean place between low (0) and high side (1) of the design corridor while the nacelles go from 85 to 5 deg."""
    margin_flight_kt: float
    """Smallest margin to the corridor ``flight`` [kn]; the metrics hold that to ``design``."""
    rotor_speed_spread_rpm: float
    """Largest minus smallest rotor speed [rpm]."""
    rotor_speed_rpm: float
    """Mean rotor speed [rpm]."""


@cache
def _trim_map(file: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Axes of the database and the two flapping angles of its trims."""
    from rtsim.aircraft.variables import STATE
    from rtsim.lpv.files.storage import load_database
    from rtsim.lpv.flown import flown_database

    database = flown_database(load_database(file or None), file or None)
    flapping = database.x_ref[..., [STATE.flap_1c, STATE.flap_1s]]
    return database.layer_acceleration, database.airspeed, database.nacelle, flapping


def trimmed_flapping(
    airspeed_kt: FloatArray,
    nacelle_deg: FloatArray,
    acceleration_kt_s: FloatArray | float = 0.0,
    database: str = "",
) -> FloatArray:
    """Flapping of the trim at a condition, interpolated in a database [deg].

    Args:
        airspeed_kt: Airspeeds [kn], any shape.
        nacelle_deg: Nacelle angles [deg], the same shape.
        acceleration_kt_s: Level accelerations [kn/s], clipped to the database's.
        database: The database, a file; empty: the shipped XV-15.
    """
    from scipy.interpolate import RegularGridInterpolator

    layers, airspeeds, nacelles, flapping = _trim_map(database)
    shape = np.shape(airspeed_kt)
    points = np.stack(
        [
            np.broadcast_to(np.clip(kt(1.0) * np.asarray(acceleration_kt_s), layers[0], layers[-1]), shape),
            np.clip(kt(1.0) * airspeed_kt, airspeeds[0], airspeeds[-1]),
            np.clip(deg(1.0) * nacelle_deg, nacelles[0], nacelles[-1]),
        ],
        axis=-1,
    )
    both = RegularGridInterpolator((layers, airspeeds, nacelles), flapping)(points)
    return np.asarray(np.degrees(np.hypot(both[..., 0], both[..., 1])), dtype=np.float64)


def flown_trim(flight: Flight, *, level: bool = False) -> FloatArray:
    """Trimmed flapping along a flight at the acceleration of its reference [deg], shape (frames,).

    Args:
        level: Leave the acceleration out, as the paper's map does.
    """
    acceleration = 0.0 if level else np.gradient(flight["airspeed_reference_kt"], flight.time)
    return trimmed_flapping(flight["airspeed_kt"], flight["nacelle_deg"], acceleration, flight.database)


def measure(flight: Flight) -> FlightMeasures:
    """Measure a flight.

    Args:
        flight: The flight, at least 5 s long.
    """
    time, flapping, collective = flight.time, flight["flapping_deg"], flight["collective_75_deg"]
    nacelle, acceleration = flight["nacelle_deg"], flight["airspeed_rate_kt_s"]
    settled = time >= SETTLED_S
    early = settled & (time <= EARLY_S)
    trim, level = flown_trim(flight), flown_trim(flight, level=True)
    oscillation = flapping - trim
    to_airplane = _first(time, nacelle <= 0.5)
    late = settled & (nacelle <= LATE_NACELLE_DEG) & (time <= (to_airplane if to_airplane > 0.0 else time[-1]) + 2.0)
    initial = collective[(time >= COLLECTIVE_S[0]) & (time <= COLLECTIVE_S[1])]
    centre = (time >= CENTRE_S[0]) & (time <= CENTRE_S[1])
    tilting = (nacelle <= 50.0) & (nacelle >= 2.0) & (np.abs(flight["nacelle_rate_deg_s"]) > 0.1)
    peak = int(np.argmax(np.where(early, flapping, -1.0)))
    return FlightMeasures(
        completed=flight.completed,
        end_reason=flight.end_reason,
        duration_s=flight.programme.duration,
        metrics=flight_metrics(flight.rows, flight.programme, 1.0 / RATE_HZ),
        time_to_170_kt_s=_first(time, flight["airspeed_kt"] >= 169.5),
        time_to_airplane_s=to_airplane,
        early_peak_deg=float(flapping[peak]),
        early_peak_time_s=float(time[peak]),
        trim_peak_deg=float(trim[early].max()),
        level_trim_peak_deg=float(level[early].max()),
        trim_correlation=float(np.corrcoef(trim[early], flapping[early])[0, 1]),
        early_mean_deg=float(flapping[early].mean()),
        time_high_s=float(np.count_nonzero(flapping > HIGH_FLAPPING_DEG) / RATE_HZ),
        oscillation_rms_deg=_rms(oscillation[settled]),
        oscillation_peak_deg=float(np.abs(oscillation[settled]).max()),
        late_oscillation_rms_deg=_rms(oscillation[late]),
        late_oscillation_peak_deg=float(np.abs(oscillation[late]).max(initial=0.0)),
        collective_rise_deg=float(_climb(initial).max()),
        collective_fall_deg=float(initial[0] - initial.min()),
        collective_falls_until_s=_first(
            time[time >= COLLECTIVE_S[0]], _climb(collective[time >= COLLECTIVE_S[0]]) > CLIMB_DEG
        ),
        centre_acceleration_kt_s=_mean(acceleration[centre]),
        centre_acceleration_max_kt_s=float(acceleration[centre & (time >= CENTRE_S[0] + 2.0)].max(initial=-np.inf)),
        tilt_acceleration_kt_s=_mean(acceleration[tilting]),
        stick_frequency_hz=_mean_frequency(flight["stick"][settled]),
        lever_frequency_hz=_mean_frequency(flight["lever"][settled]),
        stick_rate_in_s=_rms(np.diff(flight["stick"][settled]) * RATE_HZ * STICK_HALF_TRAVEL_IN),
        lever_rate_per_s=_rms(np.diff(flight["lever"][settled]) * RATE_HZ),
        time_fast_s=float(np.count_nonzero(np.abs(flight["nacelle_rate_deg_s"]) > FAST_RATE_DEG_S) / RATE_HZ),
        corridor_position=_corridor_position(flight),
        margin_flight_kt=_smallest_margin_kt(flight, "flight"),
        rotor_speed_spread_rpm=float(np.ptp(flight["rotor_speed_rpm"])),
        rotor_speed_rpm=float(flight["rotor_speed_rpm"].mean()),
    )


def table_1_times(*, rate_deg_s: float = 3.0, caps: tuple[float, ...] | None = None, rule: str = "both") -> FloatArray:
    """Times of the points of Table 1 by a timing rule [s], shape (10,), the last one after the 4 s hold.

    Args:
        rate_deg_s: Nacelle rate [deg/s].
        caps: Acceleration caps of the eight segments [kn/s]; None: 3, 4 between 105 and 130 kn, 5 on the downstop.
        rule: ``both`` (the slower of nacelle and airspeed) or ``nacelle`` (the paper's equation 5 alone).
    """
    caps = caps if caps is not None else (3.0, 3.0, 3.0, 3.0, 3.0, 4.0, 3.0, 5.0)
    airspeed, nacelle = np.array(TABLE_1).T
    by_nacelle = np.abs(np.diff(nacelle)) / rate_deg_s
    by_airspeed = np.diff(airspeed) / np.array(caps)
    steps = by_nacelle if rule == "nacelle" else np.maximum(by_nacelle, by_airspeed)
    return np.concatenate([[0.0], np.cumsum(np.append(steps, 4.0))])


def rms_difference(one: Flight, other: Flight, signal: str) -> float:
    """Root mean square difference of a signal between two flights of the same programme.

    Args:
        one: A flight.
        other: Another one.
        signal: The signal.
    """
    frames = min(len(one.rows), len(other.rows))
    return _rms(one[signal][:frames] - other[signal][:frames])


def _climb(values: FloatArray) -> FloatArray:
    """How far each value lies above the lowest one so far."""
    return values - np.minimum.accumulate(values)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values * values))) if values.size else float("nan")


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if values.size else float("nan")


def _first(time: FloatArray, reached: npt.NDArray[np.bool_]) -> float:
    return float(time[int(np.argmax(reached))]) if reached.any() else float("nan")


def _mean_frequency(signal: FloatArray) -> float:
    """Power-weighted mean frequency of a signal's rate, each motion counting once [Hz]."""
    rate = np.diff(signal) * RATE_HZ
    power = np.abs(np.fft.rfft(rate * np.hanning(rate.size))) ** 2
    frequency = np.fft.rfftfreq(rate.size, 1.0 / RATE_HZ)
    return float((power * frequency).sum() / power.sum())


def _corridor_position(flight: Flight) -> float:
    corridor = load_corridor("design")
    nacelle = flight["nacelle_deg"]
    tilting = (nacelle <= 85.0) & (nacelle >= 5.0)
    angle = deg(1.0) * nacelle[tilting]
    low = np.maximum(to_kt(1.0) * np.asarray(corridor.low_speed(angle)), 0.0)
    high = to_kt(1.0) * np.asarray(corridor.high.at(angle))
    return _mean((flight["airspeed_kt"][tilting] - low) / (high - low))


def _smallest_margin_kt(flight: Flight, name: str) -> float:
    corridor = load_corridor(name)
    airspeed, angle = flight["airspeed_kt"], deg(1.0) * flight["nacelle_deg"]
    low = to_kt(1.0) * np.asarray(corridor.low_speed(angle))
    high = to_kt(1.0) * np.asarray(corridor.high_speed(angle))
    return float(np.minimum(airspeed - low, high - airspeed).min())
