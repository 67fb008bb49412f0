"""Level-flight trims of the nonlinear XV-15 against published numbers, with the bands printed beside those numbers.

Bands are the ``tol``/``acc`` entries of tests/data/xv15_validation.toml, fixed before the model ran. Where that file
prints none, the band is ours, set after a first look, and called so. Where the model misses a band the test says
`documented mismatch` and holds the measured figure, which docs/model.md reports.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import OUTPUT, STATE
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import FOOT, FOOT_POUND, HORSEPOWER, POUND_FORCE, deg, kt, rpm, to_deg

DATA = tomllib.loads((Path(__file__).parents[1] / "data" / "xv15_validation.toml").read_text())
AIRCRAFT = Xv15.load()
ROOT_TWIST_DEG = 34.43
"""Twist at the root above 0.75 R (NASA TP-2004-212262): GTRS prints the collective at the root."""


@cache
def trim(airspeed_kt, nacelle_deg, flap_deg=None, rotor_rpm=None):
    condition = Condition(
        airspeed=kt(airspeed_kt),
        nacelle_angle=deg(nacelle_deg),
        flap=None if flap_deg is None else deg(flap_deg),
        rotor_speed=None if rotor_rpm is None else rpm(rotor_rpm),
    )
    point = AIRCRAFT.trim(condition)
    assert point.converged, f"{airspeed_kt} kn at nacelle {nacelle_deg}: {point.unclosed} did not close"
    return condition, point


def pitch(point):
    return to_deg(point.x[STATE.pitch])


def stick_in(point):
    return 4.8 + 4.8 * point.u[0]


def power_kw(point):
    return point.y[OUTPUT.power] / 1e3


HELICOPTER = DATA["trim"]["heli_gtrs"]


@pytest.mark.parametrize("i", range(6))
def test_helicopter_trim_of_gtrs(i):
    """Nacelle 90, 0-100 kn: pitch, stick, elevator, thrust. Source: Kleinhesselink 2007 table C-1 (GTRS column)."""
    _, point = trim(HELICOPTER["speed_kn"][i], 90.0)
    low, high = HELICOPTER["tol_pitch_deg"]
    assert low <= pitch(point) - HELICOPTER["pitch_deg"][i] <= high
    assert abs(stick_in(point) - HELICOPTER["stick_in"][i]) <= HELICOPTER["tol_stick_in"]
    assert abs(to_deg(point.x[STATE.elevator]) - HELICOPTER["elevator_deg"][i]) <= HELICOPTER["tol_elevator_deg"]
    thrust = point.y[OUTPUT.thrust] / POUND_FORCE / HELICOPTER["thrust_per_rotor_lb"][i]
    assert abs(thrust - 1.0) <= HELICOPTER["tol_thrust_frac"]
    # No band is printed for the cyclic; the stick's band through its gearing of 2.1 deg/in is.
    assert abs(to_deg(point.x[STATE.cyclic_1s]) - HELICOPTER["theta1s_deg"][i]) <= 2.1 * HELICOPTER["tol_stick_in"]


LOADS = DATA["trim"]["heli_gtrs_loads"]
FORCE_BAND, MOMENT_BAND = 325.0, 700.0
"""Our bands: 2.5 % of the weight [lb], and 0.033 rad/s^2 of pitch acceleration [ft lb]."""


@pytest.mark.parametrize("i", range(4))
def test_component_loads_of_gtrs(i):
    """X, Z, M of rotors, wing, tail and whole airframe at 40-100 kn. Source: NASA CR-166537 printout A-10..A-20."""
    condition, point = trim(LOADS["speed_kn"][i], 90.0)
    loads = AIRCRAFT.at(condition).component_loads(point.x, point.u, condition.nacelle_angle)
    unit = np.array([POUND_FORCE, POUND_FORCE, FOOT_POUND])
    band = np.array([FORCE_BAND, FORCE_BAND, MOMENT_BAND])
    for name, prefix in (("rotors", "rotor_total"), ("wing", "wing")):
        printed = np.array([LOADS[f"{prefix}_{axis}"][i] for axis in "XZM"])
        assert np.all(np.abs(loads[name] / unit - printed) <= band), name
    tail = loads["tail"] / unit
    assert abs(tail[1] - LOADS["htail_Z"][i]) <= FORCE_BAND
    assert abs(tail[2] - LOADS["htail_M"][i]) <= MOMENT_BAND
    airframe = (loads["wing"] + loads["body"] + loads["tail"]) / unit
    printed = np.array([LOADS[f"airframe_{axis}"][i] for axis in "XZM"])
    assert np.all(np.abs(airframe - printed) <= band), airframe


@pytest.mark.parametrize("i", range(4))
def test_mean_induced_velocity_of_gtrs(i):
    """Wi at 40-100 kn within 5 % (our band). Source: NASA CR-166537 printout."""
    _, point = trim(LOADS["speed_kn"][i], 90.0)
    air, rotor = AIRCRAFT.tables.configuration, AIRCRAFT.tables.rotor
    induced = point.x[STATE.inflow_0] * air.rotor_speed * rotor.radius / FOOT
    assert induced == pytest.approx(LOADS["induced_ft_s"][i], rel=0.05)


WANG_90 = DATA["trim"]["wang_gtrs_90"]


@pytest.mark.parametrize("i", range(6))
def test_root_collective_and_power_of_gtrs_at_nacelle_90(i):
    """Root collective within 2 deg, power within 12 % (printed for nacelle 30). Source: Wang 2025 fig 1a."""
    _, point = trim(WANG_90["speed_kn"][i], 90.0)
    assert abs(to_deg(point.x[STATE.collective_75]) + ROOT_TWIST_DEG - WANG_90["theta0_deg"][i]) <= 2.0
    assert power_kw(point) == pytest.approx(WANG_90["power_kW"][i], rel=0.12)
    assert abs(pitch(point) - WANG_90["pitch_deg"][i]) <= 2.0


@pytest.mark.parametrize("i", range(5))
def test_stick_of_gtrs_at_nacelle_90(i):
    """Stick within the 0.7 in printed for nacelle 90. Source: Wang 2025 fig 1a (the same GTRS trims, digitised).

    The 5 % of travel (0.48 in) printed for nacelle 30 would be missed by 0.3 % at 60 kn; docs/model.md reports it.
    """
    _, point = trim(WANG_90["stick_speed_kn"][i], 90.0)
    difference = 50.0 + 50.0 * point.u[0] - WANG_90["stick_pct"][i]
    assert abs(difference) / 100.0 * 9.6 <= HELICOPTER["tol_stick_in"]
    assert (abs(difference) <= 5.0) == (i != 2)


FLIGHT = DATA["trim"]["wang_flight_90"]


@pytest.mark.parametrize(("i", "pitch_offset", "power_offset"), [(0, -3.0, -0.13), (1, -4.1, -0.14), (2, -4.6, -0.11)])
def test_flight_at_nacelle_90_documented_offset(i, pitch_offset, power_offset):
    """Documented mismatch: like GTRS itself the model sits 3.5-5.5 deg below flight and needs 11-14 % less power.

    Source: flight markers of Wang 2025 fig 1a; the file's own note: "flight sits 3.5-5.5 deg above GTRS".
    """
    _, point = trim(FLIGHT["speed_kn"][i], 90.0)
    assert pitch(point) - FLIGHT["pitch_deg"][i] == pytest.approx(pitch_offset, abs=0.4)
    assert -6.0 <= pitch(point) - FLIGHT["pitch_deg"][i] <= 2.0
    assert power_kw(point) / FLIGHT["power_kW"][i] - 1.0 == pytest.approx(power_offset, abs=0.03)


WANG_30 = DATA["trim"]["wang_gtrs_30"]


@pytest.mark.parametrize("i", range(4))
def test_gtrs_at_nacelle_30(i):
    """Flaps 20/12.5, 100-160 kn: pitch within 2 deg, stick 5 %, root collective 2 deg. Source: Wang 2025 fig 1c."""
    _, point = trim(WANG_30["speed_kn"][i], 30.0, 20.0)
    assert abs(pitch(point) - WANG_30["pitch_deg"][i]) <= 2.0
    assert abs(50.0 + 50.0 * point.u[0] - WANG_30["stick_pct"][i]) <= 5.0
    assert abs(to_deg(point.x[STATE.collective_75]) + ROOT_TWIST_DEG - WANG_30["theta0_deg"][i]) <= 2.0


@pytest.mark.parametrize(("i", "offset"), [(0, -0.145), (1, -0.143), (2, -0.088), (3, -0.067)])
def test_power_of_gtrs_at_nacelle_30(i, offset):
    """Power within 12 % at 140 and 160 kn; documented mismatch of 14-15 % at 100 and 120 kn. Wang 2025 fig 1c."""
    _, point = trim(WANG_30["speed_kn"][i], 30.0, 20.0)
    found = power_kw(point) / WANG_30["power_kW"][i] - 1.0
    assert found == pytest.approx(offset, abs=0.015)
    assert (abs(found) <= 0.12) == (i >= 2)


FLAPPING = DATA["trim"]["flapping"]


def flapping_error(nacelle):
    speeds = FLAPPING[f"n{nacelle}_kn"]
    found = []
    for speed in speeds:
        point = AIRCRAFT.trim(Condition(airspeed=kt(speed), nacelle_angle=deg(float(nacelle))))
        found.append(to_deg(point.y[OUTPUT.flapping]) if point.converged else np.nan)
    return np.array(speeds), np.array(found) - np.array(FLAPPING[f"n{nacelle}_deg"])


def test_trim_flapping_at_nacelle_90():
    """Total flapping within 1 deg wherever the model trims (to 100 kn). Source: TM X-62407 fig 7.3.1."""
    speeds, error = flapping_error(90)
    trimmed = np.isfinite(error)
    assert list(speeds[~trimmed]) == [110.0, 125.0, 130.0]  # documented: no trim with 40 deg of flap beyond 103 kn
    assert np.max(np.abs(error[trimmed])) <= FLAPPING["tol_deg"]


def test_flapping_peak_at_nacelle_90():
    """The low-speed ridge: 4.2 deg near 30-35 kn in the chart, within 1 deg. Source: TM X-62407 fig 7.3.1."""
    speeds = np.arange(10.0, 60.0, 2.5)
    values = np.array([to_deg(trim(float(v), 90.0)[1].y[OUTPUT.flapping]) for v in speeds])
    assert 25.0 <= speeds[np.argmax(values)] <= 40.0
    assert values.max() == pytest.approx(4.2, abs=FLAPPING["tol_deg"])


def test_trim_flapping_at_nacelle_75():
    """Within 1 deg from 60 kn on; documented mismatch of 1.1-1.6 deg at 33-50 kn. Source: TM X-62407 fig 7.3.1."""
    speeds, error = flapping_error(75)
    assert np.all(np.isfinite(error))
    assert np.max(np.abs(error[speeds >= 60.0])) <= FLAPPING["tol_deg"]
    np.testing.assert_allclose(error[speeds < 60.0], [1.39, 1.55, 1.15], atol=0.1)


POWER = DATA["power"]["ratio"]


@pytest.mark.parametrize("nacelle", [90, 75])
def test_level_flight_power_of_the_familiarization_document(nacelle):
    """Engine power over 2920 shp within -10..+28 %. Source: TM X-62407 fig 5.4.2; efficiency 0.93 (its sec. 5)."""
    low, high = POWER["tol_frac"]
    for speed, ratio in zip(POWER[f"n{nacelle}_kn"], POWER[f"n{nacelle}"], strict=True):
        _, point = trim(speed, float(nacelle))
        found = point.y[OUTPUT.power] / HORSEPOWER / 0.93 / POWER["takeoff_shp"]
        assert low <= found / ratio - 1.0 <= high, speed


FUEL = DATA["power"]["fuel_flow_flight"]


@pytest.mark.parametrize(
    ("number", "nacelle", "flap", "rotor_rpm", "span"),
    [
        (0, 90.0, None, None, (44.0, 84.0)),
        (1, 75.0, None, None, (44.0, 90.0)),
        (2, 60.0, 20.0, None, (56.0, 100.0)),
        (3, 30.0, 20.0, None, (94.0, 116.0)),
        (4, 0.0, 40.0, None, (99.0, 130.0)),
    ],
)
def test_speed_of_minimum_power(number, nacelle, flap, rotor_rpm, span):
    """Speed of minimum power within 10 kn of the flown minimum of fuel flow. Source: NASA TM-81244 fig 13."""
    speeds = np.arange(*span, 2.0)
    powers = [trim(float(v), nacelle, flap, rotor_rpm)[1].y[OUTPUT.power] for v in speeds]
    found = speeds[int(np.argmin(powers))]
    assert abs(found - FUEL["min_speed_ktas"][number]) <= FUEL["tol_speed_kn"]


def test_speed_of_minimum_power_in_airplane_mode_documented_mismatch():
    """Documented mismatch: 116 kn at sea level, flaps up, 517 rpm; flown 140 KTAS at an unstated height (TM-81244)."""
    speeds = np.arange(108.0, 142.0, 2.0)
    powers = [trim(float(v), 0.0, 0.0, 517.0)[1].y[OUTPUT.power] for v in speeds]
    assert speeds[int(np.argmin(powers))] == pytest.approx(116.0, abs=2.0)


def boundary(nacelle, *, alpha_limit=16.0, flap_deg=40.0):
    """Lowest airspeed [kn] reached from the fast side with the wing below an angle of attack."""
    last = None
    for speed in np.arange(125.0, 45.0, -1.0):
        point = AIRCRAFT.trim(
            Condition(airspeed=kt(float(speed)), nacelle_angle=deg(nacelle), flap=deg(flap_deg)), guess=last
        )
        jumped = last is not None and abs(point.x[STATE.pitch] - last.x[STATE.pitch]) > deg(3.0)
        if not point.converged or jumped or to_deg(point.y[OUTPUT.wing_angle_of_attack]) > alpha_limit:
            return float(speed) + 1.0
        last = point
    return 45.0


CORRIDOR = DATA["corridor"]["recommended"]


@pytest.mark.parametrize("nacelle", [0.0, 10.0, 20.0, 60.0])
def test_low_speed_boundary(nacelle):
    """Wing stall (or 16 deg) with 40 deg of flap within the band of the corridor. Source: TM X-62407 fig 5.4.1."""
    k = CORRIDOR["nacelle_deg"].index(nacelle)
    assert abs(boundary(nacelle) - CORRIDOR["low_kn"][k]) <= CORRIDOR["low_tol_kn"][k]


@pytest.mark.parametrize(("nacelle", "offset"), [(50.0, 7.5), (40.0, 9.0), (30.0, 7.5)])
def test_low_speed_boundary_documented_mismatch(nacelle, offset):
    """Documented mismatch: at 30-50 deg the model stalls 7-9 kn faster than TM X-62407 fig 5.4.1 (band 5 kn).

    It lies between that prediction and the power-on stall flown (TM-81244 fig 14), which the test also holds.
    """
    k = CORRIDOR["nacelle_deg"].index(nacelle)
    found = boundary(nacelle)
    assert found - CORRIDOR["low_kn"][k] == pytest.approx(offset, abs=2.0)
    flown = DATA["corridor"]["flight_power_on_stall"]
    assert found < np.interp(-nacelle, -np.array(flown["nacelle_deg"]), flown["speed_kn"])


STATIC = DATA["corridor"]["wang2025_static"]


@pytest.mark.parametrize(("nacelle", "flap_deg"), [(0.0, 0.0), (30.0, 20.0)])
def test_low_speed_boundary_of_another_model(nacelle, flap_deg):
    """Computed stall boundary within 5 kn (our band), at the flap settings of its source. Wang 2025 fig 15a."""
    k = STATIC["nacelle_deg"].index(nacelle)
    assert abs(boundary(nacelle, flap_deg=flap_deg) - STATIC["low_kn"][k]) <= 5.0


def test_low_speed_boundary_of_another_model_documented_mismatch():
    """Documented mismatch: at nacelle 60, flaps 20, the wing reaches 16 deg at 59 kn; Wang 2025 fig 15a prints 70."""
    assert boundary(60.0, flap_deg=20.0) == pytest.approx(59.0, abs=2.0)


@pytest.mark.parametrize("nacelle", [65.0, 49.2, 31.0])
def test_flown_line_of_six_degrees(nacelle):
    """Level-flight minimum (alpha = 6 deg) within 5 kn (our band), flaps 20 assumed. Source: TM-81244 fig 14."""
    flown = DATA["corridor"]["flight_vmin_alpha6"]
    expected = flown["speed_kn"][flown["nacelle_deg"].index(nacelle)]
    assert abs(boundary(nacelle, alpha_limit=6.0, flap_deg=20.0) - expected) <= 5.0


SPEEDS = DATA["speeds"]


def test_wing_stall_on_the_downstop_with_flaps():
    """101 kn with 40 deg of flap within 5 kn. Source: TM X-62407 fig 5.4.1."""
    assert abs(boundary(0.0) - SPEEDS["wing_stall_nacelle0_flaps40_kn"]) <= 5.0


def test_stall_in_airplane_mode():
    """Stall angle 16 +- 1 deg; documented mismatch in speed with flaps up. Source: NASA TM-81244 text.

    95-100 KIAS at 12000-13000 lb is met with 40 deg of flap (98 kn); flaps up the model stalls at 106 kn. The source
    does not print the flap setting.
    """
    last = None
    for speed in np.arange(125.0, 95.0, -0.5):
        point = AIRCRAFT.trim(
            Condition(airspeed=kt(float(speed)), nacelle_angle=0.0, flap=0.0, rotor_speed=rpm(517.0)), guess=last
        )
        if not point.converged:
            break
        last = point
    assert speed == pytest.approx(106.0, abs=1.5)
    assert abs(to_deg(last.y[OUTPUT.wing_angle_of_attack]) - SPEEDS["stall_alpha_deg"]) <= 1.0
    low, high = SPEEDS["stall_airplane_kias"]
    assert low <= boundary(0.0) <= high


def speed_at_torque(limit_inlb):
    speeds = np.arange(230.0, 295.0, 5.0)
    torques = [trim(float(v), 0.0, 0.0, 517.0)[1].y[OUTPUT.torque] / (FOOT_POUND / 12.0) for v in speeds]
    return float(np.interp(limit_inlb, torques, speeds))


def test_maximum_level_speed_at_cruise_torque():
    """260 KTAS at sea level with 130000 in lb, flaps up, 517 rpm, within 2 % (our band). TM X-62407 fig 5.5.1."""
    assert abs(speed_at_torque(130000.0) - SPEEDS["vmax_sl_cruise_torque_ktas"]) <= 5.2


def test_all_published_flap_settings_trim():
    """The published flap settings at each nacelle angle trim across their speed range (YAN2023, CR-166537 headers)."""
    for nacelle, flap, speeds in ((90.0, 40.0, (0, 50, 100)), (60.0, 20.0, (70, 110, 150)), (30.0, 20.0, (100, 160))):
        for speed in speeds:
            trim(float(speed), nacelle, flap)
