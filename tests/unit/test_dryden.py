"""Dryden turbulence: values of MIL-F-8785C, exact filters, spectra against the analytic ones.

Sources: MIL-F-8785C (5 November 1980), paragraphs 3.7.1.2, 3.7.1.4, 3.7.2, 3.7.3.4 and figures 7, 9, 10, 11.
Tolerances of the statistical tests were chosen before the first run: 10 % for a spectrum averaged over half an octave,
5 % for a variance. The flights are long enough for these to be more than three standard errors.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy import linalg, signal

from rtsim.atmosphere import dryden_kernels as dryden
from rtsim.atmosphere.air import gust_tables, new_gust_state, set_turbulence
from rtsim.atmosphere.gust_kernels import GUST, gust_step
from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.errors import InputError
from rtsim.kernels.compiled import allocating_kernel
from rtsim.units import FOOT, KNOT, ft, kt


def longitudinal_spectrum(frequency, *, sigma, scale, speed):
    """MIL-F-8785C 3.7.1.2, one-sided in angular frequency [(m/s)^2 s/rad]: its integral from 0 is sigma squared."""
    return sigma**2 * 2.0 * scale / (math.pi * speed) / (1.0 + (scale * frequency / speed) ** 2)


def vertical_spectrum(frequency, *, sigma, scale, speed):
    """MIL-F-8785C 3.7.1.2, one-sided in angular frequency [(m/s)^2 s/rad]: its integral from 0 is sigma squared."""
    reduced = scale * frequency / speed
    return sigma**2 * scale / (math.pi * speed) * (1.0 + 3.0 * reduced**2) / (1.0 + reduced**2) ** 2


def pitch_spectrum(frequency, *, sigma, scale, speed, span):
    """MIL-F-8785C 3.7.1.4: of the pitch gust that goes with the gust from below [(rad/s)^2 s/rad]."""
    wave = frequency / speed
    gain = wave**2 / (1.0 + (4.0 * span * wave / math.pi) ** 2)
    return gain * vertical_spectrum(frequency, sigma=sigma, scale=scale, speed=speed)


def roll_spectrum(frequency, *, sigma, scale, speed, span):
    """MIL-F-8785C 3.7.1.4, of the roll gust, one-sided in angular frequency; vertical intensity and scale."""
    height = sigma**2 / (speed * scale) * 0.8 * (math.pi * scale / (4.0 * span)) ** (1.0 / 3.0)
    return height / (1.0 + (4.0 * span * frequency / (math.pi * speed)) ** 2)


def yaw_spectrum(frequency, *, sigma, scale, speed, span):
    """MIL-F-8785C 3.7.1.4: of the yaw gust that goes with the gust from the side."""
    wave = frequency / speed
    gain = wave**2 / (1.0 + (3.0 * span * wave / math.pi) ** 2)
    return gain * vertical_spectrum(frequency, sigma=sigma, scale=scale, speed=speed)


DT = 0.004
SPAN = 32.17 * FOOT
MODERATE = AirSpecification(turbulence=Turbulence(wind_at_20_ft=kt(30.0), fade_in=0.0))
TABLES = gust_tables(MODERATE)
LATERAL = dataclasses.replace(MODERATE, lateral=True)
LEVEL = (0.0, 0.0)


@allocating_kernel
def loop(tables, state, speed, altitude, dt, history):
    """Replace each row of normals by the gusts: ahead, below, pitch; where there are six, from the right, roll, yaw."""
    for k in range(history.shape[0]):
        gust_step(tables, state, speed[k], altitude[k], (0.0, 0.0), k * dt, dt if k else 0.0, history[k])
        history[k, 0], history[k, 1], history[k, 2] = state[GUST.ahead], state[GUST.below], state[GUST.q]
        if history.shape[1] > 3:
            history[k, 3], history[k, 4], history[k, 5] = state[GUST.right], state[GUST.p], state[GUST.r]


def fly(air, *, speed, altitude, seconds, seed, dt=DT):
    """Columns ahead, below, pitch gust, and of lateral turbulence right, roll, yaw, at a constant condition."""
    random = np.random.default_rng(seed)
    width = 6 if air.lateral else 3
    state = new_gust_state(air, random.standard_normal(width))
    history = random.standard_normal((round(seconds / dt), width))
    loop(gust_tables(air), state, np.full(len(history), speed), np.full(len(history), altitude), dt, history)
    return history


def test_low_altitude_values_of_the_specification():
    # At 1000 ft all scales are 1000 ft and all intensities 0.1 W20: 0.177 + 0.823 = 1.
    scales = dryden.turbulence_scales(TABLES.turbulence, ft(1000.0), kt(30.0))
    assert scales == pytest.approx((kt(3.0), kt(3.0), ft(1000.0), ft(1000.0)), rel=1e-12)
    # 100 ft: the figures of the specification read Lu = 600 ft, sigma_u / sigma_w = 1.73.
    sigma_u, sigma_w, scale_u, scale_w = dryden.turbulence_scales(TABLES.turbulence, ft(100.0), kt(30.0))
    assert scale_w == pytest.approx(ft(100.0))
    assert scale_u / FOOT == pytest.approx(100.0 / 0.2593**1.2, rel=1e-12)
    assert sigma_w == pytest.approx(5.0634 * FOOT, rel=1e-4)
    assert sigma_u / sigma_w == pytest.approx(0.2593**-0.4, rel=1e-12)
    # Below 10 ft the model is not defined: the values at 10 ft hold.
    ground = dryden.turbulence_scales(TABLES.turbulence, 0.0, kt(30.0))
    assert ground == dryden.turbulence_scales(TABLES.turbulence, ft(10.0), kt(30.0))


@pytest.mark.parametrize(
    ("wind_kt", "height_ft", "intensity_ft_s"),
    [
        (15.0, 3750.0, 7.4),
        (30.0, 7500.0, 10.1),
        (45.0, 15000.0, 22.1),
        (30.0, (3750.0 + 7500.0) / 2.0, (10.6 + 10.1) / 2.0),
        (22.5, 7500.0, (6.7 + 10.1) / 2.0),
        (60.0, 15000.0, 22.1 * 60.0 / 45.0),
        (7.5, 15000.0, 2.3),
        (0.0, 15000.0, 0.0),
        (30.0, 60000.0, 4.2),
    ],
)
def test_high_altitude_values_of_the_specification(wind_kt, height_ft, intensity_ft_s):
    scales = dryden.turbulence_scales(TABLES.turbulence, ft(height_ft), kt(wind_kt))
    expected = (ft(intensity_ft_s), ft(intensity_ft_s), ft(1750.0), ft(1750.0))
    assert scales == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("wind_kt", [1.0, 15.0, 30.0, 45.0, 60.0])
def test_intensity_and_scale_are_continuous_in_height(wind_kt):
    heights = ft(np.arange(0.0, 50_000.0, 2.0))
    values = np.array([dryden.turbulence_scales(TABLES.turbulence, h, kt(wind_kt)) for h in heights])
    # Largest physical slopes: sigma_u near the ground, Lu just above 10 ft.
    steps = np.abs(np.diff(values, axis=0)).max(axis=0)
    assert steps[0] < 0.02 * kt(wind_kt)
    assert steps[1] < 0.02 * kt(wind_kt)
    assert steps[2] < ft(20.0)
    assert steps[3] <= ft(2.0) * (1.0 + 1e-9)


def test_the_vertical_filter_is_the_exact_solution():
    """The kernel against matrix exponential and Cholesky factor of the noise covariance."""
    A = np.array([[-1.0, 0.0], [2.0, -1.0]])
    for s in (1e-6, 3e-4, 0.02, 0.199999, 0.200001, 0.3, 3.0):
        F = linalg.expm(A * s)
        z, n = np.array([0.7, -1.3]), np.array([0.4, 1.1])
        if s > 1e-3:
            G = np.linalg.cholesky(np.eye(2) - F @ F.T)
        else:  # the difference cancels: the same covariance as a series in s, exact to s**5
            q11, q12 = 2 * s - 2 * s**2 + 4 * s**3 / 3, -2 * s + 4 * s**2 - 4 * s**3
            first = math.sqrt(q11)
            G = np.array([[first, 0.0], [q12 / first, math.sqrt(4.0 * math.exp(-2 * s) * s**4 / 3 / q11)]])
        expected = F @ z + G @ n
        assert dryden.advance_second_order(*z, s, *n) == pytest.approx(tuple(expected), rel=1e-9)


def test_no_distance_changes_nothing():
    assert dryden.advance_second_order(0.7, -1.3, 0.0, 5.0, 5.0) == (0.7, -1.3)
    assert dryden.advance_first_order(0.7, 0.0, 5.0) == 0.7


def test_two_half_steps_have_the_distribution_of_one_step():
    """Transition matrices multiply and covariances add: the filter does not depend on the frame rate."""

    def matrices(s):
        columns = [dryden.advance_second_order(*unit, s, 0.0, 0.0) for unit in ((1.0, 0.0), (0.0, 1.0))]
        noise = [dryden.advance_second_order(0.0, 0.0, s, *unit) for unit in ((1.0, 0.0), (0.0, 1.0))]
        G = np.array(noise).T
        return np.array(columns).T, G @ G.T

    for s in (1e-3, 0.07, 1.0):
        F, Q = matrices(s)
        half_F, half_Q = matrices(s / 2.0)
        assert pytest.approx(F, rel=1e-12, abs=1e-15) == half_F @ half_F
        assert pytest.approx(Q, rel=1e-9, abs=1e-15) == half_F @ half_Q @ half_F.T + half_Q


def test_sinh_excess_matches_high_precision_values():
    for s in (1e-5, 0.1, 0.199, 0.201, 2.0):
        # sinh^2 - s^2 = sum over k >= 2 of 2^(2k-1) s^(2k) / (2k)!
        terms = [2.0 ** (2 * k - 1) * s ** (2 * k) / math.factorial(2 * k) for k in range(2, 30)]
        assert dryden.sinh_excess(s) == pytest.approx(math.fsum(terms), rel=1e-12)


def test_lag_is_exact_for_a_straight_line():
    tau, dt = 0.3, 0.05
    lag, before, now = 0.2, 1.0, 1.7
    _, expected, _ = signal.lsim(([1.0], [tau, 1.0]), [before, now], [0.0, dt], X0=[lag * tau])
    assert dryden.advance_lag(lag, before, now, dt / tau) == pytest.approx(expected[-1], rel=1e-12)


def test_analytic_spectra_integrate_to_the_variance():
    frequency = np.concatenate([[0.0], np.geomspace(1e-5, 1e4, 200_001)])
    values = {"sigma": 1.7, "scale": 150.0, "speed": 40.0}
    for spectrum in (longitudinal_spectrum, vertical_spectrum):
        assert np.trapezoid(spectrum(frequency, **values), frequency) == pytest.approx(1.7**2, rel=1e-3)


def half_octaves(frequency, values, edges):
    return np.array([values[(frequency >= a) & (frequency < b)].mean() for a, b in itertools.pairwise(edges)])


@pytest.mark.parametrize(
    ("speed", "altitude"),
    [(kt(60.0), 30.0), (kt(120.0), 100.0), (0.0, 100.0), (kt(170.0), 900.0)],
    ids=["60 kn at 30 m", "120 kn at 100 m", "hover at 100 m", "170 kn at 900 m"],
)
def test_spectra_of_all_six_gusts_are_the_analytic_ones(speed, altitude):
    history = fly(LATERAL, speed=speed, altitude=altitude, seconds=12_000.0, seed=11)
    sigma_u, sigma_w, scale_u, scale_w = dryden.turbulence_scales(TABLES.turbulence, altitude, kt(30.0))
    through = max(speed, kt(30.0))
    edges = np.geomspace(0.2, 12.8, 13)
    frequency, measured = signal.welch(history, fs=1.0 / DT, nperseg=8192, axis=0)
    omega = 2.0 * math.pi * frequency
    per_hertz = 2.0 * math.pi
    expected = (
        longitudinal_spectrum(omega, sigma=sigma_u, scale=scale_u, speed=through),
        vertical_spectrum(omega, sigma=sigma_w, scale=scale_w, speed=through),
        pitch_spectrum(omega, sigma=sigma_w, scale=scale_w, speed=through, span=SPAN),
        vertical_spectrum(omega, sigma=sigma_u, scale=scale_u, speed=through),
        roll_spectrum(omega, sigma=sigma_w, scale=scale_w, speed=through, span=SPAN),
        yaw_spectrum(omega, sigma=sigma_u, scale=scale_u, speed=through, span=SPAN),
    )
    for column, spectrum in enumerate(expected):
        ratio = half_octaves(frequency, measured[:, column], edges) / half_octaves(
            frequency, per_hertz * spectrum, edges
        )
        assert ratio == pytest.approx(np.ones(ratio.size), abs=0.10), f"column {column}"


@pytest.mark.parametrize(("speed", "altitude"), [(kt(100.0), 20.0), (kt(40.0), 60.0)])
def test_variances_are_those_of_the_specification(speed, altitude):
    history = fly(MODERATE, speed=speed, altitude=altitude, seconds=20_000.0, seed=3, dt=0.02)
    sigma_u, sigma_w, _, _ = dryden.turbulence_scales(TABLES.turbulence, altitude, kt(30.0))
    assert history[:, 0].var() == pytest.approx(sigma_u**2, rel=0.05)
    assert history[:, 1].var() == pytest.approx(sigma_w**2, rel=0.05)
    assert abs(np.corrcoef(history[:, 0], history[:, 1])[0, 1]) < 0.05


def test_the_intensity_in_roll_is_the_integral_of_its_spectrum():
    frequency = np.concatenate([[0.0], np.geomspace(1e-5, 1e5, 200_001)])
    spectrum = roll_spectrum(frequency, sigma=1.5, scale=30.0, speed=40.0, span=SPAN)
    intensity = dryden.roll_intensity(SPAN, 1.5, 30.0)
    assert np.trapezoid(spectrum, frequency) == pytest.approx(intensity**2, rel=1e-3)
    assert intensity == pytest.approx(math.radians(5.72), rel=0.02)


def test_lateral_turbulence_leaves_the_others_as_they_are():
    """The first three normals do what they did; the last three act on side, roll and yaw alone, which are three."""
    random = np.random.default_rng(2)
    first, normals = random.standard_normal(6), random.standard_normal((500, 6))
    where = (np.full(500, 40.0), np.full(500, 60.0), DT)
    both, plain = normals.copy(), normals[:, :3].copy()
    loop(TABLES, new_gust_state(LATERAL, first), *where, both)
    loop(TABLES, new_gust_state(MODERATE, first[:3]), *where, plain)
    assert both[:, :3].tobytes() == plain.tobytes()
    assert (both[:, 3:] != 0.0).any(axis=0).all()


def test_the_yaw_gust_is_the_slope_of_the_side_gust_met_from_ahead():
    """Air that comes from the right more and more ahead is felt as the nose yawing right into it."""
    state = np.zeros(dryden.TURBULENCE.size)
    state[dryden.TURBULENCE.active] = state[dryden.TURBULENCE.lateral] = 1.0
    state[dryden.TURBULENCE.wind] = state[dryden.TURBULENCE.wind_target] = kt(30.0)
    state[dryden.TURBULENCE.v_1] = 1.0
    gusts = [dryden.turbulence_step(TABLES.turbulence, state, 50.0, 100.0, dt, np.zeros(6)) for dt in (0.0, DT)]
    slope = (gusts[1][3] - gusts[0][3]) / (50.0 * DT)
    a = DT * 50.0 * math.pi / (3.0 * SPAN)
    assert gusts[1][5] == pytest.approx(slope * -math.expm1(-a), rel=1e-9)
    assert gusts[0][5] == 0.0


def test_a_change_of_speed_and_height_leaves_no_transient():
    """Over an ensemble the variance at every instant of a wild manoeuvre is that of the place, exactly as scheduled."""
    flights, frames, dt = 4000, 150, 0.1
    random = np.random.default_rng(8)
    speed = np.where(np.arange(frames) % 50 < 25, kt(200.0), kt(5.0))
    altitude = np.where(np.arange(frames) % 30 < 15, 10.0, 300.0)
    gusts = random.standard_normal((flights, frames, 3))
    for flight in range(flights):
        loop(TABLES, new_gust_state(MODERATE, random.standard_normal(3)), speed, altitude, dt, gusts[flight])
    ahead, below = gusts[:, :, 0], gusts[:, :, 1]
    scales = np.array([dryden.turbulence_scales(TABLES.turbulence, h, kt(30.0)) for h in altitude])
    # 4000 flights: a variance has 2.2 % standard error; 4.5 of them hold for 300 values with margin.
    assert ahead.var(axis=0) / scales[:, 0] ** 2 == pytest.approx(np.ones(frames), abs=0.10)
    assert below.var(axis=0) / scales[:, 1] ** 2 == pytest.approx(np.ones(frames), abs=0.10)


def test_a_step_of_speed_moves_no_gust():
    """The gust of a frame depends on what was flown before, so the coefficients' jump cannot show in it."""
    state = new_gust_state(MODERATE, np.array([0.3, -0.8, 1.2]))
    for k in range(500):
        gust_step(TABLES, state, 20.0, 50.0, LEVEL, k * DT, DT if k else 0.0, np.zeros(3))
    before = state[[GUST.u, GUST.w]]
    gust_step(TABLES, state, 80.0, 50.0, LEVEL, 500 * DT, DT, np.zeros(3))
    reach = 80.0 * DT / 50.0
    assert np.abs(state[[GUST.u, GUST.w]] - before).max() < 3.0 * reach * np.abs(before).max()


def test_the_pitch_gust_is_the_slope_of_the_vertical_gust_met_from_ahead():
    """Air that rises more and more ahead lifts the nose; felt as air-relative motion it is a pitch-down rate."""
    tables = TABLES.turbulence
    state = np.zeros(dryden.TURBULENCE.size)
    state[dryden.TURBULENCE.active] = 1.0
    state[dryden.TURBULENCE.wind] = state[dryden.TURBULENCE.wind_target] = kt(30.0)
    state[dryden.TURBULENCE.w_1] = 1.0
    gusts = [dryden.turbulence_step(tables, state, 50.0, 100.0, dt, np.zeros(3)) for dt in (0.0, DT)]
    slope = (gusts[1][1] - gusts[0][1]) / (50.0 * DT)
    a = DT * 50.0 * math.pi / (4.0 * SPAN)
    assert gusts[1][2] == pytest.approx(-slope * -math.expm1(-a), rel=1e-9)
    assert gusts[0][2] == 0.0


def test_normals_of_the_first_state_are_its_filters():
    state = new_gust_state(MODERATE, np.array([0.3, -0.8, 1.2]))
    assert state[dryden.TURBULENCE.u] == 0.3
    assert (state[dryden.TURBULENCE.w_1], state[dryden.TURBULENCE.w_2]) == (-0.8, 1.2)
    with pytest.raises(ValueError, match="standard normals"):
        new_gust_state(MODERATE)


@pytest.mark.parametrize("lateral", [False, True])
def test_turbulence_fades_in_from_calm_air_and_out_to_exact_calm(lateral):
    air = AirSpecification(turbulence=Turbulence(wind_at_20_ft=kt(30.0), fade_in=2.0), lateral=lateral)
    random, width = np.random.default_rng(5), 6 if lateral else 3
    state = new_gust_state(air, random.standard_normal(width))
    acting = [GUST.u, GUST.w, *((GUST.v, GUST.p, GUST.r) if lateral else ())]
    winds = []
    for k in range(1501):
        if k == 1000:
            set_turbulence(state, Turbulence(wind_at_20_ft=0.0, fade_in=1.0), random.standard_normal(width))
        gust_step(TABLES, state, 40.0, 100.0, LEVEL, k * DT, DT if k else 0.0, random.standard_normal(width))
        winds.append(state[dryden.TURBULENCE.wind])
        if k == 0 or k > 1250:
            assert (state[GUST.u : GUST.busy] == 0.0).all()
        elif k < 1000:
            assert (state[acting] != 0.0).all()
    assert winds[250] == pytest.approx(kt(15.0))
    assert winds[500] == pytest.approx(kt(30.0))
    assert winds[1000] == pytest.approx(kt(30.0), abs=kt(0.13))
    assert winds[1125] == pytest.approx(kt(15.0), abs=kt(0.13))
    assert winds[-1] == 0.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"wind_at_20_ft": -1.0}, "wind_at_20_ft: is out of range"),
        ({"wind_at_20_ft": math.nan}, "wind_at_20_ft: is out of range"),
        ({"wind_at_20_ft": kt(61.0)}, "0 to 30.87 m/s"),
        ({"wind_at_20_ft": 1.0, "fade_in": 61.0}, "fade_in: is out of range"),
    ],
)
def test_mistakes_in_turbulence(arguments, words):
    with pytest.raises(InputError, match=words):
        Turbulence(**arguments)


def test_severities_are_winds():
    assert Turbulence.of_severity("severe").wind_at_20_ft == pytest.approx(45.0 * KNOT)
    assert not AirSpecification(turbulence=Turbulence.of_severity("none")).turbulent
    with pytest.raises(InputError, match="none, light, moderate, severe"):
        Turbulence.of_severity("extreme")  # type: ignore[arg-type]
