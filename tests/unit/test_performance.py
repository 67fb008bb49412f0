"""Hover ceiling, climb and level speed: each stands at the limit that it names, and nothing else is passed there."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import OUTPUT, STATE
from rtsim.aircraft.xv15.model import Xv15
from rtsim.analysis.performance import best_climb, climb_rate, hover_ceiling, level_speed, mast_torque_limit
from rtsim.cli.main import run
from rtsim.systems.engine import power_available
from rtsim.units import FOOT, HORSEPOWER, INCH_POUND, deg, kt, lb, rpm

AIRCRAFT = Xv15.load()
TILTED = Condition(airspeed=kt(70.0), nacelle_angle=deg(75.0))


def test_the_hover_ceiling_takes_all_the_power_there_is():
    """It is within 1500 ft of the published ones: TM X-62407 7600 ft (text) and 7800 (figure), SP-2000-4517 8650."""
    found = hover_ceiling(AIRCRAFT, mass=lb(13000.0), rotor_speed=rpm(565.0))
    assert found.limit == "power"
    assert found.point.y[OUTPUT.power] == pytest.approx(power_available("takeoff", found.value), rel=1e-3)
    assert found.point.y[OUTPUT.torque] < mast_torque_limit(Condition(airspeed=0.0, nacelle_angle=deg(90.0)))
    assert 7600.0 - 1500.0 < found.value / FOOT < 8650.0 + 1500.0


def test_less_weight_or_more_power_hovers_higher():
    base = hover_ceiling(AIRCRAFT, rating="takeoff").value
    assert hover_ceiling(AIRCRAFT, mass=lb(12500.0), rating="takeoff").value > base + 300.0
    assert hover_ceiling(AIRCRAFT, rating="military").value < base - 300.0
    assert math.isnan(hover_ceiling(AIRCRAFT, mass=lb(19000.0)).value)


@pytest.mark.parametrize(("power", "torque", "limit"), [(1900.0, 163000.0, "power"), (2600.0, 110000.0, "torque")])
def test_a_climb_stands_at_what_ends_it(power, torque, limit):
    found = climb_rate(AIRCRAFT, TILTED, power=power * HORSEPOWER, torque=torque * INCH_POUND)
    shares = {
        "power": found.point.y[OUTPUT.power] / HORSEPOWER / power,
        "torque": found.point.y[OUTPUT.torque] / INCH_POUND / torque,
    }
    assert found.limit == limit
    assert shares[limit] == pytest.approx(1.0, abs=1e-3)
    assert max(shares.values()) <= 1.0
    assert 5.0 < found.value < 20.0


def test_too_little_power_descends_and_enough_for_level_flight_stays_level():
    level = AIRCRAFT.trim(TILTED).y[OUTPUT.power]
    assert climb_rate(AIRCRAFT, TILTED, power=level * 1.0001).value == pytest.approx(0.0, abs=0.01)
    descent = climb_rate(AIRCRAFT, TILTED, power=0.5 * level)
    assert descent.limit == "power"
    assert -12.0 < descent.value < -2.0
    assert descent.point.y[OUTPUT.power] >= 0.5 * level


def test_what_is_climbed_is_paid_for():
    """The power for a little more climb is at least what the weight gains."""
    mass = AIRCRAFT.tables.configuration.mass
    low, high = (climb_rate(AIRCRAFT, TILTED, power=shp * HORSEPOWER).value for shp in (1500.0, 1700.0))
    assert 0.7 < mass * 9.80665 * (high - low) / (200.0 * HORSEPOWER) < 1.0


def test_the_best_climb_is_the_best_of_those_tried():
    speeds = [kt(40.0), kt(70.0), kt(500.0)]
    at, best = best_climb(AIRCRAFT, TILTED, speeds, power=1900.0 * HORSEPOWER)
    each = [climb_rate(AIRCRAFT, replace(TILTED, airspeed=v), power=1900.0 * HORSEPOWER).value for v in speeds[:2]]
    assert best.value == max(each)
    assert at == speeds[each.index(best.value)]
    assert math.isnan(best_climb(AIRCRAFT, TILTED, [kt(500.0)], power=1.0)[1].value)


def test_level_speed_of_the_airplane_is_that_of_the_cruise_torque():
    """With the power for it; a knot faster takes more. How near the published 260 kn is: tests/acceptance."""
    start = Condition(airspeed=kt(170.0), nacelle_angle=0.0)
    found = level_speed(AIRCRAFT, start, power=power_available("contingency", 0.0))
    assert found.limit == "torque"
    assert found.point.y[OUTPUT.torque] == pytest.approx(130000.0 * INCH_POUND, rel=1e-3)
    faster = AIRCRAFT.trim(replace(start, airspeed=found.value + kt(1.0)), found.point)
    assert faster.y[OUTPUT.torque] > 130500.0 * INCH_POUND
    assert abs(found.point.x[STATE.pitch]) < deg(10.0)


def test_the_command_shows_every_figure(capsys):
    assert run(["performance", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result) == {"weight_lb", "altitude_ft", "cg_in", "hover_ceiling", "climb", "level_speed"}
    assert result["hover_ceiling"]["altitude_ft"] == pytest.approx(hover_ceiling(AIRCRAFT).value / FOOT)
    flown = [(90.0, 589), (75.0, 589), (0.0, 517)]
    for figures in (result["climb"], result["level_speed"]):
        assert [(found["nacelle_deg"], round(found["rotor_rpm"])) for found in figures] == flown
    assert all(speed["limit"] in {"power", "torque", "trim"} for speed in result["level_speed"])


@pytest.mark.parametrize("option", [["--rating", "full"], ["--weight-lb", "100"], ["--altitude-ft", "nan"]])
def test_what_cannot_be_asked_is_refused(option, capsys):
    assert run(["performance", *option]) == 2
    assert option[0] in capsys.readouterr().err
