"""Checks of a database against itself and of its Jacobians against another step size.

The paper tunes the density of its grid by predicting the trim of a neighbouring grid point from the linear model of the
one at hand: along the airspeed axis A dx + B du = 0 must lead to the neighbour, along the nacelle axis
A dx + B du + (df/dn) dn = 0. The error is second order in the spacing, and ties together the two places where speed
derivatives live: the matrix A and the trim map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rtsim.aircraft.variables import position, required_position
from rtsim.arrays import BoolArray, FloatArray
from rtsim.lpv.cells import fill_invalid
from rtsim.lpv.database import GRIDDED, Database
from rtsim.units import to_deg, to_kt

Axis = Literal["airspeed", "nacelle"]

NEIGHBOUR_LIMIT = 1e-2
"""Largest error that the paper allows."""


@dataclass(frozen=True, slots=True)
class NeighbourError:
    """How well one grid point predicts the trim of the next."""

    axis: Axis
    """The axis along which the two are neighbours."""
    layer: int
    """Number of the layer."""
    start: tuple[int, int]
    """Airspeed and nacelle number of the point whose linear model predicts."""
    end: tuple[int, int]
    """Airspeed and nacelle number of the predicted point."""
    error: float
    """Norm of predicted minus true trim over the norm of the true trim, over (x, u) in the units of the database
    (m/s, rad, rad/s, and controls as fractions of their travel)."""
    worst: str
    """Name of the state or input that contributes most."""
    flap_moves: bool
    """The flap schedule sets the two at different deflections: the schedule has corners there, no linear model can
    predict across them, and the 1e-2 does not apply."""


@dataclass(frozen=True, slots=True)
class NeighbourReport:
    """The neighbour check over a whole database; ``largest`` and ``above`` leave out pairs whose flaps differ."""

    errors: tuple[NeighbourError, ...]
    """Every pair of valid neighbours, in both directions."""

    def largest(self, axis: Axis | None = None) -> NeighbourError:
        """Give the worst pair.

        Args:
            axis: Only along this axis; None takes both.

        Returns:
            The pair with the largest error.

        Raises:
            ValueError: There is no pair.
        """
        return max((e for e in self.errors if axis in {None, e.axis} and not e.flap_moves), key=lambda e: e.error)

    def above(self, limit: float = NEIGHBOUR_LIMIT) -> tuple[NeighbourError, ...]:
        """Give the pairs above a limit, worst first.

        Args:
            limit: The limit of the relative error.

        Returns:
            The pairs.
        """
        return tuple(sorted((e for e in self.errors if e.error > limit and not e.flap_moves), key=lambda e: -e.error))

    def cell_errors(self, axis: Axis, shape: tuple[int, int]) -> FloatArray:
        """Map the errors over the grid.

        Args:
            axis: The axis of the pairs.
            shape: Numbers of airspeeds and nacelle angles.

        Returns:
            Largest error of the pairs that start at each point, NaN where there is none (V, N).
        """
        result = np.full(shape, np.nan)
        for e in self.errors:
            if e.axis == axis:
                result[e.start] = np.nanmax([result[e.start], e.error])
        return result


def check_neighbours(
    database: Database, *, inside: BoolArray | None = None, layer: int | None = None
) -> NeighbourReport:
    """Predict every trim from its neighbours' linear models.

    Args:
        inside: Grid points to take part (V, N), for instance those within the corridor; None takes all valid ones.
        layer: The layer to check; None takes level flight.

    Returns:
        The errors of all pairs of valid neighbours.
    """
    layer = database.level_layer if layer is None else layer
    usable = database.valid[layer] if inside is None else database.valid[layer] & inside
    predict = _predictor(database, layer)
    names = [variable.name for variable in (*database.states, *database.inputs)]
    errors = []
    for axis, start, end in _pairs(usable):
        true = np.concatenate([database.x_ref[layer][end], database.u_ref[layer][end]])
        miss = predict(start, end) - true
        error = float(np.linalg.norm(miss) / np.linalg.norm(true))
        flap_moves = bool(abs(database.flap[start] - database.flap[end]) > 1e-9)
        errors.append(NeighbourError(axis, layer, start, end, error, names[int(np.argmax(np.abs(miss)))], flap_moves))
    return NeighbourReport(tuple(errors))


def _pairs(usable: BoolArray) -> Iterator[tuple[Axis, tuple[int, int], tuple[int, int]]]:
    for i, j in np.argwhere(usable):
        for axis, (a, b) in (("airspeed", (i + 1, j)), ("nacelle", (i, j + 1))):
            if a < usable.shape[0] and b < usable.shape[1] and usable[a, b]:
                one, two = (int(i), int(j)), (int(a), int(b))
                name: Axis = "airspeed" if axis == "airspeed" else "nacelle"
                yield name, one, two
                yield name, two, one


def _predictor(database: Database, layer: int) -> Callable[[tuple[int, int], tuple[int, int]], FloatArray]:
    """Function that predicts (x, u) of one grid point from the linear model of another."""
    nx, nu = len(database.states), len(database.inputs)
    iu, iw, ip = (required_position(database.states, name, "the neighbour check") for name in ("u", "w", "pitch"))
    altitude, drive = position(database.states, "altitude"), position(database.inputs, "rotor_speed")
    free_inputs = np.flatnonzero(np.ptp(database.u_ref[database.valid], axis=0) > 0.0)
    unknown = np.concatenate([np.flatnonzero(np.arange(nx) != altitude), nx + free_inputs])
    acceleration = float(database.layer_acceleration[layer])

    def predict(start: tuple[int, int], end: tuple[int, int]) -> FloatArray:
        x, u = database.x_ref[layer][start], database.u_ref[layer][start]
        sine, cosine = np.sin(x[ip]), np.cos(x[ip])
        system = np.zeros((nx + 1, nx + nu))
        system[:nx, :nx], system[:nx, nx:] = database.A[layer][start], database.B[layer][start]
        # an accelerated trim keeps its acceleration level while the pitch attitude changes
        system[iu, ip] += acceleration * sine
        system[iw, ip] -= acceleration * cosine
        system[nx, iu], system[nx, iw], system[nx, ip] = cosine, sine, -x[iu] * sine + x[iw] * cosine
        wanted = np.zeros(nx + 1)
        turned = max(database.nacelle[end[1]], 0.0) - max(database.nacelle[start[1]], 0.0)
        wanted[:nx] = -database.df_dnacelle[layer][start] * turned
        slower = database.rotor_speed[end[1]] - database.rotor_speed[start[1]]
        if slower != 0.0:
            wanted[:nx] -= database.B[layer][start][:, drive] * slower
        wanted[nx] = database.airspeed[end[0]] - database.airspeed[start[0]]
        # rows of very different size (flapping accelerations, speeds): scaled, so that least squares sees all of them
        size = np.maximum(np.abs(system).max(axis=1), 1e-12)
        change = np.zeros(nx + nu)
        change[unknown] = np.linalg.lstsq(system[:, unknown] / size[:, None], wanted / size, rcond=None)[0]
        return np.concatenate([x, u]) + change

    return predict


def without_poor_edges(database: Database, limit: float = NEIGHBOUR_LIMIT) -> Database:
    """Draw the valid region in where its edge fails the check: next to the trim map's fold no grid is dense enough.

    Of a pair above the limit, the point at the edge of the valid region along the airspeed axis is marked invalid (the
    trim map folds with airspeed), again and again until no such pair is left. Pairs in the interior stay and are
    reported by ``check_neighbours``.

    Args:
        database: A built database.
        limit: Largest error kept.

    Returns:
        The database with fewer valid cells, those filled as all invalid ones are.
    """
    valid = database.valid.copy()
    for layer in range(valid.shape[0]):
        while True:
            report = check_neighbours(database, inside=valid[layer], layer=layer)
            poor = {cell for e in report.above(limit) for cell in (e.start, e.end) if _at_edge(valid[layer], cell)}
            if not poor:
                break
            for cell in poor:
                valid[layer][cell] = False
    arrays = {name: getattr(database, name).copy() for name in GRIDDED} | {"valid": valid}
    fill_invalid(arrays, database.airspeed, database.level_layer)
    return replace(database, **arrays)


def _at_edge(valid: BoolArray, cell: tuple[int, int]) -> bool:
    i, j = cell
    last = valid.shape[0] - 1
    return bool(valid[cell]) and ((i > 0 and not valid[i - 1, j]) or (i < last and not valid[i + 1, j]))


def describe(error: NeighbourError, database: Database) -> str:
    """Put one pair into a sentence.

    Args:
        error: The pair.

    Returns:
        One line of text.
    """
    points = [
        f"{to_kt(database.airspeed[v]):.1f} kn, {to_deg(database.nacelle[n]):.1f} deg"
        for v, n in (error.start, error.end)
    ]
    return f"{points[0]} -> {points[1]}: {error.error:.4f}, mostly {error.worst}"
