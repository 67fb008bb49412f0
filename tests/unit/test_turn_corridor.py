"""The corridor in turns: sides that move with the load factor, and the laws' model of a turning aircraft."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import INPUT, STATE
from rtsim.aircraft.xv15.model import Xv15
from rtsim.command import SENSOR
from rtsim.corridor.boundaries import load_corridor
from rtsim.corridor.corridor_kernels import turn_excess
from rtsim.lpv.files.storage import load_database
from rtsim.protection import prediction_kernels as kernels
from rtsim.protection.boundary import load_boundary, turning_of
from rtsim.protection.limits import load_weights
from rtsim.protection.model import reduce_model
from rtsim.protection.tables import sample_boundary
from rtsim.units import GRAVITY, deg, kt

BANKS = st.floats(-1.2, 1.2)


@pytest.fixture(scope="module")
def turning():
    return turning_of(load_database())


def test_straight_flight_moves_no_side():
    """Wings level, whatever the load: the chart's margins to the last bit."""
    chart, moving = load_corridor("flight"), load_boundary("flight", load_database())
    for airspeed, angle in ((0.0, 90.0), (60.0, 75.0), (120.0, 30.0), (180.0, 0.0)):
        assert moving.margins(kt(airspeed), deg(angle), 0.0) == chart.margins(kt(airspeed), deg(angle))
    assert turn_excess(0.0) == 0.0


@given(BANKS, st.floats(0.0, 90.0), st.floats(-20.0, 230.0))
def test_turns_to_either_side_cost_the_same_and_never_widen_the_corridor(bank, angle, airspeed):
    corridor = load_boundary("flight", load_database())
    level, turn = (corridor.margins(kt(airspeed), deg(angle), one) for one in (0.0, bank))
    assert turn == corridor.margins(kt(airspeed), deg(angle), -bank)
    assert turn.low <= level.low
    assert turn.high <= level.high
    if min(level.low, level.high) > 0.0:
        # Which side a nacelle motion meets, and that it meets none, agrees with the speed margins.
        assert (turn.low < 0.0) == (turn.nacelle_forward < 0.0)


@pytest.mark.parametrize("bank", [20.0, 35.0, 45.0])
def test_the_stall_of_the_wing_rises_with_the_root_of_the_load_factor(turning, bank):
    """Airplane mode carries all weight on the wing: textbook stall speed in a turn, within the grid's 7 kn spacing."""
    stall = float(load_corridor("flight").low.at(0.0))
    load = 1.0 / math.cos(deg(bank))
    assert turning.low[0] * (load - 1.0) == pytest.approx(stall * (math.sqrt(load) - 1.0), abs=kt(4.0), rel=0.15)


def test_the_high_speed_side_moves_in_and_the_low_one_up(turning):
    assert np.all(turning.low >= 0.0)
    assert np.all(turning.high <= 0.0)
    middle = turning.nacelle < deg(66.0)
    assert np.all(np.diff(turning.low[middle]) <= 1e-9), "the more of the weight the rotors carry, the less"


@given(BANKS, st.floats(0.6, 90.0))
def test_the_laws_sampled_corridor_is_the_frames(bank, angle):
    corridor = load_boundary("flight", load_database())
    low, high = kernels.speed_range(sample_boundary(corridor), deg(angle), turn_excess(bank))
    margins = corridor.margins(0.0, deg(angle), bank)
    assert low == pytest.approx(-margins.low, abs=0.1)
    assert high == pytest.approx(margins.high, abs=0.1)


@pytest.mark.parametrize(("airspeed", "nacelle"), [(80.0, 75.0), (100.0, 60.0), (120.0, 30.0), (150.0, 0.0)])
@pytest.mark.parametrize("bank", [-30.0, 20.0, 40.0])
def test_a_steady_turn_of_the_nonlinear_aircraft_is_one_of_the_laws_model(airspeed, nacelle, bank):
    """Its own trim of a level turn, seen by sensors: the model finds it in equilibrium, at its stick, lever, torque.

    Bounds: a twentieth of the weight, and a third of what the model of level flight would miss.
    """
    trim = Xv15.load().trim(Condition(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), bank=deg(bank)))
    assert trim.converged
    sensors = np.zeros(SENSOR.size)
    sensors[SENSOR.airspeed] = kt(airspeed)
    for sensor, state in (("pitch", "pitch"), ("pitch_rate", "q"), ("yaw_rate", "r"), ("bank", "bank")):
        sensors[getattr(SENSOR, sensor)] = trim.x[getattr(STATE, state)]
    controls = (trim.u[INPUT.stick], trim.u[INPUT.lever])
    tables = reduce_model(load_database(), load_weights())
    z = kernels.turn_motion(sensors)
    found = []
    for turns in (True, False):
        cell = np.zeros(kernels.CELL.size)
        kernels.model_at(tables, kt(airspeed), deg(nacelle), cell)
        if turns:
            kernels.turn_model(cell, 1.0 + turn_excess(deg(bank)), 0.0)
        found.append(np.abs(kernels.accelerations(cell, z, controls, (0.0, 0.0))[:2]).max())
    assert found[0] < 0.05 * GRAVITY
    assert found[0] < 0.35 * found[1]
