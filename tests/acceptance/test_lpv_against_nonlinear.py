"""The LPV aircraft judged by the nonlinear model: the same pilot flies both over whole manoeuvres.

Source of the limits: the project's requirements (RMS over Table 1: 0.3 kn, 0.5 m, 0.4 deg, 0.15 deg of flapping). An
independent build of the same data reached 0.04 kn, 0.02 m, 0.04 deg, 0.02 deg. Measured here: docs/lpv.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from scenarios.files.loader import load_scenario

LIMITS = {"airspeed_kt": 0.3, "altitude_m": 0.5, "pitch_deg": 0.4, "flapping_deg": 0.15}


def fly(programme, plant):
    simulation = Simulation(FlightSetup(programme=programme).with_options(plant=plant))
    return simulation.run(round(programme.duration * 250))


def rms_errors(programme, plant="lpv"):
    truth, mine = fly(programme, "nonlinear"), fly(programme, plant)
    assert len(truth) == len(mine) == round(programme.duration * 250)
    errors = {}
    for name in LIMITS:
        column = getattr(COLUMN, name)
        errors[name] = float(np.sqrt(np.mean((mine[:, column] - truth[:, column]) ** 2)))
    return errors


def slowed(programme, factor):
    return Programme(programme.time * factor, programme.airspeed, programme.nacelle_angle, programme.altitude)


@pytest.mark.parametrize("name", ["typical_conversion", "typical_conversion_rate3", "conversion_8deg", "reconversion"])
def test_whole_manoeuvres(name):
    errors = rms_errors(load_scenario(name).programme)
    for signal, limit in LIMITS.items():
        assert errors[signal] <= limit, errors


@pytest.mark.parametrize("factor", [1.6, 2.4])
@pytest.mark.parametrize("name", ["typical_conversion", "reconversion"])
def test_accelerations_between_the_layers(name, factor):
    errors = rms_errors(slowed(load_scenario(name).programme, factor))
    for signal, limit in LIMITS.items():
        assert errors[signal] <= limit, errors


def test_angle_of_attack_as_third_variable_is_what_makes_it_so_close():
    """The paper's two-variable form misses the accelerated trims; if this fails, the layers have lost their use."""
    programme = load_scenario("typical_conversion").programme
    plain, layered = rms_errors(programme, "lpv-plain"), rms_errors(programme)
    for signal in LIMITS:
        assert plain[signal] > 3.0 * layered[signal], (plain, layered)


def test_cruise_with_a_change_of_rotor_speed():
    """589 to 517 rpm on the downstop, 220 kn, and back before reconversion. Limits: the issue's, set beforehand."""
    programme = load_scenario("cruise_rotor_speed").programme
    truth, mine = (
        Simulation(FlightSetup(programme=programme).with_options(plant=plant, automatic_rotor_speed=True)).run(
            round(programme.duration * 250)
        )
        for plant in ("nonlinear", "lpv")
    )
    assert truth[:, COLUMN.rotor_speed_rpm].min() == pytest.approx(517.0, abs=1e-6)
    np.testing.assert_allclose(mine[:, COLUMN.rotor_speed_rpm], truth[:, COLUMN.rotor_speed_rpm], atol=1e-6)
    for name, limit in {"airspeed_kt": 0.3, "altitude_m": 0.5, "pitch_deg": 0.3, "flapping_deg": 0.1}.items():
        column = getattr(COLUMN, name)
        assert np.sqrt(np.mean((mine[:, column] - truth[:, column]) ** 2)) <= limit, name


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_a_pilot_whose_power_is_limited_keeps_the_height(plant):
    """Table 1 under the law `full`, which limits the torque: 5 m of height (limit of the issue), speed gives way."""
    programme = load_scenario("typical_conversion").programme
    setup = FlightSetup(programme=programme).with_options(plant=plant, protection="full", corridor="flight")
    rows = Simulation(setup).run(round(programme.duration * 250))
    assert np.max(np.abs(rows[:, COLUMN.altitude_m] - 100.0)) < 5.0
    assert np.max(rows[:, COLUMN.mast_torque_inlb]) < 130_000.0
    assert np.min(rows[:, COLUMN.protection_lever]) < 0.0
