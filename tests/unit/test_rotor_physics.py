"""The rotor's physics: signs by finite difference, symmetries, power balance, momentum theory, refinement."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import STATE
from rtsim.aircraft.xv15 import rotor_kernels as kernels
from rtsim.aircraft.xv15.data_reader import read_data
from rtsim.aircraft.xv15.model import Xv15
from rtsim.aircraft.xv15.rotor_reader import read_rotor
from rtsim.units import GRAVITY, deg, kt

AIRCRAFT = Xv15.load()
ROTOR, AIR = AIRCRAFT.tables.rotor, AIRCRAFT.tables.configuration
TIP = AIR.rotor_speed * ROTOR.radius
STILL = (0.05, 0.0, 0.0, 0.0, 0.0, 0.0)
INFLOW = (0.05, 0.0, 0.0)


def twin():
    """The numpy twin of tests/property, loaded by path (test directories are no packages)."""
    path = Path(__file__).parents[1] / "property" / "test_aircraft_twin.py"
    spec = importlib.util.spec_from_file_location("aircraft_twin", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["aircraft_twin"] = module
    spec.loader.exec_module(module)
    return module


def whole(hub):
    """The hub's motion with nothing sideways."""
    return (*hub, *(0.0,) * (6 - len(hub)))


def loads(hub=(0.0, 0.0, 0.0), flapping=STILL, inflow=INFLOW, pitch=(0.2, 0.0), rotor=ROTOR, air=AIR):
    out = np.zeros(kernels.LOAD_COUNT)
    kernels.rotor_loads(rotor, air, whole(hub), flapping, inflow, pitch, out)
    return out


def equilibrium(hub, pitch, rotor=ROTOR, air=AIR):
    """Steady flapping and inflow of the rotor alone: loads, (b0, b1c, b1s), inflow."""

    def residual(z):
        flapping = (z[0], 0.0, z[1], 0.0, z[2], 0.0)
        found = loads(hub, flapping, tuple(z[3:]), pitch, rotor, air)
        accelerations = kernels.flapping_accelerations(rotor, air.rotor_speed, (hub[2], 0.0, 0.0, 0.0), flapping, found)
        return [*(np.array(accelerations) / 4e3), *kernels.inflow_rates(rotor, air, whole(hub), tuple(z[3:]), found)]

    z, _, found, message = fsolve(residual, [0.05, 0.0, 0.0, 0.05, 0.0, 0.0], full_output=True, xtol=1e-13)
    assert found == 1, message
    return loads(hub, (z[0], 0.0, z[1], 0.0, z[2], 0.0), tuple(z[3:]), pitch, rotor, air), z[:3], z[3:]


def test_collective_raises_thrust_and_climb_and_inflow_lower_it():
    assert loads(pitch=(0.21, 0.0))[0] > loads()[0]
    assert loads(hub=(0.0, 2.0, 0.0))[0] < loads()[0]
    assert loads(inflow=(0.06, 0.0, 0.0))[0] < loads()[0]


def test_forward_cyclic_tilts_the_disc_forward():
    """Negative cyclic_1s (forward stick) gives positive flap_1c: aft blade up, disc forward, force forward."""
    forward, flap, _ = equilibrium((0.0, 0.0, 0.0), (0.2, -deg(2.0)))
    assert flap[1] > deg(1.0)
    assert forward[kernels.FORWARD_FORCE] > 0.0


def test_forward_speed_tilts_the_disc_aft_and_towards_the_retreating_side():
    """Advancing blade (azimuth 90, starboard for this rotor) lifts more and flaps up 90 deg later, over the nose."""
    _, flap, _ = equilibrium((kt(60.0), 0.0, 0.0), (0.15, 0.0))
    assert flap[1] < 0.0


def test_flap_up_increases_pitch():
    """Delta-3 of -15 deg: +0.268 of pitch per flap, the positive coupling of TM X-62407."""
    assert ROTOR.pitch_flap == pytest.approx(np.tan(deg(15.0)), abs=1e-6)
    up = loads(flapping=(0.08, 0.0, 0.0, 0.0, 0.0, 0.0))[0]
    assert up > loads()[0]


def test_mast_rotation_leaves_the_disc_behind():
    """A steady nose-up rate tilts the disc forward relative to the mast by 16 p / (gamma om C).

    C = 1 / (1 + a sigma / (16 lambda)) is the lift deficiency of the harmonic inflow in hover (Johnson 1980, ch. 10).
    """
    rate = 0.1
    _, flap, _ = equilibrium((0.0, 0.0, rate), (0.2, 0.0))
    _, rest, inflow = equilibrium((0.0, 0.0, 0.0), (0.2, 0.0))
    lag = flap[1] - rest[1]
    deficiency = 1.0 / (1.0 + 5.7 * 0.089 / (16.0 * inflow[0]))
    assert lag == pytest.approx(16.0 * rate / (3.83 * AIR.rotor_speed * deficiency), rel=0.2)
    found = loads(flapping=STILL, hub=(0.0, 0.0, rate))
    resting = loads(flapping=STILL)
    # Nose up: the aft blade moves down and meets more angle of attack.
    assert found[kernels.COSINE_MOMENT] > resting[kernels.COSINE_MOMENT]


def test_flapping_equation_keeps_a_free_gyroscope_in_space():
    """No air, no spring: a disc left behind by a pitching mast stays fixed in space (b1c = pitch angle, b1s = 0)."""
    vacuum = ROTOR._replace(hub_spring=0.0)
    no_loads = np.zeros(kernels.LOAD_COUNT)
    dt, om = 1e-4, AIR.rotor_speed
    state = np.zeros(4)  # b1c, b1c', b1s, b1s'

    def rate(values, time):
        mast = (0.3 * (1.0 - np.cos(2.0 * time)), 0.6 * np.sin(2.0 * time), 0.0, 0.0)
        _, c, s = kernels.flapping_accelerations(vacuum, om, mast, (0.0, 0.0, *values), no_loads)
        return np.array([values[1], c, values[3], s])

    for k in range(5000):
        t = k * dt
        k1 = rate(state, t)
        k2 = rate(state + 0.5 * dt * k1, t + 0.5 * dt)
        k3 = rate(state + 0.5 * dt * k2, t + 0.5 * dt)
        k4 = rate(state + dt * k3, t + dt)
        state += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    angle = 0.3 * (0.5 - np.sin(1.0) / 2.0)
    assert state[0] == pytest.approx(angle, abs=1e-6)
    assert state[2] == pytest.approx(0.0, abs=1e-6)


def test_reversing_the_in_plane_wind_turns_everything_half_round():
    """Fore-aft symmetry: with vf reversed thrust and torque stay, in-plane force and flapping change sign."""
    ahead, flap, inflow = equilibrium((20.0, 3.0, 0.0), (0.18, 0.0))
    back, flap_back, inflow_back = equilibrium((-20.0, 3.0, 0.0), (0.18, 0.0))
    np.testing.assert_allclose(back[[0, 2, 3]], ahead[[0, 2, 3]], rtol=1e-9)
    assert back[1] == pytest.approx(-ahead[1], rel=1e-8)
    np.testing.assert_allclose(flap_back, flap * np.array([1.0, -1.0, -1.0]), atol=1e-10)
    np.testing.assert_allclose(inflow_back, inflow * np.array([1.0, -1.0, -1.0]), atol=1e-10)


@pytest.mark.parametrize(
    ("hub", "pitch"),
    [((0.0, 0.0, 0.0), (0.2, 0.0)), ((30.0, 2.0, 0.0), (0.17, -0.02)), ((2.0, 85.0, 0.0), (0.55, 0.0))],
)
def test_power_balance(hub, pitch):
    """Shaft power = thrust and in-plane force times hub speed + induced + profile power, in flapping equilibrium.

    Exact in this model up to the work of the (zero-mean) flapping moments; the two sides come from different sums.
    """
    reference = twin()
    found, flap, inflow = equilibrium(hub, pitch)
    _, disc = reference.rotor_twin(ROTOR, AIR, whole(hub), (flap[0], 0.0, flap[1], 0.0, flap[2], 0.0), inflow, pitch)
    shaft = found[kernels.TORQUE] * AIR.rotor_speed
    propulsive = found[kernels.THRUST] * hub[1] + found[kernels.FORWARD_FORCE] * hub[0]
    assert disc.profile_power > 0.0
    assert shaft == pytest.approx(propulsive + disc.induced_power + disc.profile_power + disc.flap_power, rel=1e-9)
    assert abs(disc.flap_power) < 1e-6 * shaft


@pytest.mark.parametrize("climb", [0.0, 5.0, 20.0, 90.0])
def test_axial_momentum_theory(climb):
    """Uniform inflow obeys T = 2 rho A v (V + v), v being the mean inflow less its 5 % surcharge."""
    collective = 0.2 + np.arctan2(climb, 0.75 * TIP)
    found, _, inflow = equilibrium((0.0, climb, 0.0), (collective, 0.0))
    v = inflow[0] * TIP / ROTOR.induced_factor
    disc = np.pi * ROTOR.radius**2
    assert found[kernels.THRUST] == pytest.approx(2.0 * AIR.density * disc * v * (climb + v), rel=1e-8)


def test_fast_forward_flight_tends_to_the_wing_formula():
    """At high advance ratio the induced velocity falls to T / (2 rho A V), times surcharge and side-by-side factor."""
    found, _, inflow = equilibrium((60.0, 0.0, 0.0), (0.12, 0.0))
    expected = found[kernels.THRUST] / (2.0 * AIR.density * np.pi * ROTOR.radius**2 * 60.0)
    expected *= ROTOR.induced_factor * (1.0 - 0.085)
    assert inflow[0] * TIP == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("hub", "pitch"), [((40.0, -3.0, 0.0), (0.16, -0.03)), ((3.0, 80.0, 0.0), (0.52, 0.0))])
def test_twelve_azimuths_are_enough(hub, pitch):
    data, choices = read_data()
    choices["rotor"]["azimuth_stations"] = 24
    coarse, _, _ = equilibrium(hub, pitch)
    fine, _, _ = equilibrium(hub, pitch, rotor=read_rotor(data, choices))
    np.testing.assert_allclose(coarse[:3], fine[:3], rtol=3e-3, atol=20.0)


def test_radial_stations_are_enough():
    """Every second twist station instead of all changes thrust and torque by less than 1 %."""
    data, choices = read_data()
    coarse_data = {**data, "rotor": dict(data["rotor"])}
    for key in ("twist_rR", "twist_deg"):
        coarse_data["rotor"][key] = data["rotor"][key][::2]
    fine, _, _ = equilibrium((40.0, -3.0, 0.0), (0.16, -0.03))
    coarse, _, _ = equilibrium((40.0, -3.0, 0.0), (0.16, -0.03), rotor=read_rotor(coarse_data, choices))
    np.testing.assert_allclose(coarse[[0, 2]], fine[[0, 2]], rtol=1e-2)


def test_angle_function_is_the_arctangent():
    values = [0.0, -0.0, 1e-300, 1e-9, 0.3, 0.41421356237309503, 0.42, 1.0, 2.5, 1e3]
    values += [-v for v in values]
    for y in values:
        for x in values:
            if x == 0.0 and y == 0.0:
                continue
            found = kernels._angle(y, x)
            expected = np.arctan2(y, x)
            # On the negative axis the sign of a zero is not followed: +pi and -pi are one angle.
            if abs(abs(expected) - np.pi) < 1e-15:
                found, expected = abs(found), abs(expected)
            assert found == pytest.approx(expected, rel=5e-16, abs=1e-300), (y, x)


def test_section_tables_go_once_round_the_circle():
    """Lift and drag at -180 and +180 deg agree, so a wrapped angle meets no step; drag is positive everywhere."""
    section = ROTOR.section
    np.testing.assert_allclose(section[:, :3], section[:, -3:], atol=1e-12)
    assert np.all(np.isfinite(section))
    assert section[..., 1].min() >= 0.005  # the smallest that is printed


def test_reversed_rising_flow_stays_in_the_tables():
    """Autorotation at high advance ratio: the section angle passes 180 deg inboard, and thrust stays ordinary."""
    found = loads(hub=(120.0, -60.0, 0.0), inflow=(0.0, 0.0, 0.0), pitch=(0.3, 0.0))
    assert np.all(np.abs(found[[0, 1]]) < 40.0 * AIR.mass * GRAVITY)
    nearby = loads(hub=(120.0, -60.01, 0.0), inflow=(0.0, 0.0, 0.0), pitch=(0.3, 0.0))
    assert np.max(np.abs(found - nearby)) < 1e3


def test_gimbal_spring_moment_tilts_the_aircraft_with_the_disc():
    """A forward-tilted disc pitches the aircraft nose down through the hub spring alone."""
    condition = Condition(airspeed=0.0, nacelle_angle=deg(90.0))
    point = AIRCRAFT.trim(condition)
    x = point.x.copy()
    x[STATE.flap_1c] += 0.01
    stiff = AIRCRAFT.tables._replace(rotor=ROTOR._replace(hub_spring=2.0 * ROTOR.hub_spring))
    soft_rate = AIRCRAFT.derivative(x, point.u, deg(90.0))[STATE.q]
    stiff_rate = Xv15(stiff).derivative(x, point.u, deg(90.0))[STATE.q]
    assert stiff_rate < soft_rate < AIRCRAFT.derivative(point.x, point.u, deg(90.0))[STATE.q] + 1e-9
