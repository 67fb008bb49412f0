"""The LPV aircraft as an object: trim, linear model, outputs and the compiled step, from a database."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rtsim.aircraft.condition import AircraftCondition
from rtsim.aircraft.points import TrimPoint
from rtsim.aircraft.variables import position, required_position
from rtsim.arguments import number, vector
from rtsim.arrays import FloatArray
from rtsim.errors import InputError, TrimError, suggestion
from rtsim.kernels.compiled import interpreted
from rtsim.kernels.grid_kernels import cell
from rtsim.kernels.packed import packed
from rtsim.kernels.parts import entry_point
from rtsim.lpv import lpv_kernels as kernels
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.tables import FORMS, REFRESHES, Form, Refresh, prepare_tables
from rtsim.units import to_deg, to_kt

if TYPE_CHECKING:
    import control


_DERIVATIVE, _OUTPUTS = interpreted(kernels.lpv_derivative), interpreted(kernels.lpv_outputs)
_cell = interpreted(cell)
TRIM_TOLERANCE = 1e-9
"""Largest state derivative left by a trim of the LPV aircraft."""


@dataclass(frozen=True, slots=True)
class LpvAircraft:
    """The quasi-LPV aircraft. SI and radians; the order of states, inputs and outputs is the database's."""

    database: Database
    """Trim map and linear models."""
    form: Form = "layered"
    """``layered`` (scheduled on airspeed, nacelle angle and angle of attack), ``stitched`` or the paper's ``plain``."""
    refresh: Refresh = "step"
    """How often a step interpolates, see ``rtsim.lpv.tables.REFRESHES``."""
    tables: kernels.LpvTables = field(init=False, repr=False)
    """What the compiled kernels take."""
    _work: FloatArray = field(init=False, repr=False)
    _stepping: kernels.Stepping = field(init=False, repr=False)
    _step: Callable[..., float] | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        """Pack the database for the kernels."""
        for key, value, known in (("form", self.form, FORMS), ("refresh", self.refresh, REFRESHES)):
            if value not in known:
                mend = suggestion(str(value), known, otherwise="choose one")
                raise InputError("is not known", key=key, value=value, allowed=", ".join(known), mend=mend)
        tables = prepare_tables(self.database, self.form, refresh=self.refresh)
        object.__setattr__(self, "tables", tables)
        object.__setattr__(self, "_work", np.zeros(interpreted(kernels.work_size)(tables)))
        stepping = kernels.Stepping(tables, self._work, np.zeros((3, 3)))
        object.__setattr__(self, "_stepping", packed(stepping))

    @property
    def flags(self) -> int:
        """Flags of the last derivative, output or step: 0 inside the grid, else bits ``lpv_kernels.FLAG_*``."""
        return int(self._work[kernels.WORK.flags])

    def derivative(self, x: FloatArray, u: FloatArray, nacelle_angle: float) -> FloatArray:
        """State derivative.

        Args:
            u: Total input (nu,), nacelle rate and acceleration included.

        Returns:
            The state derivative (nx,).
        """
        x, u = vector(x, "x", len(self.database.states)), vector(u, "u", len(self.database.inputs))
        xdot = np.empty(x.size)
        self._work[kernels.WORK.flags] = 0.0
        kernels.lpv_derivative(self.tables, x, u, nacelle_angle, xdot, self._work)
        return xdot

    def outputs(self, x: FloatArray, u: FloatArray, nacelle_angle: float) -> FloatArray:
        """Outputs.

        Args:
            u: Total input (nu,), nacelle rate and acceleration included.

        Returns:
            The outputs (ny,).
        """
        x, u = vector(x, "x", len(self.database.states)), vector(u, "u", len(self.database.inputs))
        y = np.empty(len(self.database.outputs))
        self._work[kernels.WORK.flags] = 0.0
        kernels.lpv_outputs(self.tables, x, u, nacelle_angle, y, self._work)
        return y

    def step(
        self,
        x: FloatArray,
        u: FloatArray,
        *,
        nacelle_angle: float,
        nacelle_rate: float = 0.0,
        nacelle_acceleration: float = 0.0,
        dt: float = 0.004,
    ) -> FloatArray:
        """Advance by one fixed Runge-Kutta step.

        Args:
            x: Total state at the start (nx,).
            u: Inputs held over the step (nu,); nacelle rate and acceleration are taken from the arguments below.
            nacelle_angle: Nacelle angle at the start [rad].
            nacelle_rate: Nacelle rate at the start [rad/s].
            nacelle_acceleration: Nacelle acceleration over the step [rad/s^2].

        Returns:
            A new array: the state at the end (nx,). ``flags`` tells whether the grid was left.
        """
        # The held entry point looks at no types: these are the ones it was compiled for.
        end, u = np.array(x, dtype=np.float64, order="C"), np.ascontiguousarray(u, dtype=np.float64)
        d = self.database
        if end.shape != d.x_ref.shape[-1:] or u.shape != d.u_ref.shape[-1:]:  # it would write where nothing is its own
            end, u = vector(x, "x", len(d.states)), vector(u, "u", len(d.inputs))
        step = self._step
        if step is None:
            arguments = (self._stepping, end, u, nacelle_angle, nacelle_rate, nacelle_acceleration, dt)
            step = entry_point(kernels.lpv_step_steady, *arguments)
            object.__setattr__(self, "_step", step)
        step(self._stepping, end, u, nacelle_angle, nacelle_rate, nacelle_acceleration, dt)
        return end

    def trim(self, *, airspeed: float, nacelle: float, acceleration: float = 0.0) -> TrimPoint:
        """Find the level-flight trim of the LPV aircraft itself; at grid points it is the database's.

        Args:
            acceleration: Level acceleration [m/s^2].

        Returns:
            The trim; ``converged`` is False where it did not close or the database has no trim there.

        Raises:
            InputError: Airspeed or nacelle angle outside the grid.
        """
        self._require_inside(airspeed, nacelle)
        number(acceleration, "acceleration", "m/s^2")
        x, u, free = self._interpolated_trim(airspeed, nacelle, acceleration)
        unknown = np.concatenate([np.flatnonzero(np.arange(x.size) != self._altitude()), x.size + free])
        z = np.concatenate([x, u])
        # Where the database holds the trim itself nothing is solved, and nothing is compiled for it.
        residual = self._trim_residual(_DERIVATIVE, z, airspeed, nacelle, acceleration)
        solved = np.max(np.abs(residual)) < TRIM_TOLERANCE
        derivative, outputs = (_DERIVATIVE, _OUTPUTS) if solved else (kernels.lpv_derivative, kernels.lpv_outputs)
        for _ in range(20):
            if np.max(np.abs(residual)) < TRIM_TOLERANCE:
                break
            jacobian = np.empty((residual.size, unknown.size))
            for column, k in enumerate(unknown):
                step = 1e-6 * max(1.0, abs(z[k]))
                shifted = z.copy()
                shifted[k] += step
                jacobian[:, column] = (
                    self._trim_residual(derivative, shifted, airspeed, nacelle, acceleration) - residual
                ) / step
            z[unknown] -= np.linalg.lstsq(jacobian, residual, rcond=None)[0]
            residual = self._trim_residual(derivative, z, airspeed, nacelle, acceleration)
        x, u = z[: x.size].copy(), z[x.size :].copy()
        xdot, y = np.empty(x.size), np.empty(len(self.database.outputs))
        self._work[kernels.WORK.flags] = 0.0
        derivative(self.tables, x, u, nacelle, xdot, self._work)
        inside = self.flags == 0
        outputs(self.tables, x, u, nacelle, y, self._work)
        worst = float(np.max(np.abs(residual)))
        return TrimPoint(x, u, y, xdot, bool(inside and worst < 1e-6), worst)

    def linearize(self, *, airspeed: float, nacelle: float) -> control.StateSpace:
        """Linear model of level flight, interpolated between the grid points.

        Returns:
            The model with named states, inputs and outputs (``control.StateSpace``), in deviations from the trim.

        Raises:
            InputError: Airspeed or nacelle angle outside the grid.
            TrimError: A grid point around has no trim to linearize at; ``matrices`` gives what fills it.
        """
        import control

        self._require_inside(airspeed, nacelle)
        if not self.is_valid(airspeed=airspeed, nacelle=nacelle):
            where = f"{to_kt(airspeed):.4g} kn at nacelle {to_deg(nacelle):.4g} deg"
            raise TrimError(f"the database has no level-flight trim around {where}", mend="see database.valid")
        A, B, C, D = self.matrices(airspeed=airspeed, nacelle=nacelle)
        return control.StateSpace(
            A, B, C, D,
            states=[variable.name for variable in self.database.states],
            inputs=[variable.name for variable in self.database.inputs],
            outputs=[variable.name for variable in self.database.outputs],
            name=f"{to_kt(airspeed):.0f} kn, nacelle {to_deg(nacelle):.0f} deg",
        )  # fmt: skip

    def matrices(self, *, airspeed: float, nacelle: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Matrices of the linear model of level flight, interpolated between the grid points.

        Returns:
            A (nx, nx), B (nx, nu), C (ny, nx), D (ny, nu).

        Raises:
            InputError: Airspeed or nacelle angle outside the grid.
        """
        self._require_inside(airspeed, nacelle)
        d, level = self.database, self.database.level_layer
        A, B, C, D = (self.interpolated(array[level], airspeed, nacelle) for array in (d.A, d.B, d.C, d.D))
        return A, B, C, D

    def flap(self, *, airspeed: float, nacelle: float) -> float:
        """Flap deflection of the schedule, interpolated between the grid points [rad]."""
        return float(self.interpolated(self.database.flap, airspeed, nacelle))

    def is_valid(self, *, airspeed: float, nacelle: float) -> bool:
        """Whether all grid points around a condition have a level trim."""
        d = self.database
        if not (d.airspeed[0] <= airspeed <= d.airspeed[-1] and d.nacelle[0] <= nacelle <= d.nacelle[-1]):
            return False
        return bool(self.interpolated(d.valid[d.level_layer].astype(float), airspeed, nacelle) > 1.0 - 1e-9)

    def _altitude(self) -> int:
        return position(self.database.states, "altitude")

    def interpolated(self, array: FloatArray, airspeed: float, nacelle: float) -> FloatArray:
        """Interpolate an array on the database's grid.

        Args:
            array: Leading axes [airspeed, nacelle].
        """
        d = self.database
        (i, s), (j, t) = _cell(d.airspeed, airspeed), _cell(d.nacelle, nacelle)
        near = (1.0 - t) * array[i, j] + t * array[i, j + 1]
        far = (1.0 - t) * array[i + 1, j] + t * array[i + 1, j + 1]
        return np.asarray((1.0 - s) * near + s * far)

    def _interpolated_trim(
        self, airspeed: float, nacelle: float, acceleration: float
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
        """Starting values of the trim, and the inputs that trims of this database use."""
        d = self.database
        free = np.flatnonzero(np.ptp(d.u_ref[d.valid], axis=0) > 0.0)
        if d.layer_acceleration.size == 1:
            layer, share = 0, 0.0
        else:
            layer, share = _cell(d.layer_acceleration, acceleration)
        parts = []
        for array in (d.x_ref, d.u_ref):
            near = self.interpolated(array[layer], airspeed, nacelle)
            far = near if share == 0.0 else self.interpolated(array[layer + 1], airspeed, nacelle)
            parts.append((1.0 - share) * near + share * far)
        return parts[0], parts[1], free

    def _trim_residual(
        self, derivative: Callable[..., None], z: FloatArray, airspeed: float, nacelle: float, acceleration: float
    ) -> FloatArray:
        """State derivative minus the wanted one, and the airspeed that is missing."""
        d = self.database
        nx = len(d.states)
        x, u = z[:nx], z[nx:]
        iu, iw, ip = (required_position(d.states, name, "trim") for name in ("u", "w", "pitch"))
        rest = np.empty(nx)
        self._work[kernels.WORK.flags] = 0.0
        derivative(self.tables, x, u, nacelle, rest, self._work)
        rest[iu] -= acceleration * np.cos(x[ip])
        rest[iw] -= acceleration * np.sin(x[ip])
        return np.append(rest, x[iu] * np.cos(x[ip]) + x[iw] * np.sin(x[ip]) - airspeed)

    def _require_inside(self, airspeed: float, nacelle: float) -> None:
        d = self.database
        airspeed, nacelle = number(airspeed, "airspeed", "m/s"), number(nacelle, "nacelle", "rad")
        degrees = f"angles are in radians: write nacelle=deg({nacelle:g}) with rtsim.units.deg"
        nonlinear = "choose a value in this range, or solve the nonlinear model there (--nonlinear)"
        for name, value, axis, shown, unit in (
            ("airspeed", airspeed, d.airspeed, to_kt, "kn"),
            ("nacelle", nacelle, d.nacelle, to_deg, "deg"),
        ):
            slack = 1e-9 * (axis[-1] - axis[0])
            if not axis[0] - slack <= value <= axis[-1] + slack:
                raise InputError(
                    "outside the database",
                    key=name,
                    value=f"{shown(value):g} {unit}",
                    allowed=f"{shown(axis[0]):g} to {shown(axis[-1]):g} {unit}",
                    mend=degrees if name == "nacelle" and abs(value) > 2.0 * np.pi else nonlinear,
                )


def load_aircraft(path: str | Path | AircraftCondition | None = None, **options: Any) -> LpvAircraft:
    """Load the LPV aircraft; without a path, the shipped XV-15.

    Args:
        path: A database file (``.nc`` or ``.mat``), or a condition whose database is kept.
        **options: ``form`` and ``refresh`` of ``LpvAircraft``.

    Returns:
        The aircraft.

    Raises:
        InputError: The file cannot be read or is not a usable database.
    """
    return LpvAircraft(load_database(path), **options)
