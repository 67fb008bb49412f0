"""The held rotor speed: down on the downstop only, at its rate, back before the nacelles move; who may ask for what."""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.errors import InputError
from rtsim.lpv.files.storage import load_database
from rtsim.systems import drive_kernels as drive
from rtsim.systems.requests import held_offset, set_held_speed
from rtsim.systems.settings import load_drive_tables
from rtsim.units import deg, rpm, to_rpm

DATABASE = load_database()
LPV = load_drive_tables(rotor_speed=DATABASE.rotor_speed, nacelle=DATABASE.nacelle)
DT = 0.004


def governed():
    state = np.zeros(drive.DRIVE_STATE_SIZE)
    state[drive.GOVERNED] = 1.0
    return state


def advance(state, seconds, *, automatic=True, angle=0.0, leaving=False):
    speeds = []
    for _ in range(round(seconds / DT)):
        drive.held_advance(LPV, state, automatic, angle, leaving, DT)
        speeds.append(to_rpm(drive.rotor_speed_now(LPV, state)))
    return np.array(speeds)


def test_comes_down_to_airplane_speed_at_its_rate_and_back():
    """589 to 517 rpm (NASA), 10 rpm/s (ours): 7.2 s each way, never beyond either end."""
    state = governed()
    down = advance(state, 8.0)
    assert down[-1] == pytest.approx(517.0, abs=1e-9)
    assert np.diff(down).min() == pytest.approx(-10.0 * DT, rel=1e-6)
    assert abs(np.count_nonzero(np.diff(down)) * DT - 7.2) < 0.05
    up = advance(state, 8.0, leaving=True)
    assert up[-1] == pytest.approx(589.0, abs=1e-9)
    assert state[drive.HELD_OFFSET] == 0.0


def test_only_locked_governed_nacelles_let_it_down():
    for change in ({"angle": 1e-3}, {"leaving": True}):
        assert advance(governed(), 1.0, **change)[-1] == pytest.approx(589.0)
    loose = governed()
    loose[drive.GOVERNED] = 0.0
    assert advance(loose, 1.0)[-1] == pytest.approx(589.0)


def test_by_hand_it_goes_to_the_setting_and_stays_when_automatic_is_switched_off():
    state = governed()
    set_held_speed(LPV, state, rpm(550.0), 0.0)
    assert advance(state, 6.0, automatic=False)[-1] == pytest.approx(550.0, abs=1e-9)
    advance(state, 8.0)
    assert advance(state, 2.0, automatic=False)[-1] == pytest.approx(517.0, abs=1e-9)


def test_slowing_the_rotors_gives_their_energy_to_the_shaft():
    """The power counted over the change is the change of rotational energy (conservation)."""
    state, energy = governed(), 0.0
    for _ in range(round(8.0 / DT)):
        drive.held_advance(LPV, state, True, 0.0, False, DT)
        energy += state[drive.HELD_POWER] * DT
    end, start = drive.rotor_speed_now(LPV, state), LPV.governed_speed
    assert energy == pytest.approx(0.5 * LPV.inertia * (end**2 - start**2), rel=1e-3)


def test_place_on_the_nacelle_axis_is_that_of_the_row_with_this_speed():
    state = governed()
    for row in range(4):
        state[drive.HELD_OFFSET] = DATABASE.rotor_speed[row] - DATABASE.governed_speed
        assert drive.schedule_angle(LPV, state, 0.0) == pytest.approx(DATABASE.nacelle[row], abs=1e-12)
    state[drive.HELD_OFFSET] = 0.0
    assert drive.schedule_angle(LPV, state, deg(40.0)) == deg(40.0)


@pytest.mark.parametrize(
    ("speed", "nacelle", "words"),
    [(400.0, 0.0, "out of range"), (600.0, 0.0, "out of range"), (550.0, deg(5.0), "downstop"), (np.nan, 0.0, "range")],
)
def test_what_cannot_be_held_is_refused(speed, nacelle, words):
    with pytest.raises(InputError, match=words):
        held_offset(LPV, rpm(speed), nacelle)


def test_a_database_with_one_speed_has_no_other():
    single = load_drive_tables(rotor_speed=np.full(3, rpm(589.0)), nacelle=np.array([0.0, 0.5, 1.0]))
    assert single.slow_offset == 0.0
    with pytest.raises(InputError, match="no other"):
        held_offset(single, rpm(550.0), 0.0)
