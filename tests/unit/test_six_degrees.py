"""Motion out of the plane of symmetry: exact mirror symmetry, exact zeros, signs, conservation, published figures."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rtsim.aircraft.motion_kernels import advanced, down_of, euler_of, quaternion_of, quaternion_rate
from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, INPUTS, LATERAL_STATES, OUTPUT, STATE, STATES, whole
from rtsim.aircraft.xv15.data_reader import read_lateral_data
from rtsim.aircraft.xv15.model import Xv15
from rtsim.errors import InputError
from rtsim.units import deg, kt, rpm, to_deg

AIRCRAFT = Xv15.load()
LATERAL = slice(len(STATES), len(STATES) + len(LATERAL_STATES))
SCALE = np.array([10.0, 0.5, 0.5, 0.6, 3.0, 0.02, 0.3, 0.1, 0.5, 0.1, 0.5, 0.01, 0.02, 0.02, 0.03, 0.03, 0.3, 0.3])


def mirrored(x, u):
    x, u = x.copy(), u.copy()
    x[LATERAL] *= -1.0
    x[STATE.east] *= -1.0
    u[len(INPUTS) :] *= -1.0
    return x, u


def random_state(generator):
    x, u = np.zeros(len(ALL_STATES)), np.zeros(len(ALL_INPUTS))
    x[: len(STATES)] = 0.05 * generator.normal(size=len(STATES))
    x[STATE.u], x[STATE.w] = generator.uniform(-12.0, 110.0), generator.uniform(-15.0, 15.0)
    x[STATE.inflow_0], x[STATE.collective_75] = 0.04, generator.uniform(0.0, 0.6)
    x[LATERAL] = SCALE * generator.uniform(-1.0, 1.0, len(LATERAL_STATES))
    u[INPUT.stick], u[INPUT.lever] = generator.uniform(-1.0, 1.0), 0.5
    u[len(INPUTS) :] = generator.uniform(-1.0, 1.0, len(ALL_INPUTS) - len(INPUTS))
    return x, u, deg(generator.choice([90.0, 75.0, 60.0, 45.0, 30.0, 15.0, 0.0]))


@pytest.mark.parametrize("changes", [None, {"lateral.mast_tilt_deg": 1.0}, {"lateral.rotation": -1.0}])
def test_a_mirrored_state_has_the_mirrored_derivative_to_the_last_bit(changes):
    """200 random states: the left half is the right one called with mirrored arguments."""
    aircraft, generator = Xv15.load(changes), np.random.default_rng(12)
    for _ in range(200):
        x, u, nacelle = random_state(generator)
        here, there = aircraft.derivative(x, u, nacelle), aircraft.derivative(*mirrored(x, u), nacelle)
        assert np.array_equal(here, mirrored(there, u)[0])
        outputs, mirror = aircraft.outputs(x, u, nacelle), aircraft.outputs(*mirrored(x, u), nacelle)
        assert np.array_equal(outputs[: OUTPUT.flapping + 1], mirror[: OUTPUT.flapping + 1])
        assert np.array_equal(outputs[OUTPUT.thrust_difference :], -mirror[OUTPUT.thrust_difference :])


def test_symmetric_flow_leaves_every_lateral_rate_exactly_zero():
    """Reckoned side by side, not only skipped: the smallest number there is makes the left half count."""
    generator = np.random.default_rng(7)
    for _ in range(50):
        x, u, nacelle = random_state(generator)
        x[LATERAL], u[len(INPUTS) :] = 0.0, 0.0
        skipped = AIRCRAFT.derivative(x, u, nacelle)
        assert not skipped[LATERAL].any()
        x[STATE.rudder] = 5e-324
        reckoned = AIRCRAFT.derivative(x, u, nacelle)
        assert np.array_equal(reckoned[: len(STATES)], skipped[: len(STATES)])
        assert np.abs(reckoned[LATERAL]).max() < 1e-300


@pytest.mark.parametrize(("airspeed", "nacelle"), [(0.0, 90.0), (60.0, 75.0), (120.0, 30.0), (170.0, 0.0)])
def test_signs_of_controls_and_sideslip(airspeed, nacelle):
    """Right stick rolls right, right pedal turns right; a sideward velocity is resisted."""
    condition = Condition(airspeed=kt(airspeed), nacelle_angle=deg(nacelle))
    model = AIRCRAFT.linearize_lateral(condition, AIRCRAFT.trim(condition))
    slow = [0, 1, 2, 3, 14, 15, 16, 17]
    fast = list(range(5, 14))
    settled = model.A[np.ix_(slow, slow)] - model.A[np.ix_(slow, fast)] @ np.linalg.solve(
        model.A[np.ix_(fast, fast)], model.A[np.ix_(fast, slow)]
    )
    gearing = -np.linalg.solve(model.A[np.ix_(slow[4:], slow[4:])], model.B[np.ix_(slow[4:], [0, 1])])
    stick, pedal = (settled[:3, 4:] @ gearing).T
    assert stick[1] > 0.5
    assert pedal[2] > 0.1
    assert settled[0, 0] < 0.0  # Y_v
    assert settled[1, 0] < 0.0  # L_v: the wind from the right rolls left
    assert settled[1, 1] < -0.3  # L_p


def test_decoupling_is_exact():
    """Cross blocks of the whole Jacobian vanish at a symmetric trim: each is odd in what it is taken with."""
    condition = Condition(airspeed=kt(60.0), nacelle_angle=deg(75.0))
    trim = AIRCRAFT.trim(condition)
    x, u = whole(trim.x, ALL_STATES), whole(trim.u, ALL_INPUTS)
    for place in range(len(ALL_STATES) - 2):
        shift = np.zeros(x.size)
        shift[place] = 1e-4
        slope = (
            AIRCRAFT.derivative(x + shift, u, deg(75.0)) - AIRCRAFT.derivative(x - shift, u, deg(75.0))
        ) / 2e-4  # fmt: skip
        symmetric = place < len(STATES)
        other = slope[LATERAL] if symmetric else slope[: len(STATES)]
        assert np.abs(other).max() == 0.0


def test_the_switches_each_change_what_they_say():
    """One data switch each for fin area, K_betaR, interference, mast tilt and sense of rotation."""

    def lateral(changes, airspeed, nacelle):
        aircraft = Xv15.load(changes)
        condition = Condition(airspeed=kt(airspeed), nacelle_angle=deg(nacelle))
        return aircraft.linearize_lateral(condition, aircraft.trim(condition)).A

    weathercock = 2, 0
    base = lateral(None, 170.0, 0.0)
    assert lateral({"lateral.fin_area_each_ft2": 20.25}, 170.0, 0.0)[weathercock] < base[weathercock]
    slow = lateral(None, 40.0, 90.0)
    assert lateral({"lateral.rotor_sidewash": False}, 40.0, 90.0)[weathercock] > slow[weathercock] + 0.01
    assert abs(lateral({"lateral.rotation": -1.0}, 170.0, 0.0)[2, 1] - base[2, 1]) > 0.05  # N_p changes its sign
    still = Xv15.load().trim(Condition(airspeed=0.0, nacelle_angle=deg(90.0)))
    tilted = Xv15.load({"lateral.mast_tilt_deg": 1.0}).trim(Condition(airspeed=0.0, nacelle_angle=deg(90.0)))
    assert to_deg(tilted.x[STATE.pitch] - still.x[STATE.pitch]) == pytest.approx(-0.16, abs=0.04)
    side = Condition(airspeed=0.0, nacelle_angle=deg(90.0), lateral_airspeed=kt(25.0))
    without = Xv15.load({"lateral.sideward_interference": False}).trim(side).u[INPUT.lateral_stick]
    assert Xv15.load().trim(side).u[INPUT.lateral_stick] > without + 0.05


def test_a_free_body_keeps_its_angular_momentum():
    """The body's equations alone, without air and jets: Euler's, by scipy's cross products."""
    mass, nacelle = AIRCRAFT.tables.lateral.mass, deg(45.0)
    xx, zz, xz = (law[0] + law[1] * nacelle for law in (mass.roll, mass.yaw, mass.product))
    own = AIRCRAFT.tables.mass
    yy = own.pitch_inertia_airplane + own.pitch_inertia_slope * nacelle
    inertia = np.array([[xx, 0.0, -xz], [0.0, yy, 0.0], [-xz, 0.0, zz]])
    still = Xv15.load({"drag.jet_thrust": False}).tables
    empty = still._replace(configuration=still.configuration._replace(density=1e-12))
    x = np.zeros(len(ALL_STATES))
    x[[STATE.p, STATE.q, STATE.r]] = rates = np.array([0.4, 0.3, -0.5])
    x[STATE.coning] = AIRCRAFT.tables.rotor.precone
    found = Xv15(empty).derivative(x, np.zeros(len(ALL_INPUTS)), nacelle)[[STATE.p, STATE.q, STATE.r]]
    assert found == pytest.approx(np.linalg.solve(inertia, -np.cross(rates, inertia @ rates)), rel=1e-3, abs=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_against_scipy(seed):
    """Attitude, gravity and rates against scipy's rotations, heading counted over whole turns."""
    generator = np.random.default_rng(seed)
    bank, pitch, heading = generator.uniform([-3.0, -1.5, -9.0], [3.0, 1.5, 9.0])
    rotation = Rotation.from_euler("ZYX", [heading, pitch, bank])
    e = quaternion_of(bank, pitch, heading)
    assert np.array(down_of(e)) == pytest.approx(rotation.inv().apply([0.0, 0.0, 1.0]), abs=1e-14)
    assert euler_of(e, heading) == pytest.approx((bank, pitch, heading), abs=1e-12)
    rates, dt = generator.normal(size=3), 1e-6
    turned = rotation * Rotation.from_rotvec(rates * dt)
    after = euler_of(advanced(e, quaternion_rate(e, *rates), dt), heading)
    assert np.unwrap([heading, turned.as_euler("ZYX")[0]])[1] == pytest.approx(
        math.remainder(after[2] - heading, 2.0 * math.pi) + heading, abs=1e-10
    )
    assert after[0] == pytest.approx(turned.as_euler("ZYX")[2], abs=1e-10)


@pytest.mark.parametrize(
    ("condition", "bank", "pedal"),
    [
        # A prototype by other hands, with the inflow gradient from hover on; ours fades it in below 30 kn.
        ({"airspeed": kt(60.0), "nacelle_angle": deg(90.0), "sideslip": deg(10.0)}, 2.8, -0.27),
        ({"airspeed": kt(80.0), "nacelle_angle": deg(90.0), "sideslip": deg(10.0)}, 4.2, -0.39),
        ({"airspeed": kt(60.0), "nacelle_angle": deg(75.0), "sideslip": deg(10.0)}, 2.3, -0.26),
        ({"airspeed": kt(120.0), "nacelle_angle": deg(30.0), "sideslip": deg(5.0)}, 2.9, -0.52),
        ({"airspeed": 0.0, "nacelle_angle": deg(90.0), "lateral_airspeed": kt(25.0)}, 3.9, -0.54),
    ],
)
def test_trims_in_sideslip_against_another_model(condition, bank, pedal):
    """Steady sideslip and sideward flight: bank within 0.4 deg, pedals within 8 % of their travel."""
    right = AIRCRAFT.trim(Condition(**condition))
    name = "sideslip" if "sideslip" in condition else "lateral_airspeed"
    left = AIRCRAFT.trim(Condition(**condition | {name: -condition[name]}))
    assert right.converged
    assert to_deg(right.x[STATE.bank]) == pytest.approx(bank, abs=0.4)
    assert right.u[INPUT.pedal] == pytest.approx(pedal, abs=0.08)
    assert left.x[LATERAL] == pytest.approx(-right.x[LATERAL], abs=1e-9)
    assert (
        np.abs(AIRCRAFT.at(Condition(**condition)).derivative(right.x, right.u, condition["nacelle_angle"])[:34]).max()
        < 1e-6
    )


@pytest.mark.parametrize(("airspeed", "nacelle", "bank"), [(40.0, 90.0, 30.0), (60.0, 75.0, 45.0), (170.0, 0.0, 45.0)])
def test_coordinated_turns_close(airspeed, nacelle, bank):
    """Load factor 1 / cos(bank) within the tilt of the lift, turn rate g tan(bank) / V, next to no sideward force."""
    point = AIRCRAFT.trim(Condition(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), bank=deg(bank)))
    assert point.converged
    rate = math.sqrt(point.x[STATE.p] ** 2 + point.x[STATE.q] ** 2 + point.x[STATE.r] ** 2)
    assert rate == pytest.approx(9.80665 * math.tan(deg(bank)) / kt(airspeed), rel=0.06)
    assert point.y[OUTPUT.load_factor] == pytest.approx(1.0 / math.cos(deg(bank)), rel=0.03)
    assert abs(point.y[OUTPUT.side_force]) < 0.06
    assert point.x[STATE.v] == pytest.approx(0.0, abs=1e-12)


def test_where_a_branch_ends_is_told():
    """Sideslip in airplane mode ends at the pedals; a turn standing still does not exist."""
    ended = AIRCRAFT.trim(Condition(airspeed=kt(170.0), nacelle_angle=0.0, sideslip=deg(15.0)))
    assert not ended.converged
    assert ended.unclosed
    assert not AIRCRAFT.trim(Condition(airspeed=0.0, nacelle_angle=deg(90.0), bank=deg(10.0))).converged
    with pytest.raises(InputError, match="more than one"):
        Condition(airspeed=0.0, nacelle_angle=0.0, bank=0.1, sideslip=0.1)


def test_control_power_in_hover():
    """NASA TM X-62407 fig 8.3.1: rad/s^2 per inch, 1975 inertia, 565 rpm; bands chosen before: 20 % roll, 15 % yaw."""
    printed = read_lateral_data()["validation"]["control_power"]
    inertia = read_lateral_data()["mass"]
    aircraft = Xv15.load(
        {
            "mass.Ixx_heli_slugft2": inertia["Ixx_1975_heli_airplane_slugft2"][0],
            "mass.Izz_heli_slugft2": inertia["Izz_1975_heli_airplane_slugft2"][0],
        }
    )
    condition = Condition(airspeed=0.0, nacelle_angle=deg(90.0), rotor_speed=rpm(565.0))
    model = aircraft.linearize_lateral(condition, aircraft.trim(condition))
    act, fast = [14, 15, 16, 17], list(range(5, 14))
    rigid = [1, 2]
    effect = model.A[np.ix_(rigid, act)] - model.A[np.ix_(rigid, fast)] @ np.linalg.solve(
        model.A[np.ix_(fast, fast)], model.A[np.ix_(fast, act)]
    )
    gearing = -np.linalg.solve(model.A[np.ix_(act, act)], model.B[np.ix_(act, [0, 1])])
    power = effect @ gearing
    assert power[0, 0] / 4.8 == pytest.approx(printed["roll_nacelle90"][0], rel=0.2)
    assert power[1, 1] / 2.5 == pytest.approx(printed["yaw_nacelle90"][0], rel=0.15)
