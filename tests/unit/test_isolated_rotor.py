"""The isolated rotor: momentum theory, energy, symmetry, where it ends, and what the command says."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rtsim.analysis.isolated_rotor import IsolatedRotor, RotorCondition
from rtsim.cli.main import run
from rtsim.units import deg

ROTOR = IsolatedRotor.load()
HOVER = RotorCondition(tip_mach=0.69)


def test_hover_power_is_above_the_ideal_and_falls_to_profile_power_alone():
    points = ROTOR.polar(HOVER)
    thrust = np.array([p.thrust_coefficient for p in points])
    power = np.array([p.power_coefficient for p in points])
    ideal = np.maximum(thrust, 0.0) ** 1.5 / np.sqrt(2.0)
    assert np.all(power > ideal)
    resting = ROTOR.at_thrust(0.0, HOVER, points)
    assert resting.figure_of_merit == pytest.approx(0.0, abs=1e-9)
    # Mean profile drag coefficient: C_P = sigma cd / 8.
    assert 0.008 < 8.0 * resting.power_coefficient / ROTOR.solidity < 0.03


def test_hover_needs_no_cyclic_and_forward_flight_does():
    hover = ROTOR.at_thrust(0.008, HOVER)
    forward = ROTOR.at_thrust(0.008, RotorCondition(tip_mach=0.69, advance_ratio=0.15))
    assert abs(hover.cyclic) < 1e-9
    assert abs(hover.lateral_flapping) < 1e-9
    assert forward.cyclic < -deg(1.0)  # forward cyclic against blow-back
    assert forward.power_coefficient < hover.power_coefficient  # less induced power


def test_shaft_aft_takes_power_from_the_flow():
    """Between shaft angles the power changes by the work of the thrust on the axial flow (less some profile power)."""
    found = {
        a: ROTOR.at_thrust(0.007, RotorCondition(tip_mach=0.65, advance_ratio=0.17, shaft_angle=deg(a)))
        for a in (-5.0, 5.0)
    }
    work = 2.0 * 0.17 * np.sin(deg(5.0)) * 0.007
    assert found[-5.0].power_coefficient - found[5.0].power_coefficient == pytest.approx(work, rel=0.3)


def test_propeller_converts_power_to_thrust():
    """Axial flight: power between ideal mu C_T and 1.5 times that."""
    point = ROTOR.at_thrust(0.004, RotorCondition(tip_mach=0.57, advance_ratio=0.45, shaft_angle=-deg(90.0)))
    assert 1.0 < point.power_coefficient / (0.45 * 0.004) < 1.5


@pytest.mark.parametrize("advance_ratio", [0.0, 0.1, 0.2])
def test_thrust_ends_at_stall_and_not_before(advance_ratio):
    condition = RotorCondition(tip_mach=0.66, advance_ratio=advance_ratio)
    points = ROTOR.polar(condition)
    largest = max(p.thrust_coefficient for p in points)
    assert ROTOR.at_thrust(0.999 * largest, condition, points) is not None
    assert ROTOR.at_thrust(1.001 * largest, condition, points) is None
    assert points[-1].thrust_coefficient < largest


def test_found_point_stands_on_its_polar():
    points = ROTOR.polar(HOVER)
    point = ROTOR.at_thrust(points[60].thrust_coefficient, HOVER, points)
    assert point.collective == pytest.approx(points[60].collective, abs=1e-9)
    assert point.power_coefficient == pytest.approx(points[60].power_coefficient, rel=1e-9)


def test_command_answers(capsys):
    words = ["rotor", "--thrust-coefficient", "0.0075", "--tip-mach", "0.65", "--advance-ratio", "0.17", "--json"]
    assert run([*words, "--shaft-deg", "-5"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["converged"] is True
    assert answer["figure_of_merit"] is None
    expected = ROTOR.at_thrust(0.0075, RotorCondition(tip_mach=0.65, advance_ratio=0.17, shaft_angle=deg(-5.0)))
    assert answer["power_coefficient"] == pytest.approx(expected.power_coefficient, rel=1e-9)
    assert answer["torque_coefficient_over_solidity"] == pytest.approx(expected.power_coefficient / ROTOR.solidity)
    assert run(["rotor", "--thrust-coefficient", "0.0075", "--tip-mach", "0.65"]) == 0
    assert "figure of merit" in capsys.readouterr().out


def test_stall_delay_raises_the_largest_thrust():
    largest = {
        law: max(p.thrust_coefficient for p in IsolatedRotor.load({"rotor.stall_delay": law}).polar(HOVER))
        for law in ("none", "du_selig", "corrigan_schillings")
    }
    assert largest["none"] < largest["du_selig"] < largest["corrigan_schillings"]
    assert max(p.thrust_coefficient for p in ROTOR.polar(HOVER)) == largest["corrigan_schillings"]


def test_command_says_where_there_is_no_solution(capsys):
    assert run(["rotor", "--thrust-coefficient", "0.04", "--tip-mach", "0.65", "--json"]) == 2
    told = capsys.readouterr()
    answer = json.loads(told.out)
    assert answer["converged"] is False
    assert answer["power_coefficient"] is None
    assert "below stall" in told.err
    assert run(["rotor", "--thrust-coefficient", "0.01", "--tip-mach", "1.4"]) == 2
    assert "0.1 to 0.9" in capsys.readouterr().err
