"""The bench out of the plane of symmetry: signs, inertia, the nonlinear step beside the linear model."""

from __future__ import annotations

import math

import pytest

from rtsim.validation.bench import the_bench
from rtsim.validation.sideways import (
    acceleration,
    damping,
    largest_control,
    lateral_model,
    oscillation,
    roll_root,
    roots,
    turned,
    with_inertia_of_1975,
)

BENCH = the_bench()


@pytest.mark.parametrize(("control", "rate"), [("lateral_stick", "p"), ("pedal", "r")])
def test_right_controls_turn_right_and_are_damped(control, rate):
    for place in ((0.0, 90.0), (80.0, 75.0), (200.0, 0.0)):
        assert acceleration(BENCH, control, rate, *place) > 0.0
        assert damping(BENCH, rate, *place) > 0.0
        assert turned(BENCH, control, 1.0, 0.5, *place) > 0.0


def test_the_inertia_of_1975_is_the_lighter_one():
    """Roll by 42400 to 52795, yaw by 49500 to 66335 slug ft2, but for what the product of inertia couples."""
    light = with_inertia_of_1975(BENCH)
    for control, rate, share in (("lateral_stick", "p", 42400.0 / 52795.0), ("pedal", "r", 49500.0 / 66335.0)):
        heavy = acceleration(BENCH, control, rate, 0.0, 90.0)
        assert heavy / acceleration(light, control, rate, 0.0, 90.0) == pytest.approx(share, rel=0.01)


def test_a_small_step_of_the_nonlinear_aircraft_is_that_of_a_damped_roll():
    """Bank from acceleration and damping, later by up to 0.1 s: actuators lag, rotors lead their inflow."""
    power, damp = acceleration(BENCH, "lateral_stick", "p", 80.0, 75.0), damping(BENCH, "p", 80.0, 75.0)

    def bank(seconds):
        return 0.1 * math.degrees(power / damp**2 * (damp * seconds - 1.0 + math.exp(-damp * seconds)))

    assert bank(0.9) < turned(BENCH, "lateral_stick", 0.1, 1.0, 80.0, 75.0) < bank(1.0)


def test_roots():
    assert oscillation([-1.0, 0.1 + 0.5j, 0.1 - 0.5j, -0.2 + 2.0j]) == 0.1 + 0.5j
    assert roll_root([-1.0, -0.1, 0.1 + 0.5j]) == -1.0
    assert math.isnan(oscillation([-1.0]).real)
    found = roots(BENCH, 170.0, 0.0)
    assert len(found) == 4  # Dutch roll, roll, spiral: the heading is left out, rotors and actuators are faster
    assert roll_root(found) < -0.5


def test_where_there_is_no_trim_there_is_no_number():
    assert lateral_model(BENCH, 160.0, 90.0) is None
    assert math.isnan(acceleration(BENCH, "pedal", "r", 160.0, 90.0))
    assert math.isnan(turned(BENCH, "pedal", 1.0, 0.1, 160.0, 90.0))
    assert roots(BENCH, 160.0, 90.0) == []


def test_sideward_flight_needs_more_than_hover():
    assert largest_control(BENCH, 0.0, 0.0) < largest_control(BENCH, 0.0, 15.0) < 1.0
