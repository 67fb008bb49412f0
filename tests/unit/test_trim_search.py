"""The trim search: cold starts, the unstalled branch, honest failure, speed."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import OUTPUT, STATE, STATES
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import GRAVITY, POUND, deg, kt, rpm, to_deg

AIRCRAFT = Xv15.load()
KNOT_PER_SECOND = kt(1.0)


def condition(airspeed, nacelle, **more):
    return Condition(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), **more)


def assert_equilibrium(where, point):
    """The rates are the wanted ones, in the model at that condition, by its own derivative."""
    assert point.converged, f"{where}: {point.unclosed} left {point.residual:.1e}"
    assert point.unclosed == ""
    rates = AIRCRAFT.at(where).derivative(point.x, point.u, where.nacelle_angle)
    pitch = point.x[STATE.pitch]
    rates[STATE.u] -= where.acceleration * np.cos(pitch)
    rates[STATE.w] -= where.acceleration * np.sin(pitch)
    np.testing.assert_allclose(rates[:3], 0.0, atol=1e-8)
    np.testing.assert_allclose(rates[3:], 0.0, atol=1e-6)
    assert abs(point.u[0]) <= 1.0
    assert point.x[STATE.u] * np.cos(pitch) + point.x[STATE.w] * np.sin(pitch) == pytest.approx(
        where.airspeed, abs=1e-9
    )


SENSIBLE = [
    *((v, 90.0, {}) for v in (-20.0, -5.0, 0.0, 3.0, 20.0, 60.0, 100.0)),
    *((v, 75.0, {}) for v in (-10.0, 0.0, 40.0, 90.0, 140.0)),
    *((v, 60.0, {"flap": deg(20.0)}) for v in (58.0, 80.0, 120.0, 160.0)),
    *((v, 60.0, {"flap": 0.0}) for v in (70.0, 110.0, 150.0)),
    *((v, 45.0, {}) for v in (80.0, 100.0, 150.0, 170.0)),
    *((v, 30.0, {"flap": deg(20.0)}) for v in (95.0, 130.0, 170.0)),
    *((v, 30.0, {"flap": deg(75.0)}) for v in (90.0, 100.0)),
    *((v, 15.0, {}) for v in (98.0, 140.0, 170.0)),
    *((v, 0.0, {"flap": 0.0, "rotor_speed": rpm(517.0)}) for v in (110.0, 150.0, 200.0, 260.0)),
    *((v, 0.0, {"flap": 0.0, "rotor_speed": rpm(458.0)}) for v in (120.0, 180.0, 250.0)),
    *((v, 0.0, {}) for v in (100.0, 150.0, 170.0, 175.0, 185.0, 240.0)),
    *((0.0, 90.0, {"mass": m * POUND}) for m in (9000.0, 11000.0, 15000.0)),
    *((v, 0.0, {"flap": 0.0, "mass": 15000.0 * POUND, "pressure_altitude": 6000.0}) for v in (190.0, 250.0)),
    *((v, 90.0, {"pressure_altitude": 2000.0, "rotor_speed": rpm(600.0)}) for v in (0.0, 40.0, 80.0)),
    (150.0, 30.0, {"pressure_altitude": 3000.0, "mass": 11000.0 * POUND}),
]


@pytest.mark.parametrize(("airspeed", "nacelle", "more"), SENSIBLE)
def test_cold_start_converges(airspeed, nacelle, more):
    where = condition(airspeed, nacelle, **more)
    assert_equilibrium(where, AIRCRAFT.trim(where))


@pytest.mark.parametrize("acceleration", [-3.0, 3.0])
@pytest.mark.parametrize(
    ("airspeed", "nacelle"), [(0.0, 90.0), (30.0, 82.0), (60.0, 75.0), (100.0, 60.0), (130.0, 45.0), (150.0, 10.0)]
)
def test_accelerated_cold_start(airspeed, nacelle, acceleration):
    """Level acceleration and deceleration of 3 kn/s, the layers of the database."""
    where = condition(airspeed, nacelle, acceleration=acceleration * KNOT_PER_SECOND)
    point = AIRCRAFT.trim(where)
    assert_equilibrium(where, point)
    assert point.y[OUTPUT.airspeed_rate] == pytest.approx(where.acceleration, abs=1e-7)


@pytest.mark.parametrize(("nacelle", "flap", "lowest"), [(0.0, 40.0, 99.0), (30.0, 40.0, 91.0), (30.0, 20.0, 93.0)])
def test_cold_start_near_stall_lies_on_the_branch_from_the_fast_side(nacelle, flap, lowest):
    """Down to the fold the cold trim is the one reached by 1 kn steps from 130 kn; below it, none is claimed."""
    point = None
    for airspeed in np.arange(130.0, lowest - 0.5, -1.0):
        point = AIRCRAFT.trim(condition(float(airspeed), nacelle, flap=deg(flap)), guess=point)
        assert point.converged
    cold = AIRCRAFT.trim(condition(lowest, nacelle, flap=deg(flap)))
    assert cold.converged
    assert to_deg(cold.y[OUTPUT.wing_angle_of_attack]) > 11.0
    np.testing.assert_allclose(cold.x, point.x, atol=1e-7)
    for below in (84.0, 75.0, 60.0):
        stalled = AIRCRAFT.trim(condition(below, nacelle, flap=deg(flap)))
        assert not stalled.converged
        assert stalled.unclosed in {variable.name for variable in STATES}


def test_a_trim_beyond_the_stick_stop_is_no_trim():
    """At nacelle 30 and 84 kn the equations close with the wing stalled and the stick past its stop."""
    start = AIRCRAFT.trim(condition(90.0, 30.0, flap=deg(40.0)))
    past = start
    for airspeed in np.arange(89.0, 79.0, -1.0):
        past = AIRCRAFT.trim(condition(float(airspeed), 30.0, flap=deg(40.0)), guess=past)
    assert past.residual < 1e-9
    assert abs(past.u[0]) > 1.0
    assert not past.converged
    assert past.unclosed == "elevator"


def test_failure_names_the_residual():
    point = AIRCRAFT.trim(condition(160.0, 90.0))
    assert not point.converged
    assert point.unclosed in {"u", "w", "q"}
    assert point.residual > 1e-9


def test_a_guess_is_followed_not_searched():
    """With a guess the solver stays on the caller's branch and reproduces the cold trim from a neighbour."""
    neighbour = AIRCRAFT.trim(condition(62.0, 80.0))
    followed = AIRCRAFT.trim(condition(60.0, 80.0), guess=neighbour)
    cold = AIRCRAFT.trim(condition(60.0, 80.0))
    np.testing.assert_allclose(followed.x, cold.x, atol=1e-9)


def test_mass_and_height_move_the_trim_the_right_way():
    """More weight: more thrust and power in hover. More height: more collective and power."""
    light, heavy = (AIRCRAFT.trim(condition(0.0, 90.0, mass=m * POUND)) for m in (11000.0, 14000.0))
    assert heavy.y[OUTPUT.thrust] / light.y[OUTPUT.thrust] == pytest.approx(14.0 / 11.0, rel=0.01)
    assert heavy.y[OUTPUT.power] > 1.3 * light.y[OUTPUT.power]
    high = AIRCRAFT.trim(condition(0.0, 90.0, pressure_altitude=1500.0, mass=11000.0 * POUND))
    assert high.y[OUTPUT.power] > light.y[OUTPUT.power]
    assert high.x[STATE.collective_75] > light.x[STATE.collective_75]
    assert high.y[OUTPUT.load_factor] == pytest.approx(np.cos(high.x[STATE.pitch]), rel=1e-9)


def test_trims_are_fast():
    """Well below 0.1 s of CPU time each, cold, the hard ones (60 kn at nacelle 60, 12-16 deg of wing) included."""
    conditions = [condition(v, n, flap=deg(f)) for v, n, f in ((0, 90, 40), (60, 60, 20), (100, 30, 20), (150, 0, 0))]
    for where in conditions:
        AIRCRAFT.trim(where)
    start = time.process_time()
    for _ in range(3):
        for where in conditions:
            AIRCRAFT.trim(where)
    assert (time.process_time() - start) / 12.0 < 0.1


LOW_KT = ([0.0, 30.0, 60.0, 75.0, 90.0], [110.0, 103.0, 70.0, 0.0, -20.0])
HIGH_KT = ([0.0, 30.0, 60.0, 75.0, 90.0], [240.0, 170.0, 155.0, 135.0, 95.0])


@settings(max_examples=40)
@given(
    nacelle=st.floats(0.0, 90.0),
    share=st.floats(0.0, 1.0),
    acceleration=st.floats(-2.0, 2.0),
    weight=st.floats(10000.0, 13000.0),
)
def test_residuals_vanish_anywhere_inside(nacelle, share, acceleration, weight):
    """Any point well inside the corridor trims, at any weight, accelerating or not, and there the rates are zero."""
    low, high = np.interp(nacelle, *LOW_KT), np.interp(nacelle, *HIGH_KT)
    where = condition(
        low + share * (high - low), nacelle, acceleration=acceleration * KNOT_PER_SECOND, mass=weight * POUND
    )
    point = AIRCRAFT.trim(where)
    assert_equilibrium(where, point)
    assert point.y[OUTPUT.power] > 0.0
    assert abs(point.y[OUTPUT.load_factor] - 1.0) < 0.2
    assert abs(point.x[STATE.pitch]) < deg(35.0)
    assert point.y[OUTPUT.thrust] < weight * POUND * GRAVITY
