"""Flights in which the rotors slow down: with laws, automatic nacelles, speeds by hand, and a pilot short of power."""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.errors import InputError
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.nacelle.automatic import AutomaticNacelle
from rtsim.programme import Programme
from rtsim.units import deg, kt, rpm
from scenarios.files.loader import load_scenario


def flown(programme, automatic=None, **options):
    setup = FlightSetup(programme=programme, automatic_nacelle=automatic).with_options(**options)
    simulation = Simulation(setup)
    return simulation.run(round(programme.duration * 250)), simulation


def points(*rows):
    time, airspeed, nacelle = (np.array(column) for column in zip(*rows, strict=True))
    return Programme(time, kt(1.0) * airspeed, deg(1.0) * nacelle, np.full(time.size, 200.0))


def test_a_law_knows_that_the_rotors_are_slow():
    """At 517 rpm the trim lever is a tenth higher; a law that reckoned with 589 rpm climbed 850 m."""
    rows, _ = flown(
        load_scenario("cruise_rotor_speed").programme, automatic_rotor_speed=True, protection="full", corridor="flight"
    )
    assert np.abs(rows[:, COLUMN.altitude_m] - 100.0).max() < 3.0
    assert np.abs(rows[:, COLUMN.protection_stick]).max() == 0.0


def test_rotors_set_by_hand_are_back_before_the_programme_moves_the_nacelles():
    rows, simulation = flown(load_scenario("reconversion").programme, rotor_speed=rpm(517.0))
    assert not simulation.end_reason
    assert rows[0, COLUMN.rotor_speed_rpm] == pytest.approx(517.0, abs=1e-6)
    moving = rows[:, COLUMN.nacelle_deg] > 0.01
    assert rows[moving, COLUMN.rotor_speed_rpm].min() == pytest.approx(589.0, abs=1e-6)
    assert rows[-1, COLUMN.nacelle_deg] == pytest.approx(90.0, abs=0.1)


def test_automatic_nacelles_get_their_rotors_back_in_time():
    rows, simulation = flown(
        load_scenario("reconversion").programme, AutomaticNacelle(), automatic_rotor_speed=True, protection="full",
        corridor="flight",
    )  # fmt: skip
    assert not simulation.end_reason
    assert rows[-1, COLUMN.nacelle_deg] == pytest.approx(90.0, abs=0.5)
    assert rows[:, COLUMN.margin_kt].min() > 4.0


def test_a_short_excursion_of_the_nacelles_is_seen_ahead():
    programme = points(
        (0.0, 160.0, 0.0), (20.0, 160.0, 0.0), (21.5, 160.0, 4.5), (23.0, 160.0, 0.0), (40.0, 160.0, 0.0)
    )
    rows, _ = flown(programme, automatic_rotor_speed=True)
    assert rows[:, COLUMN.nacelle_deg].max() > 1.5
    assert rows[:, COLUMN.rotor_speed_rpm].min() < 520.0


def test_a_pilot_short_of_power_follows_a_reference_that_comes_down_again():
    """He lets the speed go while it is below what is asked, and not when it is above: else he would never slow down."""
    programme = points(
        (0.0, 170.0, 0.0), (3.0, 170.0, 0.0), (53.0, 258.0, 0.0), (120.0, 180.0, 0.0), (160.0, 180.0, 0.0)
    )
    rows, _ = flown(programme, protection="full", corridor="flight")
    assert np.min(rows[:, COLUMN.protection_lever]) < -0.001
    assert rows[-1, COLUMN.airspeed_kt] == pytest.approx(180.0, abs=0.5)
    assert np.abs(rows[:, COLUMN.altitude_m] - 200.0).max() < 3.0


def test_the_governor_off_opens_the_interlock_once_the_rotors_are_fast():
    setup = FlightSetup(programme=points((0.0, 160.0, 0.0), (60.0, 160.0, 0.0))).with_options(rotor_speed=rpm(560.0))
    simulation = Simulation(setup)
    simulation.set_aid("governor", False)
    simulation.set_throttle_trim(0.1)
    rows = simulation.run(2500)
    fast = rows[:, COLUMN.rotor_speed_rpm] > 589.5
    assert fast.any()
    assert simulation.snapshot().state.drive[5] == 0.0


def test_what_the_aircraft_lacks_is_refused():
    with pytest.raises(InputError, match="downstop"):
        flown(points((0.0, 0.0, 90.0), (1.0, 0.0, 90.0)), rotor_speed=rpm(550.0))
