"""Ground and gear: ground effect over height, speed and tilt; springs that carry the weight; nothing away from it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, INPUTS, STATE, STATES
from rtsim.aircraft.xv15.model import Xv15
from rtsim.atmosphere.wind_kernels import level_motion
from rtsim.systems import ground_kernels as kernels
from rtsim.systems.ground import light_on_wheels, load_ground_tables
from rtsim.units import FOOT, GRAVITY, deg, kt

GROUND = load_ground_tables(xv15_profile(), Xv15.load().tables)


def touch_ground(altitude, **motion):
    """Share of the weight, and the inputs by which the ground acts; motion by the names of the states."""
    x, inputs = np.zeros(len(ALL_STATES)), np.zeros(len(ALL_INPUTS))
    x[STATE.altitude] = altitude
    for name, value in motion.items():
        x[getattr(STATE, name)] = value
    ahead, right, _ = level_motion(x)
    return kernels.ground_contact(GROUND, x, (ahead, right), inputs), inputs


def contact(altitude, **motion):
    share, inputs = touch_ground(altitude, **motion)
    return share, inputs[[INPUT.contact_x, INPUT.contact_z, INPUT.contact_pitch]]


def lateral_contact(altitude, **motion):
    return touch_ground(altitude, **motion)[1][[INPUT.contact_y, INPUT.contact_roll, INPUT.contact_yaw]]


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
    x, inputs, dt = np.zeros(len(ALL_STATES)), np.zeros(len(ALL_INPUTS)), 0.004
    x[STATE.altitude], x[STATE.w] = light_on_wheels(GROUND, 0.0), 10.0 * FOOT
    heights = []
    for _ in range(2000):
        kernels.ground_contact(GROUND, x, (0.0, 0.0), inputs)
        x[STATE.w] += dt * (GRAVITY + inputs[INPUT.contact_z])
        x[STATE.altitude] -= dt * x[STATE.w]
        heights.append(x[STATE.altitude])
    assert min(heights) > -0.35
    assert abs(heights[-1]) < 0.03
    assert abs(x[STATE.w]) < 0.01


def test_symmetric_contact_is_exactly_symmetric():
    for motion in ({}, {"pitch": 0.05, "u": 3.0, "w": 1.0, "q": -0.1}, {"pitch": -0.03, "u": -2.0}):
        assert lateral_contact(-0.02, **motion).tobytes() == np.zeros(3).tobytes()


def test_a_banked_aircraft_is_righted_and_stands_on_the_lower_wheel():
    """Right wing low: the right spring carries more and rolls it left; so with a roll rate to the right."""
    for bank in (0.03, -0.03):
        assert np.sign(lateral_contact(0.0, bank=bank)[1]) == -np.sign(bank)
        assert np.sign(lateral_contact(0.0, p=bank)[1]) == -np.sign(bank)
    on_one_wheel, _ = touch_ground(light_on_wheels(GROUND, 0.0) + 0.02, bank=0.1)
    assert 0.0 < on_one_wheel < 0.5
    assert kernels.touches(GROUND, _state(light_on_wheels(GROUND, 0.0) + 0.02, bank=0.1))
    assert not kernels.touches(GROUND, _state(light_on_wheels(GROUND, 0.0) + 0.02, bank=0.0))


def _state(altitude, *, bank):
    x = np.zeros(len(ALL_STATES))
    x[STATE.altitude], x[STATE.bank] = altitude, bank
    return x


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_wheels_hold_against_sliding_sideways_and_turning(side):
    """Friction is against the sliding, wherever it goes, and never more than its coefficient."""
    share, inputs = touch_ground(0.0, v=side * 4.0)
    assert inputs[INPUT.contact_y] == pytest.approx(-side * GROUND.friction * share * GRAVITY, rel=1e-6)
    assert abs(inputs[INPUT.contact_x]) < 1e-12
    share, inputs = touch_ground(0.0, v=side * 3.0, u=4.0)
    force = np.array([inputs[INPUT.contact_x], inputs[INPUT.contact_y]])
    assert force == pytest.approx(-GROUND.friction * share * GRAVITY * np.array([0.8, side * 0.6]), rel=1e-6)
    assert side * lateral_contact(0.0, r=side * 0.5)[2] < 0.0


def test_a_mirrored_contact_is_the_mirrored_one():
    motion = {"bank": 0.05, "v": 1.3, "p": 0.2, "r": -0.3}
    share, inputs = touch_ground(-0.03, u=2.0, w=0.4, q=0.1, pitch=0.02, **motion)
    other, mirrored = touch_ground(-0.03, u=2.0, w=0.4, q=0.1, pitch=0.02, **{k: -v for k, v in motion.items()})
    signs = np.ones(len(ALL_INPUTS))
    signs[[INPUT.contact_y, INPUT.contact_roll, INPUT.contact_yaw]] = -1.0
    assert other == pytest.approx(share, rel=1e-12)
    assert mirrored == pytest.approx(signs * inputs, rel=1e-12, abs=1e-12)


def test_rocking_from_wheel_to_wheel_dies_out():
    """Let go banked at rest, it comes to stand level: roll alone, with the acceleration that the ground gives."""
    x, inputs, dt = np.zeros(len(ALL_STATES)), np.zeros(len(ALL_INPUTS)), 0.004
    x[STATE.bank] = 0.06
    for _ in range(1500):
        kernels.ground_contact(GROUND, x, (0.0, 0.0), inputs)
        x[STATE.p] += dt * inputs[INPUT.contact_roll]
        x[STATE.bank] += dt * x[STATE.p]
    assert abs(x[STATE.bank]) < 2e-3
    assert abs(x[STATE.p]) < 2e-3


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
