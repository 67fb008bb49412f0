"""Flights that turn, slip and stand in a wind: mirrored, straight, replayed, trimmed at the start, over their point."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenarios
from rtsim.aircraft.variables import STATE
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_NAMES
from rtsim.loop.setup import FlightSetup, prepare
from rtsim.loop.simulation import Simulation
from rtsim.programme import TURN, Programme
from rtsim.units import deg, kt
from scenarios.files.options import Overrides
from scenarios.flight.replay import replay_log
from scenarios.flight.runner import FlightOutputs

ODD = (
    "bank_deg", "roll_rate_deg_s", "yaw_rate_deg_s", "turn_rate_deg_s", "sideslip_deg", "lateral_kt",
    "lateral_acceleration", "east_m", "aileron_deg", "rudder_deg", "differential_collective_deg",
    "differential_cyclic_deg", "differential_longitudinal_flapping_deg",
    "differential_lateral_flapping_deg", "gust_v_m_s", "gust_p_deg_s", "gust_r_deg_s", "wind_east_m_s", "lateral_stick",
    "pedal", "pilot_lateral_stick", "pilot_pedal", "protection_lateral_stick", "protection_pedal", "bank_reference_deg",
    "lateral_reference_kt", "track_error_m",
)  # fmt: skip
"""Columns that change their sign in a mirror; in symmetric flight they are zero."""
ROUND = ("heading_deg", "track_deg", "heading_reference_deg")
SIDES = {"flapping_right_deg": "flapping_left_deg", "mast_torque_right_inlb": "mast_torque_left_inlb"}


def programme(
    airspeed: float, nacelle: float, *points: tuple[float, int, float, float], track: float = 0.0
) -> Programme:
    """Points of time, kind of turn, its value [deg] and lateral speed [kn] at one airspeed [kn] and angle [deg]."""
    time, kind, turn, lateral = (np.array(row) for row in zip(*points, strict=True))
    one = np.ones(time.size)
    return Programme(
        time,
        kt(airspeed) * one,
        deg(nacelle) * one,
        100.0 * one,
        kind,
        np.deg2rad(turn),
        kt(1.0) * lateral,
        track * one,
    )


def flown(asked: Programme, seconds: float, **options: Any) -> FloatArray:
    setup = FlightSetup(programme=asked).with_options(**options)
    return Simulation(setup).run(round(seconds * setup.options.rate_hz))


TURNS = {
    "turn": lambda side: programme(
        60, 75, (0, TURN.bank, 0, 0), (1, TURN.bank, 0, 0), (4, TURN.bank, side * 25, 0), (9, TURN.rate, -side * 3, 0)
    ),
    "sideward": lambda side: programme(
        0, 90, (0, TURN.bank, 0, side * 8), (5, TURN.bank, 0, side * 14), (9, TURN.rate, side * 6, side * 4), track=1.0
    ),
}


@pytest.mark.parametrize("name", TURNS)
@pytest.mark.parametrize(("plant", "tolerance"), [("lpv", 0.0), ("nonlinear", 1e-9)])
def test_a_left_turn_is_the_mirror_image_of_a_right_one(name: str, plant: str, tolerance: float) -> None:
    right, left = (flown(TURNS[name](side), 9.0, plant=plant) for side in (1.0, -1.0))
    assert right.shape == left.shape
    assert np.ptp(right[:, COLUMN.bank_deg]) > 3.0
    for column, signal in enumerate(SIGNAL_NAMES):
        if signal in ROUND:
            error = right[:, column] + left[:, column]
            assert np.abs(error - 360.0 * np.round(error / 360.0)).max() < 1e-9
            continue
        other = SIDES.get(signal, next((key for key, value in SIDES.items() if value == signal), signal))
        image = left[:, getattr(COLUMN, other)] * (-1.0 if signal in ODD else 1.0)
        scale = max(np.abs(right[:, column]).max(), 1.0)
        assert np.abs(right[:, column] - image).max() <= tolerance * scale, signal


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_a_straight_flight_has_exact_zeros_out_of_its_plane(plant: str) -> None:
    rows = flown(scenarios.load_scenario("typical_conversion").programme, 5.0, plant=plant, heading=0.0)
    for signal in (*ODD, *ROUND, "point_error_m"):
        assert not rows[:, getattr(COLUMN, signal)].any(), signal


def test_a_track_in_calm_air_is_the_straight_flight() -> None:
    straight, held = (flown(programme(0, 90, (0, TURN.bank, 0, 0), track=track), 4.0) for track in (0.0, 1.0))
    assert np.abs(straight - held).max() < 1e-6  # what rounding moves the aircraft by, the track takes back
    for signal in ODD:
        assert not held[:, getattr(COLUMN, signal)].any(), signal


@pytest.mark.parametrize("name", ["standard_turn_40_90", "crosswind_takeoff"])
def test_a_replay_of_a_turning_flight_has_the_same_history(tmp_path: Path, name: str) -> None:
    log, overrides = tmp_path / "a.parquet", Overrides(duration=8.0)
    flight = scenarios.fly(name, speed="max", overrides=overrides, outputs=FlightOutputs(log=log))
    result = replay_log(log)
    assert result.same
    assert result.replayed_sha256 == flight.history_sha256
    assert np.abs(flight["lateral_stick"]).max() > 0.01


@pytest.mark.parametrize(("plant", "rest"), [("lpv", 0.02), ("nonlinear", 1e-6)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_flight_starts_trimmed_in_sideward_flight(plant: str, rest: float, side: float) -> None:
    asked = programme(10, 90, (0, TURN.bank, 0, side * 12))
    flying = prepare(FlightSetup(programme=asked).with_options(plant=plant))
    x = flying.state.x.copy()
    assert x[STATE.v] == pytest.approx(side * kt(12.0), rel=0.01)
    assert side * np.rad2deg(x[STATE.bank]) > 0.5
    flying.run(1)
    rigid = [STATE.u, STATE.v, STATE.w, STATE.p, STATE.q, STATE.r]
    assert np.abs(flying.state.x - x)[rigid].max() / 0.004 < rest


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_hovers_over_its_place_in_wind_from_the_side(plant: str) -> None:
    asked = programme(-kt(20.0) * 0.5 / kt(1.0), 90, (0, TURN.heading, 30, 0), track=1.0)
    rows = flown(asked, 30.0, plant=plant, wind=kt(20.0), wind_from=deg(150.0), heading=deg(30.0))
    assert np.hypot(rows[:, COLUMN.north_m], rows[:, COLUMN.east_m]).max() < 1.0
    assert np.abs(rows[:, COLUMN.heading_deg] - 30.0).max() < 0.5
    assert abs(rows[0, COLUMN.lateral_kt]) == pytest.approx(20.0 * np.sqrt(0.75), rel=0.01)


def test_comes_back_over_its_point_when_blown_away() -> None:
    asked = programme(0.3, 90, (0, TURN.heading, 0, 0), track=1.0)  # 0.3 kn too fast: stands all the same
    rows = flown(asked, 60.0)
    assert abs(rows[-1, COLUMN.north_m]) < 1.5  # at 0.3 kn it would be 9 m away
    assert rows[-1, COLUMN.point_error_m] == pytest.approx(abs(rows[-1, COLUMN.north_m]), abs=0.1)


def test_starts_that_have_no_trim_sideward_are_refused() -> None:
    with pytest.raises(InputError, match=r"35\.0 kn to the right"):
        flown(programme(0, 90, (0, TURN.bank, 0, 35)), 1.0)


def test_an_aircraft_without_a_lateral_half_does_not_turn() -> None:
    with pytest.raises(InputError, match="plane of symmetry alone"):
        flown(TURNS["turn"](1.0), 1.0, plant="lpv-plain")


def test_a_line_begins_where_the_flight_has_turned_onto_it() -> None:
    """At 80 kn, across 10 kn of wind: the nose points into the wind, the course is the line's."""
    kind = TURN.heading
    asked = programme(80, 75, (0, kind, 0, 0), (4, kind, 0, 0), (4.1, kind, 40, 0), (50, kind, 40, 0), track=1.0)
    rows = flown(asked, 50.0, wind=kt(10.0), wind_from=deg(130.0))
    assert abs(rows[0, COLUMN.lateral_kt]) < 1e-9  # at speed the heading holds the line
    assert np.abs(rows[:, COLUMN.track_error_m]).max() < 25.0
    assert abs(rows[-1, COLUMN.track_error_m]) < 5.0
    assert rows[-1, COLUMN.track_deg] == pytest.approx(40.0, abs=0.5)
    assert rows[-1, COLUMN.heading_deg] == pytest.approx(40.0 + np.rad2deg(np.arcsin(10.0 / 80.0)), abs=0.5)
