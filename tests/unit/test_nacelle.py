"""The conversion actuator and the pilot's switch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from rtsim.errors import InputError
from rtsim.nacelle.nacelle_kernels import (
    nacelle_advance,
    nacelle_assigned_rate,
    nacelle_at,
    nacelle_path,
    new_actuator_state,
    on_downstop,
)
from rtsim.nacelle.switch import NacelleActuator, NacelleSwitch, load_nacelle_tables
from rtsim.units import deg, to_deg

DT = 0.004


def fly(switch, actuator, presses):
    """Fly (direction, seconds) pairs; give the command angles [deg] at the ends of the frames."""
    angles = []
    for direction, seconds in presses:
        for _ in range(round(seconds / DT)):
            rate = switch.step(direction, command_angle=actuator.command_angle, dt=DT)
            actuator.step(rate, DT)
            angles.append(to_deg(actuator.command_angle))
    return np.array(angles)


def test_actuator_is_the_exact_solution_of_the_filter():
    rates = deg(1.0) * np.repeat([-3.0, 0.0, -12.0, 0.0, 5.0, 12.0, 0.0], 500)
    actuator = NacelleActuator(deg(80.0))
    angle, rate = [], []
    for value in rates:
        actuator.step(value, DT)
        angle.append(actuator.angle)
        rate.append(actuator.rate)
    # lsim with linear interpolation of the input is exact for a piecewise linear command.
    time = DT * np.arange(rates.size + 1)
    command = deg(80.0) + np.concatenate([[0.0], np.cumsum(rates * DT)])
    system = signal.StateSpace([[0.0, 1.0], [-9.0, -6.0]], [[0.0], [9.0]], np.eye(2), np.zeros((2, 1)))
    _, states, _ = signal.lsim(system, command, time, X0=[deg(80.0), 0.0])
    assert np.array(angle) == pytest.approx(states[1:, 0], abs=1e-11)
    assert np.array(rate) == pytest.approx(states[1:, 1], abs=1e-10)


def test_motion_within_a_frame_satisfies_the_differential_equation():
    tables = load_nacelle_tables()
    state, rate = np.array([0.9, 0.95, -0.07]), deg(-4.0)
    out, ahead, behind = np.empty(3), np.empty(3), np.empty(3)
    step = 1e-5
    for elapsed in (0.001, 0.002, 0.0035):
        nacelle_at(tables, state, rate, elapsed, out)
        nacelle_at(tables, state, rate, elapsed + step, ahead)
        nacelle_at(tables, state, rate, elapsed - step, behind)
        command = state[0] + rate * elapsed
        assert out[2] == pytest.approx(9.0 * (command - out[0]) - 6.0 * out[1], rel=1e-12)
        assert (ahead[0] - behind[0]) / (2.0 * step) == pytest.approx(out[1], rel=1e-8)
        assert (ahead[1] - behind[1]) / (2.0 * step) == pytest.approx(out[2], rel=1e-8)


def test_path_begins_at_the_state_and_ends_where_the_frame_ends():
    tables = load_nacelle_tables()
    state, path = np.array([0.9, 0.95, -0.07]), np.empty((3, 3))
    nacelle_path(tables, state, deg(3.0), DT, path)
    assert path[0, :2] == pytest.approx(state[1:], abs=1e-15)
    nacelle_advance(tables, state, deg(3.0), DT)
    assert tuple(path[2, :2]) == tuple(state[1:])  # bit for bit: the plant's last stage and the log agree


def test_ramp_lags_by_two_over_the_frequency():
    actuator = NacelleActuator(deg(90.0))
    for _ in range(2500):
        actuator.step(deg(-3.0), DT)
    assert to_deg(actuator.angle - actuator.command_angle) == pytest.approx(3.0 * 2.0 / 3.0, abs=1e-6)
    assert to_deg(actuator.rate) == pytest.approx(-3.0, abs=1e-6)


def test_command_stops_at_the_end_of_the_travel_and_says_so():
    actuator = NacelleActuator(deg(0.01))
    acted = actuator.step(deg(-5.0), DT)
    assert to_deg(acted) == pytest.approx(-0.01 / DT)
    assert actuator.command_angle == pytest.approx(0.0, abs=1e-15)
    assert actuator.step(deg(-5.0), DT) == pytest.approx(0.0, abs=1e-12)


def test_aft_of_90_deg_only_if_asked():
    assert to_deg(load_nacelle_tables().aft_stop) == pytest.approx(90.0)
    assert to_deg(load_nacelle_tables(extended_aft_travel=True).aft_stop) == pytest.approx(95.0)
    with pytest.raises(InputError, match="0 to 90 deg"):
        NacelleActuator(deg(92.0))


def test_assigned_rate_is_limited_to_12_deg_s():
    tables = load_nacelle_tables()
    assert to_deg(nacelle_assigned_rate(tables, deg(20.0))) == pytest.approx(12.0)
    assert to_deg(nacelle_assigned_rate(tables, deg(-20.0))) == pytest.approx(-12.0)
    assert to_deg(nacelle_assigned_rate(tables, deg(-11.0))) == pytest.approx(-11.0)


def test_downstop_flag():
    tables = load_nacelle_tables()
    assert on_downstop(tables, deg(0.5))
    assert not on_downstop(tables, deg(0.51))


def test_switch_is_free_between_90_and_75():
    switch, actuator = NacelleSwitch(), NacelleActuator(deg(90.0))
    angles = fly(switch, actuator, [(-1, 2.0), (0, 1.0)])
    assert 75.0 < angles[-1] < 85.0
    assert angles[-1] == angles[-200]  # stays where it was let go
    back = fly(switch, actuator, [(1, 0.2), (0, 0.2)])
    assert back[-1] == pytest.approx(angles[-1] + 0.2 * 7.5)


def test_each_press_runs_to_the_next_detent_and_no_further():
    switch, actuator = NacelleSwitch(), NacelleActuator(deg(90.0))
    assert fly(switch, actuator, [(-1, 10.0)])[-1] == pytest.approx(75.0)  # held on: the detent stops it
    for expected in (50.0, 0.0):
        assert fly(switch, actuator, [(0, 0.1), (-1, 0.02), (0, 10.0)])[-1] == pytest.approx(
            expected
        )  # a tap is enough
    assert fly(switch, actuator, [(-1, 1.0)])[-1] == pytest.approx(0.0)
    for expected in (50.0, 75.0):
        assert fly(switch, actuator, [(0, 0.1), (1, 12.0)])[-1] == pytest.approx(expected)  # held on: still stops
    assert fly(switch, actuator, [(0, 0.1), (1, 1.0)])[-1] == pytest.approx(82.5)  # free again aft of 75
    assert fly(switch, actuator, [(1, 10.0)])[-1] == pytest.approx(90.0)


def test_switch_runs_at_constant_rate_and_slowly_near_the_stops():
    switch, actuator = NacelleSwitch(), NacelleActuator(deg(50.0))
    rates = -np.diff(fly(switch, actuator, [(-1, 10.0)]), prepend=50.0) / DT
    moving = rates[rates > 1e-6]
    assert np.unique(moving.round(6))[[-1]] == pytest.approx([7.5])
    assert np.count_nonzero(np.abs(moving - 7.5) < 1e-6) == pytest.approx(47.5 / 7.5 / DT, abs=2)
    assert np.count_nonzero(np.abs(moving - 1.96) < 1e-6) == pytest.approx(2.5 / 1.96 / DT, abs=8)
    aft = NacelleActuator(deg(90.0))
    start = np.diff(fly(NacelleSwitch(), aft, [(-1, 0.5)]), prepend=90.0) / DT
    assert start == pytest.approx(-2.73)


def test_a_press_the_other_way_turns_a_run_round():
    switch, actuator = NacelleSwitch(), NacelleActuator(deg(75.0))
    assert fly(switch, actuator, [(-1, 0.02), (0, 1.0)])[-1] == pytest.approx(75.0 - 1.02 * 7.5)
    assert switch.running
    assert fly(switch, actuator, [(1, 0.02), (0, 5.0)])[-1] == pytest.approx(75.0)
    assert not switch.running


def test_a_press_between_detents_runs_to_the_next_one():
    assert fly(NacelleSwitch(), NacelleActuator(deg(60.0)), [(-1, 0.02), (0, 5.0)])[-1] == pytest.approx(50.0)
    assert fly(NacelleSwitch(), NacelleActuator(deg(60.0)), [(1, 0.02), (0, 5.0)])[-1] == pytest.approx(75.0)


def test_whole_conversion_by_the_switch_takes_about_as_long_as_the_paper_says():
    # The paper: 12 s at constant rate; the slow zones at the stops add 2.5/1.96 + 2.5/2.73 - 5/7.5 s.
    switch, actuator = NacelleSwitch(), NacelleActuator(deg(90.0))
    frames = 0
    pressed = -1
    while to_deg(actuator.command_angle) > 1e-6:
        before = actuator.command_angle
        actuator.step(switch.step(pressed, command_angle=before, dt=DT), DT)
        # Let go and press again where a detent stops the run.
        stopped = abs(actuator.command_angle - before) < 1e-9
        pressed = 0 if stopped and pressed else -1
        frames += 1
        assert frames < 10_000
    assert frames * DT == pytest.approx(12.0 + 2.5 / 1.96 + 2.5 / 2.73 - 5.0 / 7.5, abs=0.1)


def test_state_at_rest_stays_bit_for_bit():
    tables, state = load_nacelle_tables(), new_actuator_state(deg(75.0))
    nacelle_advance(tables, state, 0.0, DT)
    assert state == pytest.approx([deg(75.0), deg(75.0), 0.0], abs=0.0)
