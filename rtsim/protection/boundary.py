"""Boundaries to protect: the two published ones, one computed by our model, and what chart and plant disagree about."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rtsim.aircraft.condition import AircraftCondition
from rtsim.aircraft.variables import required_position
from rtsim.arrays import FloatArray
from rtsim.choices import CORRIDOR_NAMES
from rtsim.corridor.boundaries import STRAIGHT, Boundary, Corridor, Turning, load_corridor
from rtsim.errors import InputError
from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.protection.limiter_kernels import torque_limit
from rtsim.protection.limits import Limits, load_limits
from rtsim.units import deg, to_deg, to_kt

MODEL_PITCH = deg(15.0)
"""Nose-up attitude of a level trim at which the computed low-speed side begins; the design chart's is 12 to 16 deg."""
NO_LIMIT = 1e6
"""Stands for a speed without limit where lines are interpolated [m/s]."""
_TRIMS = "level trims of the LPV database"


@dataclass(frozen=True, slots=True)
class Inconsistency:
    """A stretch of nacelle angle where a chart's boundary lies outside what the plant can trim within its limits."""

    side: Literal["low", "high"]
    """Which boundary."""
    nacelle_from: float
    """Forward end of the stretch [rad]."""
    nacelle_to: float
    """Aft end [rad]."""
    depth: float
    """Largest distance between chart and plant [m/s]."""
    nacelle_deepest: float
    """Nacelle angle where that is [rad]."""

    def sentence(self) -> str:
        """Say it for people."""
        what = "stall or attitude" if self.side == "low" else "mast torque or trim"
        return (
            f"the chart's {self.side}-speed side lies up to {to_kt(self.depth):.1f} kn outside the plant's {what} "
            f"limit, worst at nacelle {to_deg(self.nacelle_deepest):.0f} deg ({to_deg(self.nacelle_from):.0f} to "
            f"{to_deg(self.nacelle_to):.0f} deg)"
        )


def model_corridor(database: Database, limits: Limits | None = None) -> Corridor:
    """Compute a corridor from the trims of a database.

    The low side is where the unstalled level trim ends or its attitude passes ``MODEL_PITCH``; the high side where its
    mast torque passes the limit or the trim ends. Levels and downstop are those of the published corridors.

    Args:
        limits: The torque limit; None: the aircraft's.
    """
    limits = load_limits(database.profile) if limits is None else limits
    level = database.level_layer
    angles, low, high = _trim_lines(
        database, limits, database.x_ref[level], database.y_ref[level], database.valid[level]
    )
    published = _chart("design", database)
    downstop = float(high[0])
    off_stop = angles > published.downstop_nacelle + 1e-9
    # On and just off the stop the trims are the same but for the flaps; the step stays at the downstop.
    high[~off_stop] = high[off_stop][0]
    return replace(
        published,
        name="model",
        title="Computed corridor (level trims: stall or attitude, mast torque)",
        low=Boundary(angles, np.minimum.accumulate(low), "stall or attitude", _TRIMS),
        high=Boundary(angles, np.minimum.accumulate(high), "mast torque or end of the trims", _TRIMS),
        downstop_speed=min(downstop, published.downstop_speed),
    )


def _trim_lines(
    database: Database, limits: Limits, x_ref: FloatArray, y_ref: FloatArray, valid: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nacelle angles, and the airspeeds between which trims exist and keep their attitude and their torque."""
    rows = database.nacelle >= 0.0  # not those of a lower rotor speed
    angles, exists = database.nacelle[rows], valid[:, rows]
    pitch = x_ref[:, rows, required_position(database.states, "pitch", "the boundary")]
    torque = y_ref[:, rows, required_position(database.outputs, "torque", "the boundary")]
    low, high = np.empty(angles.size), np.empty(angles.size)
    for j, angle in enumerate(angles):
        good = np.flatnonzero(exists[:, j])
        if not good.size:
            low[j] = high[j] = np.nan
            continue
        speeds = database.airspeed[good]
        spare = MODEL_PITCH - pitch[good, j]
        bound = np.array([torque_limit(limits.torque, speed, angle) for speed in speeds])
        middle = int(np.argmin(torque[good, j]))
        low[j] = _crossing(speeds[middle::-1], spare[middle::-1])
        high[j] = _crossing(speeds[middle:], (bound - torque[good, j])[middle:])
    return angles, low, high


def turning_of(database: Database) -> Turning:
    """How far a turn moves the sides of a corridor, from the database's trims that carry more than the weight.

    Both sides are those of ``model_corridor``, of straight flight and of the largest load factor that trims; what lies
    between them is taken to grow with the load factor, and is smoothed over three nacelle angles, since the trims end
    from one airspeed of the grid to the next.

    Args:
        database: The aircraft; without a lateral half it does not turn.
    """
    return STRAIGHT if database.lateral is None else _turning(database)


@functools.lru_cache(maxsize=8)
def _turning(database: Database) -> Turning:
    data, level, limits = LateralData.of(database), database.level_layer, load_limits(database.profile)
    angles, low, high = _trim_lines(
        database, limits, database.x_ref[level], database.y_ref[level], database.valid[level]
    )
    moved = np.zeros((2, angles.size))
    for k, load in enumerate(data.load_factor):
        _, *lines = _trim_lines(database, limits, data.loaded_x_ref[k], data.loaded_y_ref[k], data.loaded_valid[k])
        slope = (np.array(lines) - (low, high)) / (load - 1.0)
        moved = np.where(np.isfinite(slope), slope, moved)
    wide = np.pad(moved, ((0, 0), (1, 1)), mode="edge")
    smooth = (wide[:, :-2] + wide[:, 1:-1] + wide[:, 2:]) / 3.0
    return Turning(angles, np.maximum(smooth[0], 0.0), np.minimum(smooth[1], 0.0))


def _samples() -> FloatArray:
    """Nacelle angles at which lines are compared [rad]."""
    return np.asarray(deg(0.5) * np.arange(191))


def _crossing(speeds: FloatArray, spare: FloatArray) -> float:
    """Speed at which what is spare first runs out, walking along the list; its end where it never does."""
    for k in range(1, len(speeds)):
        if spare[k] < 0.0:
            share = spare[k - 1] / (spare[k - 1] - spare[k]) if spare[k - 1] > 0.0 else 0.0
            return float(speeds[k - 1] + share * (speeds[k] - speeds[k - 1]))
    return float(speeds[-1])


def load_boundary(name: str, database: Database | None = None) -> Corridor:
    """Load a boundary by name.

    Args:
        name: ``design``, ``flight`` or ``model``.
        database: The aircraft, and the air it flies in; None: the shipped XV-15.

    Returns:
        The boundary in true airspeed.

    Raises:
        InputError: There is no such boundary.
    """
    if name not in CORRIDOR_NAMES:
        raise InputError("no such boundary", key="corridor", value=name, allowed=", ".join(CORRIDOR_NAMES))
    if name != "model" and database is None:
        return load_corridor(name)
    if database is None:
        from rtsim.lpv.files.storage import load_database

        database = load_database()
    corridor = model_corridor(database) if name == "model" else _chart(name, database)
    return replace(corridor, turning=turning_of(database))


def _chart(name: str, database: Database) -> Corridor:
    """A published corridor, in true airspeed of the air that the aircraft flies in."""
    condition = AircraftCondition.stored(database.attributes)
    return load_corridor(name, database.profile).in_true_airspeed(condition.true_over_calibrated)


def guarded_corridor(corridor: Corridor, database: Database, guard: float) -> Corridor:
    """Tighten both sides to where the plant still has an unstalled trim.

    A law that kept a chart's line beyond the plant's stall would hold the aircraft there while it sinks.

    Args:
        corridor: The chart.
        guard: Distance to keep from the slowest and the fastest trim [m/s].

    Returns:
        A corridor whose sides are the nearer of the chart and the plant's line less the guard.
    """
    slowest, fastest = trim_range(database)
    angles = np.union1d(_samples(), np.concatenate([corridor.low.nacelle, corridor.high.nacelle]))
    low = np.maximum(np.asarray(corridor.low.at(angles)), np.interp(angles, database.nacelle, slowest) + guard)
    high = np.minimum(np.asarray(corridor.high.at(angles)), np.interp(angles, database.nacelle, fastest) - guard)
    note = f"; not beyond the plant's level trims less {to_kt(guard):g} kn"
    # Nowhere rising with the nacelle angle, as every boundary: the stricter side of a wiggle holds.
    return replace(
        corridor,
        low=Boundary(angles, np.maximum.accumulate(low[::-1])[::-1], corridor.low.kind, corridor.low.source + note),
        high=Boundary(angles, np.minimum.accumulate(high), corridor.high.kind, corridor.high.source + note),
    )


def trim_range(database: Database) -> tuple[FloatArray, FloatArray]:
    """Slowest and fastest unstalled level trim of each nacelle angle (N,) [m/s].

    Where the grid itself ends or was not solved further, the plant sets no limit: minus and plus ``NO_LIMIT``.
    """
    from rtsim.lpv.building.grid import conversion_grid

    valid = database.valid[database.level_layer]
    grid = conversion_grid()
    same = np.array_equal(grid.airspeed, database.airspeed) and np.array_equal(grid.nacelle, database.nacelle)
    tried = grid.wanted if same else np.ones_like(valid)
    slowest, fastest = np.full(valid.shape[1], -NO_LIMIT), np.full(valid.shape[1], NO_LIMIT)
    for j in range(valid.shape[1]):
        good = np.flatnonzero(valid[:, j])
        if good[0] > 0 and tried[good[0] - 1, j]:
            slowest[j] = database.airspeed[good[0]]
        if good[-1] < valid.shape[0] - 1 and tried[good[-1] + 1, j]:
            fastest[j] = database.airspeed[good[-1]]
    return slowest, fastest


def check_consistency(corridor: Corridor, database: Database, *, tolerance: float = 0.5) -> tuple[Inconsistency, ...]:
    """Find where a chart allows what the plant cannot trim within its limits.

    Args:
        corridor: The chart.
        tolerance: Distances below this are agreement [m/s].
    """
    plant = model_corridor(database)
    angles = _samples()
    angles = angles[(angles > corridor.downstop_nacelle) & (angles <= database.nacelle[-1] + 1e-9)]
    # Rearward flight is an allowance of the chart's side, not a limit of the plant.
    forward = np.asarray(corridor.low.at(angles)) > 0.0
    low = np.where(forward, np.asarray(plant.low.at(angles)) - np.asarray(corridor.low.at(angles)), -np.inf)
    high = np.asarray(corridor.high.at(angles)) - np.asarray(plant.high.at(angles))
    return (*_stretches("low", angles, low, tolerance), *_stretches("high", angles, high, tolerance))


def _stretches(
    side: Literal["low", "high"], angles: FloatArray, depth: FloatArray, tolerance: float
) -> list[Inconsistency]:
    """Connected stretches where the depth is larger than the tolerance."""
    outside = np.concatenate([[False], depth > tolerance, [False]])
    edges = np.flatnonzero(np.diff(outside.astype(np.int8)))
    found = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        deepest = first + int(np.argmax(depth[first:end]))
        found.append(
            Inconsistency(
                side, float(angles[first]), float(angles[end - 1]), float(depth[deepest]), float(angles[deepest])
            )
        )
    return found
