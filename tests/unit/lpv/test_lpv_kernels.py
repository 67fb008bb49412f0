"""The compiled LPV kernels against a plain numpy twin, written from the formulas and the database, not the tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.kernels.compiled import interpreted
from rtsim.lpv import lpv_kernels as kernels
from rtsim.lpv import schedule_kernels as schedule
from rtsim.lpv.tables import prepare_tables
from rtsim.units import GRAVITY

ALPHA_SPEED = 4.5


def smoothstep(s):
    s = np.clip(s, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


class NumpyLpv:
    def __init__(self, database, form):
        self.d, self.form = database, form
        names = [variable.name for variable in database.states]
        self.iu, self.iw, self.iq, self.ip, self.ih = (
            names.index(name) for name in ("u", "w", "q", "pitch", "altitude")
        )

    def alpha(self, x):
        sine, cosine = np.sin(x[..., self.ip]), np.cos(x[..., self.ip])
        u, w = x[..., self.iu], x[..., self.iw]
        headwind = ALPHA_SPEED + np.where(u * cosine + w * sine < 0.0, -(u * cosine + w * sine), 0.0)
        return np.arctan2(w + headwind * sine, u + headwind * cosine)

    def through_air(self, x, u):
        """The state that schedules: with the gusts, except in the plain form."""
        y = x.copy()
        if self.form != "plain":
            y[self.iu] += u[GUST_U]
            y[self.iw] += u[GUST_W]
        return y

    def corners(self, x, nacelle):
        airspeed = x[self.iu] * np.cos(x[self.ip]) + x[self.iw] * np.sin(x[self.ip])
        result, weights = [], []
        for axis, value in ((self.d.airspeed, airspeed), (self.d.nacelle, nacelle)):
            inside = np.clip(value, axis[0], axis[-1])
            k = int(np.clip(np.searchsorted(axis, inside, side="right") - 1, 0, axis.size - 2))
            result.append(k)
            weights.append((inside - axis[k]) / (axis[k + 1] - axis[k]))
        (i, j), (s, t) = result, weights
        return [(i, j, (1 - s) * (1 - t)), (i, j + 1, (1 - s) * t), (i + 1, j, s * (1 - t)), (i + 1, j + 1, s * t)]

    def shares(self, x, corners):
        level = self.d.level_layer
        shares = np.zeros(self.d.layer_acceleration.size)
        shares[level] = 1.0
        if self.form != "layered":
            return shares
        layer_alpha = np.array([sum(w * self.alpha(self.d.x_ref[layer, i, j]) for i, j, w in corners)
                                for layer in range(shares.size)])  # fmt: skip
        alpha = self.alpha(x)
        for direction in (1, -1):
            here = level
            while 0 <= here + direction < shares.size:
                gap = layer_alpha[here + direction] - layer_alpha[here]
                moved = 0.0
                if abs(gap) >= np.radians(1.0):
                    fade = smoothstep((abs(gap) - np.radians(1.0)) / np.radians(1.0))
                    moved = shares[here] * fade * smoothstep((alpha - layer_alpha[here]) / gap)
                shares[here + direction] = moved
                shares[here] -= moved
                here += direction
        return shares

    def interpolated(self, name, shares, corners):
        array = getattr(self.d, name)
        return sum(share * w * array[layer, i, j] for layer, share in enumerate(shares) for i, j, w in corners)

    def rigid_body(self, x):
        f = np.zeros(x.size)
        u, w, q, pitch = x[self.iu], x[self.iw], x[self.iq], x[self.ip]
        f[self.iu] = -GRAVITY * np.sin(pitch) - q * w
        f[self.iw] = GRAVITY * np.cos(pitch) + q * u
        f[self.ip] = q
        f[self.ih] = u * np.sin(pitch) - w * np.cos(pitch)
        return f

    def rigid_body_jacobian(self, x):
        J = np.zeros((x.size, x.size))
        for k in range(x.size):
            # complex step: exact to rounding
            z = x.astype(complex)
            z[k] += 1e-30j
            u, w, q, pitch = z[self.iu], z[self.iw], z[self.iq], z[self.ip]
            J[self.iu, k] = (-GRAVITY * np.sin(pitch) - q * w).imag / 1e-30
            J[self.iw, k] = (GRAVITY * np.cos(pitch) + q * u).imag / 1e-30
            J[self.ip, k] = q.imag / 1e-30
            J[self.ih, k] = (u * np.sin(pitch) - w * np.cos(pitch)).imag / 1e-30
        return J

    def derivative(self, x, u, nacelle):
        corners = self.corners(self.through_air(x, u), nacelle)
        shares = self.shares(self.through_air(x, u), corners)
        dx = x - self.interpolated("x_ref", shares, corners)
        du = u - self.interpolated("u_ref", shares, corners)
        dx[self.ih] = 0.0
        f = np.zeros(x.size)
        for layer, share in enumerate(shares):
            for i, j, w in corners:
                x_ref = self.d.x_ref[layer, i, j]
                A, xdot_ref = self.d.A[layer, i, j].copy(), self.d.xdot_ref[layer, i, j].copy()
                if self.form != "plain":
                    A -= self.rigid_body_jacobian(x_ref)
                    xdot_ref -= self.rigid_body(x_ref)
                    A[[self.iu, self.iw], self.ip] = 0.0
                    A[[self.ip, self.ih]] = 0.0
                    xdot_ref[[self.ip, self.ih]] = 0.0
                f += share * w * (xdot_ref + A @ dx + self.d.B[layer, i, j] @ du)
        return f if self.form == "plain" else f + self.rigid_body(x)

    def outputs(self, x, u, nacelle):
        corners = self.corners(self.through_air(x, u), nacelle)
        shares = self.shares(self.through_air(x, u), corners)
        dx = x - self.interpolated("x_ref", shares, corners)
        du = u - self.interpolated("u_ref", shares, corners)
        dx[self.ih] = 0.0
        C, D = self.interpolated("C", shares, corners), self.interpolated("D", shares, corners)
        return self.interpolated("y_ref", shares, corners) + C @ dx + D @ du

    def step(self, x, u, path, dt, rate_input, acceleration_input):
        def slope(x, row):
            v = u.copy()
            v[rate_input], v[acceleration_input] = path[row, 1], path[row, 2]
            return self.derivative(x, v, path[row, 0])

        k1 = slope(x, 0)
        k2 = slope(x + 0.5 * dt * k1, 1)
        k3 = slope(x + 0.5 * dt * k2, 1)
        k4 = slope(x + dt * k3, 2)
        return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


FORMS = ("layered", "stitched", "plain")
RATE, ACCELERATION, GUST_U, GUST_W = 2, 3, 4, 5  # positions in the toy's inputs


def flight_state(database, rng, spread=1.0):
    """A state some way off a random trim of a random layer, between grid points."""
    layer, i, j = (int(rng.integers(size)) for size in database.valid.shape)
    x = database.x_ref[layer, i, j] + spread * rng.normal(size=len(database.states)) * np.array(
        [0.05, 0.03, 2.0, 1.0, 0.05, 30.0, 0.02, 0.02]
    )
    u = database.u_ref[layer, i, j] + spread * 0.05 * rng.normal(size=len(database.inputs))
    u[[GUST_U, GUST_W]] = spread * 2.0 * rng.normal(size=2)
    nacelle = np.clip(database.nacelle[j] + 0.05 * rng.normal(), 0.0, np.pi / 2)
    return x, u, float(nacelle)


@pytest.fixture(scope="module", params=FORMS)
def form(request):
    return request.param


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_derivative_equals_twin(toy_database, form, seed):
    x, u, nacelle = flight_state(toy_database, np.random.default_rng(seed))
    tables = prepare_tables(toy_database, form)
    xdot, work = np.full(x.size, np.nan), np.zeros(kernels.work_size(tables))
    kernels.lpv_derivative(tables, x, u, nacelle, xdot, work)
    np.testing.assert_allclose(xdot, NumpyLpv(toy_database, form).derivative(x, u, nacelle), rtol=1e-11, atol=1e-11)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_outputs_equal_twin(toy_database, form, seed):
    x, u, nacelle = flight_state(toy_database, np.random.default_rng(seed))
    tables = prepare_tables(toy_database, form)
    y, work = np.full(len(toy_database.outputs), np.nan), np.zeros(kernels.work_size(tables))
    kernels.lpv_outputs(tables, x, u, nacelle, y, work)
    np.testing.assert_allclose(y, NumpyLpv(toy_database, form).outputs(x, u, nacelle), rtol=1e-11, atol=1e-11)


def test_step_equals_twin_and_is_bit_reproducible(toy_database, form):
    rng = np.random.default_rng(5)
    tables = prepare_tables(toy_database, form, refresh="stage")
    work = np.zeros(kernels.work_size(tables))
    twin = NumpyLpv(toy_database, form)
    x, u, _ = flight_state(toy_database, rng, spread=0.3)
    again, reference = x.copy(), x.copy()
    nacelle, rate, dt = 1.2, -0.05, 0.01
    for frame in range(40):
        path = np.array([[nacelle + rate * (frame + c) * dt, rate, 0.1 * c] for c in (0.0, 0.5, 1.0)])
        kernels.lpv_step(tables, x, u, path, dt, work)
        work[schedule.WORK.size :] = rng.normal(size=work.size - schedule.WORK.size)  # nothing may be carried over
        kernels.lpv_step(tables, again, u, path, dt, work)
        reference = twin.step(reference, u, path, dt, RATE, ACCELERATION)
    np.testing.assert_allclose(x, reference, rtol=1e-9, atol=1e-9)
    assert x.tobytes() == again.tobytes()


@pytest.mark.parametrize("refresh", ["step", "references"])
def test_interpolating_once_per_step_changes_little(toy_database, refresh):
    ends = []
    for how in (refresh, "stage"):
        tables = prepare_tables(toy_database, refresh=how)
        stepping = kernels.Stepping(tables, np.zeros(interpreted(kernels.work_size)(tables)), np.zeros((3, 3)))
        x, u = toy_database.x_ref[1, 6, 8].copy(), toy_database.u_ref[1, 6, 8].copy()
        u[1] += 0.02
        for frame in range(250):
            kernels.lpv_step_steady(stepping, x, u, 1.4 - 0.0002 * frame, -0.05, 0.0, 0.004)
        ends.append(x)
    assert np.abs(ends[0] - ends[1]).max() < 2e-4
    assert np.abs(ends[0] - ends[1]).max() > 0.0


def test_trim_of_every_grid_point_is_steady(toy_database):
    """At its own trim the level layer's derivative vanishes, in every form."""
    for form in FORMS:
        tables = prepare_tables(toy_database, form)
        work, xdot = np.zeros(kernels.work_size(tables)), np.zeros(len(toy_database.states))
        for i, j in np.argwhere(toy_database.valid[1]):
            x, u = toy_database.x_ref[1, i, j], toy_database.u_ref[1, i, j]
            work[kernels.WORK.flags] = 0.0
            kernels.lpv_derivative(tables, x, u, toy_database.nacelle[j], xdot, work)
            assert np.abs(xdot).max() < 2e-8
            assert work[kernels.WORK.flags] == 0.0


def test_accelerated_trim_accelerates(toy_database):
    """At the accelerated trim the layered form gives the accelerated state derivative where the layers are apart."""
    tables = prepare_tables(toy_database)
    work, xdot = np.zeros(kernels.work_size(tables)), np.zeros(len(toy_database.states))
    checked = 0
    for layer in (0, 2):
        for i, j in np.argwhere(toy_database.valid[layer]):
            x, u = toy_database.x_ref[layer, i, j], toy_database.u_ref[layer, i, j]
            if abs(tables.alpha[i, j, layer] - tables.alpha[i, j, 1]) > np.radians(2.0):
                kernels.lpv_derivative(tables, x, u, toy_database.nacelle[j], xdot, work)
                np.testing.assert_allclose(xdot, toy_database.xdot_ref[layer, i, j], atol=2e-8)
                checked += 1
    assert checked > 30


@pytest.mark.parametrize(
    ("airspeed", "nacelle", "flag"),
    [
        (-9.0, 1.4, kernels.FLAG_AIRSPEED_LOW),
        (65.0, 0.3, kernels.FLAG_AIRSPEED_HIGH),
        (40.0, 1.8, kernels.FLAG_NACELLE),
        (40.0, -0.1, kernels.FLAG_NACELLE),
        (10.0, 0.2, kernels.FLAG_NO_TRIM),
        (30.0, 1.4, 0),
        (40.0, 0.0, 0),
    ],
)
def test_outside_the_grid_is_flagged(toy_database, airspeed, nacelle, flag):
    tables = prepare_tables(toy_database)
    stepping = kernels.Stepping(tables, np.zeros(interpreted(kernels.work_size)(tables)), np.zeros((3, 3)))
    x, u = toy_database.x_ref[1, 9, 5].copy(), toy_database.u_ref[1, 9, 5]
    x[2], x[3], x[1] = airspeed, 0.0, 0.0
    assert int(kernels.lpv_step_steady(stepping, x, u, nacelle, 0.0, 0.0, 0.001)) & 15 == flag
    # and the flags do not stick
    x[:] = toy_database.x_ref[1, 9, 5]
    assert kernels.lpv_step_steady(stepping, x, u, toy_database.nacelle[5], 0.0, 0.0, 0.001) == 0


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_layer_shares_sum_to_one_and_are_continuous(toy_database, seed):
    rng = np.random.default_rng(seed)
    tables = prepare_tables(toy_database)
    x, u, nacelle = flight_state(toy_database, rng)
    shares = []
    for shift in (0.0, 1e-7):
        work, xdot = np.zeros(kernels.work_size(tables)), np.zeros(x.size)
        kernels.lpv_derivative(tables, x + shift, u, nacelle, xdot, work)
        shares.append(work[schedule.WORK.layer_share : schedule.WORK.layer_share + 3].copy())
        assert shares[-1].min() >= 0.0
        assert abs(shares[-1].sum() - 1.0) < 1e-12
    assert np.abs(shares[0] - shares[1]).max() < 1e-4


def test_altitude_does_not_act(toy_database, form):
    tables = prepare_tables(toy_database, form)
    x, u, nacelle = flight_state(toy_database, np.random.default_rng(3))
    ends = []
    for altitude in (0.0, 5000.0):
        work, xdot = np.zeros(kernels.work_size(tables)), np.zeros(x.size)
        x[5] = altitude
        kernels.lpv_derivative(tables, x, u, nacelle, xdot, work)
        ends.append(xdot)
    assert ends[0].tobytes() == ends[1].tobytes()
