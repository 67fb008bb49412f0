"""Corridor boundaries, margins and levels against their published points and written-out definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtsim.choices import CHART_NAMES
from rtsim.corridor.boundaries import Boundary, load_corridor
from rtsim.corridor.corridor_kernels import corridor_level_step, new_level_state
from rtsim.errors import InputError
from rtsim.units import deg, kt, to_deg, to_kt

DT = 0.004

# Digitised points as published, independent of the shipped file: NASA TM X-62407 figs 4.1.1 and 5.4.1 (13 000 lb line,
# V_C), NASA TM 81244 fig 14 (power-on stall).
TM_X_62407_LOW = {74.0: 5.0, 59.3: 58.0, 50.0: 66.7, 40.0: 75.3, 30.0: 82.6, 20.0: 89.1, 10.0: 95.2, 0.0: 101.0}
TM_81244_STALL = {70.5: 72.0, 64.7: 80.0, 55.4: 89.0, 46.0: 95.0, 32.6: 101.0, 17.0: 106.5, 0.0: 110.8}
V_C = {95.0: 120.0, 90.0: 125.0, 75.0: 140.0, 60.0: 155.0, 45.0: 170.0, 10.0: 170.0}


@pytest.mark.parametrize(("name", "points"), [("design", TM_X_62407_LOW), ("flight", TM_81244_STALL)])
def test_low_side_goes_through_the_published_points(name, points):
    corridor = load_corridor(name)
    for nacelle_deg, speed_kt in points.items():
        assert to_kt(corridor.low_speed(deg(nacelle_deg))) == pytest.approx(speed_kt, abs=1e-9)


@pytest.mark.parametrize("name", CHART_NAMES)
def test_high_side_is_the_design_speed_and_260_kt_on_the_downstop(name):
    corridor = load_corridor(name)
    for nacelle_deg, speed_kt in V_C.items():
        assert to_kt(corridor.high_speed(deg(nacelle_deg))) == pytest.approx(speed_kt, abs=1e-9)
    assert to_kt(corridor.high_speed(deg(0.5))) == pytest.approx(260.0)
    assert to_kt(corridor.high_speed(deg(0.5001))) == pytest.approx(170.0)


@pytest.mark.parametrize("name", CHART_NAMES)
def test_rearward_allowance_near_helicopter_mode(name):
    corridor = load_corridor(name)
    assert to_kt(corridor.low_speed(deg(80.0))) == pytest.approx(-25.0)
    assert to_kt(corridor.low_speed(deg(90.0))) == pytest.approx(-35.0)


def test_flight_low_side_is_straight_from_the_stall_line_to_5_kt_at_75_deg():
    corridor = load_corridor("flight")
    middle = 0.5 * (70.5 + 75.0)
    assert to_kt(corridor.low_speed(deg(middle))) == pytest.approx(0.5 * (72.0 + 5.0))
    assert to_kt(corridor.low_speed(deg(75.0))) == pytest.approx(5.0)


def test_centre_line_matches_the_published_table():
    # Digitised centre line: half of V_C in helicopter mode, midway between stall and V_C otherwise.
    corridor = load_corridor("design")
    table = {90: 62.5, 75: 70.0, 60: 105.2, 50: 115.9, 45: 120.7, 40: 122.7, 30: 126.3, 20: 129.6, 10: 132.6, 0: 135.5}
    angles = np.array([deg(float(angle)) for angle in table])
    assert to_kt(np.asarray(corridor.centre_speed(angles))) == pytest.approx(list(table.values()), abs=0.3)


def test_table_1_of_the_paper_lies_inside_the_design_corridor():
    corridor = load_corridor("design")
    speeds = [0, 24, 40, 61, 80, 105, 130, 150, 170]
    angles = [90, 82, 82, 75, 75, 50, 50, 0, 0]
    for speed, angle in zip(speeds, angles, strict=True):
        margins = corridor.margins(kt(speed), deg(angle))
        assert min(margins.low, margins.high) > 0.0


def test_margins_of_a_point_inside():
    margins = load_corridor("design").margins(kt(100.0), deg(75.0))
    assert to_kt(margins.low) == pytest.approx(100.0)  # the low side passes through 0 kn at 75 deg
    assert to_kt(margins.high) == pytest.approx(40.0)
    # 101 kn is the stall speed at 0 deg and 95.2 at 10 deg: 100 kn is met at 10 * 1 / 5.8 deg.
    assert to_deg(margins.nacelle_forward) == pytest.approx(75.0 - 10.0 / 5.8)
    assert to_deg(margins.nacelle_aft) == pytest.approx(20.0)  # the end of the travel at 95 deg


def test_margins_outside_give_the_travel_that_re_enters():
    corridor = load_corridor("design")
    slow = corridor.margins(kt(40.0), deg(50.0))
    assert to_kt(slow.low) == pytest.approx(40.0 - 66.7)
    assert slow.nacelle_forward < 0.0 < slow.nacelle_aft
    assert corridor.inside(kt(40.0), deg(50.0) - slow.nacelle_forward + 1e-9)
    assert not corridor.inside(kt(40.0), deg(50.0) - slow.nacelle_forward - 1e-6)
    fast = corridor.margins(kt(180.0), deg(10.0))
    assert to_deg(fast.nacelle_aft) == pytest.approx(-9.5)  # only the downstop allows 180 kn
    assert to_deg(fast.nacelle_forward) == pytest.approx(10.0)


@pytest.mark.parametrize("airspeed_kt", [-40.0, 261.0])
def test_no_nacelle_angle_would_do(airspeed_kt):
    margins = load_corridor("design").margins(kt(airspeed_kt), deg(45.0))
    assert to_deg(margins.nacelle_forward) == to_deg(margins.nacelle_aft) == pytest.approx(-95.0)


def test_unknown_corridor_names_the_choices():
    with pytest.raises(InputError, match="design, flight"):
        load_corridor("nominal")


@pytest.mark.parametrize(
    ("nacelle", "speed", "message"),
    [
        ([0.0, 1.0], [1.0], "as many speeds"),
        ([0.0], [1.0], "at least two"),
        ([0.0, 0.0], [2.0, 1.0], "fall strictly"),
        ([0.0, 1.0], [1.0, 2.0], "must not fall"),
        ([0.0, 1.0], [math.nan, 2.0], "not a number"),
    ],
)
def test_a_boundary_refuses_data_that_make_no_corridor(nacelle, speed, message):
    with pytest.raises(InputError, match=message):
        Boundary(nacelle=np.array(nacelle), speed=np.array(speed), kind="", source="")


def levels_of(margins_kt):
    tables = load_corridor("design").tables()
    state = new_level_state()
    return [corridor_level_step(tables, kt(margin), DT, state) for margin in margins_kt]


def test_level_begins_after_a_tenth_of_a_second():
    levels = levels_of([9.9] * 30)
    assert levels[:24] == [0] * 24
    assert levels[24:] == [1] * 6


def test_a_margin_jumping_straight_outside_becomes_an_exceedance_at_once_after_the_delay():
    levels = levels_of([20.0] * 5 + [-1.0] * 30)
    assert levels[28] == 0
    assert levels[29] == 3


def test_a_short_dip_raises_nothing():
    assert max(levels_of([20.0] * 10 + [-5.0] * 24 + [20.0] * 50)) == 0


def test_level_ends_only_after_a_second_beyond_the_hysteresis():
    entered = [3.9] * 30
    assert levels_of([*entered, *[5.4] * 500])[-1] == 2  # 5.4 < 4 + 1.5: never ends
    levels = levels_of([*entered, *[5.6] * 260])
    assert levels[30 + 248] == 2
    assert levels[30 + 249] == 1  # the caution goes on: 5.6 < 10
    interrupted = levels_of([*entered, *[5.6] * 240, 5.0, *[5.6] * 240])
    assert interrupted[-1] == 2


def test_flicker_between_warning_and_outside_counts_as_warning_only():
    assert max(levels_of([-1.0, 3.0] * 200)) == 2
