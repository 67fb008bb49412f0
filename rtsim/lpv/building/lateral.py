"""Builds the lateral half of a database: loaded trims, trims in sideslip, and the blocks of the linear model.

Each nacelle row is one task of fixed content, as in ``rtsim.lpv.building.build``. Trims are continued: loaded ones from
the level one, those in sideslip from one sideward velocity to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rtsim.aircraft.points import Condition, TrimPoint
from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES, INPUT, PLACE_STATES, whole
from rtsim.aircraft.xv15.steady import newton, steady_point, unknowns_of
from rtsim.aircraft.xv15.steady_kernels import SIDE, UNKNOWN, Steady
from rtsim.arrays import FloatArray
from rtsim.lpv.building.xv15_grid import Xv15Grid, flown_model
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.units import kt
from rtsim.worker_pool import work

LOAD_FACTORS = (1.2, 1.4)
"""Load factors of the loaded trims: turns to 34 and 44 deg of bank."""
LATERAL_KT = (2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 20.0, 25.0, 30.0)
"""Sideward velocities of the trims in sideslip [kn]: close where the fins' sidewash and the rotors' wake at the tail
bend."""
_MOST_CONTROL = 1.6
"""Trims with a control further beyond its stop than this are no help to anyone."""
Arrays = dict[str, FloatArray]


def with_lateral(
    database: Database, grid: Xv15Grid, *, jobs: int = 2, progress: Callable[[float], None] | None = None
) -> Database:
    """Give a database its lateral half.

    Args:
        database: The symmetric database, as built.
        grid: The aircraft it was built from.
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the share of the work done since the last call; the shares add up to 1.
    """
    rows = range(database.nacelle.size)
    level = database.level_layer
    tasks = []
    for n in rows:
        points = [
            (database.x_ref[level, v, n], database.u_ref[level, v, n], database.y_ref[level, v, n])
            if database.valid[level, v, n]
            else None
            for v in range(database.airspeed.size)
        ]
        tasks.append((grid, database.airspeed, float(database.nacelle[n]), points))
    found: list[list[Arrays]] = []
    for row in work(_finish_row, tasks, jobs=jobs):
        found.append(_without_holes(row, database.airspeed))
        if progress is not None:
            progress(1.0 / len(tasks))
    # [nacelle][airspeed] of arrays with the leading axis of the trims, to [trims, airspeed, nacelle, ...].
    arrays = {
        name: np.stack([np.stack([cell[name] for cell in row], axis=1) for row in found], axis=2)
        for name in found[0][0]
    }
    tables = grid.aircraft.tables
    nacelle = np.maximum(database.nacelle, 0.0)
    laws = [tables.lateral.mass.roll, tables.lateral.mass.yaw, tables.lateral.mass.product]
    xx, zz, xz = (law[0] + law[1] * nacelle for law in laws)
    yy = tables.mass.pitch_inertia_airplane + tables.mass.pitch_inertia_slope * nacelle
    data = LateralData(
        load_factor=np.array(LOAD_FACTORS),
        lateral_velocity=kt(1.0) * np.array(LATERAL_KT),
        inertia=np.column_stack([xx, yy, zz, xz]),
        **arrays,
    )
    return replace(database, lateral=data.stored())


def _without_holes(row: list[Arrays | None], airspeed: FloatArray) -> list[Arrays]:
    """Fill airspeeds without a level trim from the nearest that has one, and mark them."""
    good = [v for v, cell in enumerate(row) if cell is not None]
    filled = []
    for v, cell in enumerate(row):
        if cell is None:
            source = row[min(good, key=lambda g: abs(airspeed[g] - airspeed[v]))]
            assert source is not None
            cell = {name: array * 0.0 if name.endswith("valid") else array for name, array in source.items()}  # noqa: PLW2901
        filled.append(cell)
    return filled


def _finish_row(
    grid: Xv15Grid, airspeed: FloatArray, nacelle: float, points: list[tuple[FloatArray, ...] | None]
) -> list[Arrays | None]:
    return [
        None if point is None else _Cell(grid, float(speed), nacelle).arrays(point)
        for speed, point in zip(airspeed, points, strict=True)
    ]


@dataclass
class _Cell:
    """One grid point."""

    grid: Xv15Grid
    airspeed: float
    nacelle: float
    rows: dict[str, list[Any]] = field(default_factory=dict)

    def arrays(self, point: tuple[FloatArray, ...]) -> Arrays:
        """All trims and derivatives of this grid point, each with a leading axis."""
        self._put_lateral(point[0], point[1])
        self._load(point)
        self._slip(point)
        return {name: np.array(values, dtype=float) for name, values in self.rows.items()}

    def _put(self, **values: Any) -> None:
        for name, value in values.items():
            self.rows.setdefault(name, []).append(value)

    def _condition(self, load_factor: float = 1.0) -> Condition:
        return replace(self.grid.condition_at(self.airspeed, self.nacelle, 0.0), load_factor=load_factor)

    def _put_lateral(self, x: FloatArray, u: FloatArray) -> None:
        trim = TrimPoint(x, u, np.zeros(0), np.zeros(0), converged=True, residual=0.0)
        model = self.grid.aircraft.linearize_lateral(self._condition(), trim)
        self._put(A=model.A, B=model.B, C=model.C, D=model.D)

    def _load(self, point: tuple[FloatArray, ...]) -> None:
        """Trims that carry more than the weight, and the linear models there."""
        x, u, y = point
        trim = TrimPoint(x, u, y, np.zeros_like(x), converged=True, residual=0.0)
        exists = True
        for load_factor in LOAD_FACTORS:
            condition = self._condition(load_factor)
            found = self.grid.aircraft.trim(condition, trim) if exists else trim
            exists = exists and found.converged and self.grid.near(found, trim, self.airspeed)
            trim = found if exists else trim
            model = flown_model(self.grid.aircraft, self._condition(), trim)
            self._put(
                loaded_x_ref=trim.x, loaded_u_ref=trim.u, loaded_y_ref=trim.y, loaded_xdot_ref=trim.xdot,
                loaded_A=model.A, loaded_B=model.B, loaded_C=model.C, loaded_D=model.D, loaded_valid=float(exists),
            )  # fmt: skip
            self._put_lateral(trim.x, trim.u)

    def _slip(self, point: tuple[FloatArray, ...]) -> None:
        """Trims with sideward velocity at the same forward airspeed."""
        condition = self._condition()
        tables = self.grid.aircraft.at(condition).tables
        x, u, y = point
        z, jacobian = unknowns_of(whole(x, ALL_STATES), whole(u, ALL_INPUTS)), np.zeros((UNKNOWN.size,) * 2)
        last = TrimPoint(
            whole(x, ALL_STATES), whole(u, ALL_INPUTS), whole(y, ALL_OUTPUTS), np.zeros(0), converged=True, residual=0.0
        )
        before, done, exists = None, 0.0, True
        for velocity in LATERAL_KT:
            side = kt(velocity)
            flight = Steady(condition.airspeed, 0.0, condition.nacelle_angle, float(SIDE.body), side)
            guess = z if before is None else z + (side - done) / (done - before[0]) * (z - before[1])
            found = newton(tables, flight, guess, jacobian) if exists else None
            if found is not None:
                trial = steady_point(tables, flight, found)
                exists = max(abs(trial.u[[INPUT.stick, INPUT.lateral_stick, INPUT.pedal]])) < _MOST_CONTROL
            else:
                exists = False
            if exists and found is not None:
                before, z, done, last = (done, z), found, side, trial
            self._put(
                slip_x_ref=last.x[: -len(PLACE_STATES)], slip_u_ref=last.u, slip_y_ref=last.y, slip_valid=float(exists)
            )
