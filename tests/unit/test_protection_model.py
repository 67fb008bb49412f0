"""The laws' model: reduction from the database, regulators, prediction against a plain numpy twin."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from scipy.signal import cont2discrete

from rtsim.corridor.boundaries import load_corridor
from rtsim.kernels.ramp_filter_kernels import critically_damped_ramp
from rtsim.lpv.aircraft import load_aircraft
from rtsim.lpv.files.storage import load_database
from rtsim.protection import prediction_kernels as kernels
from rtsim.protection.limits import load_weights
from rtsim.protection.model import reduce_model
from rtsim.protection.tables import sample_boundary
from rtsim.units import GRAVITY, deg, kt

SLOW = ("u", "w", "q", "pitch")


@pytest.fixture(scope="module")
def database():
    return load_database()


@pytest.fixture(scope="module")
def tables(database):
    return reduce_model(database, load_weights())


def cell_at(tables, airspeed, nacelle):
    cell = np.zeros(kernels.CELL.size)
    kernels.model_at(tables, airspeed, nacelle, cell)
    return cell


def valid_points(database, every=1):
    points = np.argwhere(database.valid[database.level_layer])
    return [tuple(int(k) for k in point) for point in points[::every]]


def test_trim_is_an_equilibrium_of_the_reduced_model(database, tables):
    for i, j in valid_points(database):
        cell = tables.cells[i, j]
        z, c = tuple(cell[:4]), tuple(cell[kernels.CELL.control : kernels.CELL.control + 2])
        du, dw, dq, rate, airspeed = kernels.accelerations(cell, z, c, (0.0, 0.0))
        assert max(abs(du), abs(dw), abs(dq), abs(rate)) < 1e-9
        assert airspeed == pytest.approx(database.airspeed[i], abs=1e-6)


@pytest.mark.parametrize(
    ("airspeed", "nacelle"), [(0.0, 90.0), (60.0, 75.0), (105.0, 50.0), (130.0, 20.0), (170.0, 0.0)]
)
def test_reduced_accelerations_are_those_of_the_settled_lpv_aircraft(database, airspeed, nacelle):
    """Move one slow state or control, let the fast states of the full linear model settle, compare."""
    level = database.level_layer
    i = int(np.argmin(np.abs(database.airspeed - kt(airspeed))))
    j = int(np.argmin(np.abs(database.nacelle - deg(nacelle))))
    A, B = database.A[level, i, j], database.B[level, i, j]
    names = [variable.name for variable in database.states]
    slow = [names.index(name) for name in SLOW]
    fast = [k for k in range(len(names)) if k not in slow and names[k] != "altitude"]
    cell = reduce_model(database, load_weights()).cells[i, j]
    trim, controls = cell[:4], cell[kernels.CELL.control : kernels.CELL.control + 2]
    step = 1e-4
    for k in range(6):
        dz, dc = np.zeros(4), np.zeros(2)
        (dz if k < 4 else dc)[k % 4 if k < 4 else k - 4] = step
        x = np.zeros(len(names))
        x[slow] = dz
        x[fast] = np.linalg.solve(A[np.ix_(fast, fast)], -A[np.ix_(fast, slow)] @ dz - B[fast][:, :2] @ dc)
        expected = (A @ x + B[:, :2] @ dc)[slow[:3]]
        got = kernels.accelerations(cell, tuple(trim + dz), tuple(controls + dc), (0.0, 0.0))[:3]
        # Gravity turns with the attitude: its second-order part is g step^2 / 2.
        np.testing.assert_allclose(got, expected, rtol=2e-3, atol=GRAVITY * step**2)


def test_settled_torque_and_flapping_are_those_of_the_lpv_aircraft(database, tables):
    """A new trim with another stick and lever, flown by the LPV aircraft until rotor and actuators have settled."""
    aircraft = load_aircraft()
    airspeed, nacelle = kt(105.0), deg(50.0)
    i = int(np.argmin(np.abs(database.airspeed - airspeed)))
    j = int(np.argmin(np.abs(database.nacelle - nacelle)))
    level = database.level_layer
    x, u = database.x_ref[level, i, j].copy(), database.u_ref[level, i, j].copy()
    u[0] += 0.02
    u[1] += 0.005
    names = [variable.name for variable in database.states]
    slow = [names.index(name) for name in (*SLOW, "altitude")]
    held = x[slow].copy()
    for _ in range(400):
        x = aircraft.step(x, u, nacelle_angle=database.nacelle[j])
        x[slow] = held
    outputs = [variable.name for variable in database.outputs]
    y = aircraft.outputs(x, u, database.nacelle[j])
    cell = cell_at(tables, database.airspeed[i], database.nacelle[j])
    z = tuple(held[:4])
    torque = kernels.affine(cell, kernels.CELL.torque, z, (u[0], u[1]), 0.0)
    assert torque == pytest.approx(y[outputs.index("torque")], rel=2e-3)
    for place, name in ((kernels.CELL.flap_c, "flap_1c"), (kernels.CELL.flap_s, "flap_1s")):
        assert kernels.affine(cell, place, z, (u[0], u[1]), 0.0) == pytest.approx(x[names.index(name)], abs=2e-4)


def test_gains_are_those_of_the_riccati_equation(database, tables):
    weights = load_weights()
    level = database.level_layer
    names = [variable.name for variable in database.states]
    slow = [names.index(name) for name in SLOW]
    fast = [k for k in range(len(names)) if k not in slow and names[k] != "altitude"]
    for i, j in valid_points(database, every=97):
        A, B = database.A[level, i, j], database.B[level, i, j][:, :2]
        inner = np.linalg.solve(A[np.ix_(fast, fast)], np.hstack([A[np.ix_(fast, slow)], B[fast]]))
        a = A[np.ix_(slow, slow)] - A[np.ix_(slow, fast)] @ inner[:, :4]
        b = B[slow] - A[np.ix_(slow, fast)] @ inner[:, 4:]
        u, w, _, pitch = database.x_ref[level, i, j][slow]
        s, c = np.sin(pitch), np.cos(pitch)
        seen = np.array([[c, s, 0, w * c - u * s], [s, -c, 0, u * c + w * s], [0, 0, 0, 1], [0, 0, 1, 0]])
        scale = [weights.airspeed, weights.climb_rate, weights.pitch, weights.pitch_rate]
        cost = seen.T @ np.diag(1.0 / np.square(scale)) @ seen
        effort = np.diag(1.0 / np.square([weights.stick, weights.lever]))
        gain = np.linalg.solve(effort, b.T @ solve_continuous_are(a, b, cost, effort))
        stored = tables.cells[i, j, kernels.CELL.gain :][:8].reshape(2, 4)
        np.testing.assert_allclose(stored, gain, rtol=1e-5, atol=1e-7)


def test_recovery_is_stable_with_the_whole_aircraft_at_every_trim(database, tables):
    """With rotor, inflow, actuators and 50 decisions a second, every valid grid point decays at 0.2 1/s or faster."""
    level = database.level_layer
    names = [variable.name for variable in database.states]
    keep = [k for k, name in enumerate(names) if name != "altitude"]
    worst = -np.inf
    for i, j in valid_points(database):
        A, B = database.A[level, i, j][np.ix_(keep, keep)], database.B[level, i, j][keep, :2]
        discrete, held, *_ = cont2discrete((A, B, np.eye(len(keep)), np.zeros((len(keep), 2))), 0.02)
        feedback = np.zeros((2, len(keep)))
        feedback[:, :4] = tables.cells[i, j, kernels.CELL.gain :][:8].reshape(2, 4)
        radius = np.abs(np.linalg.eigvals(discrete - held @ feedback)).max()
        worst = max(worst, float(np.log(radius) / 0.02))
    assert worst < -0.2


def twin_roll_out(tables, corridor, cell, start, controls, nacelle, motion, bias, time, guard):
    """Plain numpy version of ``roll_out``: arrays of margins over time."""
    z = np.array(start)
    command, angle, rate = nacelle
    here, (missing, decay), (step, horizon) = angle, bias, time
    A = cell[kernels.CELL.a : kernels.CELL.a + 9].reshape(3, 3)
    B = cell[kernels.CELL.b : kernels.CELL.b + 9].reshape(3, 3)
    lows, highs = [], []
    carried = 0.0
    for k in range(round(horizon / step) + 1):
        u, w, q, pitch = z
        inputs = np.array([*(np.array(controls) - cell[kernels.CELL.control : kernels.CELL.control + 2]), rate])
        a = cell[kernels.CELL.air : kernels.CELL.air + 3] + A @ (z[:3] - cell[:3]) + B @ inputs
        a = a + cell[kernels.CELL.nacelle : kernels.CELL.nacelle + 3] * (angle - here)
        airspeed = u * np.cos(pitch) + w * np.sin(pitch) + carried
        lows.append(airspeed - corridor.low_speed(angle))
        highs.append(corridor.high_speed(angle) - airspeed)
        f = guard[1]
        dq = np.clip(a[2], -f * (f * (guard[0] + pitch) + 2 * q), f * (f * (guard[0] - pitch) - 2 * q))
        new_q = q + step * dq
        z = np.array(
            [
                u + step * (a[0] - GRAVITY * np.sin(pitch) - q * w),
                w + step * (a[1] + GRAVITY * np.cos(pitch) + q * u),
                new_q,
                pitch + step * new_q,
            ]
        )
        carried += step * missing
        missing *= np.exp(-step / decay)
        r = motion[0] if k * step < motion[1] - 1e-9 else 0.0
        r = np.clip(command + r * step, tables.forward_stop, tables.aft_stop) / step - command / step
        angle, rate, _ = critically_damped_ramp(tables.nacelle_frequency, command, r, angle, rate, step)
        command += r * step
    return np.array(lows), np.array(highs)


@pytest.mark.parametrize("seed", range(12))
def test_roll_out_agrees_with_its_twin(tables, seed):
    rng = np.random.default_rng(seed)
    corridor = load_corridor("flight")
    nacelle = rng.uniform(5.0, 88.0)
    airspeed = kt(rng.uniform(40.0, 130.0))
    cell = cell_at(tables, airspeed, deg(nacelle))
    start = tuple(cell[:4] + rng.normal(size=4) * [2.0, 1.0, 0.05, 0.03])
    controls = tuple(cell[kernels.CELL.control : kernels.CELL.control + 2] + rng.normal(size=2) * 0.05)
    angle = deg(nacelle)
    state = (angle + rng.normal() * 0.02, angle, rng.normal() * 0.05)
    motion, bias = (rng.normal() * 0.1, 0.5), (rng.normal() * 0.5, 2.0)
    time, guard = (0.1, 2.0), (deg(22.0), 1.5)
    out = np.zeros(kernels.OUT.size)
    kernels.roll_out(tables, sample_boundary(corridor), cell, start, controls, state, motion, bias, time, guard, out)
    low, high = twin_roll_out(tables, corridor, cell, start, controls, state, motion, bias, time, guard)
    expected = [low.min(), high.min(), low[-1], high[-1]]
    np.testing.assert_allclose(out[:4], expected, rtol=1e-9, atol=1e-9)
    margin = np.minimum(low, high)
    if (margin < 0.0).any():
        k = int(np.argmax(margin < 0.0))
        crossing = 0.0 if k == 0 else 0.1 * (k - 1 + margin[k - 1] / (margin[k - 1] - margin[k]))
        assert out[kernels.OUT.time] == pytest.approx(crossing, abs=1e-9)
        assert out[kernels.OUT.side] == (-1.0 if low[k] < high[k] else 1.0)
    else:
        assert out[kernels.OUT.time] == 2.0
        assert out[kernels.OUT.side] == 0.0


def test_sampled_boundaries_are_the_boundaries():
    corridor = load_corridor("flight")
    sampled = sample_boundary(corridor)
    for angle in deg(np.concatenate([np.linspace(0.6, 95.0, 700), [70.5, 75.0, 64.7, 0.3, 0.0]])):
        low, high = kernels.speed_range(sampled, angle, 0.0)
        assert low == pytest.approx(corridor.low_speed(float(angle)), abs=1e-6)
        assert high == pytest.approx(corridor.high_speed(float(angle)), abs=1e-6)


def test_prediction_follows_the_lpv_aircraft_for_two_seconds(tables):
    """From a trim, lever and stick moved: after 2 s within 0.1 kn and a fifth of the change of the LPV aircraft."""
    aircraft = load_aircraft()
    for airspeed, nacelle in ((kt(105.0), deg(50.0)), (kt(80.0), deg(75.0)), (kt(140.0), deg(20.0))):
        point = aircraft.trim(airspeed=airspeed, nacelle=nacelle)
        x, u = point.x.copy(), point.u.copy()
        u[0] -= 0.02
        u[1] -= 0.05
        for _ in range(500):
            x = aircraft.step(x, u, nacelle_angle=nacelle)
        flown = x[0] * np.cos(x[3]) + x[1] * np.sin(x[3])
        cell = cell_at(tables, airspeed, nacelle)
        out = np.zeros(kernels.OUT.size)
        wide = sample_boundary(load_corridor("design"))
        kernels.roll_out(
            tables, wide, cell, tuple(point.x[:4]), (u[0], u[1]), (nacelle, nacelle, 0.0), (0.0, 0.0), (0.0, 2.0),
            (0.1, 2.0), (deg(60.0), 5.0), out,
        )  # fmt: skip
        low = kernels.speed_range(wide, nacelle, 0.0)[0]
        predicted = out[kernels.OUT.low_end] + low
        assert abs(flown - airspeed) > kt(1.0)
        assert abs(predicted - flown) < kt(0.1) + 0.2 * abs(flown - airspeed)
