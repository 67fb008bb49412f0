"""Stability and margins of the loop as it is flown: sampled, with the kernels of the aircraft and of the pilot.

The loop is frozen at one commanded airspeed, nacelle angle and acceleration. Its one-frame map (4 ms) is differentiated
numerically through the very kernels that fly: interpolated tables, trim map, integrators or outer loops, delay, limits
and the aircraft's own scheduling on its states are all in it. ``s = log(z) / dt`` turns eigenvalues into rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtsim.aircraft.variables import required_position
from rtsim.arrays import ComplexArray, FloatArray
from rtsim.choices import OuterLoop
from rtsim.lpv.database import Database
from rtsim.lpv.lpv_kernels import LpvTables, lpv_step, work_size
from rtsim.lpv.tables import Form, prepare_tables
from rtsim.pilot import pilot_kernels as kernels
from rtsim.pilot.design_plant import CONTROLS
from rtsim.pilot.pilot_kernels import PilotTables
from rtsim.pilot.response import Margins, margins, one_at_a_time
from rtsim.pilot.tables import load_pilot_tables

_STEP = 1e-5
"""Step of the numerical derivatives, for every state and control (SI, radians)."""


@dataclass(frozen=True, slots=True)
class FrozenLoop:
    """One-frame maps of aircraft and pilot about a commanded condition, deviations, order [aircraft | pilot]."""

    plant_a: FloatArray
    """Aircraft state to aircraft state (nx, nx)."""
    plant_b: FloatArray
    """Controls to aircraft state (nx, nu)."""
    pilot_a: FloatArray
    """Pilot state to pilot state (ns, ns)."""
    pilot_b: FloatArray
    """Aircraft state to pilot state (ns, nx)."""
    pilot_c: FloatArray
    """Pilot state to controls (nu, ns)."""
    dt: float
    """Length of a frame [s]."""
    names: tuple[str, ...]
    """Names of the aircraft's states."""

    @property
    def matrix(self) -> FloatArray:
        """The one-frame map of the closed loop (nx + ns, nx + ns)."""
        return np.block([[self.plant_a, self.plant_b @ self.pilot_c], [self.pilot_b, self.pilot_a]])

    def eigenvalues(self) -> ComplexArray:
        """Rates ``log(z) / dt`` of the closed loop's modes [rad/s], slowest first; modes gone in a frame left out."""
        z = np.linalg.eigvals(self.matrix)
        z = z[np.abs(z) > 1e-6].astype(np.complex128)
        s = np.log(z) / self.dt
        return np.asarray(s[np.argsort(-s.real)])

    def growth(self) -> float:
        """Largest real part of the eigenvalues [rad/s]; negative where the loop is stable."""
        return float(self.eigenvalues()[0].real)

    def return_ratio(self, frequencies: FloatArray) -> ComplexArray:
        """Return ratio at each control with the other closed.

        Args:
            frequencies: w [rad/s] (k,).

        Returns:
            L_j, positive for negative feedback (k, nu).
        """
        z = np.exp(1j * np.asarray(frequencies) * self.dt)[:, None, None]
        plant = np.linalg.solve(z * np.eye(self.plant_a.shape[0]) - self.plant_a, self.plant_b.astype(np.complex128))
        pilot = np.linalg.solve(z * np.eye(self.pilot_a.shape[0]) - self.pilot_a, self.pilot_b @ plant)
        return one_at_a_time(np.asarray(-(self.pilot_c @ pilot), dtype=np.complex128))

    def margins(self) -> Margins:
        """Crossover, phase and gain margin of each control."""
        modes = np.abs(np.log(np.linalg.eigvals(self.plant_a).astype(np.complex128) + 1e-300).imag) / self.dt
        nearby = (modes[:, None] * np.array([0.98, 1.0, 1.02])).ravel()
        return margins(self.return_ratio, nearby)


@dataclass(frozen=True, slots=True)
class FrozenCommand:
    """A frozen command. SI and radians."""

    airspeed: float
    """Commanded airspeed [m/s]."""
    nacelle_angle: float
    """Nacelle angle [rad]."""
    acceleration: float = 0.0
    """Commanded acceleration [m/s^2]."""
    altitude: float = 100.0
    """Commanded altitude [m]."""


class _Frame:
    """The two halves of one frame as functions of flat states, allocated once."""

    def __init__(
        self, database: Database, lpv: LpvTables, pilot: PilotTables, condition: FrozenCommand, dt: float
    ) -> None:
        self.lpv, self.pilot, self.dt = lpv, pilot, dt
        self.nacelle = condition.nacelle_angle
        self.reference = np.array([condition.airspeed, condition.acceleration, condition.altitude, 0.0, 0.0])
        self.path = np.zeros((3, 3))
        self.path[:, 0] = condition.nacelle_angle
        self.work = np.zeros(work_size(lpv))
        self.hands = [required_position(database.inputs, name, "the pilot") for name in CONTROLS]
        self.inputs = np.zeros(len(database.inputs))
        self.silence = np.zeros(0)
        self.out = np.zeros(len(CONTROLS))

    def plant(self, x: FloatArray, controls: FloatArray) -> FloatArray:
        after = x.copy()
        self.inputs[self.hands] = controls
        lpv_step(self.lpv, after, self.inputs, self.path, self.dt, self.work)
        return after

    def output(self, x: FloatArray, state: FloatArray) -> FloatArray:
        kernels.mocm_output(self.pilot, state, x, self.nacelle, 0.0, self.reference, self.silence, self.out)
        return self.out.copy()

    def advance(self, x: FloatArray, state: FloatArray) -> FloatArray:
        applied = self.output(x, state)
        after = state.copy()
        kernels.mocm_advance(self.pilot, after, x, self.nacelle, 0.0, self.reference, applied, self.silence, self.dt)
        return after


def jacobian(function: Callable[[FloatArray], FloatArray], at: FloatArray, step: FloatArray) -> FloatArray:
    """Jacobian by central differences.

    Args:
        function: Of a vector.
        at: Where.
        step: Step of each component.
    """
    columns = []
    for k in range(at.size):
        ahead, behind = at.copy(), at.copy()
        ahead[k] += step[k]
        behind[k] -= step[k]
        columns.append((function(ahead) - function(behind)) / (2.0 * step[k]))
    return np.array(columns).T


def trim_state(database: Database, condition: FrozenCommand) -> tuple[FloatArray, FloatArray]:
    """Interpolated trim state and controls of the condition.

    Args:
        database: The trims.
        condition: The command.
    """
    level = database.level_layer
    layers = database.layer_acceleration

    def at_layer(array: FloatArray, layer: int) -> FloatArray:
        v = np.clip(condition.airspeed, database.airspeed[0], database.airspeed[-1])
        n = np.clip(condition.nacelle_angle, database.nacelle[0], database.nacelle[-1])
        i = int(np.clip(np.searchsorted(database.airspeed, v, side="right") - 1, 0, database.airspeed.size - 2))
        j = int(np.clip(np.searchsorted(database.nacelle, n, side="right") - 1, 0, database.nacelle.size - 2))
        s = (v - database.airspeed[i]) / (database.airspeed[i + 1] - database.airspeed[i])
        t = (n - database.nacelle[j]) / (database.nacelle[j + 1] - database.nacelle[j])
        cell = array[layer]
        low, high = (1.0 - t) * cell[i, j] + t * cell[i, j + 1], (1.0 - t) * cell[i + 1, j] + t * cell[i + 1, j + 1]
        return np.asarray((1.0 - s) * low + s * high)

    layer = int(np.argmin(np.abs(layers - condition.acceleration))) if condition.acceleration else level
    x = at_layer(database.x_ref, layer)
    x[required_position(database.states, "altitude", "the pilot")] = condition.altitude
    return x, at_layer(database.u_ref, layer)


def frozen_loop(
    database: Database,
    condition: FrozenCommand,
    *,
    outer_loop: OuterLoop = "integrators",
    dt: float = 0.004,
    form: Form = "layered",
    tables: tuple[LpvTables, PilotTables] | None = None,
) -> FrozenLoop:
    """Linearize aircraft and pilot as flown, frozen at one command.

    Args:
        condition: The command.
        outer_loop: How airspeed and altitude are held.
        form: Form of the LPV aircraft.
        tables: Prepared tables of aircraft and pilot, to save time on maps; None: prepared from the database.

    Returns:
        The one-frame maps.
    """
    lpv, pilot = tables if tables is not None else _tables(database, outer_loop, dt, form)
    frame = _Frame(database, lpv, pilot, condition, dt)
    x, u = trim_state(database, condition)
    state = np.zeros(kernels.pilot_state_size(pilot))
    # Between grid points the trims of aircraft and pilot come from the same tables and agree to second order of the
    # cell; on an accelerated layer the point is none of rest, and the map's derivative there is what is wanted.
    kernels.mocm_engage(pilot, state, x, condition.nacelle_angle, 0.0, frame.reference, u[frame.hands])
    present = frame.output(x, state)
    step_x, step_u = np.full(x.size, _STEP), np.full(present.size, _STEP)
    step_s = np.full(state.size, _STEP)
    return FrozenLoop(
        plant_a=jacobian(lambda v: frame.plant(v, present), x, step_x),
        plant_b=jacobian(lambda v: frame.plant(x, v), present, step_u),
        pilot_a=jacobian(lambda v: frame.advance(x, v), state, step_s),
        pilot_b=jacobian(lambda v: frame.advance(v, state), x, step_x),
        pilot_c=jacobian(lambda v: frame.output(x, v), state, step_s),
        dt=dt,
        names=tuple(variable.name for variable in database.states),
    )


def _tables(database: Database, outer_loop: OuterLoop, dt: float, form: Form) -> tuple[LpvTables, PilotTables]:
    return prepare_tables(database, form), load_pilot_tables(database, outer_loop, dt=dt)


@dataclass(frozen=True, slots=True)
class StabilityMap:
    """Growth rates of the frozen loop over the grid; NaN where there is no trim."""

    airspeed: FloatArray
    """Airspeeds (V,) [m/s]."""
    nacelle: FloatArray
    """Nacelle angles (N,) [rad]."""
    growth: FloatArray
    """Largest real part of the eigenvalues (V, N) [rad/s]."""

    @property
    def unstable(self) -> list[tuple[float, float, float]]:
        """Airspeed [m/s], nacelle angle [rad] and growth [rad/s] of every unstable point, worst first."""
        places = np.argwhere(self.growth >= 0.0)
        rows = [(float(self.airspeed[i]), float(self.nacelle[j]), float(self.growth[i, j])) for i, j in places]
        return sorted(rows, key=lambda row: -row[2])


def stability_map(
    database: Database,
    *,
    outer_loop: OuterLoop = "integrators",
    mid_cells: bool = False,
    layer: int | None = None,
    dt: float = 0.004,
    tables: tuple[LpvTables, PilotTables] | None = None,
) -> StabilityMap:
    """Map the frozen loop's growth over all valid grid points or the middles of all valid cells.

    Args:
        outer_loop: How airspeed and altitude are held.
        mid_cells: Middles of cells instead of grid points.
        layer: Layer of the trims; None: level flight.
        tables: Prepared tables; None: prepared from the database.

    Returns:
        The map.
    """
    number = database.level_layer if layer is None else layer
    valid: npt.NDArray[np.bool_] = database.valid[number]
    v, n = database.airspeed, database.nacelle
    if mid_cells:
        valid = valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:] & valid[1:, 1:]
        v, n = 0.5 * (v[1:] + v[:-1]), 0.5 * (n[1:] + n[:-1])
    chosen = tables if tables is not None else _tables(database, outer_loop, dt, "layered")
    growth = np.full(valid.shape, np.nan)
    acceleration = float(database.layer_acceleration[number])
    for i, j in np.argwhere(valid):
        condition = FrozenCommand(float(v[i]), float(n[j]), acceleration)
        growth[i, j] = frozen_loop(database, condition, dt=dt, tables=chosen).growth()
    return StabilityMap(airspeed=v, nacelle=n, growth=growth)
