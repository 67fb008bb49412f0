"""Figures of merit of a flight as named numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.loop.data import END
from rtsim.measures import merit_kernels as places
from rtsim.units import HORSEPOWER


@dataclass(frozen=True, slots=True)
class ControlFigures:
    """How busy one control was. The unit is the inch for the stick; full travel of the lever is 1."""

    rms: float
    """Standard deviation about the mean."""
    rms_rate: float
    """Standard deviation of the rate [per s]: the control effort."""
    travel: float
    """Largest minus smallest position."""
    path: float
    """Total distance moved."""


@dataclass(frozen=True, slots=True)
class FlightFigures:
    """Everything a conversion is judged by; the names in brackets are the keys of ``rtsim fly --json``."""

    completed: bool
    """The flight reached its end."""
    frames: int
    """Frames flown."""
    duration_s: float
    """Time flown [s]."""
    flapping_integral_deg_s: float
    """Integral of cyclic flapping over time (``flapping_deg.integral_deg_s``)."""
    flapping_peak_deg: float
    """Largest cyclic flapping (``flapping_deg.peak``)."""
    flapping_peak_time_s: float
    """When (``flapping_deg.peak_time_s``)."""
    flapping_rms_deg: float
    """Root mean square of cyclic flapping (``flapping_deg.rms``)."""
    stick: ControlFigures
    """Longitudinal stick [in]: ``stick.rms_in``, ``stick.rms_rate_in_s``, ``stick.travel_in``."""
    lever: ControlFigures
    """Power lever [-]: ``lever.rms``, ``lever.rms_rate_per_s``, ``lever.travel``."""
    worst_margin_kt: float
    """Smallest distance to the corridor's boundaries (``corridor.worst_margin_kt``)."""
    mean_margin_kt: float
    """Mean distance to them."""
    time_outside_s: float
    """Time outside (``corridor.time_outside_s``)."""
    altitude_deviation_m: float
    """Largest altitude error (``altitude_m.max_deviation``)."""
    pitch_min_deg: float
    """Smallest pitch attitude (``pitch_deg.min``)."""
    pitch_max_deg: float
    """Largest pitch attitude (``pitch_deg.max``)."""
    pitch_rate_rms_deg_s: float
    """Root mean square of the pitch rate."""
    airspeed_rms_error_kt: float
    """Root mean square of airspeed minus filtered reference (``airspeed_kt.rms_error``)."""
    airspeed_max_error_kt: float
    """Largest magnitude of that difference (``airspeed_kt.max_error``)."""
    airspeed_final_kt: float
    """Airspeed of the last frame (``airspeed_kt.final``)."""
    nacelle_final_deg: float
    """Nacelle angle of the last frame (``nacelle_deg.final``)."""
    nacelle_max_rate_deg_s: float
    """Largest nacelle rate (``nacelle_deg.max_rate_deg_s``)."""
    controls_on_stop_frames: int
    """Frames with a control on its stop (``controls_on_stop_frames``)."""
    energy_mj: float
    """Energy of the engines [MJ]."""
    engine_power_max_shp: float
    """Largest engine power [shp]."""
    mast_torque_max_inlb: float
    """Largest torque of one mast [in lb]."""

    @property
    def pitch_excursion_deg(self) -> float:
        """Largest minus smallest pitch attitude [deg]."""
        return self.pitch_max_deg - self.pitch_min_deg


OBJECTIVES: dict[str, str] = {
    "flapping_integral": "integral of cyclic flapping [deg s]",
    "flapping_peak": "largest cyclic flapping [deg]",
    "flapping_rms": "root mean square of cyclic flapping [deg]",
    "stick_effort": "standard deviation of the stick rate [in/s]",
    "lever_effort": "standard deviation of the lever rate [1/s]",
    "stick_travel": "distance moved by the stick [in]",
    "duration": "time to convert [s]",
    "corridor_proximity": "smallest distance to the corridor's boundaries, negated [kn]",
    "altitude_excursion": "largest altitude error [m]",
    "pitch_excursion": "range of pitch attitude [deg]",
    "energy": "energy of the engines [MJ]",
}
"""What can be minimized, with its meaning."""


def objective_value(figures: FlightFigures, objective: str) -> float:
    """One objective of a flight, to be minimized.

    Args:
        figures: The flight.
        objective: One of :data:`OBJECTIVES`.

    Raises:
        InputError: There is no such objective.
    """
    values = {
        "flapping_integral": figures.flapping_integral_deg_s,
        "flapping_peak": figures.flapping_peak_deg,
        "flapping_rms": figures.flapping_rms_deg,
        "stick_effort": figures.stick.rms_rate,
        "lever_effort": figures.lever.rms_rate,
        "stick_travel": figures.stick.path,
        "duration": figures.duration_s,
        "corridor_proximity": -figures.worst_margin_kt,
        "altitude_excursion": figures.altitude_deviation_m,
        "pitch_excursion": figures.pitch_excursion_deg,
        "energy": figures.energy_mj,
    }
    if objective not in values:
        raise InputError("is not an objective", key="objective", value=objective, allowed=", ".join(OBJECTIVES))
    return values[objective]


def figures_from_sums(merit: FloatArray, dt: float) -> FlightFigures:
    """Turn the sums and extremes of a flight into its figures.

    Args:
        merit: As filled by ``merit_kernels``, shape (MERIT_SIZE,).
        dt: Length of a frame [s].

    Raises:
        InputError: Not one frame was flown.
    """
    values = [float(value) for value in merit]
    frames = int(values[places.FRAMES])
    if frames == 0:
        raise InputError("has no frames", key="flight")
    return FlightFigures(
        completed=values[places.END_CODE] == END.none,
        frames=frames,
        duration_s=frames * dt,
        flapping_integral_deg_s=values[places.FLAPPING_SUM] * dt,
        flapping_peak_deg=values[places.FLAPPING_PEAK],
        flapping_peak_time_s=values[places.FLAPPING_PEAK_TIME],
        flapping_rms_deg=math.sqrt(values[places.FLAPPING_SQUARES] / frames),
        stick=_control(values[places.STICK : places.LEVER], frames),
        lever=_control(values[places.LEVER : places.MARGIN_LEAST], frames),
        worst_margin_kt=values[places.MARGIN_LEAST],
        mean_margin_kt=values[places.MARGIN_SUM] / frames,
        time_outside_s=values[places.OUTSIDE_FRAMES] * dt,
        altitude_deviation_m=values[places.ALTITUDE_DEVIATION],
        pitch_min_deg=values[places.PITCH_LEAST],
        pitch_max_deg=values[places.PITCH_LARGEST],
        pitch_rate_rms_deg_s=math.sqrt(values[places.PITCH_RATE_SQUARES] / frames),
        airspeed_rms_error_kt=math.sqrt(values[places.AIRSPEED_SQUARES] / frames),
        airspeed_max_error_kt=values[places.AIRSPEED_LARGEST],
        airspeed_final_kt=values[places.AIRSPEED_FINAL],
        nacelle_final_deg=values[places.NACELLE_FINAL],
        nacelle_max_rate_deg_s=values[places.NACELLE_RATE_LARGEST],
        controls_on_stop_frames=int(values[places.STOP_FRAMES]),
        energy_mj=values[places.ENGINE_POWER_SUM] * dt * HORSEPOWER / 1e6,
        engine_power_max_shp=values[places.ENGINE_POWER_LARGEST],
        mast_torque_max_inlb=values[places.TORQUE_LARGEST],
    )


def figures_of_rows(rows: FloatArray, dt: float) -> FlightFigures:
    """Measure a flight that was recorded; equal to the batch's figures bit for bit.

    Args:
        rows: The frame history, shape (frames, SIGNAL_COUNT).
        dt: Length of a frame [s].
    """
    merit = np.zeros(places.MERIT_SIZE)
    places.measure_rows(rows, dt, merit)
    return figures_from_sums(merit, dt)


def deviation_from_sums(total: float, squares: float, count: int) -> float:
    """Standard deviation from the sums of values and of their squares; the values must be near 0 for precision.

    Args:
        total: Sum of the values.
        squares: Sum of their squares.
        count: How many there are; 0 gives 0.
    """
    if count == 0:
        return 0.0
    mean = total / count
    return math.sqrt(max(squares / count - mean * mean, 0.0))


def _control(values: list[float], frames: int) -> ControlFigures:
    return ControlFigures(
        rms=deviation_from_sums(values[places.SUM], values[places.SQUARES], frames),
        rms_rate=deviation_from_sums(values[places.RATE_SUM], values[places.RATE_SQUARES], frames - 1),
        travel=values[places.LARGEST] - values[places.LEAST],
        path=values[places.TRAVELLED],
    )
