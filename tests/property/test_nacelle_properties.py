"""Properties of the conversion actuator and the switch, and the kernels against plain twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from rtsim.nacelle.nacelle_kernels import nacelle_advance, nacelle_at, nacelle_effective_rate
from rtsim.nacelle.switch import NacelleActuator, NacelleSwitch, load_nacelle_tables
from rtsim.units import deg, to_deg

DT = 0.004
angles = st.floats(0.0, 90.0).map(deg)
rates = st.floats(-12.0, 12.0).map(deg)
segments = st.lists(st.tuples(rates, st.integers(1, 800)), min_size=1, max_size=12)

# Twin: exact transition of [y, y', c, c'] by the matrix exponential.
GENERATOR = np.array([[0.0, 1.0, 0.0, 0.0], [-9.0, -6.0, 9.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])


@given(angles, angles, st.floats(-0.3, 0.3), rates, st.floats(1e-4, 0.1))
def test_kernel_equals_the_matrix_exponential(command, angle, rate, command_rate, elapsed):
    out = np.empty(3)
    nacelle_at(load_nacelle_tables(), np.array([command, angle, rate]), command_rate, elapsed, out)
    twin = expm(GENERATOR * elapsed) @ np.array([angle, rate, command, command_rate])
    assert out[0] == pytest.approx(twin[0], abs=1e-12)
    assert out[1] == pytest.approx(twin[1], abs=1e-12)
    assert out[2] == pytest.approx(9.0 * (twin[2] - twin[0]) - 6.0 * twin[1], abs=1e-11)


@given(angles, segments)
def test_angle_never_leaves_the_travel(start, plan):
    actuator = NacelleActuator(start)
    for rate, frames in plan:
        for _ in range(frames):
            actuator.step(rate, DT)
            assert 0.0 <= actuator.angle <= deg(90.0)
            assert -1e-12 <= actuator.command_angle <= deg(90.0) + 1e-12


@given(angles, segments)
def test_forward_and_back_are_mirror_images(start, plan):
    there, back = NacelleActuator(start), NacelleActuator(deg(90.0) - start)
    for rate, frames in plan:
        for _ in range(frames):
            there.step(rate, DT)
            back.step(-rate, DT)
        assert there.angle + back.angle == pytest.approx(deg(90.0), abs=1e-10)
        assert there.rate + back.rate == pytest.approx(0.0, abs=1e-10)


@given(angles, segments, st.integers(2, 5))
def test_one_frame_equals_several_shorter_ones(start, plan, parts):
    tables = load_nacelle_tables()
    whole, split = np.array([start, start, 0.0]), np.array([start, start, 0.0])
    for rate, _ in plan:
        acting = nacelle_effective_rate(tables, whole, rate, DT)
        nacelle_advance(tables, whole, acting, DT)
        for _ in range(parts):
            nacelle_advance(tables, split, acting, DT / parts)
    assert split == pytest.approx(whole, abs=1e-12)


@given(angles, st.lists(st.tuples(st.sampled_from([-1, 0, 1]), st.integers(1, 600)), min_size=1, max_size=12))
def test_switch_keeps_its_rate_and_never_strides_across_a_detent(start, plan):
    switch, actuator = NacelleSwitch(), NacelleActuator(start)
    for direction, frames in plan:
        for _ in range(frames):
            before = to_deg(actuator.command_angle)
            rate = switch.step(direction, command_angle=actuator.command_angle, dt=DT)
            assert abs(to_deg(rate)) <= 7.5 + 1e-4
            actuator.step(rate, DT)
            low, high = sorted((before, to_deg(actuator.command_angle)))
            # Every run ends on the detent; a stride across one would be a fault.
            assert not any(low < detent - 1e-6 and high > detent + 1e-6 for detent in (75.0, 50.0))
