"""The judged numbers, each on a made-up history whose answer is known by other means."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.signal

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.measures.metrics import METRIC_NAMES, exceedance_events, flight_metrics, metric_unit, nacelle_reference_deg
from rtsim.programme import Programme
from rtsim.units import deg

DT = 0.004
HOLD = Programme.hold(airspeed=0.0, nacelle_angle=deg(90.0), altitude=100.0)
KEYS = {
    "corridor": ("exceedances", "worst_margin_kt", "time_outside_s"),
    "flapping_deg": ("peak", "peak_time_s", "peak_after_30_s", "rms", "integral_deg_s"),
    "airspeed_kt": ("final", "rms_error", "max_error"),
    "nacelle_deg": ("final", "max_error", "max_rate_deg_s"),
    "altitude_m": ("max_deviation", "final"),
    "pitch_deg": ("min", "max"),
    "stick": ("rms_in", "rms_rate_in_s", "travel_in"),
    "lever": ("rms", "rms_rate_per_s", "travel"),
}


def history(frames: int, **columns: FloatArray | float) -> FloatArray:
    """A history at rest in hover, 20 kn inside the corridor, with some columns replaced."""
    rows = np.zeros((frames, SIGNAL_COUNT))
    rows[:, COLUMN.frame] = np.arange(frames)
    rows[:, COLUMN.time_s] = np.arange(frames) * DT
    rows[:, COLUMN.nacelle_deg] = 90.0
    rows[:, COLUMN.altitude_m] = rows[:, COLUMN.altitude_reference_m] = 100.0
    rows[:, COLUMN.margin_kt] = 20.0
    for name, values in columns.items():
        rows[:, getattr(COLUMN, name)] = values
    return rows


def test_the_names_are_the_keys_of_the_command() -> None:
    dotted = [f"{group}.{key}" for group, keys in KEYS.items() for key in keys]
    assert list(METRIC_NAMES) == [*dotted, "controls_on_stop_frames"]
    metrics = flight_metrics(history(10), HOLD, DT)
    for name in METRIC_NAMES:
        value = metrics.value(name)
        assert value is None if name == "flapping_deg.peak_after_30_s" else math.isfinite(value)


def test_airspeed_error_is_against_the_filtered_reference_over_all_frames() -> None:
    airspeed = np.array([10.0, 12.0, 9.0, 10.0])
    rows = history(4, airspeed_kt=airspeed, airspeed_reference_kt=10.0, airspeed_command_kt=99.0)
    metrics = flight_metrics(rows, HOLD, DT).airspeed_kt
    assert metrics.rms_error == pytest.approx(math.sqrt((0 + 4 + 1 + 0) / 4))
    assert metrics.max_error == pytest.approx(2.0)
    assert metrics.final == 10.0


def test_altitude_deviation_follows_a_changing_reference() -> None:
    rows = history(3, altitude_m=np.array([100.0, 104.0, 111.0]), altitude_reference_m=np.array([100.0, 105.0, 110.0]))
    metrics = flight_metrics(rows, HOLD, DT).altitude_m
    assert (metrics.max_deviation, metrics.final) == (1.0, 111.0)


def test_pitch_nacelle_rate_and_stops() -> None:
    rows = history(
        4,
        pitch_deg=np.array([1.0, -7.0, 3.0, 2.0]),
        nacelle_rate_deg_s=np.array([0.0, -7.5, 3.0, 0.0]),
        control_on_stop=np.array([0.0, 1.0, 1.0, 0.0]),
    )
    metrics = flight_metrics(rows, HOLD, DT)
    assert (metrics.pitch_deg.min, metrics.pitch_deg.max) == (-7.0, 3.0)
    assert metrics.nacelle_deg.max_rate_deg_s == 7.5
    assert metrics.controls_on_stop_frames == 2


def test_flapping_of_a_decaying_peak() -> None:
    time = np.arange(10_000) * DT
    flapping = 5.0 * np.exp(-(((time - 12.0) / 6.0) ** 2)) + 1.0
    metrics = flight_metrics(history(10_000, flapping_deg=flapping), HOLD, DT).flapping_deg
    assert metrics.peak == pytest.approx(6.0)
    assert metrics.peak_time_s == pytest.approx(12.0)
    assert metrics.peak_after_30_s == pytest.approx(1.0 + 5.0 * math.exp(-9.0), rel=1e-6)
    # Integral of the bell from 0 to 40 s, by the error function, plus the constant.
    bell = 5.0 * 6.0 * math.sqrt(math.pi) / 2.0 * (math.erf(28.0 / 6.0) + math.erf(2.0))
    assert metrics.integral_deg_s == pytest.approx(bell + 40.0, rel=1e-4)
    assert metrics.rms == pytest.approx(math.sqrt(np.trapezoid(flapping**2, time) / 40.0), rel=1e-3)


def test_control_activity_is_about_the_mean() -> None:
    time = np.arange(5000) * DT
    stick = 0.3 + 0.1 * np.sin(2.0 * math.pi * time)
    rows = history(5000, stick=stick, lever=0.5 + 0.02 * np.cos(2.0 * math.pi * time))
    metrics = flight_metrics(rows, HOLD, DT)
    assert metrics.stick.rms_in == pytest.approx(0.48 / math.sqrt(2.0), rel=1e-6)
    assert metrics.stick.travel_in == pytest.approx(0.96, rel=1e-4)
    assert metrics.stick.rms_rate_in_s == pytest.approx(0.48 * 2.0 * math.pi / math.sqrt(2.0), rel=1e-3)
    assert metrics.lever.rms == pytest.approx(0.02 / math.sqrt(2.0), rel=1e-6)
    assert metrics.lever.travel == pytest.approx(0.04, rel=1e-4)
    assert metrics.lever.rms_rate_per_s == pytest.approx(0.02 * 2.0 * math.pi / math.sqrt(2.0), rel=1e-3)


def test_a_reset_is_not_a_motion_of_the_stick() -> None:
    stick = np.concatenate((np.full(100, 0.9), np.full(100, -0.9)))
    time = np.concatenate((np.arange(100), np.arange(100))) * DT
    metrics = flight_metrics(history(200, stick=stick, time_s=time), HOLD, DT)
    assert metrics.stick.rms_rate_in_s == 0.0


def margins(*runs: tuple[float, int]) -> FloatArray:
    """A margin history from (value, frames) pairs."""
    return np.concatenate([np.full(frames, value) for value, frames in runs])


@pytest.mark.parametrize(
    ("runs", "events"),
    [
        (((20.0, 500),), []),
        (((20.0, 10), (-0.5, 100), (20.0, 10)), []),  # -0.5 itself is not outside
        (((20.0, 10), (-0.6, 24), (20.0, 10)), []),  # 96 ms are too short
        (((20.0, 10), (-0.6, 25), (20.0, 10)), [(10, 35)]),  # 100 ms count
        (((-3.0, 30), (20.0, 125), (-3.0, 30)), [(0, 185)]),  # gap of 0.5 s: one event
        (((-3.0, 30), (20.0, 126), (-3.0, 30)), [(0, 30), (156, 186)]),
        (
            ((-3.0, 30), (20.0, 60), (-3.0, 5), (20.0, 61), (-3.0, 30)),
            [(0, 30), (156, 186)],
        ),  # the blip bridges nothing
        (((20.0, 5), (-3.0, 100)), [(5, 105)]),  # open at the end
    ],
)
def test_exceedance_events(runs: tuple[tuple[float, int], ...], events: list[tuple[int, int]]) -> None:
    margin = margins(*runs)
    assert exceedance_events(margin, DT) == events
    metrics = flight_metrics(history(len(margin), margin_kt=margin), HOLD, DT).corridor
    assert metrics.exceedances == len(events)
    assert metrics.worst_margin_kt == margin.min()
    assert metrics.time_outside_s == pytest.approx(sum(n for value, n in runs if value < -0.5) * DT)


def test_nacelle_reference_agrees_with_an_integrated_filter() -> None:
    programme = Programme(
        np.array([0.0, 8.0, 13.2, 20.0, 30.0]),
        np.zeros(5),
        deg(1.0) * np.array([90.0, 82.0, 82.0, 40.0, 60.0]),
        np.full(5, 100.0),
    )
    time = np.arange(10_000) * DT  # every corner falls on a frame, so linear interpolation of the input is exact
    wanted = np.interp(time, programme.time, programme.nacelle_angle) / deg(1.0)
    a = np.array([[0.0, 1.0], [-9.0, -6.0]])
    system = (a, np.array([[0.0], [9.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
    _, expected, _ = scipy.signal.lsim(system, wanted, time, X0=[90.0, 0.0])
    assert nacelle_reference_deg(programme, time) == pytest.approx(expected, abs=1e-8)
    rows = history(len(time), nacelle_deg=expected + np.where(time > 25.0, 0.25, 0.0))
    metrics = flight_metrics(rows, programme, DT).nacelle_deg
    assert metrics.max_error == pytest.approx(0.25, abs=1e-8)
    assert metrics.final == pytest.approx(60.25, abs=1e-6)


def test_every_metric_has_its_unit() -> None:
    numbers = {"corridor.exceedances", "controls_on_stop_frames", "lever.rms", "lever.travel"}
    assert {name for name in METRIC_NAMES if not metric_unit(name)} == numbers
    assert metric_unit("nacelle_deg.max_rate_deg_s") == "deg/s"
    assert metric_unit("flapping_deg.peak_after_30_s") == "deg"
    assert metric_unit("flapping_deg.integral_deg_s") == "deg s"
