"""Steady wind by direction and height: signs, the law of MIL-F-8785C, motion over the ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtsim.aircraft.variables import ALL_STATES, STATE
from rtsim.atmosphere import wind_kernels as kernels
from rtsim.atmosphere.air import wind_tables
from rtsim.units import FOOT, deg, ft, kt


def wind(speed, wind_from=None, *, heading=0.0, reference_height=0.0, felt=True):
    return wind_tables(speed, wind_from, heading=heading, reference_height=reference_height, felt=felt)


def state(**values):
    x = np.zeros(len(ALL_STATES))
    for name, value in values.items():
        x[getattr(STATE, name)] = value
    return x


@pytest.mark.parametrize(
    ("wind_from_deg", "heading_deg", "ahead", "right"),
    [(0.0, 0.0, -10.0, 0.0), (270.0, 0.0, 0.0, 10.0), (90.0, 0.0, 0.0, -10.0), (270.0, 270.0, -10.0, 0.0),
     (180.0, 90.0, 0.0, -10.0), (225.0, 0.0, 10.0 / math.sqrt(2.0), 10.0 / math.sqrt(2.0))],
)  # fmt: skip
def test_wind_from_a_direction_blows_the_other_way(wind_from_deg, heading_deg, ahead, right):
    """Wind from the west, flying north, carries to the right; from the north it is a headwind."""
    tables = wind(10.0, deg(wind_from_deg), heading=deg(heading_deg))
    assert kernels.wind_along(tables, deg(heading_deg)) == pytest.approx((ahead, right), abs=1e-12)
    north, east = -10.0 * math.cos(deg(wind_from_deg)), -10.0 * math.sin(deg(wind_from_deg))
    assert kernels.wind_along(tables, 0.0) == pytest.approx((north, east), abs=1e-12)


def test_wind_without_direction_is_a_tailwind_to_the_last_bit():
    for heading in (0.0, 0.3, 4.0):
        assert kernels.wind_along(wind(5.1, heading=heading), heading) == (5.1, 0.0)


def test_wind_shear_of_the_specification():
    """MIL-F-8785C 3.7.3.2, Category C: u = u20 ln(h / 0.15) / ln(20 / 0.15), h in ft, from 3 to 1000 ft."""
    tables = wind(kt(20.0), 0.0, reference_height=20.0 * FOOT)
    for height in (3.0, 20.0, 100.0, 1000.0):
        expected = math.log(height / 0.15) / math.log(20.0 / 0.15)
        assert kernels.wind_share(tables, ft(height)) == pytest.approx(expected, rel=1e-12)
    assert kernels.wind_share(tables, 0.0) == kernels.wind_share(tables, ft(3.0))
    assert kernels.wind_share(tables, ft(5000.0)) == kernels.wind_share(tables, ft(1000.0))
    assert kernels.wind_share(wind(5.0), 3.0) == 1.0
    step = 1e-4
    slope = (kernels.wind_share(tables, 30.0 + step) - kernels.wind_share(tables, 30.0 - step)) / (2.0 * step)
    assert kernels.wind_gradient(tables, 30.0) == pytest.approx(slope, rel=1e-6)
    assert kernels.wind_gradient(tables, 0.1) == kernels.wind_gradient(tables, 400.0) == 0.0


def test_level_motion_is_the_velocity_turned_by_pitch_and_bank():
    x = state(u=30.0, v=-4.0, w=2.0, pitch=0.2, bank=-0.7)
    turn_pitch = np.array([[math.cos(0.2), 0.0, math.sin(0.2)], [0.0, 1.0, 0.0], [-math.sin(0.2), 0.0, math.cos(0.2)]])
    turn_bank = np.array(
        [[1.0, 0.0, 0.0], [0.0, math.cos(-0.7), -math.sin(-0.7)], [0.0, math.sin(-0.7), math.cos(-0.7)]]
    )
    ahead, right, down = turn_pitch @ turn_bank @ np.array([30.0, -4.0, 2.0])
    assert kernels.level_motion(x) == pytest.approx((ahead, right, -down), rel=1e-12)


def test_meeting_other_wind_leaves_the_motion_over_the_ground_alone():
    """Air-relative velocity and wind change by the same: over the ground and upwards nothing does."""
    tables = wind(12.0, deg(250.0), heading=deg(20.0), reference_height=10.0)
    x = state(u=20.0, v=3.0, w=-1.0, pitch=0.1, bank=0.4, heading=deg(75.0), altitude=30.0)
    before = (*kernels.over_ground(tables, x), kernels.level_motion(x)[2])
    airspeed = kernels.level_motion(x)[0]
    climbed = x.copy()
    climbed[STATE.altitude] = 45.0
    kernels.meet_wind(tables, climbed, 30.0)
    after = (*kernels.over_ground(tables, climbed), kernels.level_motion(climbed)[2])
    assert after == pytest.approx(before, rel=1e-12)
    assert abs(kernels.level_motion(climbed)[0] - airspeed) > 0.1


def test_an_aircraft_without_sideways_motion_meets_the_wind_along_its_heading_only():
    tables = wind(12.0, deg(60.0), reference_height=10.0, felt=False)
    x = state(u=20.0, w=1.0, pitch=0.1, altitude=45.0)
    ahead, _, climb = kernels.level_motion(x)
    kernels.meet_wind(tables, x, 30.0)
    assert x[STATE.v] == 0.0
    change = kernels.wind_share(tables, 45.0) - kernels.wind_share(tables, 30.0)
    assert kernels.level_motion(x)[0] - ahead == pytest.approx(-change * tables.ahead, rel=1e-9)
    assert kernels.level_motion(x)[2] == pytest.approx(climb, rel=1e-12)


def test_ground_speed_has_a_sign_only_where_it_is_rather_rearward():
    assert kernels.level_speed(-3.0, 0.0) == -3.0
    assert kernels.level_speed(3.0, -4.0) == 5.0
    assert kernels.level_speed(-3.0, 4.0) == 5.0
    assert kernels.level_speed(-4.0, 3.0) == -5.0
