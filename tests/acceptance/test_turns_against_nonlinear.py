"""Turns and sideward flight of the LPV aircraft judged by the nonlinear model, the same pilot flying both.

Source of the limits: twice what an independent prototype of the same form reached with another controller (bank,
heading, lateral and forward airspeed, pitch, height, flapping: deg, kn, m). Measured here: docs/six-degrees.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.frame import COLUMN
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.programme import TURN, Programme
from rtsim.units import deg, kt
from scenarios.files.loader import load_scenario

SIGNALS = ("bank_deg", "heading_deg", "lateral_kt", "airspeed_kt", "pitch_deg", "altitude_m")
TURNING = (0.08, 0.12, 0.16, 0.10, 0.12, 0.14)
STEEP = (0.40, 0.40, 0.46, 0.28, 0.26, 0.30)


def turn(airspeed, nacelle, bank, *, entry=4.0):
    time = np.array([0.0, 3.0, 3.0 + entry, 22.0, 22.0 + entry, 35.0])
    one = np.ones(time.size)
    banks = deg(bank) * np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    return Programme(time, kt(airspeed) * one, deg(nacelle) * one, 100.0 * one, turn=banks)


def sideward():
    time = np.array([0.0, 3.0, 23.0, 35.0, 55.0, 65.0])
    one, lateral = np.ones(time.size), kt(25.0) * np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    return Programme(time, 0.0 * one, deg(90.0) * one, 100.0 * one, lateral=lateral)


def fly(programme, plant, seconds=None):
    simulation = Simulation(FlightSetup(programme=programme).with_options(plant=plant, protection="off"))
    rows = simulation.run(round((seconds or programme.duration) * 250))
    assert not simulation.end_reason
    return rows


def errors(programme):
    difference = fly(programme, "lpv") - fly(programme, "nonlinear")
    difference[:, COLUMN.heading_deg] = (difference[:, COLUMN.heading_deg] + 180.0) % 360.0 - 180.0
    return {name: float(np.sqrt(np.mean(difference[:, getattr(COLUMN, name)] ** 2))) for name in SIGNALS}


@pytest.mark.parametrize(
    ("programme", "limits"),
    [
        (turn(60, 75, 30), TURNING),
        (turn(90, 75, 30), TURNING),
        (turn(120, 30, 30), TURNING),
        (turn(165, 0, 30), TURNING),
        (turn(60, 75, 40), STEEP),
        (sideward(), (0.26, 0.22, 0.18, 0.18, 0.12, 0.12)),
    ],
    ids=["60/75", "90/75", "120/30", "165/0", "steep", "sideward"],
)
def test_turns_and_sideward_flight(programme, limits):
    found = errors(programme)
    for name, limit in zip(SIGNALS, limits, strict=True):
        assert found[name] <= limit, found


def test_table_1_with_a_turn():
    """Table 1 with a 20 deg turn from 14 to 46 s."""
    straight = load_scenario("typical_conversion").programme
    time = np.union1d(straight.time, [14.0, 18.0, 42.0, 46.0])
    rows = [
        np.interp(time, straight.time, row) for row in (straight.airspeed, straight.nacelle_angle, straight.altitude)
    ]
    banks = np.interp(time, [14.0, 18.0, 42.0, 46.0], [0.0, deg(20.0), deg(20.0), 0.0])
    found = errors(Programme(time, *rows, turn=banks))
    for name, limit in zip(SIGNALS, (0.08, 0.20, 0.18, 0.26, 0.24, 0.30), strict=True):
        assert found[name] <= limit, found


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_a_mirrored_flight_is_the_mirror_image(plant):
    """A turn to the left and one to the right: bit for bit on the LPV aircraft, to rounding on the nonlinear one."""
    right, left = fly(turn(60, 75, 30), plant, 20.0), fly(turn(60, 75, -30), plant, 20.0)
    odd = [COLUMN.bank_deg, COLUMN.lateral_kt, COLUMN.east_m, COLUMN.lateral_stick, COLUMN.pedal, COLUMN.rudder_deg]
    even = [COLUMN.airspeed_kt, COLUMN.pitch_deg, COLUMN.altitude_m, COLUMN.north_m, COLUMN.stick, COLUMN.lever]
    assert np.abs(right[:, odd]).max() > 10.0
    tolerance = 0.0 if plant == "lpv" else 1e-9
    np.testing.assert_allclose(left[:, odd], -right[:, odd], rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(left[:, even], right[:, even], rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(left[:, COLUMN.flapping_left_deg], right[:, COLUMN.flapping_right_deg], atol=tolerance)


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_a_straight_flight_is_exactly_symmetric(plant):
    """Gusts ahead, conversion and all: every lateral column is exactly zero, and the heading stays."""
    simulation = Simulation(
        FlightSetup(programme=load_scenario("typical_conversion").programme).with_options(
            plant=plant, heading=deg(30.0)
        )
    )
    rows = simulation.run(20 * 250)
    names = ("bank_deg", "roll_rate_deg_s", "yaw_rate_deg_s", "turn_rate_deg_s", "sideslip_deg", "lateral_kt",
             "lateral_acceleration", "aileron_deg", "rudder_deg", "differential_collective_deg", "lateral_stick",
             "pedal")  # fmt: skip
    for name in names:
        assert not rows[:, getattr(COLUMN, name)].any(), name
    assert np.ptp(rows[:, COLUMN.heading_deg]) == 0.0
    assert np.array_equal(rows[:, COLUMN.flapping_right_deg], rows[:, COLUMN.flapping_left_deg])
    assert np.array_equal(rows[:, COLUMN.mast_torque_right_inlb], rows[:, COLUMN.mast_torque_left_inlb])


@pytest.mark.parametrize(("plant", "heading"), [("lpv", 90.0), ("lpv", -120.0), ("nonlinear", 90.0)])
def test_a_heading_is_flown_the_nearest_way(plant, heading):
    """80 kn, nacelle 75: 20 deg of bank at most, less than 2 deg of sideslip, on the heading within 0.5 deg."""
    time, one = np.array([0.0, 3.0, 3.01, 40.0]), np.ones(4)
    asked = deg(heading) * np.array([0.0, 0.0, 1.0, 1.0])
    kinds = TURN.heading * one
    rows = fly(Programme(time, kt(80.0) * one, deg(75.0) * one, 100.0 * one, turn_kind=kinds, turn=asked), plant)
    assert rows[-1, COLUMN.heading_deg] == pytest.approx(heading % 360.0, abs=0.5)
    assert np.abs(rows[:, COLUMN.bank_deg]).max() < 21.5
    assert np.abs(rows[:, COLUMN.sideslip_deg]).max() < 2.0
    assert np.sign(rows[1500, COLUMN.bank_deg]) == np.sign(heading)
