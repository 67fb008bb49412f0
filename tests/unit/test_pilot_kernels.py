"""The pilot on line: against a plain numpy twin, and what it must do at limits, hand-over and under noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.choices import OUTER_LOOPS, OuterLoop
from rtsim.kernels.packed import packed
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.lpv_kernels import lpv_step, work_size
from rtsim.lpv.tables import prepare_tables
from rtsim.pilot.delay import delay_filter
from rtsim.pilot.layout_kernels import OFFSETS, S_ESTIMATE, S_LIMITED, noise_width, pilot_state_size
from rtsim.pilot.pilot_kernels import PilotTables, mocm_advance, mocm_engage, mocm_output
from rtsim.pilot.schedule import ScheduledPilot
from rtsim.pilot.tables import load_pilot_tables
from rtsim.units import deg, kt

DT = 0.004
SILENCE = np.zeros(0)
DATABASE = load_database()
LPV = packed(prepare_tables(DATABASE))
TABLES: dict[str, PilotTables] = {loop: packed(load_pilot_tables(DATABASE, loop, dt=DT)) for loop in OUTER_LOOPS}
NAMES = [variable.name for variable in DATABASE.states]
U, W, Q, PITCH, ALTITUDE = (NAMES.index(name) for name in ("u", "w", "q", "pitch", "altitude"))
HANDS = [[variable.name for variable in DATABASE.inputs].index(name) for name in ("stick", "lever")]


def blend(array: np.ndarray, database: Database, airspeed: float, nacelle: float) -> np.ndarray:
    """Bilinear interpolation on [airspeed, nacelle, ...]."""
    i = int(np.clip(np.searchsorted(database.airspeed, airspeed, side="right") - 1, 0, database.airspeed.size - 2))
    j = int(np.clip(np.searchsorted(database.nacelle, nacelle, side="right") - 1, 0, database.nacelle.size - 2))
    s = np.clip((airspeed - database.airspeed[i]) / np.diff(database.airspeed)[i], 0.0, 1.0)
    t = np.clip((nacelle - database.nacelle[j]) / np.diff(database.nacelle)[j], 0.0, 1.0)
    return np.asarray(
        (1 - s) * (1 - t) * array[i, j]
        + (1 - s) * t * array[i, j + 1]
        + s * (1 - t) * array[i + 1, j]
        + s * t * array[i + 1, j + 1]
    )


def trim(airspeed: float, nacelle: float) -> tuple[np.ndarray, np.ndarray]:
    """State and controls of the interpolated level trim, at 100 m."""
    level = DATABASE.level_layer
    x = blend(DATABASE.x_ref[level], DATABASE, airspeed, nacelle)
    x[ALTITUDE] = 100.0
    return x, blend(DATABASE.u_ref[level], DATABASE, airspeed, nacelle)[HANDS]


class Twin:
    """One frame of the pilot as matrices, with classical Runge-Kutta steps of the whole linear system."""

    def __init__(self, loop: OuterLoop) -> None:
        self.loop, self.tables = loop, TABLES[loop]
        self.pilot = ScheduledPilot.from_arrays(DATABASE.pilot[loop])
        tau = np.full(2, float(self.pilot.attributes["delay"]))
        self.model, self.true = delay_filter(tau), delay_filter(tau - DT)
        self.n, self.nd = self.pilot.A.shape[-1], self.model.A.shape[0]
        self.n1 = self.n + self.nd + 2

    def reference_trim(self, r: np.ndarray, nacelle: float) -> tuple[np.ndarray, np.ndarray]:
        values = blend(self.tables.trim, DATABASE, r[0], nacelle).reshape(4, 3)
        a = np.clip(r[1], -self.tables.numbers[2], self.tables.numbers[2])
        point = values[0] + a * values[1] + a * a * values[2]
        point[0] += r[3] * r[0] / (r[0] ** 2 + 15.0**2)
        return point, values[3]

    def demand(self, state: np.ndarray) -> np.ndarray:
        hands = state[S_ESTIMATE + self.n1 :][:2]
        delay = state[S_ESTIMATE + self.n1 + 2 :][: self.nd]
        return np.asarray(self.true.C @ delay + np.diag(self.true.D) * hands)

    def advance(
        self, state: np.ndarray, x: np.ndarray, nacelle: float, nacelle_rate: float, r: np.ndarray, applied: np.ndarray,
        noise: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        n, nd, n1 = self.n, self.nd, self.n1
        after = state.copy()
        at = {"xh": slice(2, 2 + n1), "u": slice(2 + n1, 4 + n1), "d": slice(4 + n1, 4 + n1 + nd)}
        z_at, last_at = 4 + n1 + nd, 6 + n1 + nd
        offset = state[-OFFSETS:]
        own = r[:4] + offset
        point, slope = self.reference_trim(own, nacelle)
        pitch_rate = (point[0] - state[last_at + 3]) / DT
        sine, cosine = np.sin(point[0]), np.cos(point[0])
        target = np.zeros(n)
        target[:5] = own[0] * cosine + own[3] * sine, own[0] * sine - own[3] * cosine, pitch_rate, point[0], own[2]
        target[5:7] = point[1:]
        xh = state[at["xh"]].copy()
        xh[:n] -= target - state[last_at : last_at + n]
        after[last_at : last_at + n] = target

        A, B, C, N, F, L, G = (
            blend(getattr(self.pilot, name), DATABASE, state[0], nacelle)
            for name in ("A", "B", "C", "nacelle_effect", "F", "l", "G2")
        )
        V = np.sqrt(np.concatenate([self.pilot.V_y, self.pilot.V_u], axis=-1))
        V = blend(V, DATABASE, state[0], nacelle)
        airspeed = x[U] * np.cos(x[PITCH]) + x[W] * np.sin(x[PITCH])
        climb = x[U] * np.sin(x[PITCH]) - x[W] * np.cos(x[PITCH])
        dy = np.array([airspeed - own[0], x[ALTITUDE] - own[2], climb - own[3], x[PITCH] - point[0], x[Q] - pitch_rate])
        errors = dy[:2].copy()
        command = np.zeros(2)
        z = state[z_at : z_at + 2]
        if self.loop == "integrators":
            dy = np.concatenate([dy, z])
        else:
            kp_v, ki_v, kp_h, ki_h = self.tables.numbers[4:8]
            move = np.zeros(L.shape[1])
            dv, dh = -kp_v * errors[0] - ki_v * z[0], -kp_h * errors[1] - ki_h * z[1]
            move[[0, 1, 3]] = cosine - own[0] * sine * slope[0], sine + own[0] * cosine * slope[0], slope[0]
            move[5:7] = slope[1:]
            move *= dv
            move[4] += dh
            command = L @ move + slope[1:] * dv
        ny = dy.size
        motor = np.zeros(2)
        if noise.size:
            dy = dy + V[:ny] * noise[:ny] / np.sqrt(DT)
            motor = G @ (V[ny:] * noise[ny:]) / np.sqrt(DT)
        plant = N[:, 0] * nacelle_rate + A[:, 2] * pitch_rate
        plant[0] += own[1] * cosine
        plant[1] += own[1] * sine
        rate = G @ (command - L @ xh[: n + nd] - state[at["u"]])
        allowed = np.clip(rate, -self.tables.limits[2], self.tables.limits[2])
        place = point[1:] + state[at["u"]]
        allowed[(place >= 1.0) & (allowed > 0.0)] = 0.0
        allowed[(place <= self.tables.limits[0]) & (allowed < 0.0)] = 0.0
        overruled = applied - (point[1:] + self.demand(state))
        overruled[np.abs(overruled) <= 1e-9] = 0.0
        frozen = bool(np.any(overruled != 0.0) or np.any(allowed != rate))
        plant = plant + B @ overruled
        plant_row = A.copy()
        b_row = B.copy()
        if frozen and self.loop == "integrators":
            plant_row[-2:], b_row[-2:], plant[-2:] = 0.0, 0.0, 0.0

        total = n1 + 2 + nd
        M, k = np.zeros((total, total)), np.zeros(total)
        M[:n, :n] = plant_row
        M[:n, n : n + nd] = b_row @ self.model.C
        M[:n, n + nd : n1] = b_row @ self.model.D
        M[n : n + nd, n : n + nd], M[n : n + nd, n + nd : n1] = self.model.A, self.model.B
        M[n + nd : n1, : n + nd], M[n + nd : n1, n + nd : n1] = -G @ L, -G
        M[n1 : n1 + 2, : n + nd], M[n1 : n1 + 2, n1 : n1 + 2] = -G @ L, -G
        M[n1 + 2 :, n1 + 2 :], M[n1 + 2 :, n1 : n1 + 2] = self.true.A, self.true.B
        M[:n1, :n] -= F @ C
        k[:n] = plant
        k[:n1] += F @ dy
        k[n + nd : n1] += G @ command + allowed - rate
        k[n1 : n1 + 2] += G @ command + allowed - rate + motor
        y = np.concatenate([xh, state[at["u"]], state[at["d"]]])
        k1 = M @ y + k
        k2 = M @ (y + 0.5 * DT * k1) + k
        k3 = M @ (y + 0.5 * DT * k2) + k
        k4 = M @ (y + DT * k3) + k
        y = y + DT / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        after[2 : 2 + total] = y
        if not frozen:
            after[z_at : z_at + 2] += DT * errors
        for position, speed, acceleration, largest, error in (
            (0, 1.5, 1.5, 10.0, errors[0]), (2, 4.0, 4.0, 20.0, errors[1]),
        ):  # fmt: skip
            o, v = offset[position], offset[position + 1]
            change = np.clip(
                -0.4 * (0.4 * np.clip(o, -5.0 * speed, 5.0 * speed) + 2.0 * v), -acceleration, acceleration
            )
            after[-OFFSETS + position] = o + DT * (v + 0.5 * DT * change) + error - np.clip(error, -largest, largest)
            after[-OFFSETS + position + 1] = v + DT * change
        after[0] += (1.0 - np.exp(-DT / 0.3)) * (airspeed - state[0])
        after[1] = float(frozen)
        return after


def engaged(
    loop: str,
    airspeed: float,
    nacelle: float,
    *,
    change: dict[int, float] | None = None,
    present: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """State of the pilot, aircraft state, controls and reference after taking over at a trim, optionally displaced."""
    x, hands = trim(airspeed, nacelle)
    for place, amount in (change or {}).items():
        x[place] += amount
    hands = hands if present is None else present
    reference = np.array([airspeed, 0.0, 100.0, 0.0, 0.0])
    state = np.zeros(pilot_state_size(TABLES[loop]))
    mocm_engage(TABLES[loop], state, x, nacelle, 0.0, reference, hands)
    return state, x, hands, reference


@pytest.mark.parametrize("loop", OUTER_LOOPS)
@pytest.mark.parametrize("noisy", [False, True])
def test_numpy_twin(loop: OuterLoop, noisy: bool) -> None:
    """Random displays, references, limits and overruled controls over many frames: the same numbers to 1e-9."""
    rng = np.random.default_rng(7)
    twin, tables = Twin(loop), TABLES[loop]
    state, x, _, reference = engaged(loop, kt(75.0), deg(73.0), change={U: 1.0, PITCH: 0.03, ALTITUDE: -3.0})
    limited = 0
    for frame in range(150):
        reference[:4] = kt(75.0) + 0.02 * frame, 1.2, 100.0 + 0.01 * frame, 0.5
        nacelle, nacelle_rate = deg(73.0 - 0.01 * frame), deg(-2.5)
        x[[U, W, Q, PITCH, ALTITUDE]] += rng.normal(size=5) * [0.05, 0.05, 0.01, 0.005, 0.1]
        if frame > 100:
            x[ALTITUDE] += 0.8  # drives the hands to their limits and the pilot away from its reference
        noise = rng.standard_normal(noise_width(tables)) if noisy else SILENCE
        applied = np.zeros(2)
        mocm_output(tables, state, x, nacelle, nacelle_rate, reference, noise, applied)
        if frame % 7 == 3:
            applied[0] = np.clip(applied[0] + 0.1, -1.0, 1.0)
        expected = twin.advance(state, x, nacelle, nacelle_rate, reference, applied, noise)
        mocm_advance(tables, state, x, nacelle, nacelle_rate, reference, applied, noise, DT)
        assert state == pytest.approx(expected, rel=1e-9, abs=1e-9), frame
        limited += int(state[S_LIMITED])
    assert 20 < limited < 150


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_output_changes_no_state_and_is_the_demand_within_the_stops(loop: str) -> None:
    state, x, _, reference = engaged(loop, kt(40.0), deg(82.0))
    state[S_ESTIMATE + TABLES[loop].cells.shape[-1] % 7] += 0.1
    before, out = state.copy(), np.zeros(2)
    mocm_output(TABLES[loop], state, x, deg(82.0), 0.0, reference, SILENCE, out)
    assert np.array_equal(before, state)
    assert -1.0 <= out[0] <= 1.0
    assert 0.0 <= out[1] <= 1.0


@pytest.mark.parametrize("loop", OUTER_LOOPS)
@settings(max_examples=40, deadline=None)
@given(
    airspeed_kt=st.floats(0.0, 60.0), pitch=st.floats(-0.2, 0.2), altitude=st.floats(-60.0, 60.0),
    stick=st.floats(-1.0, 1.0), lever=st.floats(0.0, 1.0), off_kt=st.floats(-20.0, 20.0),
)  # fmt: skip
def test_taking_over_does_not_move_the_controls(
    loop: str, airspeed_kt: float, pitch: float, altitude: float, stick: float, lever: float, off_kt: float
) -> None:
    """The first output is the present stick and lever; the second is within what a hand can move in a frame."""
    tables, nacelle = TABLES[loop], deg(85.0)
    present = np.array([stick, lever])
    state, x, _, reference = engaged(
        loop, kt(airspeed_kt), nacelle, change={U: kt(off_kt), PITCH: pitch, ALTITUDE: altitude}, present=present
    )
    out = np.zeros(2)
    mocm_output(tables, state, x, nacelle, 0.0, reference, SILENCE, out)
    assert out == pytest.approx(present, abs=1e-9)
    mocm_advance(tables, state, x, nacelle, 0.0, reference, out, SILENCE, DT)
    mocm_output(tables, state, x, nacelle, 0.0, reference, SILENCE, out)
    assert np.all(np.abs(out - present) < 0.01 * np.array([2.0, 1.0]))


def fly(
    loop: str, state: np.ndarray, x: np.ndarray, reference: np.ndarray, nacelle: float, frames: int,
    *, hold: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Fly LPV aircraft and pilot; ``hold`` overrules the controls. Returns controls per frame."""
    path, work = np.zeros((3, 3)), np.zeros(work_size(LPV))
    path[:, 0] = nacelle
    inputs, out = np.zeros(len(DATABASE.inputs)), np.zeros(2)
    rows = np.zeros((frames, 2))
    for frame in range(frames):
        mocm_output(TABLES[loop], state, x, nacelle, 0.0, reference, SILENCE, out)
        if hold is not None:
            out[:] = hold
        mocm_advance(TABLES[loop], state, x, nacelle, 0.0, reference, out, SILENCE, DT)
        inputs[HANDS] = out
        lpv_step(LPV, x, inputs, path, DT, work)
        rows[frame] = out
    return rows


@pytest.mark.parametrize("loop", OUTER_LOOPS)
@pytest.mark.parametrize(("airspeed_kt", "nacelle_deg"), [(0, 90), (40, 82.5), (81, 75), (109, 50), (150, 0), (170, 0)])
def test_trim_is_held_exactly(loop: str, airspeed_kt: float, nacelle_deg: float) -> None:
    level = DATABASE.level_layer
    i, j = (int(np.argmin(np.abs(axis - value))) for axis, value in
            ((DATABASE.airspeed, kt(airspeed_kt)), (DATABASE.nacelle, deg(nacelle_deg))))  # fmt: skip
    airspeed, nacelle = float(DATABASE.airspeed[i]), float(DATABASE.nacelle[j])
    assert DATABASE.valid[level, i, j]
    state, x, hands, reference = engaged(loop, airspeed, nacelle)
    rows = fly(loop, state, x, reference, nacelle, 2500)
    assert np.max(np.abs(rows - hands)) < 1e-4
    assert x[ALTITUDE] == pytest.approx(100.0, abs=1e-2)


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_a_lost_altitude_is_captured_gently(loop: str) -> None:
    """50 m below: the pilot climbs at a rate it chooses, overshoots little and comes to rest at the reference."""
    nacelle = deg(75.0)
    state, x, _, reference = engaged(loop, kt(80.0), nacelle, change={ALTITUDE: -50.0})
    heights, climbs = [], []
    for _ in range(200):
        before = x[ALTITUDE]
        fly(loop, state, x, reference, nacelle, 100)
        heights.append(x[ALTITUDE])
        climbs.append((x[ALTITUDE] - before) / 0.4)
    assert max(heights) < 105.0
    assert max(climbs) < 6.0
    assert heights[-1] == pytest.approx(100.0, abs=0.5)
    assert np.all(state[-OFFSETS:] == pytest.approx(0.0, abs=1e-3))


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_overruled_controls_reach_the_internal_model(loop: str) -> None:
    """Stick held off by protection for 3 s: the estimate follows the aircraft and the integrals stand still."""
    nacelle = deg(75.0)
    state, x, hands, reference = engaged(loop, kt(80.0), nacelle)
    integrals_at = pilot_state_size(TABLES[loop]) - OFFSETS - int(TABLES[loop].roles.plant) - 2
    integrals = state[integrals_at : integrals_at + 2].copy()
    fly(loop, state, x, reference, nacelle, 750, hold=hands + np.array([0.03, 0.0]))
    assert state[S_LIMITED] == 1.0
    assert np.array_equal(state[integrals_at : integrals_at + 2], integrals)
    deviation = x[PITCH] - float(blend(TABLES[loop].trim, DATABASE, kt(80.0), nacelle)[0])
    assert abs(deviation) > deg(1.5)
    assert state[S_ESTIMATE + 3] == pytest.approx(deviation, abs=0.15 * abs(deviation))
    fly(loop, state, x, reference, nacelle, 10_000)
    assert state[S_LIMITED] == 0.0
    assert x[ALTITUDE] == pytest.approx(100.0, abs=2.0)


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_hands_are_no_faster_than_their_limits(loop: str) -> None:
    nacelle = deg(75.0)
    state, x, _, reference = engaged(loop, kt(80.0), nacelle)
    x[PITCH] += deg(60.0)  # an upset the pilot did not see coming
    x[Q] += deg(40.0)
    hands_at = S_ESTIMATE + int(TABLES[loop].roles.plant + TABLES[loop].roles.delay + TABLES[loop].roles.hands)
    out = np.zeros(2)
    limited = False
    for _ in range(200):
        before = state[hands_at : hands_at + 2].copy()
        mocm_output(TABLES[loop], state, x, nacelle, 0.0, reference, SILENCE, out)
        mocm_advance(TABLES[loop], state, x, nacelle, 0.0, reference, out, SILENCE, DT)
        moved = np.abs(state[hands_at : hands_at + 2] - before) / DT
        # the limit is set at the start of a frame and held over it; the hand's own lag goes on meanwhile
        assert np.all(moved <= TABLES[loop].limits[2] * 1.3)
        limited |= bool(state[S_LIMITED])
    assert limited


@pytest.mark.parametrize("loop", OUTER_LOOPS)
def test_noise_is_the_callers_and_scales_with_its_intensity(loop: str) -> None:
    """No hidden stream: the same normals give the same flight; zero normals give the noise-free one."""
    tables, nacelle = TABLES[loop], deg(90.0)
    runs = {}
    for name, seed in (("off", None), ("zero", 0), ("one", 1), ("again", 1), ("other", 2)):
        state, x, _, reference = engaged(loop, 0.0, nacelle)
        rng, out, sticks = np.random.default_rng(seed), np.zeros(2), []
        for _ in range(500):
            noise = SILENCE if seed is None else rng.standard_normal(noise_width(tables)) * (seed > 0)
            mocm_output(tables, state, x, nacelle, 0.0, reference, noise, out)
            mocm_advance(tables, state, x, nacelle, 0.0, reference, out, noise, DT)
            sticks.append(out[0])
        runs[name] = np.array(sticks)
    assert np.array_equal(runs["off"], runs["zero"])
    assert np.array_equal(runs["one"], runs["again"])
    assert not np.array_equal(runs["one"], runs["other"])
    assert 0.001 < np.std(runs["one"]) < 0.3
