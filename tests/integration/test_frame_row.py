"""What a frame records follows from its states, and how a flight ends by itself is judged as documented."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from rtsim.aircraft.variables import STATE
from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from rtsim.units import deg, kt, to_kt

WIND = 4.0
"""Tailwind of the recorded flight [m/s]."""
ROUNDING = 1e-9
"""Columns are converted to their units and back."""


def conversion(**changes: Any) -> FlightSetup:
    programme = Programme(
        np.array([0.0, 8.0, 10.0]),
        kt(np.array([60.0, 84.0, 84.0])),
        deg(np.array([85.0, 70.0, 70.0])),
        np.full(3, 100.0),
    )
    air = changes.pop("air", AirSpecification())
    return FlightSetup(programme=programme, air=air).with_options(**changes)


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    """Ten seconds of conversion in wind and turbulence."""
    air = AirSpecification(turbulence=Turbulence.of_severity("moderate"))
    return Simulation(conversion(wind=WIND, air=air)).run(2500)


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, getattr(COLUMN, name)]


def through_the_air(rows: np.ndarray) -> np.ndarray:
    """Horizontal speed through the undisturbed air [m/s]."""
    pitch = np.radians(column(rows, "pitch_deg"))
    return column(rows, "body_u_m_s") * np.cos(pitch) + column(rows, "body_w_m_s") * np.sin(pitch)


def test_speeds_and_path_follow_from_the_body_velocities(rows: np.ndarray) -> None:
    pitch = np.radians(column(rows, "pitch_deg"))
    u, w = column(rows, "body_u_m_s"), column(rows, "body_w_m_s")
    gust_u, gust_w = column(rows, "gust_u_m_s"), column(rows, "gust_w_m_s")
    assert np.abs(gust_u).max() > 0.5
    assert np.abs(gust_w).max() > 0.5
    through = through_the_air(rows)
    climb = u * np.sin(pitch) - w * np.cos(pitch)
    airspeed = through + gust_u * np.cos(pitch) + gust_w * np.sin(pitch)
    assert column(rows, "airspeed_kt") == pytest.approx(to_kt(1.0) * airspeed, abs=ROUNDING)
    assert column(rows, "airspeed_indicated_kt") == pytest.approx(column(rows, "airspeed_kt"), abs=ROUNDING)
    assert column(rows, "ground_speed_kt") == pytest.approx(to_kt(1.0) * (through + WIND), abs=ROUNDING)
    assert column(rows, "climb_rate_m_s") == pytest.approx(climb, abs=ROUNDING)
    path = np.degrees(np.arctan2(climb, through))
    assert column(rows, "flight_path_deg") == pytest.approx(path, abs=ROUNDING)
    # The angle of attack of the scheduling: 4.5 m/s along the horizon make it smooth in hover (docs/architecture.md).
    alpha = np.degrees(np.arctan2(w + gust_w + 4.5 * np.sin(pitch), u + gust_u + 4.5 * np.cos(pitch)))
    assert column(rows, "angle_of_attack_deg") == pytest.approx(alpha, abs=ROUNDING)


def test_distance_is_the_ground_speed_summed(rows: np.ndarray) -> None:
    speed = through_the_air(rows) + WIND
    travelled = np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 0.004)]
    assert column(rows, "distance_m") == pytest.approx(travelled, abs=ROUNDING * 10.0)
    assert travelled[-1] > 300.0


def test_rates_are_those_of_their_angles(rows: np.ndarray) -> None:
    """Differences over two frames against the rate between them: equal to second order in 4 ms."""
    for rate, of, tolerance in (
        ("pitch_rate_deg_s", "pitch_deg", 2e-2),
        ("nacelle_rate_deg_s", "nacelle_deg", 2e-2),
        ("climb_rate_m_s", "altitude_m", 1e-3),
    ):
        values = column(rows, of)
        difference = (values[2:] - values[:-2]) / 0.008
        assert column(rows, rate)[1:-1] == pytest.approx(difference, abs=tolerance), rate
        assert np.ptp(column(rows, rate)) > 10.0 * tolerance


def test_power_comes_from_torque_and_the_engines_give_more(rows: np.ndarray) -> None:
    """Both masts' power, and 7 % lost between engines and masts (NASA CR-166536)."""
    shaft_speed = 589.0 * 2.0 * np.pi / 60.0
    torque = column(rows, "mast_torque_inlb") * 0.112984829
    power = 2.0 * torque * shaft_speed / 745.699872
    assert column(rows, "rotor_speed_rpm") == pytest.approx(589.0, abs=ROUNDING)
    assert column(rows, "power_shp") == pytest.approx(power, rel=1e-8)  # nine digits of the units above
    assert column(rows, "engine_power_shp") == pytest.approx(power / 0.93, rel=1e-8)


def test_flapping_and_margins_are_the_magnitudes_they_say(rows: np.ndarray) -> None:
    flapping = np.hypot(column(rows, "longitudinal_flapping_deg"), column(rows, "lateral_flapping_deg"))
    assert column(rows, "flapping_deg") == pytest.approx(flapping, abs=ROUNDING)
    low, high = column(rows, "margin_low_kt"), column(rows, "margin_high_kt")
    assert np.array_equal(column(rows, "margin_kt"), np.minimum(low, high))
    assert np.all(column(rows, "flap_deg") == pytest.approx(40.0, abs=ROUNDING))
    assert not column(rows, "on_downstop").any()


@pytest.fixture(scope="module")
def landing() -> Simulation:
    return Simulation(conversion(pilot="external", wind=2.0))


def touch(
    simulation: Simulation,
    *,
    sink: float = 1.0,
    pitch_deg: float = 0.0,
    nacelle_deg: float = 90.0,
    ground_speed_kt: float = 0.0,
    altitude: float = 0.0005,
) -> str:
    """Why the flight ends where the aircraft is put just above the ground in that motion."""
    snapshot = simulation.snapshot()
    pitch, along = deg(pitch_deg), kt(ground_speed_kt) - simulation.setup.options.wind
    state = dataclasses.replace(snapshot, state=type(snapshot.state)(*(array.copy() for array in snapshot.state)))
    x, nacelle = state.state.x, state.state.nacelle
    x[STATE.altitude], x[STATE.pitch], x[STATE.q] = altitude, pitch, 0.0
    x[STATE.u] = along * np.cos(pitch) - sink * np.sin(pitch)
    x[STATE.w] = along * np.sin(pitch) + sink * np.cos(pitch)
    nacelle[0], nacelle[1], nacelle[2] = deg(nacelle_deg), deg(nacelle_deg), 0.0
    simulation.restore(state)
    simulation.step()
    reason = simulation.end_reason
    simulation.restore(snapshot)
    return reason


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ({"sink": 1.4}, "touched down gently"),
        ({"sink": 1.6}, "landed hard"),
        ({"sink": 2.9}, "landed hard"),
        ({"sink": 3.1}, "hit the ground"),
        ({"pitch_deg": 14.5}, "touched down gently"),
        ({"pitch_deg": 15.5}, "hit the ground"),
        ({"pitch_deg": -15.5}, "hit the ground"),
        ({"nacelle_deg": 61.0}, "touched down gently"),
        ({"nacelle_deg": 59.0}, "hit the ground"),
        ({"ground_speed_kt": 59.0}, "touched down gently"),
        ({"ground_speed_kt": 61.0}, "hit the ground"),
        ({"ground_speed_kt": -61.0}, "hit the ground"),
        ({"altitude": 50.0, "pitch_deg": 79.0}, ""),
        ({"altitude": 50.0, "pitch_deg": 81.0}, "pitch attitude beyond 80 deg"),
    ],
    ids=str,
)
def test_a_flight_ends_as_its_motion_deserves(landing: Simulation, motion: dict[str, float], words: str) -> None:
    """Each limit from both of its sides; the forces of one 4 ms frame change speeds by less than 0.1 m/s."""
    reason = touch(landing, **motion)
    assert words in reason
    assert bool(reason) == bool(words)
