"""Builds a database: trims by continuation over the grid on the unstalled branch, then linear models.

The trim map folds at stall, where two trims exist. A point is therefore only solved from a solved neighbour, and only
accepted if it lies close to it: the helicopter side starts from hover, the airplane side from the fast downstop row.
Each side, then each nacelle row, is one task of fixed content: the result does not depend on the number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rtsim.aircraft.variables import Variable
from rtsim.arrays import FloatArray
from rtsim.errors import TrimError
from rtsim.lpv.building.checks import NEIGHBOUR_LIMIT, without_poor_edges
from rtsim.lpv.building.grid import HELICOPTER_SIDE, Grid
from rtsim.lpv.cells import fill_invalid, quantized
from rtsim.lpv.database import GRIDDED, Database
from rtsim.units import to_deg
from rtsim.worker_pool import work

Guess = tuple[FloatArray, FloatArray]
Jacobians = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]

ACCELERATION_STEPS = 3
"""An accelerated trim is reached from the level one in this many steps."""


@dataclass(frozen=True, slots=True)
class GridPoint:
    """One trim."""

    x: FloatArray
    """State (nx,); altitude 0."""
    u: FloatArray
    """Input (nu,); nacelle motion and gusts 0."""
    y: FloatArray
    """Output (ny,)."""
    xdot: FloatArray
    """State derivative (nx,)."""


class GridAircraft(Protocol):
    """What the builder needs of a nonlinear aircraft."""

    @property
    def states(self) -> Sequence[Variable]:
        """The nx states."""

    @property
    def inputs(self) -> Sequence[Variable]:
        """The nu inputs."""

    @property
    def outputs(self) -> Sequence[Variable]:
        """The ny outputs."""

    def rotor_speed(self, nacelle: float) -> float:
        """Rotor speed that is held at a place of the nacelle axis [rad/s]."""

    @property
    def attributes(self) -> dict[str, str | float | int]:
        """Title, condition, source hash, versions."""

    def solve(self, airspeed: float, nacelle: float, acceleration: float, guess: Guess | None) -> GridPoint | None:
        """Trim, or None where none is found from this guess.

        Args:
            acceleration: Level acceleration [m/s^2].
            guess: State and input to start from; None where there is no neighbour yet.
        """

    def reject(self, point: GridPoint, airspeed: float, nacelle: float) -> str | None:
        """Say why a trim is not on the wanted branch or not flyable, or None where it is good.

        Args:
            point: The trim.
        """

    def far_apart(self, point: GridPoint, neighbour: GridPoint) -> bool:
        """Whether two neighbours differ so much that they cannot be on the same branch.

        Args:
            point: A trim.
            neighbour: The trim it was continued from.
        """

    def jacobians(self, point: GridPoint, airspeed: float, nacelle: float, acceleration: float) -> Jacobians:
        """A, B, C, D and the derivative of the state derivative with nacelle angle, at a trim.

        Args:
            point: The trim.
            acceleration: Its level acceleration [m/s^2].
        """

    def flap(self, airspeed: float, nacelle: float) -> float:
        """Flap deflection of the schedule [rad]."""


Row = list[GridPoint | None]


def build_database(
    aircraft: GridAircraft,
    grid: Grid,
    *,
    jobs: int = 2,
    progress: Callable[[float], None] | None = None,
    edge_limit: float | None = NEIGHBOUR_LIMIT,
) -> Database:
    """Trim and linearize on the whole grid.

    Args:
        aircraft: The nonlinear aircraft.
        grid: Axes and wanted cells.
        jobs: Processes to use.
        progress: Called with the share of the work done since the last call; the shares add up to 1.
        edge_limit: Largest neighbour error kept at the edge of the valid region; None keeps all.

    Returns:
        The database without pilot gains; derivatives rounded to six digits, the valid region ending where the
        neighbour check would fail at its edge.

    Raises:
        TrimError: Not even the starting points of the continuation could be trimmed.
    """
    advance = progress if progress is not None else _ignore
    sides = [side for side in _sides(grid) if side]
    level: list[Row] = [[None] * grid.airspeed.size for _ in range(grid.nacelle.size)]
    for rows in work(_level_side, [(aircraft, grid, side) for side in sides], jobs=jobs):
        for number, row in rows:
            level[number] = row
        advance(0.2 / len(sides))
    arrays = _empty(aircraft, grid)
    tasks = [(aircraft, grid, number, level[number]) for number in range(grid.nacelle.size)]
    for number, layer, v, point, jacobians in _flattened(
        work(_finish_row, tasks, jobs=jobs), advance, 0.8 / grid.nacelle.size
    ):
        cell = (layer, v, number)
        arrays["x_ref"][cell], arrays["u_ref"][cell], arrays["y_ref"][cell] = point.x, point.u, point.y
        arrays["xdot_ref"][cell] = point.xdot
        for name, value in zip(("A", "B", "C", "D", "df_dnacelle"), jacobians, strict=True):
            arrays[name][cell] = value
        arrays["valid"][cell] = True
    fill_invalid(arrays, grid.airspeed, grid.level_layer)
    database = quantized(
        Database(
            layer_acceleration=grid.layer_acceleration,
            airspeed=grid.airspeed,
            nacelle=grid.nacelle,
            flap=np.array([[aircraft.flap(v, n) for n in grid.nacelle] for v in grid.airspeed]),
            rotor_speed=np.array([aircraft.rotor_speed(float(n)) for n in grid.nacelle]),
            states=tuple(aircraft.states),
            inputs=tuple(aircraft.inputs),
            outputs=tuple(aircraft.outputs),
            attributes=aircraft.attributes,
            **arrays,
        )
    )
    return database if edge_limit is None else without_poor_edges(database, edge_limit)


def _ignore(share: float) -> None:
    del share


def _flattened(
    results: Iterable[list[tuple[int, int, int, GridPoint, Jacobians]]], advance: Callable[[float], None], share: float
) -> Iterator[tuple[int, int, int, GridPoint, Jacobians]]:
    for rows in results:
        yield from rows
        advance(share)


def _empty(aircraft: GridAircraft, grid: Grid) -> dict[str, Any]:
    shape = (grid.layer_acceleration.size, grid.airspeed.size, grid.nacelle.size)
    nx, nu, ny = len(aircraft.states), len(aircraft.inputs), len(aircraft.outputs)
    tails = ((nx,), (nu,), (ny,), (nx,), (nx, nx), (nx, nu), (ny, nx), (ny, nu), (nx,), ())
    return {
        name: np.zeros(shape + tail, dtype=bool if name == "valid" else float)
        for name, tail in zip(GRIDDED, tails, strict=True)
    }


def _sides(grid: Grid) -> tuple[list[int], list[int]]:
    """Nacelle rows in the order of continuation: from helicopter downwards, and from the downstop upwards."""
    rows = range(grid.nacelle.size)
    helicopter = [row for row in reversed(rows) if grid.nacelle[row] >= HELICOPTER_SIDE - 1e-9]
    airplane = [row for row in rows if grid.nacelle[row] < HELICOPTER_SIDE - 1e-9]
    return helicopter, airplane


def _level_side(aircraft: GridAircraft, grid: Grid, side: list[int]) -> list[tuple[int, Row]]:
    """Solve the level trims of one side, row after row."""
    rows: list[tuple[int, Row]] = []
    before: Row = [None] * grid.airspeed.size
    for number in side:
        row = _level_row(aircraft, grid, number, before)
        rows.append((number, row))
        before = row if any(row) else before
    return rows


def _level_row(aircraft: GridAircraft, grid: Grid, number: int, before: Row) -> Row:
    """Solve one nacelle row outwards from a seed, each point from solved neighbours only."""
    nacelle = float(grid.nacelle[number])
    wanted = np.flatnonzero(grid.wanted[:, number])
    row: Row = [None] * grid.airspeed.size
    if wanted.size == 0:
        return row
    candidates = [int(v) for v in wanted if before[v] is not None]
    if candidates:
        seed = _seed(grid, number, candidates)
    else:
        seed, row[seed] = _beginning(aircraft, grid, number, [int(v) for v in wanted])
    for direction in (1, -1):
        v = seed if direction == 1 else seed - 1
        while wanted[0] <= v <= wanted[-1]:
            neighbours = [p for p in (row[v - direction] if v != seed else None, before[v]) if p is not None]
            guesses = [*_secant(grid, row, v, direction), *((p.x, p.u) for p in neighbours)]
            if neighbours:
                row[v] = _attempt(aircraft, grid, (v, nacelle, 0.0), guesses, neighbours)
            v += direction
    return row


def _beginning(aircraft: GridAircraft, grid: Grid, number: int, wanted: Sequence[int]) -> tuple[int, GridPoint]:
    """Where the continuation begins: as near as there is a trim to where a row is started from."""
    nacelle, usual = float(grid.nacelle[number]), float(grid.airspeed[_seed(grid, number, wanted)])
    for v in sorted(wanted, key=lambda v: abs(grid.airspeed[v] - usual)):
        point = _attempt(aircraft, grid, (v, nacelle, 0.0), [None], [])
        if point is not None:
            return v, point
    raise TrimError(
        f"there is no trim to start from at nacelle {to_deg(max(nacelle, 0.0)):.4g} deg, whatever the airspeed",
        mend="the aircraft may be too heavy for this air; else check its data",
    )


def _seed(grid: Grid, number: int, candidates: Sequence[int]) -> int:
    """Airspeed to start a row from: hover on the helicopter side, else the middle of what the row before has."""
    if grid.nacelle[number] >= HELICOPTER_SIDE - 1e-9:
        return int(min(candidates, key=lambda v: abs(grid.airspeed[v])))
    return int(candidates[len(candidates) // 2])


def _secant(grid: Grid, row: Row, v: int, direction: int) -> list[Guess]:
    """Extrapolate the last two points of the row."""
    one, two = v - direction, v - 2 * direction
    if not (0 <= one < len(row) and 0 <= two < len(row)):
        return []
    near, far = row[one], row[two]
    if near is None or far is None:
        return []
    ratio = (grid.airspeed[v] - grid.airspeed[one]) / (grid.airspeed[one] - grid.airspeed[two])
    return [(near.x + ratio * (near.x - far.x), near.u + ratio * (near.u - far.u))]


def _attempt(
    aircraft: GridAircraft,
    grid: Grid,
    where: tuple[int, float, float],
    guesses: Sequence[Guess | None],
    neighbours: Sequence[GridPoint],
) -> GridPoint | None:
    """Try the guesses in turn; accept a flyable trim near a neighbour."""
    v, nacelle, acceleration = where
    airspeed = float(grid.airspeed[v])
    for guess in guesses:
        point = aircraft.solve(airspeed, nacelle, acceleration, guess)
        if point is None or aircraft.reject(point, airspeed, nacelle) is not None:
            continue
        if any(aircraft.far_apart(point, neighbour) for neighbour in neighbours):
            continue
        return point
    return None


def _finish_row(
    aircraft: GridAircraft, grid: Grid, number: int, level: Row
) -> list[tuple[int, int, int, GridPoint, Jacobians]]:
    """Solve the accelerated trims of one nacelle row and linearize all of its trims."""
    nacelle = float(grid.nacelle[number])
    found = []
    for layer, acceleration in enumerate(grid.layer_acceleration):
        for v, start in enumerate(level):
            point = start
            if point is not None and layer != grid.level_layer:
                point = _accelerated(aircraft, grid, (v, nacelle, float(acceleration)), point)
            if point is not None:
                airspeed = float(grid.airspeed[v])
                found.append(
                    (number, layer, v, point, aircraft.jacobians(point, airspeed, nacelle, float(acceleration)))
                )
    return found


def _accelerated(
    aircraft: GridAircraft, grid: Grid, where: tuple[int, float, float], level: GridPoint
) -> GridPoint | None:
    """Reach an accelerated trim from the level one at the same place, in small steps of acceleration."""
    v, nacelle, acceleration = where
    last, point = level, level
    for step in range(1, ACCELERATION_STEPS + 1):
        guess = (2.0 * point.x - last.x, 2.0 * point.u - last.u)
        found = _attempt(
            aircraft, grid, (v, nacelle, acceleration * step / ACCELERATION_STEPS), [guess, (point.x, point.u)], [point]
        )
        if found is None:
            return None
        last, point = point, found
    return point
