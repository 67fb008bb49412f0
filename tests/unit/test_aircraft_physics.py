"""Signs, geometry, units, identities of the nonlinear aircraft, by finite difference or a second way to the number."""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.aircraft.atmosphere import standard_atmosphere
from rtsim.aircraft.points import Condition
from rtsim.aircraft.table_kernels import curve, surface
from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, INPUTS, OUTPUT, STATE, STATES, whole
from rtsim.aircraft.xv15 import airframe_kernels as airframe
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15 import tail_kernels
from rtsim.aircraft.xv15.data_reader import read_data
from rtsim.aircraft.xv15.model import Xv15
from rtsim.units import DEGREE, FOOT, GRAVITY, INCH, SLUG_FOOT_SQUARED, deg, kt, to_deg

AIRCRAFT = Xv15.load()
TABLES = AIRCRAFT.tables
DATA, CHOICES = read_data()


def trimmed(airspeed_kt, nacelle_deg, **more):
    condition = Condition(airspeed=kt(airspeed_kt), nacelle_angle=deg(nacelle_deg), **more)
    point = AIRCRAFT.trim(condition)
    assert point.converged, point.unclosed
    return condition, point


CONDITIONS = [(0.0, 90.0), (40.0, 90.0), (80.0, 75.0), (110.0, 60.0), (140.0, 30.0), (170.0, 0.0)]


@pytest.mark.parametrize(("airspeed", "nacelle"), CONDITIONS)
def test_signs_of_the_controls_and_of_damping(airspeed, nacelle):
    """Forward stick pitches nose down, lever adds force along the mast; the aircraft is damped in pitch and heave."""
    condition, point = trimmed(airspeed, nacelle)
    model = AIRCRAFT.linearize(condition, point)
    fast = [i for i in range(len(STATES)) if i not in (STATE.u, STATE.w, STATE.q, STATE.pitch, STATE.altitude)]
    a = model.A[np.ix_(fast, fast)]

    def settled(row, column):
        """Rate of a rigid-body state per input or state after rotor and actuators have settled."""
        if isinstance(column, tuple):
            return model.B[row, column[0]] - model.A[row, fast] @ np.linalg.solve(a, model.B[fast, column[0]])
        return model.A[row, column] - model.A[row, fast] @ np.linalg.solve(a, model.A[fast, column])

    assert settled(STATE.q, (INPUT.stick,)) < 0.0
    axial = settled(STATE.u, (INPUT.lever,)) * np.cos(deg(nacelle)) - settled(STATE.w, (INPUT.lever,)) * np.sin(
        deg(nacelle)
    )
    assert axial > 1.0
    assert settled(STATE.q, STATE.q) < 0.0
    assert settled(STATE.w, STATE.w) < 0.0
    assert settled(STATE.u, STATE.u) < 0.0


def test_more_speed_needs_more_forward_stick_in_helicopter_mode():
    """Stick position is stable against speed from 60 to 100 kn (GTRS: 5.29, 5.80, 6.94 in)."""
    sticks = [trimmed(v, 90.0)[1].u[0] for v in (60.0, 80.0, 100.0)]
    assert sticks[0] < sticks[1] < sticks[2]


def test_gusts_add_to_the_air_relative_velocity_only():
    """A gust changes the forces as the same change of u, w, q would, but neither kinematics nor Coriolis terms."""
    condition, point = trimmed(60.0, 90.0)
    x, u = point.x.copy(), point.u.copy()
    u[INPUT.gust_u], u[INPUT.gust_w], u[INPUT.gust_q] = 2.0, -1.5, 0.05
    moved = x.copy()
    moved[STATE.u] += 2.0
    moved[STATE.w] -= 1.5
    moved[STATE.q] += 0.05
    with_gust = AIRCRAFT.derivative(x, u, condition.nacelle_angle)
    as_motion = AIRCRAFT.derivative(moved, point.u, condition.nacelle_angle)
    coriolis = np.array([-moved[STATE.q] * moved[STATE.w], moved[STATE.q] * moved[STATE.u]])
    np.testing.assert_allclose(with_gust[[STATE.u, STATE.w]], (as_motion[[STATE.u, STATE.w]] - coriolis), atol=1e-12)
    assert with_gust[STATE.q] == pytest.approx(as_motion[STATE.q], abs=1e-12)
    assert with_gust[STATE.pitch] == 0.0


@pytest.mark.parametrize(("airspeed", "nacelle"), CONDITIONS)
def test_energy_rate_is_the_power_of_the_forces(airspeed, nacelle):
    """d/dt (m V^2 / 2 + I q^2 / 2 + m g h) equals the power of air and rotor forces, away from equilibrium."""
    condition, point = trimmed(airspeed, nacelle)
    x = point.x.copy()
    x[STATE.u] += 3.0
    x[STATE.w] += 2.0
    x[STATE.q], x[STATE.pitch] = 0.2, x[STATE.pitch] + 0.1
    xdot = AIRCRAFT.derivative(x, point.u, condition.nacelle_angle)
    total = sum(AIRCRAFT.component_loads(x, point.u, condition.nacelle_angle).values())
    mass = TABLES.configuration.mass
    inertia = TABLES.mass.pitch_inertia_airplane + TABLES.mass.pitch_inertia_slope * condition.nacelle_angle
    energy_rate = mass * (x[STATE.u] * xdot[STATE.u] + x[STATE.w] * xdot[STATE.w])
    energy_rate += inertia * x[STATE.q] * xdot[STATE.q] + mass * GRAVITY * xdot[STATE.altitude]
    power = total[0] * x[STATE.u] + total[1] * x[STATE.w] + total[2] * x[STATE.q]
    assert energy_rate == pytest.approx(power, rel=1e-10, abs=1e-6)


@pytest.mark.parametrize(("airspeed", "nacelle"), [(60.0, 90.0), (80.0, 75.0), (150.0, 20.0)])
def test_a_climb_is_a_level_acceleration_seen_askew(airspeed, nacelle):
    """Steady climb at gamma with mass m / cos gamma: same air loads as level acceleration g tan gamma at mass m."""
    gamma = 0.12
    condition, point = trimmed(airspeed, nacelle, acceleration=GRAVITY * np.tan(gamma))
    assert point.xdot[STATE.u] == pytest.approx(condition.acceleration * np.cos(point.x[STATE.pitch]), abs=1e-8)
    climbing = point.x.copy()
    climbing[STATE.pitch] += gamma
    heavy = TABLES._replace(configuration=TABLES.configuration._replace(mass=TABLES.configuration.mass / np.cos(gamma)))
    xdot = Xv15(heavy).derivative(climbing, point.u, condition.nacelle_angle)
    np.testing.assert_allclose(xdot[[STATE.u, STATE.w, STATE.q]], 0.0, atol=1e-8)
    assert xdot[STATE.altitude] == pytest.approx(condition.airspeed * np.sin(gamma), rel=1e-12)


def test_outputs_are_what_they_say():
    """Power, load factor, airspeed rate and flapping recomputed from their definitions."""
    condition, point = trimmed(70.0, 80.0)
    x, u, n = point.x.copy(), point.u.copy(), condition.nacelle_angle
    x[STATE.q], x[STATE.flap_1c] = 0.1, 0.03
    y, xdot = AIRCRAFT.outputs(x, u, n), AIRCRAFT.derivative(x, u, n)
    assert y[OUTPUT.power] == pytest.approx(2.0 * y[OUTPUT.torque] * TABLES.configuration.rotor_speed)
    assert y[OUTPUT.flapping] == pytest.approx(np.hypot(x[STATE.flap_1c], x[STATE.flap_1s]))
    force_z = sum(load[1] for load in AIRCRAFT.component_loads(x, u, n).values())
    assert y[OUTPUT.load_factor] == pytest.approx(-force_z / TABLES.configuration.mass / GRAVITY)
    step = 1e-6

    def airspeed(state):
        return state[STATE.u] * np.cos(state[STATE.pitch]) + state[STATE.w] * np.sin(state[STATE.pitch])

    numeric = (airspeed(x + step * xdot) - airspeed(x - step * xdot)) / (2.0 * step)
    assert y[OUTPUT.airspeed_rate] == pytest.approx(numeric, rel=1e-6)
    level = AIRCRAFT.outputs(point.x, point.u, n)
    assert level[OUTPUT.load_factor] == pytest.approx(np.cos(point.x[STATE.pitch]), rel=1e-9)


def test_centre_of_gravity_follows_the_printed_table():
    """Stationline and waterline at seven mast angles. Source: NASA CR-166536 shift law, table of xv15_inputs.toml."""
    table = DATA["cg"]
    for mast, station, water in zip(table["law_betam_deg"], table["law_SL_in"], table["law_WL_in"], strict=True):
        found = kernels.gravity_centre(TABLES.mass, deg(90.0 - mast))
        np.testing.assert_allclose(np.array(found) / INCH, [station, water], atol=2e-3)


def test_pitch_inertia_at_both_ends():
    """21360 slug ft^2 helicopter, 20348.4 airplane. Source: NASA CR-166536."""
    mass = TABLES.mass
    airplane = mass.pitch_inertia_airplane / SLUG_FOOT_SQUARED
    assert airplane == pytest.approx(20348.4, rel=1e-6)
    helicopter = (mass.pitch_inertia_airplane + mass.pitch_inertia_slope * deg(90.0)) / SLUG_FOOT_SQUARED
    assert helicopter == pytest.approx(21360.0, rel=1e-6)


def test_moment_arms_have_body_axis_signs():
    """The tail is aft (negative x) and above (negative z); 21.57 ft behind the helicopter centre of gravity."""
    centre = kernels.gravity_centre(TABLES.mass, deg(90.0))
    arm = airframe.moment_arm((TABLES.tail.position[0], TABLES.tail.position[1]), centre)
    assert arm[0] / FOOT == pytest.approx(-DATA["geometry"]["htail_arm_from_heli_cg_ft"], rel=1e-4)
    assert arm[1] < 0.0
    # An upward force on the tail pitches nose down, a drag above the centre of gravity nose up.
    assert airframe.wind_to_body(100.0, 0.0, 50.0, 0.0, arm, 0.0)[2] < 0.0
    assert airframe.wind_to_body(0.0, 100.0, 50.0, 0.0, arm, 0.0)[2] > 0.0


def test_nacelle_tables_are_turned_round_once():
    """Printed against mast angle (0 = helicopter), read at nacelle angle (90 = helicopter)."""
    controls = TABLES.controls
    half_travel = DATA["controls"]["stick_neutral_in"]
    for mast, per_inch in zip(DATA["controls"]["betam_deg"], DATA["controls"]["cyclic_deg_per_in"], strict=True):
        found = curve(controls.cyclic_per_stick, 0, deg(90.0 - mast))
        assert to_deg(found) == pytest.approx(per_inch * half_travel, abs=2e-3)
    for mast, area in zip(
        DATA["wing"]["interference"]["pylon_interf_betam_deg"],
        DATA["wing"]["interference"]["pylon_interf_D_ft2"],
        strict=True,
    ):
        assert curve(TABLES.body.pylon_area, 0, deg(90.0 - mast)) / FOOT**2 == pytest.approx(area, abs=2e-3)
    for mast, row in zip(DATA["wing"]["Cm_betam_deg"], DATA["wing"]["Cm_rows_betam_cols_flap"], strict=True):
        found = [curve(TABLES.wing.moment, k, deg(90.0 - mast)) for k in range(4)]
        np.testing.assert_allclose(found, row, atol=1e-4)


def test_wing_tables_at_their_own_nodes():
    """Airplane and helicopter rows, flap by flap, at printed angles of attack."""
    wing, source = TABLES.wing, DATA["wing"]
    for fraction, end in ((1.0, "b90"), (0.0, "b0")):
        for flap in (20.0, 40.0, 75.0):
            for k in (10, 16, 18, 20):
                alpha = source["flapped_alpha_deg"][k]
                lift, _ = airframe.wing_coefficients(wing, deg(alpha), fraction, deg(flap), 0.1)
                assert lift == pytest.approx(source[f"CL_F{flap:.0f}_{end}"][k], abs=0.02), (end, flap, alpha)
    lift, drag = airframe.wing_coefficients(wing, 0.0, 1.0, 0.0, 0.1)
    assert (lift, drag) == (pytest.approx(0.38, abs=1e-9), pytest.approx(0.0204, abs=1e-9))
    lift, drag = airframe.wing_coefficients(wing, 0.0, 0.0, 0.0, 0.1)
    assert (lift, drag) == (pytest.approx(0.3, abs=1e-9), pytest.approx(0.215, abs=1e-9))


def test_no_table_holds_a_gap():
    """Unprinted (nan) entries were filled, and nothing was extrapolated beyond what a wing or tail can do."""
    for table in (TABLES.wing.lift, TABLES.wing.drag, TABLES.tail.drag, TABLES.body.fuselage, TABLES.tail.downwash):
        assert np.all(np.isfinite(table.values))
        assert np.all(np.isfinite(table.slopes))
    for table in (TABLES.tail.lift, TABLES.tail.pressure_ratio, TABLES.tail.rotor_wake):
        assert np.all(np.isfinite(table.nodes))
    assert np.abs(TABLES.wing.lift.values).max() < 2.2
    assert TABLES.wing.drag.values.min() > 0.0
    assert TABLES.wing.drag.values.max() < 1.7
    assert np.abs(TABLES.tail.lift.nodes[..., 0]).max() < 1.8
    assert TABLES.tail.pressure_ratio.nodes[..., 0].min() >= 0.7
    assert TABLES.tail.pressure_ratio.nodes[..., 0].max() <= 2.45


SLIP = TABLES.lateral.sideslip


def test_rotor_wake_is_an_upwash_at_the_tail():
    """At 80 kn in helicopter mode the rotor wake lifts the tail: more of it, nose down (S2 tail loads confirm)."""
    air = TABLES.configuration
    arm = (-6.57, -0.54)
    flow, setting = (kt(80.0), kt(80.0) * np.tan(deg(-9.0)), 0.0), (deg(90.0), deg(40.0), 0.0)
    without = tail_kernels.tail_load(TABLES.tail, air, flow, setting, 0.0, arm, SLIP, 0.0)
    with_wake = tail_kernels.tail_load(TABLES.tail, air, flow, setting, 5.5, arm, SLIP, 0.0)
    assert with_wake[1] < without[1] - 100.0
    assert with_wake[2] < without[2]
    assert surface(TABLES.tail.rotor_wake, 0, deg(-8.0), kt(80.0)) == pytest.approx(-1.05, abs=1e-3)


def test_elevator_and_downwash_signs():
    """Trailing edge down lifts the tail; wing downwash lowers its lift."""
    air, arm = TABLES.configuration, (-6.57, -0.54)
    flow = (70.0, 3.0, 0.0)
    zero = tail_kernels.tail_load(TABLES.tail, air, flow, (0.0, 0.0, 0.0), 0.0, arm, SLIP, 0.0)
    down = tail_kernels.tail_load(TABLES.tail, air, flow, (0.0, 0.0, deg(5.0)), 0.0, arm, SLIP, 0.0)
    flapped = tail_kernels.tail_load(TABLES.tail, air, flow, (0.0, deg(40.0), 0.0), 0.0, arm, SLIP, 0.0)
    assert down[1] < zero[1] < flapped[1]
    rate = (70.0, 3.0, 0.1)
    assert tail_kernels.tail_load(TABLES.tail, air, rate, (0.0, 0.0, 0.0), 0.0, arm, SLIP, 0.0)[2] < zero[2]


def test_wing_interference_law():
    """alpha_WFS = alpha - 57.3 K X C_RF / max(0.15, mu)^2 in degrees, with the printed minus sign."""
    law = DATA["wing"]["interference"]
    mast = 30.0
    upwash = np.polynomial.polynomial.polyval(mast, law["X_RW_poly_in_betam_deg"])
    for mu in (0.05, 0.15, 0.3):
        expected = 4.0 - 57.3 * law["K_XRW"] * upwash * 0.02 / max(0.15, mu) ** 2
        found = airframe.wing_angle_of_attack(TABLES.wing, deg(4.0), deg(90.0 - mast), mu, 0.02)
        assert to_deg(found) == pytest.approx(expected, abs=1e-4)


def test_hover_download_pushes_down_and_vanishes_where_the_wing_leaves_the_wake():
    condition, point = trimmed(0.0, 90.0)
    wing = AIRCRAFT.component_loads(point.x, point.u, condition.nacelle_angle)["wing"]
    assert wing[1] > 0.08 * TABLES.configuration.mass * GRAVITY
    assert airframe.immersed_share(TABLES.wing, kt(46.0)) == 0.0
    assert airframe.immersed_share(TABLES.wing, 0.0) == 1.0
    assert curve(TABLES.wing.immersed_area, 0, deg(60.0)) == pytest.approx(0.0, abs=0.02)


def test_flow_from_behind_mirrors_the_wing_lift():
    """At 180 deg the flapped wing still lifts upwards, and lift is smooth through 90 deg."""
    wing, flap = TABLES.wing, deg(40.0)
    lift, _ = airframe.wing_coefficients(wing, np.pi, 0.0, flap, 0.0)
    z = airframe.wind_to_body(lift, 0.0, -10.0, 0.0, (0.0, 0.0), 0.0)[1]
    assert z < 0.0
    step = 1e-4
    below = airframe.wing_coefficients(wing, np.pi / 2.0 - step, 0.0, flap, 0.0)[0]
    above = airframe.wing_coefficients(wing, np.pi / 2.0 + step, 0.0, flap, 0.0)[0]
    assert above == pytest.approx(-below, abs=1e-9)


def test_nacelle_motion_moves_the_hub():
    """Turning the nacelles towards airplane carries the hub forward and down and tilts the disc aft of the mast."""
    condition, point = trimmed(60.0, 80.0)
    u = point.u.copy()
    u[INPUT.nacelle_rate] = -deg(3.0)
    rates = AIRCRAFT.derivative(point.x, u, condition.nacelle_angle) - point.xdot
    # The mast leaves the disc behind: pitching down leaves flap_1s' with +2 om p, flap_1c with more lift ahead.
    expected = 2.0 * TABLES.configuration.rotor_speed * deg(3.0)
    assert rates[STATE.flap_1s_rate] == pytest.approx(expected, rel=0.3)
    u = point.u.copy()
    u[INPUT.nacelle_acceleration] = 0.5
    rates = AIRCRAFT.derivative(point.x, u, condition.nacelle_angle) - point.xdot
    assert rates[STATE.q] < 0.0


def test_flap_schedule():
    """40 deg off the downstop at any speed; on it, retracted from 170 to 180 kn."""
    controls = TABLES.controls
    assert kernels.flap_schedule(controls, kt(200.0), deg(10.0)) == pytest.approx(deg(40.0))
    assert kernels.flap_schedule(controls, kt(170.0), 0.0) == pytest.approx(deg(40.0))
    assert kernels.flap_schedule(controls, kt(175.0), 0.0) == pytest.approx(deg(20.0))
    assert kernels.flap_schedule(controls, kt(180.0), 0.0) == 0.0


def test_standard_atmosphere():
    """ISO 2533 at 0, 5000 and 11000 m."""
    for height, density, sound in ((0.0, 1.225, 340.294), (5000.0, 0.736116, 320.529), (11000.0, 0.363918, 295.070)):
        found = standard_atmosphere(height)
        assert found == pytest.approx((density, sound), rel=2e-5)


@pytest.mark.parametrize(
    ("airspeed", "nacelle"), [*CONDITIONS, (-15.0, 90.0), (20.0, 85.0), (150.0, 30.0), (200.0, 0.0)]
)
def test_jacobians_do_not_depend_on_the_step(airspeed, nacelle):
    """Half the step changes no entry by more than 0.1 % of itself plus 0.02 % of its row's largest state derivative.

    One exception: the wing's angle of attack is undefined at rest, so its row is left out in hover.
    """
    condition, point = trimmed(airspeed, nacelle)
    full = AIRCRAFT.linearize(condition, point)
    half = AIRCRAFT.linearize(condition, point, step_scale=0.5)
    for pair in (("A", "B"), ("C", "D")):
        largest = np.max(np.abs(getattr(full, pair[0])), axis=1, keepdims=True)
        for name in pair:
            one, two = getattr(full, name), getattr(half, name)
            close = np.abs(one - two) <= 1e-3 * np.abs(one) + 2e-4 * largest + 1e-9
            if pair[0] == "C" and airspeed == 0.0:
                close[OUTPUT.wing_angle_of_attack] = True
            assert np.all(close), (name, np.argwhere(~close))


def test_jacobian_predicts_a_small_step():
    """f(x + dx, u + du, n + dn) - f(x, u, n) = A dx + B du + df/dn dn to second order."""
    condition, point = trimmed(90.0, 65.0)
    model = AIRCRAFT.linearize(condition, point)
    generator = np.random.default_rng(1)
    dx = generator.normal(size=len(STATES)) * 1e-4
    du = generator.normal(size=len(INPUTS)) * 1e-4
    # The flap schedule stands at a published setting, a corner of the tables: one interval beside it moves.
    du[INPUT.flap_0_20], du[INPUT.flap_20_40], du[INPUT.flap_40_75] = 0.0, -1e-4, 0.0
    dn = 1e-4

    def miss(scale):
        actual = AIRCRAFT.derivative(point.x + scale * dx, point.u + scale * du, condition.nacelle_angle + scale * dn)
        linear = point.xdot + scale * (model.A @ dx + model.B @ du + model.df_dnacelle * dn)
        return np.max(np.abs(actual - linear))

    assert miss(1.0) < 5e-3
    assert miss(0.5) < 0.4 * miss(1.0) + 1e-6


def test_rk4_step_converges():
    """The fixed 4 ms step differs from a fifth of it by less than 1e-6 over 0.2 s."""
    condition, point = trimmed(60.0, 75.0)
    path = np.tile([condition.nacelle_angle, 0.0, 0.0], (3, 1))

    def fly(dt, steps):
        x, u = whole(point.x, ALL_STATES), whole(point.u, ALL_INPUTS)
        x[STATE.q] += 0.05
        u[0] += 0.05
        work = np.zeros(kernels.WORK_COUNT + kernels.STEP_SIZE)
        for _ in range(steps):
            kernels.step(TABLES, x, u, path, dt, work)
        return x

    coarse, fine = fly(0.004, 50), fly(0.0008, 250)
    slow = [STATE.u, STATE.w, STATE.q, STATE.pitch, STATE.flap_1c, STATE.flap_1s]
    assert np.max(np.abs(coarse[slow] - fine[slow])) < 2e-5


def test_choices_are_used():
    """Numbers of model_choices.toml arrive in the tables in SI."""
    assert TABLES.wing.immersed_fade_speed == pytest.approx(kt(CHOICES["wing"]["immersed_fade_speed_kt"]))
    assert TABLES.rotor.induced_factor == CHOICES["rotor"]["induced_power_factor"]
    assert TABLES.controls.elevator_per_stick == pytest.approx(4.167 * 4.8 * DEGREE)
