"""A ground to land on and take off from, on both plants and by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenarios
from rtsim.aircraft.profile import read_profile
from rtsim.aircraft.xv15.model import Xv15
from rtsim.command import Command
from rtsim.errors import InputError
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme, ProgrammePoint
from rtsim.systems.ground import load_ground_tables
from rtsim.units import deg
from scenarios.files.loader import load_scenario


def flown(name, plant):
    scenario = load_scenario(name)
    simulation = Simulation(FlightSetup(programme=scenario.programme).with_options(plant=plant, ground=True))
    return simulation.run(round(scenario.programme.duration * 250))


@pytest.mark.parametrize("name", ["vertical_landing", "vertical_takeoff"])
def test_both_plants_meet_the_ground_alike(name):
    """LPV against nonlinear: heights within 0.5 m, weight on the wheels at the end within a tenth."""
    mine, truth = flown(name, "lpv"), flown(name, "nonlinear")
    assert np.max(np.abs(mine[:, COLUMN.altitude_m] - truth[:, COLUMN.altitude_m])) < 0.5
    assert mine[-1, COLUMN.weight_on_wheels] == pytest.approx(truth[-1, COLUMN.weight_on_wheels], abs=0.1)


def test_hover_on_the_wheels_takes_less_power():
    """Power in ground effect over that out of it, near 0.86 (fitted to 1.11 of the weight at one power)."""
    rows = flown("vertical_takeoff", "nonlinear")
    light, high = rows[0], rows[-1]
    assert light[COLUMN.ground_effect] == pytest.approx(0.93, abs=0.05)
    assert high[COLUMN.ground_effect] == 0.0
    settled = rows[1000, COLUMN.power_shp] / high[COLUMN.power_shp]
    assert 0.83 < settled < 0.93


def held_down(lever, seconds, **options):
    start = ProgrammePoint(airspeed=0.0, nacelle_angle=deg(90.0), altitude=5.0)
    programme = Programme.hold(airspeed=0.0, nacelle_angle=deg(90.0), altitude=5.0)
    simulation = Simulation(FlightSetup(programme=programme, start=start).with_options(**options))
    simulation.set_pilot("external")
    stick, trim = float(simulation.snapshot().state.u[0]), float(simulation.snapshot().state.u[1])
    for _ in range(round(seconds * 250)):
        if simulation.end_reason:
            break
        simulation.step(Command(stick, trim + lever, 0.0))
    return simulation


def test_a_soft_touch_stands_and_a_hard_one_breaks():
    soft = held_down(-0.03, 8.0, ground=True)
    assert not soft.end_reason
    hard = held_down(-0.3, 8.0, ground=True)
    assert "hit the ground" in hard.end_reason
    assert "landing" in (ended := held_down(-0.03, 8.0).end_reason) or "touched" in ended or "landed" in ended


def test_a_flight_says_when_the_wheels_touch_and_leave():
    landing = scenarios.fly("vertical_landing", speed="max")
    assert [event.kind for event in landing.events if event.kind == "wheels"] == ["wheels"]
    takeoff = scenarios.fly("vertical_takeoff", speed="max")
    assert [event.text for event in takeoff.events if event.kind == "wheels"] == ["lifted off"]


def test_an_aircraft_without_gear_is_refused():
    profile = read_profile(Path(__file__).parents[2] / "examples" / "second_tiltrotor" / "two_thirds.profile.toml")
    with pytest.raises(InputError, match="no landing gear"):
        load_ground_tables(profile, Xv15.load().tables)
