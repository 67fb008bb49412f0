"""Collects what the claims are judged by: measures of the flights, facts of the map, the grid and the nacelles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rtsim.arrays import FloatArray
from rtsim.corridor.boundaries import load_corridor
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.path import AccelerationCaps, path_through
from rtsim.optimization.paths import centre_line_corners, trim_flapping_map
from rtsim.units import deg, kt, to_deg, to_kt
from scenarios.reproduction.flights import Flight, Flyer, Variant
from scenarios.reproduction.measures import FlightMeasures

if TYPE_CHECKING:
    from rtsim.lpv.building.checks import NeighbourError
    from rtsim.lpv.database import Database

COMPARED = ("airspeed_kt", "altitude_m", "pitch_deg", "flapping_deg")
"""Signals by which an LPV form is judged against the nonlinear model."""
FASTEST_RATE_DEG_S = 7.5
"""Nacelle rate of the XV-15's conversion actuators [deg/s]."""
_DATABASE_ARRAYS = ("x_ref", "u_ref", "y_ref", "xdot_ref", "A", "B", "C", "D", "df_dnacelle", "valid")

Number = float | bool | str


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What one variant's flights show; the facts are the same for all variants."""

    measures: Mapping[str, FlightMeasures]
    """Measures of each flight, by the path's name."""
    facts: Mapping[str, Mapping[str, Number]]
    """Numbers that do not come from the paths' flights, by claim."""


def valley_and_ridges(database: str = "") -> dict[str, Number]:
    """Where the map of trimmed flapping is high and low inside the design corridor (Figure 6).

    Args:
        database: LPV database, a file; empty: the shipped XV-15.
    """
    airspeeds, nacelles, flapping = trim_flapping_map(load_database(database or None))
    corridor = load_corridor("design")
    found: dict[str, Number] = {}
    positions, ridges = [], True
    for nacelle in (90.0, 75.0, 60.0, 50.0, 40.0, 30.0, 15.0):
        column = flapping[:, int(np.argmin(np.abs(nacelles - nacelle)))]
        low = max(to_kt(float(corridor.low.at(deg(nacelle)))), 0.0)
        high = to_kt(float(corridor.high.at(deg(nacelle))))
        inside = ~np.isnan(column) & (airspeeds >= low - 0.5) & (airspeeds <= high + 0.5)
        speed, value = airspeeds[inside], column[inside]
        key = f"{nacelle:.0f}"
        found[f"ridge_{key}_kt"] = float(speed[int(np.argmax(value))])
        found[f"ridge_{key}_deg"] = float(value.max())
        # In helicopter mode flapping vanishes in hover too: the valley is what lies beyond the low-speed ridge.
        beyond = speed >= 60.0
        valley = float(speed[beyond][int(np.argmin(value[beyond]))])
        found[f"valley_{key}_kt"] = valley
        if nacelle < 90.0:
            positions.append((valley - low) / (high - low))
        if nacelle in {60.0, 30.0}:
            ridges = ridges and bool(np.argmax(value) == 0)
    found["valley_position"] = float(np.mean(positions))
    found["stall_side_ridges"] = ridges
    return found


def corridor_differences(reference: Mapping[str, list[float]]) -> dict[str, Number]:
    """Largest differences between the corridor ``design`` and a reference table (Figure 1).

    Args:
        reference: ``nacelle_deg``, ``low_kt`` and ``high_kt`` of its corners.
    """
    design, flight = load_corridor("design"), load_corridor("flight")
    nacelle = deg(1.0) * np.array(reference["nacelle_deg"])
    low = np.maximum(to_kt(1.0) * np.asarray(design.low.at(nacelle)), 0.0)
    high = to_kt(1.0) * np.asarray(design.high.at(nacelle))
    tilted = np.linspace(0.0, deg(75.0), 151)
    offset = to_kt(1.0) * (np.asarray(flight.low.at(tilted)) - np.asarray(design.low.at(tilted)))
    return {
        "low_difference_kt": float(np.abs(low - reference["low_kt"]).max()),
        "high_difference_kt": float(np.abs(high - reference["high_kt"]).max()),
        "flight_low_offset_kt": float(offset.max()),
    }


def grid_errors(file: str = "") -> dict[str, dict[str, Number]]:
    """How well each linear model predicts its neighbour's trim, on our grid and on one of 10 kn (Figure 2).

    Args:
        file: LPV database; empty: the shipped XV-15.
    """
    from rtsim.lpv.building.checks import check_neighbours

    database = load_database(file or None)
    corridor = load_corridor("design")
    level = database.level_layer
    inside = np.array([[corridor.inside(float(v), float(n)) for n in database.nacelle] for v in database.airspeed])
    valid = database.valid[level]
    report = check_neighbours(database, inside=inside)
    errors = np.array([error.error for error in report.errors if not error.flap_moves])
    kept = _thinned(database.airspeed)
    sparse = replace(
        database,
        airspeed=database.airspeed[kept],
        flap=database.flap[kept],
        pilot={},
        **{name: getattr(database, name)[:, kept] for name in _DATABASE_ARRAYS},
    )
    coarse = check_neighbours(sparse, inside=inside[kept])
    # The steps of 10 kn; above, multiples of the present grid's 3.5 kn give 7 kn.
    pairs = _between(sparse, coarse.errors, 19.0, 61.0)
    worst = max(pairs, key=lambda error: error.error)
    return {
        "fig2_grid": {
            "points": float(np.count_nonzero(inside & valid)),
            "outside_points": float(np.count_nonzero(valid & ~inside)),
            "infeasible_points": float(np.count_nonzero(~valid)),
            "largest_error": float(errors.max()),
            "median_error": float(np.median(errors)),
        },
        "fig2_ten_knots": {
            "largest_error": worst.error,
            "share_above": float(np.mean([error.error > 0.01 for error in pairs])),
            "worst_airspeed_kt": to_kt(float(sparse.airspeed[worst.start[0]])),
            "worst_nacelle_deg": to_deg(float(sparse.nacelle[worst.start[1]])),
            "hover_largest_error": max(_errors_between(sparse, coarse.errors, -21.0, 21.0)),
            "fast_pairs_above": float(
                sum(error > 0.01 for error in _errors_between(sparse, coarse.errors, 60.0, 171.0))
            ),
            "fast_pairs": float(len(_errors_between(sparse, coarse.errors, 60.0, 171.0))),
        },
    }


def _between(grid: Database, errors: Sequence[NeighbourError], low_kt: float, high_kt: float) -> list[NeighbourError]:
    """Pairs of neighbouring airspeeds within a range, flaps alike."""
    low, high = kt(low_kt), kt(high_kt)
    return [
        error
        for error in errors
        if error.axis == "airspeed"
        and not error.flap_moves
        and all(low <= grid.airspeed[point[0]] <= high for point in (error.start, error.end))
    ]


def _errors_between(grid: Database, errors: Sequence[NeighbourError], low_kt: float, high_kt: float) -> list[float]:
    return [error.error for error in _between(grid, errors, low_kt, high_kt)]


def _thinned(airspeed: FloatArray) -> npt.NDArray[np.int64]:
    """Numbers of the airspeeds of a grid like the paper's: 5 kn up to 20 kn, then 10 kn."""
    kept = [0]
    for number in range(1, airspeed.size):
        step = 5.0 if abs(to_kt(float(airspeed[number]))) <= 20.5 else 10.0
        # the present grid is not a multiple of 10 kn everywhere: take the nearest step that is not longer
        beyond = number + 1 >= airspeed.size or airspeed[number + 1] - airspeed[kept[-1]] > kt(step + 0.1)
        if beyond:
            kept.append(number)
    return np.array(kept, dtype=np.int64)


def centre_line_demand(acceleration_kt_s: float) -> float:
    """Largest nacelle rate the centre line asks for at an acceleration, without a limit [deg/s].

    Args:
        acceleration_kt_s: The acceleration held [kn/s].
    """
    corners = np.array(centre_line_corners())
    airspeed, tilt = np.diff(corners[:, 0]), -np.diff(corners[:, 1])
    moving = airspeed > 1e-6
    return float((tilt[moving] / airspeed[moving]).max() * acceleration_kt_s)


def twelve_seconds(database: str = "") -> dict[str, Number]:
    """The nacelles' whole travel at their fastest, and the nonlinear aircraft flown through it (section 2).

    Args:
        database: LPV database that the pilot knows, a file; empty: the shipped XV-15.
    """
    from rtsim.nacelle.switch import NacelleActuator

    actuator, dt, time = NacelleActuator(deg(90.0)), 0.004, 0.0
    while actuator.angle > deg(0.5) and time < 60.0:
        actuator.step(-deg(FASTEST_RATE_DEG_S), dt)
        time += dt
    gentle, hard = (_tilted_in_twelve_seconds(begin, end, database) for begin, end in ((80.0, 120.0), (60.0, 150.0)))
    return {
        "nacelle_time_s": time,
        "lag_s": time - 90.0 / FASTEST_RATE_DEG_S,
        "completed": gentle.completed,
        "end": gentle.end_reason or "flown to its end",
        "peak_deg": float(gentle["flapping_deg"].max()),
        "altitude_m": float(np.abs(gentle["altitude_m"] - gentle["altitude_m"][0]).max()),
        "torque_inlb": float(gentle["mast_torque_inlb"].max()),
        "hard_peak_deg": float(hard["flapping_deg"].max()),
        "hard_torque_inlb": float(hard["mast_torque_inlb"].max()),
    }


def _tilted_in_twelve_seconds(start_kt: float, end_kt: float, database: str) -> Flight:
    """Fly the nonlinear aircraft from upright to the downstop at the nacelles' fastest rate."""
    path = path_through(
        "twelve_seconds",
        f"{start_kt:g} to {end_kt:g} kn in 12 s",
        [(start_kt, 90.0), (end_kt, 0.0)],
        nacelle_rate_deg_s=FASTEST_RATE_DEG_S,
        caps=AccelerationCaps.uniform(7.6),
        nacelle_motion="spread",
    )
    return Flyer(Variant(name="nonlinear", title="", plant="nonlinear", database=database)).fly(path.name, path)


def lpv_differences(layered: Flight, plain: Flight, truth: Flight) -> dict[str, Number]:
    """RMS differences of both LPV forms to the nonlinear model over one conversion (abstract).

    Args:
        layered: The default form's flight.
        plain: The two-variable form's.
        truth: The nonlinear model's.
    """
    from scenarios.reproduction.measures import rms_difference

    found: dict[str, Number] = {name: rms_difference(layered, truth, name) for name in COMPARED}
    found |= {f"plain_{name}": rms_difference(plain, truth, name) for name in COMPARED}
    return found
