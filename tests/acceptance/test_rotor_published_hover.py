"""The isolated rotor in hover against the OARF test (NASA TM-86833 run 15, tabulated in NASA CR-2017-219486)."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from rtsim.aircraft.xv15 import rotor_kernels
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import FOOT, HORSEPOWER, POUND_FORCE, deg

DATA = tomllib.loads((Path(__file__).parents[1] / "data" / "xv15_validation.toml").read_text())
OARF = DATA["hover"]["oarf_run15"]
TABLES = Xv15.load().tables
TIP_SPEED = 770.0 * FOOT
"""Middle of the 768-772 ft/s of the test [m/s]."""


@cache
def hover(collective_deg):
    """Thrust and power coefficient of one rotor alone at zero cyclic, flapping and inflow in equilibrium."""
    rotor = TABLES.rotor
    air = TABLES.configuration._replace(rotor_speed=TIP_SPEED / rotor.radius)
    loads = np.zeros(rotor_kernels.LOAD_COUNT)

    def residual(z):
        flapping = (z[0], 0.0, z[1], 0.0, z[2], 0.0)
        hub, inflow = (0.0, 0.0, 0.0), (z[3], z[4], z[5])
        rotor_kernels.rotor_loads(rotor, air, hub, flapping, inflow, (deg(collective_deg), 0.0), loads)
        accelerations = rotor_kernels.flapping_accelerations(rotor, air.rotor_speed, (0.0, 0.0), flapping, loads)
        return [*(np.array(accelerations) / 4e3), *rotor_kernels.inflow_rates(rotor, air, hub, inflow, loads)]

    _, _, found, message = fsolve(residual, [0.05, 0.0, 0.0, 0.06, 0.0, 0.0], full_output=True)
    assert found == 1, message
    scale = air.density * np.pi * rotor.radius**2 * TIP_SPEED**2
    return loads[rotor_kernels.THRUST] / scale, loads[rotor_kernels.TORQUE] / scale / rotor.radius


def polar():
    """CT and CP from 1 deg of collective to the maximum of thrust."""
    points = np.array([hover(float(c)) for c in np.arange(1.0, 18.25, 0.5)])
    return points[:, 0], points[:, 1]


@pytest.mark.parametrize("i", range(1, 10))
def test_power_at_equal_thrust(i):
    """CP at the test's CT within 5 % from CT 0.0041 to 0.0139."""
    thrust, power = polar()
    found = np.interp(OARF["CT"][i], thrust, power)
    assert found == pytest.approx(OARF["CP"][i], rel=OARF["tol_cp_frac"])


def test_power_at_low_thrust_documented_mismatch():
    """Documented mismatch: 11 % too much power at CT 0.0017, a quarter of the hover thrust."""
    thrust, power = polar()
    assert np.interp(OARF["CT"][0], thrust, power) / OARF["CP"][0] == pytest.approx(1.11, abs=0.02)


def test_maximum_thrust_documented_mismatch():
    """Documented mismatch: the model's rotor stalls at CT 0.0147; the test still gains thrust at 0.0157 (6 % more)."""
    thrust, _ = polar()
    assert thrust.max() == pytest.approx(0.0147, abs=0.0002)
    assert thrust.max() < OARF["CT"][-1]


def test_peak_figure_of_merit():
    """FM peak 0.787 +- 0.02, at the CT of the table's own peak (0.0111) within 5 %.

    The separately printed 0.0105 is missed by 7 %, but the peak is flat: there FM is within 0.01 of its maximum.
    """
    thrust, power = polar()
    merit = thrust**1.5 / np.sqrt(2.0) / power
    assert merit.max() == pytest.approx(DATA["hover"]["fm_peak"], abs=DATA["hover"]["fm_tol"])
    measured_peak = OARF["CT"][int(np.argmax(OARF["FM"]))]
    assert thrust[np.argmax(merit)] == pytest.approx(measured_peak, rel=OARF["tol_ct_frac"])
    assert np.interp(DATA["hover"]["ct_at_fm_peak"], thrust, merit) > merit.max() - 0.01


def test_collective_expected_mismatch():
    """Expected mismatch (marked in the data): the test's collective scale lies 4-5 deg below the model's."""
    assert DATA["hover"]["collective_75R_expected_mismatch"]
    collectives = np.arange(1.0, 17.0, 0.5)
    thrust = np.array([hover(float(c))[0] for c in collectives])
    offset = [np.interp(OARF["CT"][i], thrust, collectives) - OARF["collective_75R_deg"][i] for i in range(2, 9)]
    assert all(3.5 <= value <= 5.5 for value in offset), offset


def test_engine_power_of_the_familiarization_document_at_its_own_thrust():
    """1898 shp of engine (0.65 x 2920) at 13000 lb with 7 % download, within 6 %. TM X-62407 sec. 5.1, fig 5.4.2.

    The aircraft needs more (its download is 12 % of thrust); this compares the rotors at the source's thrust.
    """
    scale = TABLES.configuration.density * np.pi * TABLES.rotor.radius**2 * TIP_SPEED**2
    coefficient = 0.5 * 13000.0 * POUND_FORCE / (1.0 - 0.07) / scale
    thrust, power = polar()
    shaft = 2.0 * np.interp(coefficient, thrust, power) * scale * TIP_SPEED
    assert shaft / 0.93 / HORSEPOWER == pytest.approx(
        DATA["hover"]["engine_shp"], rel=DATA["hover"]["engine_shp_tol_frac"]
    )
