"""The judged numbers, each on a made-up history whose answer is known by other means."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.measures.metric_kernels import METRICS, VALUE, nacelle_reference
from rtsim.measures.metrics import (
    METRIC_NAMES,
    OBJECTIVES,
    TRIAL_METRICS,
    FlightFigures,
    FlightMetrics,
    TrialMetrics,
    flight_metrics,
    measured,
    metric_unit,
    violations,
)
from rtsim.programme import Programme
from rtsim.units import KNOT, deg, kt

ROOT = Path(__file__).resolve().parents[2]
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
    "fuel_lb": ("used",),
    "bank_deg": ("min", "max", "rms_error", "max_error"),
    "heading_deg": ("final", "rms_error", "max_error"),
    "sideslip_deg": ("max",),
    "lateral_kt": ("max",),
    "track_m": ("max_error", "point_max_error"),
    "position_m": ("north", "east", "north_min", "north_max", "east_min", "east_max", "max_distance"),
    "lateral_stick": ("rms_in", "rms_rate_in_s", "travel_in", "peak_in"),
    "pedal": ("rms_in", "rms_rate_in_s", "travel_in", "peak_in"),
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
    assert sorted(METRIC_NAMES) == sorted([*dotted, "controls_on_stop_frames"])
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


def test_bank_and_heading_are_held_against_what_is_asked_for() -> None:
    rows = history(
        4,
        bank_deg=np.array([1.0, -4.0, 6.0, 5.0]),
        bank_reference_deg=np.array([1.0, -2.0, 2.0, 5.0]),
        heading_deg=np.array([359.0, 2.0, 1.0, 358.0]),
        heading_reference_deg=np.array([1.0, 1.0, 359.0, 358.0]),
    )
    metrics = flight_metrics(rows, HOLD, DT)
    bank, heading = metrics.bank_deg, metrics.heading_deg
    assert (bank.min, bank.max, bank.max_error) == (-4.0, 6.0, 4.0)
    assert bank.rms_error == pytest.approx(math.sqrt((4.0 + 16.0) / 4.0))
    assert (heading.final, heading.max_error) == (358.0, 2.0)
    assert heading.rms_error == pytest.approx(math.sqrt((4.0 + 1.0 + 4.0) / 4.0))


def test_places_and_distances_over_the_ground() -> None:
    rows = history(
        3,
        north_m=np.array([0.0, -3.0, 1.0]),
        east_m=np.array([0.0, 4.0, -2.0]),
        track_error_m=np.array([0.0, -2.5, 1.0]),
        point_error_m=np.array([0.0, 0.7, 0.2]),
        sideslip_deg=np.array([1.0, -9.0, 2.0]),
        lateral_kt=np.array([-3.0, 2.0, 1.0]),
    )
    metrics = flight_metrics(rows, HOLD, DT)
    place = metrics.position_m
    assert (place.north, place.east, place.max_distance) == (1.0, -2.0, 5.0)
    assert (place.north_min, place.north_max, place.east_min, place.east_max) == (-3.0, 1.0, -2.0, 4.0)
    assert (metrics.track_m.max_error, metrics.track_m.point_max_error) == (2.5, 0.7)
    assert (metrics.sideslip_deg.max, metrics.lateral_kt.max) == (9.0, 3.0)


def test_lateral_stick_and_pedals_in_inches_of_their_travel() -> None:
    rows = history(4, lateral_stick=np.array([0.0, -0.5, 0.25, 0.25]), pedal=np.array([0.2, 0.2, -1.0, 0.2]))
    metrics = flight_metrics(rows, HOLD, DT)
    stick, pedal = metrics.lateral_stick, metrics.pedal
    assert (stick.peak_in, stick.travel_in) == pytest.approx((2.4, 3.6))
    assert (pedal.peak_in, pedal.travel_in) == pytest.approx((2.5, 3.0))
    assert stick.rms_in == pytest.approx(4.8 * np.std([0.0, -0.5, 0.25, 0.25]))
    assert pedal.rms_rate_in_s == pytest.approx(2.5 * np.std([0.0, -1.2, 1.2]) / DT)


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


def exceedance_events(margin: FloatArray) -> list[tuple[int, int]]:
    """First and one past the last frame of each exceedance, found by looking at the whole flight."""
    outside = np.concatenate(([False], margin < -0.5, [False]))
    edges = np.flatnonzero(outside[1:] != outside[:-1])
    events: list[tuple[int, int]] = []
    for begin, end in zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True):
        if (end - begin) * DT < 0.1 - 1e-9:
            continue
        if events and (begin - events[-1][1]) * DT <= 0.5 + 1e-9:
            events[-1] = (events[-1][0], end)
        else:
            events.append((begin, end))
    return events


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
    assert exceedance_events(margin) == events
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
    points = np.array([programme.time, programme.airspeed, programme.nacelle_angle, programme.altitude])
    reference = [nacelle_reference(points, instant) for instant in time]
    assert reference == pytest.approx(expected, abs=1e-8)
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


def flown() -> tuple[FloatArray, Programme]:
    """A made-up flight of 40 s in which everything moves, and what it was asked to do."""
    random, frames = np.random.default_rng(8), 10_000
    time = np.arange(frames) * DT

    def wandering(middle: float, size: float) -> FloatArray:
        steps = np.cumsum(random.standard_normal(frames))
        return middle + size * (steps - steps.mean()) / np.abs(steps).max()

    def now_and_then(values: tuple[float, ...]) -> FloatArray:
        return np.repeat(random.choice(values, frames // 50), 50)

    programme = Programme(
        np.array([0.0, 10.0, 30.0, 40.0]), kt(1.0) * np.array([60.0, 80.0, 120.0, 120.0]),
        deg(1.0) * np.array([80.0, 60.0, 20.0, 20.0]), np.full(4, 100.0),
    )  # fmt: skip
    rows = history(
        frames,
        margin_kt=wandering(3.0, 8.0),
        flapping_deg=np.abs(wandering(7.0, 9.0)),
        flapping_left_deg=np.abs(wandering(8.0, 12.0)),
        flapping_right_deg=np.abs(wandering(8.0, 12.0)),
        climb_rate_m_s=wandering(0.0, 5.0),
        airspeed_kt=np.interp(time, [0.0, 35.0], [60.0, 119.5]) + wandering(0.0, 0.2),
        airspeed_reference_kt=np.interp(time, [0.0, 36.0], [60.0, 120.0]),
        nacelle_deg=np.interp(time, [0.0, 33.0], [80.0, 20.0]),
        nacelle_rate_deg_s=wandering(0.0, 7.0),
        altitude_m=wandering(100.0, 20.0),
        pitch_deg=wandering(-3.0, 30.0),
        pitch_rate_deg_s=wandering(0.0, 9.0),
        stick=wandering(0.1, 0.5),
        lever=wandering(0.5, 0.4),
        control_on_stop=now_and_then((0.0, 0.0, 1.0)),
        mast_torque_inlb=wandering(110e3, 20e3),
        mast_torque_left_inlb=wandering(120e3, 30e3),
        mast_torque_right_inlb=wandering(120e3, 30e3),
        engine_power_shp=wandering(1500.0, 900.0),
        load_factor=wandering(1.2, 2.0),
        protection_stick_reason=now_and_then((0.0, 0.0, 1.0, 9.0)),
        protection_lever_reason=now_and_then((0.0, 0.0, 0.0, 2.0, 7.0)),
        protection_nacelle_reason=now_and_then((0.0, 0.0, 0.0, 3.0)),
        protection_stick=wandering(0.0, 0.3),
        protection_lever=wandering(0.0, 0.2),
        protection_nacelle_rate_deg_s=wandering(0.0, 4.0),
        lateral_stick=wandering(0.1, 0.6),
        pedal=wandering(-0.1, 0.6),
        bank_deg=wandering(3.0, 40.0),
        bank_reference_deg=wandering(0.0, 40.0),
        heading_deg=wandering(180.0, 170.0),
        heading_reference_deg=wandering(180.0, 170.0),
        sideslip_deg=wandering(0.0, 30.0),
        lateral_kt=wandering(0.0, 9.0),
        north_m=wandering(5.0, 90.0),
        east_m=wandering(-5.0, 90.0),
        track_error_m=wandering(0.0, 9.0),
        point_error_m=np.abs(wandering(0.0, 9.0)),
    )
    return rows, programme


def twin(rows: FloatArray, programme: Programme) -> dict[str, float]:
    """Every metric by numpy over the whole flight, but for the nacelle error, which has a test of its own."""

    def of(name: str) -> FloatArray:
        return rows[:, getattr(COLUMN, name)]

    time, margin, pitch = of("time_s"), of("margin_kt"), of("pitch_deg")
    sides = ("", "_left", "_right")
    flapping = np.max([of(f"flapping{side}_deg") for side in sides], axis=0)
    mast_torque = np.max([of(f"mast_torque{side}_inlb") for side in sides], axis=0)
    error, height = of("airspeed_kt") - of("airspeed_reference_kt"), of("altitude_m") - of("altitude_reference_m")
    controls = {}
    inches = ("_in", "_in_s")
    for name, scale, ends in (
        ("stick", 4.8, inches), ("lever", 1.0, ("", "_per_s")), ("lateral_stick", 4.8, inches), ("pedal", 2.5, inches),
    ):  # fmt: skip
        values = of(name) * scale
        controls[f"{name}_rms{ends[0]}"] = values.std()
        controls[f"{name}_rms_rate{ends[1]}"] = (np.diff(values) / DT).std()
        controls[f"{name}_travel{ends[0]}"] = np.ptp(values)
        if name in {"stick", "lever"}:
            controls[f"{name}_path{ends[0]}"] = np.abs(np.diff(values)).sum()
        else:
            controls[f"{name}_peak_in"] = np.abs(values).max()
    north, east, bank = of("north_m"), of("east_m"), of("bank_deg")
    banked, turned_by = bank - of("bank_reference_deg"), of("heading_deg") - of("heading_reference_deg")
    astray = np.abs((turned_by + 180.0) % 360.0 - 180.0)
    takeoff = (of("nacelle_deg") > 80.0) & (of("airspeed_kt") < 60.0)
    bank_allowed = np.interp(of("nacelle_deg"), [75.0, 90.0], [45.0, 35.0])
    sideward_allowed = np.interp(np.abs(of("airspeed_kt")), [60.0, 100.0], [30.0, 21.0])
    forward = np.sqrt((of("airspeed_kt") * KNOT) ** 2 + of("climb_rate_m_s") ** 2 + 4.5**2) / KNOT
    sideward = np.abs(np.tan(np.radians(of("sideslip_deg")))) * forward
    torque = mast_torque / np.where(takeoff, 163e3, 130e3)
    reasons = np.stack([of(f"protection_{name}_reason") for name in ("stick", "lever", "nacelle")])
    corridor = np.isin(reasons, (1.0, 2.0, 3.0)).any(axis=0)
    starts = np.flatnonzero(corridor & ~np.concatenate(([False], corridor[:-1])))
    stops = np.flatnonzero(corridor & ~np.concatenate((corridor[1:], [False])))
    airspeed_end, nacelle_end = programme.airspeed[-1] / KNOT, programme.nacelle_angle[-1] / deg(1.0)
    turned = np.abs(of("nacelle_deg") - nacelle_end) <= 0.5
    away = ~turned | (np.abs(of("airspeed_kt") - airspeed_end) > 1.0)
    converted = turned & (120.0 - of("airspeed_kt") <= 1.0)  # the nacelles' motion ends at 120 kn
    return controls | {
        "exceedances": len(exceedance_events(margin)),
        "worst_margin_kt": margin.min(),
        "time_outside_s": (margin < -0.5).sum() * DT,
        "depth_kt": max(-margin.min(), 0.0),
        "area_kt_s": np.maximum(-margin, 0.0).sum() * DT,
        "mean_margin_kt": margin.mean(),
        "proximity_kt": -margin.min(),
        "flapping_peak_deg": flapping.max(),
        "flapping_peak_time_s": time[flapping.argmax()],
        "flapping_late_peak_deg": flapping[time >= 30.0].max(),
        "flapping_rms_deg": np.sqrt(np.mean(flapping**2)),
        "flapping_integral_deg_s": flapping.sum() * DT,
        "flapping_over_s": (flapping > 12.0).sum() * DT,
        "airspeed_final_kt": of("airspeed_kt")[-1],
        "airspeed_rms_error_kt": np.sqrt(np.mean(error**2)),
        "airspeed_max_error_kt": np.abs(error).max(),
        "nacelle_final_deg": of("nacelle_deg")[-1],
        "nacelle_max_rate_deg_s": np.abs(of("nacelle_rate_deg_s")).max(),
        "altitude_deviation_m": np.abs(height).max(),
        "altitude_final_m": of("altitude_m")[-1],
        "height_lost_m": -height.min(),
        "height_gained_m": height.max(),
        "pitch_min_deg": pitch.min(),
        "pitch_max_deg": pitch.max(),
        "pitch_peak_deg": np.abs(pitch).max(),
        "pitch_beyond_deg": np.abs(pitch).max() - 25.0,
        "pitch_excursion_deg": np.ptp(pitch),
        "pitch_rate_rms_deg_s": np.sqrt(np.mean(of("pitch_rate_deg_s") ** 2)),
        "bank_beyond_deg": (np.abs(bank) - bank_allowed).max(),
        "bank_peak_deg": np.abs(bank).max(),
        "bank_over_s": (np.abs(bank) > bank_allowed).sum() * DT,
        "sideslip_beyond_kt": (sideward - sideward_allowed).max(),
        "sideslip_over_s": (sideward > sideward_allowed).sum() * DT,
        "bank_min_deg": bank.min(),
        "bank_max_deg": bank.max(),
        "bank_rms_error_deg": np.sqrt(np.mean(banked**2)),
        "bank_max_error_deg": np.abs(banked).max(),
        "heading_final_deg": of("heading_deg")[-1],
        "heading_rms_error_deg": np.sqrt(np.mean(astray**2)),
        "heading_max_error_deg": astray.max(),
        "sideslip_max_deg": np.abs(of("sideslip_deg")).max(),
        "lateral_max_kt": np.abs(of("lateral_kt")).max(),
        "point_max_error_m": of("point_error_m").max(),
        "track_max_error_m": np.abs(of("track_error_m")).max(),
        "position_north_m": north[-1],
        "position_east_m": east[-1],
        "position_north_min_m": north.min(),
        "position_north_max_m": north.max(),
        "position_east_min_m": east.min(),
        "position_east_max_m": east.max(),
        "position_max_distance_m": np.hypot(north, east).max(),
        "controls_on_stop_frames": of("control_on_stop").sum(),
        "torque_ratio_peak": torque.max(),
        "torque_over_s": (torque > 1.02).sum() * DT,
        "mast_torque_max_inlb": mast_torque.max(),
        "engine_power_max_shp": of("engine_power_shp").max(),
        "fuel_used_lb": of("fuel_flow_lb_h").sum() * DT / 3600.0,
        "energy_mj": of("engine_power_shp").sum() * DT * 745.6998715822702e-6,
        "load_factor_max": of("load_factor").max(),
        "load_factor_min": of("load_factor").min(),
        "load_factor_beyond": max(of("load_factor").max() - 3.0, -0.5 - of("load_factor").min()),
        "corridor_activations": 1 + ((starts[1:] - stops[:-1]) * DT > 0.5 + 1e-9).sum(),
        "corridor_active_s": corridor.sum() * DT,
        "other_active_s": ((reasons != 0.0) & ~np.isin(reasons, (1.0, 2.0, 3.0))).any(axis=0).sum() * DT,
        "stick_authority_rms": np.sqrt(np.mean(of("protection_stick") ** 2)),
        "lever_authority_rms": np.sqrt(np.mean(of("protection_lever") ** 2)),
        "nacelle_removed_deg": np.abs(of("protection_nacelle_rate_deg_s")).sum() * DT,
        "stick_step_max": np.abs(np.diff(of("protection_stick"))).max(),
        "lever_step_max": np.abs(np.diff(of("protection_lever"))).max(),
        "completed": 0.0,
        "yielded": 1.0,
        "arrival_s": (np.flatnonzero(away)[-1] + 1) * DT,
        "conversion_s": (np.flatnonzero(converted)[0] + 1) * DT,
        "flown_s": len(rows) * DT,
        "frames": len(rows),
    }


def test_every_metric_agrees_with_plain_numpy() -> None:
    rows, programme = flown()
    numbers = measured(rows, programme, DT, ended=True, yielded=True)
    expected = twin(rows, programme)
    assert {*expected, "nacelle_max_error_deg"} == {metric.name for metric in METRICS}
    for name, value in expected.items():
        assert numbers[getattr(VALUE, name)] == pytest.approx(value, rel=1e-9), name
    assert 0 < expected["exceedances"] < len(rows)
    assert expected["corridor_activations"] > 0
    assert 0.0 < expected["conversion_s"] < expected["flown_s"]


def test_what_was_violated_is_held_against_the_limits_of_the_aircraft() -> None:
    rows, programme = flown()
    trial = TrialMetrics(measured(rows, programme, DT, ended=True))
    assert trial.exceeded >= {"corridor", "flapping", "control"}
    kept = TrialMetrics(measured(history(1000, pitch_deg=24.9, load_factor=2.9), HOLD, DT))
    assert kept.exceeded == frozenset()
    for name, changes in (
        ("pitch", {"pitch_deg": -25.1}),
        ("load_factor", {"load_factor": 3.1}),
        ("load_factor", {"load_factor": -0.6}),
        ("torque", {"mast_torque_inlb": 1.03 * 163e3}),
        ("height", {"altitude_m": 69.0}),
    ):
        one = measured(history(1000, **{"load_factor": 1.0, **changes}), HOLD, DT)
        assert {key for key, value in violations(one[None, :]).items() if value[0]} == {name}


def test_all_views_show_the_same_numbers_under_their_names() -> None:
    rows, programme = flown()
    numbers = measured(rows, programme, DT)
    flight, trial, search = FlightMetrics(numbers), TrialMetrics(numbers), FlightFigures(numbers)
    assert flight.flapping_deg.peak == flight["flapping_deg.peak"] == trial["flapping_peak_deg"]
    assert trial["flapping_peak_deg"] == search.flapping_peak_deg == search.asdict()["flapping_peak_deg"]
    assert flight.stick.rms_rate_in_s == search.stick.rms_rate == search.asdict()["stick"]["rms_rate"]
    assert search.completed is True
    assert isinstance(flight.corridor.exceedances, int)
    assert list(trial) == list(TRIAL_METRICS)
    with pytest.raises(AttributeError, match="no metric 'beauty'"):
        _ = flight.beauty
    assert search == FlightFigures(numbers.copy())
    assert search != FlightFigures(numbers + 1.0)


TOY = """
import importlib.util, json, sys
import numpy as np

def edited(name, path):
    spec = importlib.util.spec_from_file_location(name, path)
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

edited("rtsim.measures.metric_kernels", sys.argv[1])
from docs.tables import flight_metrics_table, trial_metrics_table
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.measures import metrics
from rtsim.programme import Programme
from scenarios.campaign.chunks import LawVariant
from scenarios.campaign.spec import parse_campaign
from scenarios.campaign.verdict import Flights, summarize
from scenarios.files.loader import parse_scenario

scenario, problems = parse_scenario(SCENARIO, file="mine.toml")
campaign, _ = parse_campaign(CAMPAIGN, file="mine.toml")
rows = np.zeros((5, SIGNAL_COUNT))
rows[:, COLUMN.airspeed_kt] = [1.0, 3.0, 7.0, 2.0, 0.0]
numbers = metrics.measured(rows, Programme.hold(airspeed=0.0, nacelle_angle=0.0, altitude=100.0), 0.004)
laws, asked = (LawVariant("full"), LawVariant("off")), (np.zeros((3, 2, 0)),)
flights = Flights(campaign, laws, (np.tile(numbers, (3, 2, 1)),), asked, (3,))
print(json.dumps({
    "problems": [str(item) for item in problems],
    "flight": metrics.FlightMetrics(numbers).asdict()["toy_kt"],
    "unit": metrics.metric_unit("toy_kt"),
    "trial": metrics.TrialMetrics(numbers)["toy_kt"],
    "search": metrics.FlightFigures(numbers).asdict()["toy_kt"],
    "objective": metrics.objective_value(metrics.FlightFigures(numbers), "toy"),
    "words": metrics.TRIAL_METRICS["toy_kt"],
    "campaign": summarize(flights, 0)["laws"][0]["toy_kt"],
    "docs": all("| `toy_kt` | a toy [kn] |" in table() for table in (flight_metrics_table, trial_metrics_table)),
}))
"""
TOY_SCENARIO = """
format = 1
name = "toy"
title = "A hold"
description = "For a toy."
duration_s = 5.0
[start]
condition = "hover"
[trial]
kind = "nominal"
[[trial.expect]]
name = "toy"
metric = "toy_kt"
max = 8.0
[[expect]]
name = "toy"
metric = "toy_kt"
max = 8.0
"""


def test_a_new_metric_needs_one_file_alone(tmp_path: Path) -> None:
    """A toy is measured, demanded, shown, counted, minimized and described wherever metrics are."""
    text = (ROOT / "rtsim/measures/metric_kernels.py").read_text(encoding="utf-8")
    for place, line in (
        ("METRICS = (\n", "Metric('toy_kt', 'kn', 'a toy', lambda s: s.toy, objective='toy', campaign=('max',)),\n"),
        ("SUM = Places(\n", "'toy',\n"),
        ("    first = sums[SUM.frames] == 0.0\n", "    sums[SUM.toy] = max(sums[SUM.toy], row[COLUMN.airspeed_kt])\n"),
    ):
        assert text.count(place) == 1
        text = text.replace(place, place + line)
    (tmp_path / "metric_kernels.py").write_text(text, encoding="utf-8")
    campaign = (ROOT / "scenarios/campaign/library/nominal.toml").read_text(encoding="utf-8")
    one_class = campaign[: campaign.index("[[classes]]", campaign.index("[[classes]]") + 1)]
    program = f"SCENARIO = {TOY_SCENARIO!r}\nCAMPAIGN = {one_class!r}\n{TOY}"
    (tmp_path / "toy.py").write_text(program, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, str(tmp_path / "toy.py"), str(tmp_path / "metric_kernels.py")],
        capture_output=True, text=True, cwd=ROOT, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert found["problems"] == []
    assert [found[view] for view in ("flight", "trial", "search", "objective")] == [7.0] * 4
    assert (found["unit"], found["words"], found["campaign"]) == ("kn", "a toy [kn]", {"max": 7.0})
    assert found["docs"]


def test_no_two_metrics_have_one_name() -> None:
    for view, shown in (("flight", FlightMetrics), ("trial", TrialMetrics), ("search", FlightFigures)):
        assert len(shown.shown) == sum(view in metric.views for metric in METRICS)
    assert len(OBJECTIVES) == sum(bool(metric.objective) for metric in METRICS)
