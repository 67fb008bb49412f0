"""Exact properties of the pilot model, checked on random plants and against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_are

from rtsim.pilot.design import MocmDesign, design_problem
from rtsim.pilot.problem import build_problem
from rtsim.pilot.response import closed_loop

SETTINGS = settings(max_examples=15, deadline=None, derandomize=True)


def double_integrator(**changes: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "A": [[-2.0, 0, 0], [1, 0, 0], [0, 1, 0]], "B": [[0], [1.0], [0]], "C": [[0, 0, 1.0], [0, 1, 0]],
        "E": [[1.0], [0], [0]], "W": [[4.0]], "q_y": [1, 0], "tau": 0.2, "tau_n": [0.1],
    }  # fmt: skip
    return fields | changes


def random_plant(seed: int, **changes: Any) -> dict[str, Any]:
    """Two controls, three displays, four states; the slowest mode between damped and slightly unstable."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    a += (rng.uniform(-0.5, 0.1) - np.max(np.linalg.eigvals(a).real)) * np.eye(4)
    fields: dict[str, Any] = {
        "A": a, "B": rng.normal(size=(4, 2)), "C": rng.normal(size=(3, 4)),
        "E": rng.normal(size=(4, 2)), "q_y": rng.uniform(0.5, 2.0, 3), "tau": 0.15, "tau_n": [0.1, 0.2],
    }  # fmt: skip
    return fields | changes


def solve(fields: dict[str, Any]) -> MocmDesign:
    return design_problem(build_problem(fields))


@SETTINGS
@given(lag=st.floats(0.03, 0.5))
def test_closed_forms_without_delay(lag: float) -> None:
    """K/s^2: g = (2 tau_n)^6, gains 1/(8 tau_n^2) and 1/(2 tau_n); K/s: g = 4 tau_n^4, gain 1/(2 tau_n)."""
    second = solve(double_integrator(tau=0.0, tau_n=[lag]))
    assert second.regulator.g[0] == pytest.approx((2.0 * lag) ** 6, rel=1e-8)
    assert second.l_plant[0, 1:] == pytest.approx([1.0 / (2.0 * lag), 1.0 / (8.0 * lag**2)], rel=1e-8)
    first = solve(
        {"A": [[-2.0, 0], [1, 0]], "B": [[0], [1.0]], "C": [[0, 1.0], [1, 0]], "D": [[0], [1.0]], "E": [[1.0], [0]],
         "W": [[8.8]], "q_y": [1, 0], "tau": 0.0, "tau_n": [lag]}
    )  # fmt: skip
    assert first.regulator.g[0] == pytest.approx(4.0 * lag**4, rel=1e-8)
    assert first.l_plant[0, 1] == pytest.approx(1.0 / (2.0 * lag), rel=1e-8)


@SETTINGS
@given(
    seed=st.integers(0, 10_000), tau=st.floats(0.05, 0.3), order=st.sampled_from([0, 1, 2]),
    kind=st.sampled_from(["pade", "taylor"]),
)  # fmt: skip
def test_gains_on_the_control_do_not_depend_on_the_delay(seed: int, tau: float, order: int, kind: str) -> None:
    """An all-pass filter leaves the symmetric root locus alone, so g, G2 and the slow poles stay."""
    without = solve(random_plant(seed, tau=0.0))
    delayed = solve(random_plant(seed, tau=tau, pade_order=order, pade_kind=kind))
    assert delayed.regulator.g == pytest.approx(without.regulator.g, rel=1e-6)
    assert np.allclose(delayed.regulator.G2, without.regulator.G2, rtol=1e-6, atol=1e-7)
    slow = np.linalg.eigvals(without.model.A - without.model.B @ without.model.l)
    poles = np.linalg.eigvals(delayed.model.A - delayed.model.B @ delayed.model.l)
    expected = np.concatenate([slow, np.linalg.eigvals(delayed.plant.delay.A)])
    assert np.allclose(np.poly(poles), np.poly(expected), rtol=1e-5, atol=1e-5)


@SETTINGS
@given(seed=st.integers(0, 10_000))
def test_lag_is_the_one_asked_for_and_weights_reproduce_it(seed: int) -> None:
    by_lag = solve(random_plant(seed))
    assert np.diag(by_lag.regulator.T_n) == pytest.approx([0.1, 0.2], rel=1e-9)
    assert by_lag.regulator.T_n @ by_lag.regulator.G2 == pytest.approx(np.eye(2), abs=1e-9)
    by_weight = solve(random_plant(seed, tau_n=None, g=by_lag.regulator.g))
    assert np.allclose(by_weight.regulator.l, by_lag.regulator.l, rtol=1e-7, atol=1e-9)


@SETTINGS
@given(seed=st.integers(0, 10_000), attention=st.floats(0.3, 1.0), threshold=st.floats(0.0, 0.3))
def test_joint_closed_loop_returns_the_variances_of_the_design(seed: int, attention: float, threshold: float) -> None:
    """M13 against M10: one Lyapunov equation over plant and pilot gives the same variances."""
    design = solve(random_plant(seed, f=attention, threshold=threshold))
    loop = closed_loop(design.problem, design.model, design.plant, design.regulator, design.estimator)
    rms = np.sqrt(loop.variances())
    assert np.allclose(rms, np.concatenate([design.statistics.rms_y, design.statistics.rms_delta]), rtol=1e-6)
    assert np.max(np.linalg.eigvals(loop.A).real) < 0.0
    assert np.all((design.statistics.remnant_fraction > 0.0) & (design.statistics.remnant_fraction < 1.0))


@SETTINGS
@given(seed=st.integers(0, 10_000))
def test_noises_agree_with_the_variances_they_produce(seed: int) -> None:
    design = solve(random_plant(seed, threshold=0.1, f=0.6))
    from scipy.special import erfc

    sigma = design.statistics.rms_y
    seen = erfc(0.1 / (sigma * np.sqrt(2.0)))
    assert design.estimator.V_y == pytest.approx(np.pi * 0.01 * sigma**2 / (0.6 * seen**2), rel=1e-7)
    assert design.estimator.V_u == pytest.approx(np.pi * 10**-2.5 * design.statistics.rms_u_c**2, rel=1e-7)


@SETTINGS
@given(seed=st.integers(0, 10_000))
def test_riccati_solutions_agree_with_scipy(seed: int) -> None:
    design = solve(random_plant(seed))
    a, c, e = design.model.A, design.model.C, design.model.E
    noise = np.zeros((e.shape[1], e.shape[1]))
    noise[:2, :2], noise[2:, 2:] = design.problem.W, np.diag(design.estimator.V_u)
    expected = solve_continuous_are(a.T, c.T, e @ noise @ e.T, np.diag(design.estimator.V_y))
    assert np.allclose(design.estimator.S, expected, rtol=1e-6, atol=1e-9)


@SETTINGS
@given(seed=st.integers(0, 10_000), exponents=st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4))
def test_units_of_states_do_not_matter(seed: int, exponents: list[float]) -> None:
    plain = random_plant(seed)
    scale = 10.0 ** np.array(exponents)
    other = plain | {
        "A": plain["A"] * scale[:, None] / scale, "B": plain["B"] * scale[:, None], "C": plain["C"] / scale,
        "E": plain["E"] * scale[:, None],
    }  # fmt: skip
    first, second = solve(plain), solve(other)
    assert second.statistics.rms_y == pytest.approx(first.statistics.rms_y, rel=1e-6)
    assert np.allclose(second.l_plant * scale, first.l_plant, rtol=1e-5, atol=1e-7)


def test_cost_rises_as_attention_falls() -> None:
    costs = [solve(double_integrator(f=[f])).statistics.cost for f in (1.0, 0.7, 0.5, 0.3)]
    assert costs == sorted(costs)
    assert costs[-1] > 1.5 * costs[0]


def test_true_delay_is_met_by_the_filters() -> None:
    """Second-order filters are all-pass and hold the phase of a pure delay within 1 degree up to 1/tau."""
    from rtsim.pilot.delay import delay_filter
    from rtsim.pilot.response import frequency_response

    frequencies = np.array([0.5, 1.0, 2.5, 5.0])
    for order, kind, degrees in ((1, "pade", 5.0), (2, "pade", 0.1), (2, "taylor", 2.5)):
        part = delay_filter(np.array([0.2]), order=order, kind=kind)
        response = frequency_response(part.A, part.B, part.C, part.D, frequencies)[:, 0, 0]
        assert np.abs(response) == pytest.approx(1.0, abs=1e-12)
        error = np.degrees(np.angle(response * np.exp(1j * frequencies * 0.2)))
        assert np.max(np.abs(error)) < degrees


def test_second_order_filters_are_the_published_ones() -> None:
    """(s^2 - a s + b)/(s^2 + a s + b), a = k/(2 tau), b = k/tau^2: k = 12 Pade, k = 8 the series of NASA TM-4384."""
    from rtsim.pilot.delay import delay_filter
    from rtsim.pilot.response import frequency_response

    tau, frequencies = 0.2, np.array([0.5, 2.5, 10.0, 40.0])
    s = 1j * frequencies
    for kind, k in (("pade", 12.0), ("taylor", 8.0)):
        part = delay_filter(np.array([tau]), order=2, kind=kind)
        response = frequency_response(part.A, part.B, part.C, part.D, frequencies)[:, 0, 0]
        a, b = k / (2.0 * tau), k / tau**2
        assert np.allclose(response, (s**2 - a * s + b) / (s**2 + a * s + b), rtol=1e-12, atol=0.0)


def test_a_twenty_state_problem_is_solved_quickly() -> None:
    """Guards the algorithm, not the machine: Newton and mixing need few noise-map evaluations."""
    rng = np.random.default_rng(3)
    a = rng.normal(size=(20, 20)) / np.sqrt(20.0) - np.eye(20)
    design = solve(
        {"A": a, "B": rng.normal(size=(20, 2)), "C": rng.normal(size=(5, 20)), "E": rng.normal(size=(20, 2)),
         "q_y": [1, 2, 3, 1, 1], "tau_n": [0.1, 0.2], "f": 0.5}
    )  # fmt: skip
    assert design.estimator.iterations < 20
    warm = design_problem(design.problem, start=design)
    assert warm.estimator.iterations <= 3
    assert np.allclose(warm.estimator.F, design.estimator.F, rtol=1e-5, atol=1e-7)
