"""Ground and gear: ground effect over height, speed and tilt; springs that carry the weight; nothing away from it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.variables import INPUT, INPUTS, STATE, STATES
from rtsim.aircraft.xv15.model import Xv15
from rtsim.systems import ground_kernels as kernels
from rtsim.systems.ground import light_on_wheels, load_ground_tables
from rtsim.units import FOOT, GRAVITY, deg, kt

GROUND = load_ground_tables(xv15_profile(), Xv15.load().tables)


def contact(altitude, *, pitch=0.0, w=0.0, u=0.0, q=0.0):
    x, inputs = np.zeros(len(STATES)), np.zeros(len(INPUTS))
    x[STATE.altitude], x[STATE.pitch], x[STATE.w], x[STATE.u], x[STATE.q] = altitude, pitch, w, u, q
    share = kernels.ground_contact(GROUND, x, 0.0, inputs)
    return share, inputs[[INPUT.contact_x, INPUT.contact_z, INPUT.contact_pitch]]


def test_standing_carries_the_weight_without_turning():
    """At altitude 0 and the attitude of rest the springs carry the weight, and their moment vanishes."""
    nose, main = GROUND.wheels
    lean = ((main[1] - 0.5 * 13.5 / 39.37) - (nose[1] - 0.5 * 14.5 / 39.37)) / (nose[0] - main[0])
    share, accelerations = contact(0.0, pitch=-lean)
    assert share == pytest.approx(1.0, abs=0.02)
    assert accelerations[1] == pytest.approx(-GRAVITY, rel=0.02)
    assert abs(accelerations[2]) < 0.2


def test_above_the_ground_nothing_acts():
    for pitch in (-0.1, 0.0, 0.1):
        touch = light_on_wheels(GROUND, pitch)
        assert contact(touch + 1e-6, pitch=pitch)[0] == 0.0
        assert contact(touch - 1e-3, pitch=pitch)[0] > 0.0


def test_wheels_push_only_and_brakes_hold_against_the_motion():
    """A wheel that leaves fast does not pull; friction is against the sliding, at most its coefficient."""
    assert contact(0.0, w=-20.0)[0] == 0.0
    for u in (-5.0, 5.0):
        share, accelerations = contact(0.0, u=u)
        assert accelerations[0] == pytest.approx(-np.sign(u) * GROUND.friction * share * GRAVITY, rel=1e-6)


def test_damping_takes_energy_from_a_bounce():
    """Dropped at the sink rate the gear is made for, the aircraft is caught within the stroke and comes to rest."""
    x, inputs, dt = np.zeros(len(STATES)), np.zeros(len(INPUTS)), 0.004
    x[STATE.altitude], x[STATE.w] = light_on_wheels(GROUND, 0.0), 10.0 * FOOT
    heights = []
    for _ in range(2000):
        kernels.ground_contact(GROUND, x, 0.0, inputs)
        x[STATE.w] += dt * (GRAVITY + inputs[INPUT.contact_z])
        x[STATE.altitude] -= dt * x[STATE.w]
        heights.append(x[STATE.altitude])
    assert min(heights) > -0.35
    assert abs(heights[-1]) < 0.03
    assert abs(x[STATE.w]) < 0.01


def test_ground_effect_is_one_on_the_wheels_and_fades():
    """1 hovering on the wheels; less with height, speed and tilt; nothing above 4.6 R. Height law: Hayden 1976."""
    assert kernels.ground_effect(GROUND, 0.0, deg(90.0), 0.0) == pytest.approx(1.0, abs=1e-12)
    heights = [kernels.ground_effect(GROUND, h, deg(90.0), 0.0) for h in (0.0, 1.0, 3.0, 8.0, 14.0)]
    assert all(low > high for low, high in itertools.pairwise(heights))
    assert kernels.ground_effect(GROUND, 15.0, deg(90.0), 0.0) == 0.0
    assert kernels.ground_effect(GROUND, 0.0, deg(90.0), kt(26.0)) == pytest.approx(0.5)
    assert kernels.ground_effect(GROUND, 0.0, 0.0, 0.0) == 0.0


def test_contact_inputs_are_accelerations_of_the_nonlinear_aircraft():
    """The ground's force acts on the rigid body alone, as written: one column of ones each."""
    aircraft, u = Xv15.load(), np.zeros(len(INPUTS))
    x = np.zeros(len(STATES))
    x[STATE.inflow_0], x[STATE.collective_75] = 0.05, 0.2
    before = aircraft.derivative(x, u, deg(90.0))
    u[[INPUT.contact_x, INPUT.contact_z, INPUT.contact_pitch]] = 1.0, -2.0, 0.5
    change = aircraft.derivative(x, u, deg(90.0)) - before
    np.testing.assert_allclose(change[[STATE.u, STATE.w, STATE.q]], [1.0, -2.0, 0.5], atol=1e-12)
