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


LATERAL_COLUMNS = (
    "bank_deg", "roll_rate_deg_s", "yaw_rate_deg_s", "turn_rate_deg_s", "sideslip_deg", "lateral_kt",
    "lateral_acceleration", "aileron_deg", "rudder_deg", "differential_collective_deg", "differential_cyclic_deg",
    "gust_v_m_s", "gust_p_deg_s", "gust_r_deg_s",
)  # fmt: skip


def test_a_symmetric_flight_is_exactly_symmetric(rows: np.ndarray) -> None:
    for name in LATERAL_COLUMNS:
        assert not column(rows, name).any(), name
    assert not column(rows, "heading_deg").any()
    assert not column(rows, "east_m").any()
    for side in ("right", "left"):
        assert np.array_equal(column(rows, f"flapping_{side}_deg"), column(rows, "flapping_deg"))
        assert np.array_equal(column(rows, f"mast_torque_{side}_inlb"), column(rows, "mast_torque_inlb"))
    assert column(rows, "north_m") == pytest.approx(column(rows, "distance_m"), abs=ROUNDING)
    assert np.all(column(rows, "wind_north_m_s") == WIND)


def test_the_same_flight_on_another_heading() -> None:
    """Heading 210 deg: old columns to the last bit, the place along the heading, the wind from behind."""
    north, turned = (Simulation(conversion(wind=WIND, heading=deg(angle))).run(500) for angle in (0.0, 210.0))
    names = [name for name in COLUMN.asdict() if column(north, name).any() or name in LATERAL_COLUMNS]
    changed = {"heading_deg", "track_deg", "north_m", "east_m", "wind_north_m_s", "wind_east_m_s"}
    for name in set(names) - changed:
        assert np.array_equal(column(north, name), column(turned, name)), name
    distance, heading = column(turned, "distance_m"), deg(210.0)
    assert column(turned, "north_m") == pytest.approx(distance * np.cos(heading), abs=ROUNDING)
    assert column(turned, "east_m") == pytest.approx(distance * np.sin(heading), abs=ROUNDING)
    assert column(turned, "heading_deg") == pytest.approx(210.0)
    assert column(turned, "track_deg") == pytest.approx(210.0)
    assert column(turned, "wind_east_m_s") == pytest.approx(WIND * np.sin(heading))


def test_what_the_row_says_of_a_banked_turning_aircraft() -> None:
    """Each column from a state that is put there, by its own formula; the wind blows from the west."""
    simulation = Simulation(conversion(pilot="external", wind=6.0, wind_from=deg(270.0)))
    x = simulation.flying.state.x
    values = {
        "u": 30.0, "v": 4.0, "w": 3.0, "p": 0.1, "q": 0.05, "r": -0.2, "pitch": 0.1, "bank": 0.4, "heading": -0.5,
        "north": 7.0, "east": -8.0, "flap_1c": 0.02, "flap_1s": 0.01, "flap_1c_difference": 0.005,
        "flap_1s_difference": -0.02, "aileron": 0.1, "rudder": -0.2, "collective_difference": 0.03,
        "cyclic_difference": -0.01,
    }  # fmt: skip
    for name, value in values.items():
        x[getattr(STATE, name)] = value
    simulation.flying.do(1)  # observe what was put there
    sensors = simulation.sensors()
    row = simulation.step()
    cp, sp, cb, sb = np.cos(0.1), np.sin(0.1), np.cos(0.4), np.sin(0.4)
    ahead, right = 30.0 * cp + (4.0 * sb + 3.0 * cb) * sp, 4.0 * cb - 3.0 * sb
    north = ahead * np.cos(-0.5) - right * np.sin(-0.5)
    east = ahead * np.sin(-0.5) + right * np.cos(-0.5) + 6.0
    expected = {
        "airspeed_kt": to_kt(ahead), "lateral_kt": to_kt(right),
        "climb_rate_m_s": 30.0 * sp - (4.0 * sb + 3.0 * cb) * cp,
        "ground_speed_kt": to_kt(np.hypot(north, east)), "track_deg": np.degrees(np.arctan2(east, north)) % 360.0,
        "heading_deg": 360.0 - np.degrees(0.5), "bank_deg": np.degrees(0.4), "roll_rate_deg_s": np.degrees(0.1),
        "yaw_rate_deg_s": np.degrees(-0.2), "turn_rate_deg_s": np.degrees((0.05 * sb - 0.2 * cb) / cp),
        "sideslip_deg": np.degrees(np.arctan2(4.0, np.sqrt(909.0 + 4.5**2))), "north_m": 7.0, "east_m": -8.0,
        "flapping_right_deg": np.degrees(np.hypot(0.025, -0.01)),
        "flapping_left_deg": np.degrees(np.hypot(0.015, 0.03)),
        "aileron_deg": np.degrees(0.1), "rudder_deg": np.degrees(-0.2),
        "differential_collective_deg": np.degrees(0.03),
        "differential_cyclic_deg": np.degrees(-0.01), "wind_north_m_s": 0.0, "wind_east_m_s": 6.0,
    }  # fmt: skip
    for name, value in expected.items():
        assert row[getattr(COLUMN, name)] == pytest.approx(value, abs=ROUNDING), name
    assert (sensors.bank, sensors.north, sensors.east) == pytest.approx((0.4, 7.0, -8.0))
    assert (sensors.lateral_velocity, sensors.yaw_rate) == pytest.approx((right, -0.2))
    assert sensors.heading == pytest.approx(2.0 * np.pi - 0.5)
    assert sensors.flapping_left == pytest.approx(np.hypot(0.015, 0.03))


def test_a_crosswind_carries_the_aircraft_off_its_heading() -> None:
    """Straight north in wind from the west: the air speeds are those of calm air, the place drifts east with it."""
    calm = Simulation(conversion()).run(500)
    cross = Simulation(conversion(wind=5.0, wind_from=deg(270.0))).run(500)
    for name in ("airspeed_kt", "pitch_deg", "altitude_m", "lateral_kt", "sideslip_deg"):
        assert np.array_equal(column(calm, name), column(cross, name)), name
    time = column(cross, "time_s")
    assert column(cross, "east_m") == pytest.approx(5.0 * time, abs=ROUNDING)
    assert column(cross, "north_m") == pytest.approx(column(calm, "north_m"), abs=ROUNDING)
    speeds = np.hypot(column(calm, "ground_speed_kt"), to_kt(5.0))
    assert column(cross, "ground_speed_kt") == pytest.approx(speeds, abs=ROUNDING)
    travelled = np.r_[0.0, np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * kt(1.0) * 0.004)]
    assert column(cross, "distance_m") == pytest.approx(travelled, abs=ROUNDING * 10.0)


def test_climbing_into_more_wind_keeps_the_motion_over_the_ground() -> None:
    """Thrown up steeply in a headwind that grows with height: what changes over the ground is what forces change.

    Beside the same flight in a wind of one strength, the first frames differ by the change of the wind in airspeed and
    not in ground speed: an aircraft gains energy by flying into more headwind.
    """
    rows = {}
    for height, profile in ((0.0, {}), (10.0, {"wind_reference_height": 10.0})):
        simulation = Simulation(conversion(pilot="external", wind=10.0, wind_from=0.0, **profile))
        x = simulation.flying.state.x
        x[STATE.altitude], x[STATE.w] = 20.0, x[STATE.w] - 40.0
        simulation.flying.do(1)
        rows[height] = simulation.run(25)
    same, grown = rows[0.0], rows[10.0]
    rise = np.log(column(grown, "altitude_m") / 20.0) / np.log(10.0 / (0.15 * 0.3048))
    assert -column(grown, "wind_north_m_s") == pytest.approx(
        10.0 * np.log(column(grown, "altitude_m") / (0.15 * 0.3048)) / np.log(10.0 / (0.15 * 0.3048)), rel=1e-9
    )
    gained = kt(column(grown, "airspeed_kt") - column(same, "airspeed_kt"))
    assert gained[-1] > 0.3
    assert gained == pytest.approx(10.0 * rise, abs=0.02)
    over_ground = kt(column(grown, "ground_speed_kt") - column(same, "ground_speed_kt"))
    assert over_ground - over_ground[0] == pytest.approx(np.zeros(25), abs=0.02)
    rate = np.gradient(to_kt(gained), 0.004)
    said = column(grown, "airspeed_rate_kt_s") - column(same, "airspeed_rate_kt_s")
    assert said[1:-1] == pytest.approx(rate[1:-1], abs=0.2)
    assert rate.min() > 4.0


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
    bank_deg: float = 0.0,
    sideways_kt: float = 0.0,
) -> str:
    """Why the flight ends where the aircraft is put just above the ground in that motion."""
    snapshot = simulation.snapshot()
    pitch, along = deg(pitch_deg), kt(ground_speed_kt) - simulation.setup.options.wind
    state = dataclasses.replace(snapshot, state=type(snapshot.state)(*(array.copy() for array in snapshot.state)))
    x, nacelle = state.state.x, state.state.nacelle
    x[STATE.altitude], x[STATE.pitch], x[STATE.q] = altitude, pitch, 0.0
    x[STATE.u] = along * np.cos(pitch) - sink * np.sin(pitch)
    down, bank, sideways = along * np.sin(pitch) + sink * np.cos(pitch), deg(bank_deg), kt(sideways_kt)
    x[STATE.v] = sideways * np.cos(bank) + down * np.sin(bank)
    x[STATE.w] = down * np.cos(bank) - sideways * np.sin(bank)
    x[STATE.bank] = bank
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
        ({"bank_deg": 14.5}, "touched down gently"),
        ({"bank_deg": -15.5}, "hit the ground"),
        ({"bank_deg": 14.5, "sink": 3.1}, "hit the ground"),
        ({"sideways_kt": -59.0}, "touched down gently"),
        ({"sideways_kt": 61.0}, "hit the ground"),
        ({"altitude": 50.0, "bank_deg": -119.0}, ""),
        ({"altitude": 50.0, "bank_deg": 121.0}, "bank beyond 120 deg"),
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
