"""Flaps and rotor drive as compiled kernels: exact rest, rates, energy, captures, limits; data and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.aircraft.variables import FLAP_INPUTS, INPUT, INPUTS
from rtsim.systems import drive_kernels as drive
from rtsim.systems import flap_kernels as flap
from rtsim.systems.settings import load_drive_tables, load_flap_tables
from rtsim.units import HORSEPOWER, deg, rpm

FLAPS, DRIVE = load_flap_tables(), load_drive_tables()
DT = 0.004
FULL = float(DRIVE.power[-1])


def flaps_following():
    return np.array([0.0, 1.0, flap.NO_SETTING])


def governed(deviation=0.0):
    state = np.zeros(drive.DRIVE_STATE_SIZE)
    state[drive.GOVERNED], state[drive.DEVIATION] = 1.0, deviation
    return state


def inputs_of(state, schedule):
    u = np.zeros(len(INPUTS))
    flap.flap_inputs(FLAPS, state, schedule, u)
    return np.array([u[getattr(INPUT, name)] for name in FLAP_INPUTS])


def test_the_drive_is_the_published_one():
    """6 blades of 102.5 slug ft^2; 589 rpm; 2 x 1802 shp at 0.93; idle end of the throttle gives nothing."""
    assert DRIVE.inertia == pytest.approx(6 * 102.5 * 1.3558179, rel=1e-3)
    assert DRIVE.governed_speed == pytest.approx(rpm(589.0))
    assert pytest.approx(2 * 1802 * 0.93 * HORSEPOWER) == FULL
    assert DRIVE.power[0] == 0.0
    assert np.all(np.diff(DRIVE.power) > 0.0)
    assert list(np.degrees(FLAPS.nodes).round(9)) == [0.0, 20.0, 40.0, 75.0]


@given(schedule=st.floats(0.0, deg(40.0)))
def test_flaps_that_follow_deviate_by_exactly_nothing(schedule):
    state = flaps_following()
    for _ in range(3):
        assert inputs_of(state, schedule).tobytes() == np.zeros(3).tobytes()
        flap.flap_advance(FLAPS, state, True, schedule, DT)
    assert flap.flap_now(state, schedule) == schedule


@given(present=st.floats(0.0, deg(75.0)), schedule=st.floats(0.0, deg(40.0)))
def test_the_three_inputs_are_the_whole_deviation_each_in_its_interval(present, schedule):
    state = np.array([present, 0.0, present])
    parts = inputs_of(state, schedule)
    assert parts.sum() == pytest.approx(present - schedule, abs=1e-12)
    assert np.all(np.abs(parts) <= np.diff(FLAPS.nodes) + 1e-12)
    assert np.all(parts >= 0.0) or np.all(parts <= 0.0)


def test_flaps_stay_where_they_are_when_the_schedule_is_left():
    state = flaps_following()
    flap.flap_advance(FLAPS, state, False, deg(33.0), DT)
    flap.flap_advance(FLAPS, state, False, deg(10.0), DT)
    assert flap.flap_now(state, deg(10.0)) == deg(33.0)
    # A setting of before the schedule was followed is forgotten: left again, they stay where they are then.
    state[flap.FLAP_SETTING] = deg(60.0)
    flap.flap_advance(FLAPS, state, True, deg(33.0), DT)
    flap.flap_advance(FLAPS, state, False, deg(33.0), DT)
    assert flap.flap_now(state, deg(10.0)) == deg(33.0)


@pytest.mark.parametrize("setting", [0.0, 20.0, 75.0])
def test_flaps_travel_at_their_rate_and_come_back_to_the_schedule(setting):
    state, schedule = flaps_following(), deg(40.0)
    flap.flap_advance(FLAPS, state, False, schedule, DT)
    state[flap.FLAP_SETTING] = deg(setting)
    positions = [flap.flap_now(state, schedule)]
    for _ in range(round(abs(setting - 40.0) / np.degrees(FLAPS.rate) / DT) + 2):
        flap.flap_advance(FLAPS, state, False, schedule, DT)
        positions.append(flap.flap_now(state, schedule))
    assert np.max(np.abs(np.diff(positions))) <= FLAPS.rate * DT * (1.0 + 1e-12)
    assert positions[-1] == deg(setting)
    for _ in range(len(positions) + 1):
        if state[flap.FLAP_FOLLOWS] != 0.0:
            break
        before = flap.flap_now(state, schedule)
        flap.flap_advance(FLAPS, state, True, schedule, DT)
        assert abs(flap.flap_now(state, schedule) - before) <= FLAPS.rate * DT * (1.0 + 1e-12)
    assert inputs_of(state, schedule).tobytes() == np.zeros(3).tobytes()


@given(torque=st.floats(-5e3, 4e4), lever=st.floats(0.0, 1.0))
def test_a_governed_rotor_never_moves(torque, lever):
    state = governed()
    for _ in range(5):
        drive.drive_advance(DRIVE, state, True, torque, lever, FULL, DT)
        assert state[drive.DEVIATION] == 0.0
    assert state[drive.ENGINE_POWER] == torque * DRIVE.governed_speed


@given(torque=st.floats(1e3, 2e4), lever=st.floats(0.05, 0.95))
def test_without_the_governor_nothing_happens_until_something_changes(torque, lever):
    """Switched off in a trim, the engines keep their power and the rotor its speed."""
    state = governed()
    drive.drive_advance(DRIVE, state, True, torque, lever, FULL, DT)
    for _ in range(500):
        drive.drive_advance(DRIVE, state, False, torque, lever, FULL, DT)
    assert abs(state[drive.DEVIATION]) < 1e-9
    assert state[drive.ENGINE_POWER] == pytest.approx(torque * DRIVE.governed_speed, rel=1e-9)


def test_power_not_taken_becomes_speed_of_the_rotors():
    """Energy: what the engines give less what the rotors take is the change of kinetic energy, to first order in dt."""
    errors = []
    for dt in (0.004, 0.002):
        state, given_energy = governed(), 0.0
        drive.drive_advance(DRIVE, state, True, 2e4, 0.5, FULL, dt)
        drive.drive_advance(DRIVE, state, False, 2e4, 0.5, FULL, dt)
        for _ in range(round(2.0 / dt)):
            speed = DRIVE.governed_speed + state[drive.DEVIATION]
            torque = 2e4 * (speed / DRIVE.governed_speed) ** 2
            drive.drive_advance(DRIVE, state, False, torque, 0.56, FULL, dt)
            given_energy += dt * (state[drive.ENGINE_POWER] - torque * speed)
        end = DRIVE.governed_speed + state[drive.DEVIATION]
        kinetic = 0.5 * DRIVE.inertia * (end**2 - DRIVE.governed_speed**2)
        assert kinetic > 1e4
        errors.append(abs(given_energy - kinetic) / kinetic)
    assert errors[0] < 2e-3
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.1)


def test_engine_power_follows_the_throttle_with_its_lag():
    state = governed()
    drive.drive_advance(DRIVE, state, True, 2e4, 0.5, FULL, DT)
    before = state[drive.ENGINE_POWER]
    step = drive.throttle_power(DRIVE, 0.6) - drive.throttle_power(DRIVE, 0.5)
    drive.drive_advance(DRIVE, state, False, 2e4, 0.5, FULL, DT)
    for _ in range(round(DRIVE.lag / DT)):
        drive.drive_advance(DRIVE, state, False, 2e4, 0.6, FULL, DT)
    assert (state[drive.ENGINE_POWER] - before) / step == pytest.approx(1.0 - np.exp(-1.0), abs=0.01)


def test_the_throttle_trim_adds_its_share_while_the_governor_is_off():
    state = governed()
    state[drive.THROTTLE_TRIM] = 0.1
    drive.drive_advance(DRIVE, state, True, 2e4, 0.5, FULL, DT)
    before = state[drive.ENGINE_POWER]
    assert before == 2e4 * DRIVE.governed_speed
    for _ in range(5000):
        drive.drive_advance(DRIVE, state, False, before / DRIVE.governed_speed, 0.5, FULL, DT)
        state[drive.DEVIATION] = 0.0
    assert state[drive.ENGINE_POWER] - before == pytest.approx(0.1 * FULL, rel=1e-6)


@given(
    deviation=st.floats(-12.0, 9.0),
    torque=st.floats(-1e4, 4e4),
    lever=st.floats(0.0, 1.0),
    available=st.floats(0.0, FULL),
    on=st.booleans(),
)
def test_engine_power_stays_between_none_and_what_there_is(deviation, torque, lever, available, on):
    """The governor alone goes beyond: as far as a rotor on its speed makes it go."""
    state = governed(deviation)
    state[drive.GOVERNED] = 0.0
    for _ in range(20):
        needed = torque * (DRIVE.governed_speed + state[drive.DEVIATION])
        drive.drive_advance(DRIVE, state, on, torque, lever, available, DT)
        low, high = (min(0.0, needed), max(needed, available)) if on else (0.0, available)
        if state[drive.DEVIATION] != 0.0:
            assert low <= state[drive.ENGINE_POWER] <= high


@given(deviation=st.floats(-12.0, 9.0), torque=st.floats(-6e4, 8e4), available=st.floats(0.0, FULL))
def test_a_governed_rotor_never_moves_away_from_its_speed(deviation, torque, available):
    """Windmilling, or short of power, it may not come back; but it does not run away, as it does not from rest."""
    state = governed(deviation)
    state[drive.GOVERNED] = 0.0
    for _ in range(20):
        before = abs(state[drive.DEVIATION])
        drive.drive_advance(DRIVE, state, True, torque, 0.5, available, DT)
        assert abs(state[drive.DEVIATION]) <= before


def test_an_engine_that_fails_gives_at_once_no_more_than_it_can():
    state = governed()
    drive.drive_advance(DRIVE, state, True, 2e4, 0.5, FULL, DT)
    drive.drive_advance(DRIVE, state, False, 2e4, 0.5, 3e5, DT)
    assert state[drive.ENGINE_POWER] == 3e5
    # Switched back on, it gives what the governor asks for, not what the rotors take.
    drive.drive_advance(DRIVE, state, True, 2e4, 0.5, FULL, DT)
    assert state[drive.DEVIATION] != 0.0
    assert drive.engine_power(state, 1.0) == state[drive.ENGINE_POWER]


def test_throttle_beyond_the_travel_of_the_lever_is_that_of_its_ends():
    assert drive.throttle_power(DRIVE, -0.2) == DRIVE.power[0]
    assert drive.throttle_power(DRIVE, 1.2) == DRIVE.power[-1]


@pytest.mark.parametrize("deviation", [-5.0, 4.0])
def test_the_governor_brings_the_rotor_back_exactly(deviation):
    state = governed(deviation)
    seconds = 0.0
    while state[drive.DEVIATION] != 0.0:
        before = state[drive.DEVIATION]
        drive.drive_advance(DRIVE, state, True, 1e4, 0.5, FULL, DT)
        assert abs(state[drive.DEVIATION]) < abs(before)
        seconds += DT
        assert seconds < 30.0 * DRIVE.recovery
