"""The LPV aircraft as people use it: trims, linear models, steps, flags, on the toy and on the shipped database."""

from __future__ import annotations

import control
import numpy as np
import pytest

import rtsim
from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import INPUT, INPUTS
from rtsim.aircraft.xv15.model import Xv15
from rtsim.errors import InputError, TrimError
from rtsim.lpv import lpv_kernels as kernels
from rtsim.lpv.aircraft import LpvAircraft, load_aircraft
from rtsim.lpv.files.storage import save_database
from rtsim.units import deg, kt


@pytest.fixture(scope="module")
def xv15():
    return rtsim.load_aircraft()


@pytest.fixture(scope="module")
def nonlinear():
    return Xv15.load()


def test_trim_at_grid_points_is_the_databases(toy_database):
    aircraft = LpvAircraft(toy_database)
    for v, n in np.argwhere(toy_database.valid[1])[::7]:
        point = aircraft.trim(airspeed=toy_database.airspeed[v], nacelle=toy_database.nacelle[n])
        assert point.converged
        np.testing.assert_allclose(point.x, toy_database.x_ref[1, v, n], atol=1e-8)
        np.testing.assert_allclose(point.u, toy_database.u_ref[1, v, n], atol=1e-8)
        np.testing.assert_allclose(point.y, toy_database.y_ref[1, v, n], atol=1e-7)


@pytest.mark.parametrize(
    ("airspeed", "nacelle", "acceleration"),
    [(0.0, 90.0, 0.0), (33.0, 83.0, 0.0), (62.0, 76.0, 0.0), (100.0, 75.0, 0.0), (120.0, 42.0, 0.0), (150.0, 2.0, 0.0),
     (45.0, 78.0, 1.5), (57.0, 76.0, 3.0), (80.0, 75.0, -1.5), (90.0, 66.0, 2.2), (-7.0, 88.0, 0.0)],
)  # fmt: skip
def test_trim_agrees_with_the_nonlinear_model(xv15, nonlinear, airspeed, nacelle, acceleration):
    where = {"airspeed": kt(airspeed), "acceleration": kt(acceleration)}
    point = xv15.trim(**where, nacelle=deg(nacelle))
    truth = nonlinear.trim(Condition(**where, nacelle_angle=deg(nacelle)), point)
    assert point.converged
    assert truth.converged
    names = [variable.name for variable in xv15.database.states]
    for name, tolerance in (("pitch", 0.15), ("flap_1c", 0.15), ("flap_1s", 0.1), ("collective_75", 0.05)):
        k = names.index(name)
        assert abs(np.degrees(point.x[k] - truth.x[k])) < tolerance, name
    assert abs(point.u[0] - truth.u[0]) < 0.015
    assert abs(point.u[1] - truth.u[1]) < 0.005


@pytest.mark.parametrize("form", ["layered", "plain"])
def test_every_input_acts_alone_by_its_columns(xv15, form):
    """Columns of inputs that are zero in most frames are left out where all of them are zero, and only there."""
    aircraft, database = LpvAircraft(xv15.database, form=form), xv15.database
    v, n = np.argmin(np.abs(database.airspeed - kt(60.0))), np.argmin(np.abs(database.nacelle - deg(75.0)))
    where = (database.level_layer, v, n)
    x, u, angle = database.x_ref[where], database.u_ref[where], database.nacelle[n]
    still = aircraft.derivative(x, u, angle), aircraft.outputs(x, u, angle), aircraft.step(x, u, nacelle_angle=angle)
    for k, variable in enumerate(database.inputs):
        moved = u.copy()
        moved[k] += 1e-6
        if variable.name in {"gust_u", "gust_w"}:  # these move the scheduling too
            continue
        change = (aircraft.derivative(x, moved, angle) - still[0]) / 1e-6
        np.testing.assert_allclose(change, database.B[where][:, k], rtol=2e-3, atol=2e-3, err_msg=variable.name)
        change = (aircraft.outputs(x, moved, angle) - still[1]) / 1e-6
        scale = 1e-3 * np.abs(database.D[where]).max(axis=1)
        assert np.all(np.abs(change - database.D[where][:, k]) <= scale), variable.name
        change = np.abs(aircraft.step(x, moved, nacelle_angle=angle) - still[2]).max()
        unread = variable.name in {"nacelle_rate", "nacelle_acceleration"}  # a step takes them from the path
        assert (change == 0.0) == unread, variable.name


def test_trim_where_there_is_none(xv15):
    point = xv15.trim(airspeed=kt(40.0), nacelle=deg(20.0))
    assert not point.converged
    assert not xv15.is_valid(airspeed=kt(40.0), nacelle=deg(20.0))
    assert xv15.is_valid(airspeed=kt(100.0), nacelle=deg(75.0))
    assert not xv15.is_valid(airspeed=kt(300.0), nacelle=0.0)


@pytest.mark.parametrize(("airspeed", "nacelle", "key"), [(265.0, 0.0, "airspeed"), (50.0, 91.0, "nacelle")])
def test_outside_the_database_is_refused(xv15, airspeed, nacelle, key):
    for method in (xv15.trim, xv15.linearize, xv15.matrices):
        with pytest.raises(InputError, match=f"{key}: outside the database"):
            method(airspeed=kt(airspeed), nacelle=deg(nacelle))


def test_no_linear_model_where_there_is_no_trim(xv15):
    """What fills the cells without a trim is for the kernels, not an answer."""
    with pytest.raises(TrimError, match="no level-flight trim around 30 kn at nacelle 0 deg"):
        xv15.linearize(airspeed=kt(30.0), nacelle=0.0)


def test_linear_model_has_names_and_is_the_derivative(xv15, nonlinear):
    """At a grid point the model is the Jacobian of the nonlinear aircraft, checked along random directions."""
    airspeed, nacelle = kt(81.0), deg(75.0)
    model = xv15.linearize(airspeed=airspeed, nacelle=nacelle)
    assert isinstance(model, control.StateSpace)
    assert model.state_labels[:5] == ["u", "w", "q", "pitch", "altitude"]
    assert model.input_labels == [variable.name for variable in xv15.database.inputs]
    assert model.output_labels == [variable.name for variable in xv15.database.outputs]
    assert model.dt == 0
    point = xv15.trim(airspeed=airspeed, nacelle=nacelle)
    rng = np.random.default_rng(0)
    for _ in range(5):
        dx, du = 1e-5 * rng.normal(size=17), 1e-5 * rng.normal(size=len(INPUTS))
        du[INPUT.ground_effect] = 0.0  # its column is the whole effect, not a slope
        du[7], du[8] = 0.0, min(du[8], 0.0)  # 40 deg of flap is a corner: the flaps go up, or down from it
        du[9] = max(du[9], 0.0) if du[8] == 0.0 else 0.0
        change = nonlinear.derivative(point.x + dx, point.u + du, nacelle) - nonlinear.derivative(
            point.x, point.u, nacelle
        )
        np.testing.assert_allclose(model.A @ dx + model.B @ du, change, rtol=2e-3, atol=2e-6)


def test_linear_model_is_interpolated_between_grid_points(toy_database):
    aircraft = LpvAircraft(toy_database)
    middle = aircraft.matrices(airspeed=27.5, nacelle=deg(85.0))[0]
    corners = toy_database.A[1, 6:8, 8:10]
    np.testing.assert_allclose(middle, corners.mean(axis=(0, 1)), rtol=1e-12, atol=1e-12)


def test_derivative_and_outputs_at_a_grid_point(xv15, nonlinear):
    point = xv15.trim(airspeed=kt(60.0), nacelle=deg(80.0))
    np.testing.assert_allclose(xv15.outputs(point.x, point.u, deg(80.0)), point.y)
    np.testing.assert_allclose(point.y, nonlinear.outputs(point.x, point.u, deg(80.0)), rtol=1e-6, atol=1e-8)
    assert np.abs(xv15.derivative(point.x, point.u, deg(80.0))).max() < 1e-8


def test_step_is_the_kernels_and_leaves_its_arguments_alone(toy_database):
    aircraft = LpvAircraft(toy_database)
    x, u = toy_database.x_ref[1, 8, 8].copy(), toy_database.u_ref[1, 8, 8].copy()
    u[1] += 0.05
    before = x.copy()
    after = aircraft.step(x, u, nacelle_angle=1.4, nacelle_rate=-0.1, nacelle_acceleration=0.2, dt=0.01)
    assert x.tobytes() == before.tobytes()
    path = np.array([[1.4 - 0.1 * t + 0.1 * t * t, -0.1 + 0.2 * t, 0.2] for t in (0.0, 0.005, 0.01)])
    work = np.zeros(kernels.work_size(aircraft.tables))
    kernels.lpv_step(aircraft.tables, x, u, path, 0.01, work)
    np.testing.assert_allclose(after, x, rtol=1e-15, atol=1e-15)


def test_trim_stays_put(xv15):
    """Hover is unstable, so only for a second: nothing may drive the aircraft out of its trim."""
    point = xv15.trim(airspeed=0.0, nacelle=deg(90.0))
    x = point.x
    for _ in range(250):
        x = xv15.step(x, point.u, nacelle_angle=deg(90.0))
    assert np.abs(x - point.x).max() < 1e-9
    assert xv15.flags == 0


def test_step_length_has_converged(xv15):
    """A stick doublet at 60 kn: halving the 4 ms step changes nothing a pilot could see."""
    point = xv15.trim(airspeed=kt(60.0), nacelle=deg(80.0))
    ends = []
    for rate in (250, 1000):
        x = point.x
        for frame in range(3 * rate):
            u = point.u.copy()
            u[0] += 0.1 if frame < rate else (-0.1 if frame < 2 * rate else 0.0)
            x = xv15.step(x, u, nacelle_angle=deg(80.0), dt=1.0 / rate)
        ends.append(x)
    difference = np.abs(ends[0] - ends[1])
    assert difference[:2].max() < 2e-3  # m/s
    assert np.degrees(difference[3]) < 5e-3
    assert difference.max() > 0.0


def test_flags_tell_the_edge_of_the_grid(xv15):
    point = xv15.trim(airspeed=0.0, nacelle=deg(90.0))
    x = point.x.copy()
    x[0] = -12.0
    xv15.step(x, point.u, nacelle_angle=deg(90.0))
    assert xv15.flags & kernels.FLAG_AIRSPEED_LOW
    xv15.step(point.x, point.u, nacelle_angle=deg(30.0))
    assert xv15.flags & kernels.FLAG_NO_TRIM


def test_a_file_of_ones_own_flies(toy_database, tmp_path):
    for name in ("toy.nc", "toy.mat"):
        save_database(toy_database, tmp_path / name)
        for form in ("layered", "stitched", "plain"):
            aircraft = load_aircraft(tmp_path / name, form=form)
            point = aircraft.trim(airspeed=30.0, nacelle=deg(80.0))
            x = aircraft.step(point.x, point.u, nacelle_angle=deg(80.0), dt=0.01)
            np.testing.assert_allclose(x, point.x, atol=1e-7)


def test_kinematics_of_another_convention_are_refused_by_name(toy_database):
    """A database with the altitude counted downwards flies in the plain form only."""
    from dataclasses import replace

    A, xdot_ref = toy_database.A.copy(), toy_database.xdot_ref.copy()
    A[..., 5, :] *= -1.0
    flipped = replace(toy_database, A=A, xdot_ref=xdot_ref)
    with pytest.raises(InputError, match="row of 'altitude' in A differs") as caught:
        LpvAircraft(flipped)
    assert "plain form" in str(caught.value)
    LpvAircraft(flipped, form="plain")


def test_missing_states_are_named(toy_database):
    from dataclasses import replace

    from rtsim.aircraft.variables import Variable

    states = tuple(Variable("rate", "", "", "rigid") if v.name == "q" else v for v in toy_database.states)
    renamed = replace(toy_database, states=states)
    with pytest.raises(InputError, match="no variable 'q', which the stitched form needs"):
        LpvAircraft(renamed)
    LpvAircraft(renamed, form="plain")
