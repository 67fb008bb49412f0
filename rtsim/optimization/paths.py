"""The conversion paths of the paper, generated from Table 1, the corridor's boundaries and the trim-flapping map.

Each has its name, its source and the acceleration cap at which the nonlinear model stays controlled
(``docs/optimization.md`` has the flights). The reconversions are the same points backwards.

Legend:
    nacelle_rate_deg_s: Nacelle rate [deg/s].
    caps: Acceleration caps.
    aircraft: The database of another aircraft than the shipped XV-15.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.variables import required_position
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.lpv.database import Database
from rtsim.optimization.path import (
    TABLE_1_CAPS,
    AccelerationCaps,
    ConversionPath,
    PathPoint,
    path_through,
)
from rtsim.protection.boundary import load_boundary
from rtsim.units import deg, kt, to_kt

TABLE_1: tuple[tuple[float, float], ...] = (
    (0.0, 90.0),
    (24.0, 82.0),
    (40.0, 82.0),
    (61.0, 75.0),
    (80.0, 75.0),
    (105.0, 50.0),
    (130.0, 50.0),
    (150.0, 0.0),
    (170.0, 0.0),
)
"""Airspeed [kn] and nacelle angle [deg] of the points of the paper's Table 1."""
_LEAST_FAST_KT = 60.0
"""Slowest airspeed of the fast-side path beside helicopter mode, with Table 1's end [kn]."""
NEAR_STALL_MARGIN_KT = 5.0
"""Distance of the near-stall path from the power-on stall line [kn]."""
FAST_SIDE_MARGIN_KT = 8.0
"""Distance the fast-side path keeps from the last airspeed with a trim and from the corridor [kn]."""
NEAR_STALL_CAPS = AccelerationCaps(2.0, 2.0, 5.0)
"""2 kn/s: slow enough for the nacelles to keep the path on the stall line; at 3 kn/s it is still controlled."""
FAST_SIDE_CAPS = AccelerationCaps(1.5, 3.0, 5.0)
"""1.5 kn/s at nacelle 90: at 3 kn/s the nonlinear model errs by 13.8 kn and 7.6 m there, a control on its stop."""
RECONVERSION_CAPS = AccelerationCaps.uniform(2.0)
"""Deceleration of every reconversion."""
_STEP_DEG = 5.0


def conversion_end_kt(aircraft: Database | None = None) -> float:
    """Airspeed at which an aircraft's conversions end, in airplane mode [kn].

    Args:
        aircraft: Its database; None: the XV-15.

    Raises:
        InputError: Its profile does not say, or the value is out of range.
    """
    profile = xv15_profile() if aircraft is None else aircraft.profile
    return profile.dimensions.number("conversion_end_kt", low=10.0, high=500.0)


def _in_proportion(airspeed_kt: float, aircraft: Database | None) -> float:
    """An airspeed of the XV-15's Table 1 in proportion to where another aircraft's conversions end [kn]."""
    return airspeed_kt * conversion_end_kt(aircraft) / TABLE_1[-1][0]


def table_1(
    *, nacelle_rate_deg_s: float = 3.0, caps: AccelerationCaps = TABLE_1_CAPS, aircraft: Database | None = None
) -> ConversionPath:
    """The paper's typical conversion (Table 1), its nacelles moving at a constant rate and waiting in between."""
    return path_through(
        "typical",
        "Typical conversion (Table 1)",
        [(round(_in_proportion(v, aircraft), 3), n) for v, n in TABLE_1],
        nacelle_rate_deg_s=nacelle_rate_deg_s,
        caps=caps,
        description="Table 1 of the paper: 3 kn/s to the 50 deg detent, 4 kn/s on it, 5 kn/s in airplane mode.",
    )


def near_stall(
    *, nacelle_rate_deg_s: float = 3.0, caps: AccelerationCaps = NEAR_STALL_CAPS, aircraft: Database | None = None
) -> ConversionPath:
    """The path pilots tend to fly: along the low-speed side of the corridor (paper, Figure 11).

    It follows the power-on stall line of TM 81244 (the corridor ``flight``), which is also where the model stalls.
    """
    low = load_boundary("flight", aircraft).low
    corners = [(0.0, 90.0), (_in_proportion(12.0, aircraft), 80.0)]
    for nacelle in (75.0, 70.5, 65.0, 60.0, 55.0, 50.0, 45.0, 40.0, 35.0, 30.0, 25.0, 20.0, 15.0, 10.0, 5.0, 0.0):
        airspeed = to_kt(float(low.at(deg(nacelle)))) + NEAR_STALL_MARGIN_KT
        corners.append((round(max(airspeed, _in_proportion(22.0, aircraft)), 3), nacelle))
    corners.append((conversion_end_kt(aircraft), 0.0))
    return path_through(
        "near_stall",
        "Conversion along the stall limit",
        corners,
        nacelle_rate_deg_s=nacelle_rate_deg_s,
        nacelle_motion="spread",
        caps=caps,
        description=(
            f"{NEAR_STALL_MARGIN_KT:g} kn above the power-on stall line of NASA TM 81244, at "
            f"{caps.above_detent_kt_s:g} kn/s until airplane mode."
        ),
    )


def centre_line_corners(aircraft: Database | None = None) -> list[tuple[float, float]]:
    """The centre line of the design corridor from hover to airplane mode: (airspeed [kn], nacelle angle [deg])."""
    corridor = load_boundary("design", aircraft)
    corners = [(0.0, 90.0)]
    for nacelle in np.arange(90.0, -_STEP_DEG / 2.0, -_STEP_DEG):
        airspeed = to_kt(float(corridor.centre_speed(deg(float(nacelle)))))
        corners.append((round(max(airspeed, corners[-1][0]), 3), float(nacelle)))
    corners.append((conversion_end_kt(aircraft), 0.0))
    return corners


def centre_line(
    *, nacelle_rate_deg_s: float = 3.0, caps: AccelerationCaps = TABLE_1_CAPS, aircraft: Database | None = None
) -> ConversionPath:
    """The safest path: the centre line of the corridor at a constant nacelle rate (paper, Figure 13)."""
    return path_through(
        "centre_line",
        "Centre line of the corridor at constant nacelle rate",
        centre_line_corners(aircraft),
        nacelle_rate_deg_s=nacelle_rate_deg_s,
        nacelle_motion="spread",
        caps=caps,
        description="The mean of both boundaries of the design corridor; the slower of rate and cap sets the pace.",
    )


def centre_line_variable(
    *,
    acceleration_kt_s: float = 4.0,
    largest_rate_deg_s: float = 12.0,
    airplane_kt_s: float = 5.0,
    aircraft: Database | None = None,
) -> ConversionPath:
    """The centre line at a held acceleration, the nacelle rate following from it (paper, Figure 15).

    Args:
        acceleration_kt_s: Acceleration in conversion [kn/s].
        largest_rate_deg_s: Largest nacelle rate [deg/s]; where it does not do, the acceleration gives way.
        airplane_kt_s: Acceleration in airplane mode [kn/s].
    """
    corners = centre_line_corners(aircraft)
    points = [PathPoint(*corners[0])]
    for before, corner in itertools.pairwise(corners):
        change, tilt = corner[0] - before[0], before[1] - corner[1]
        cap = airplane_kt_s if max(before[1], corner[1]) <= 0.0 else acceleration_kt_s
        if change < 1e-9 and tilt < 1e-9:
            continue
        points.append(PathPoint(corner[0], corner[1], cap, largest_rate_deg_s))
    points[-1] = dataclasses.replace(points[-1], hold_s=4.0)
    return ConversionPath(
        "centre_line_variable",
        "Centre line of the corridor at variable nacelle rate",
        tuple(points),
        f"The centre line at {acceleration_kt_s:g} kn/s; the nacelle rate follows, up to {largest_rate_deg_s:g} deg/s.",
        nacelle_motion="spread",
    )


@lru_cache(maxsize=4)
def trim_flapping_map(aircraft: Database | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The trimmed cyclic flapping over the corridor (paper, Figure 6), from the database.

    Returns:
        Airspeeds [kn], shape (v,); nacelle angles [deg], shape (n,); flapping magnitude [deg], shape (v, n), NaN where
        the level layer has no trim.
    """
    from rtsim.lpv.files.storage import load_database

    database = load_database() if aircraft is None else aircraft
    layer = database.level_layer
    cosine, sine = (required_position(database.states, name, "the path") for name in ("flap_1c", "flap_1s"))
    x = database.x_ref[layer]
    flapping = np.hypot(x[:, :, cosine], x[:, :, sine])
    flapping = np.where(database.valid[layer], np.degrees(flapping), np.nan)
    result = (database.airspeed / kt(1.0), database.nacelle / deg(1.0), flapping)
    for array in result:
        array.flags.writeable = False
    return result


def _fast_side_corners(aircraft: Database | None) -> list[tuple[float, float]]:
    """For each nacelle angle the airspeed of least trim flapping, never falling as the nacelles tilt."""
    airspeeds, nacelles, flapping = trim_flapping_map(aircraft)
    corridor = load_boundary("design", aircraft)
    corners = [(0.0, 90.0)]
    for nacelle in np.arange(90.0, -_STEP_DEG / 2.0, -_STEP_DEG):
        column = flapping[:, int(np.argmin(np.abs(nacelles - nacelle)))]
        valid = ~np.isnan(column)
        low, high = (to_kt(float(side.at(deg(float(nacelle))))) for side in (corridor.low, corridor.high))
        fast_edge = float(airspeeds[valid].max())
        least = _in_proportion(_LEAST_FAST_KT, aircraft)
        from_kt = max(low, float(airspeeds[valid].min()), least) + FAST_SIDE_MARGIN_KT
        to_airspeed = min(high, fast_edge) - FAST_SIDE_MARGIN_KT
        fine = np.arange(from_kt, to_airspeed + 0.25, 0.5)
        values = np.interp(fine, airspeeds[valid], column[valid])
        best = float(fine[int(np.argmin(values))])
        corners.append((round(max(best, corners[-1][0]), 3), float(nacelle)))
    corners.append((conversion_end_kt(aircraft), 0.0))
    return corners


def fast_side(
    *, nacelle_rate_deg_s: float = 3.0, caps: AccelerationCaps = FAST_SIDE_CAPS, aircraft: Database | None = None
) -> ConversionPath:
    """The path of least trim flapping (paper, Figure 7): down the map's slope along the fast side of the corridor.

    From hover it crosses the low-speed ridge at nacelle 90, where the slope is steepest in airspeed; then, at each
    nacelle angle, it stays at the airspeed of least trimmed flapping.
    """
    return path_through(
        "fast_side",
        "Least trim flapping, along the fast side",
        _fast_side_corners(aircraft),
        nacelle_rate_deg_s=nacelle_rate_deg_s,
        nacelle_motion="spread",
        caps=caps,
        description=(
            "At each nacelle angle the airspeed of least trimmed cyclic flapping of the database, "
            f"{FAST_SIDE_MARGIN_KT:g} kn away from its edge; {caps.above_detent_kt_s:g} kn/s above the 50 deg detent."
        ),
    )


GENERATORS: dict[str, Callable[[float, Database | None], ConversionPath]] = {
    "typical": lambda rate, aircraft: table_1(nacelle_rate_deg_s=rate, aircraft=aircraft),
    "near_stall": lambda rate, aircraft: near_stall(nacelle_rate_deg_s=rate, aircraft=aircraft),
    "centre_line": lambda rate, aircraft: centre_line(nacelle_rate_deg_s=rate, aircraft=aircraft),
    "centre_line_variable": lambda rate, aircraft: centre_line_variable(
        largest_rate_deg_s=max(rate, 12.0), aircraft=aircraft
    ),
    "fast_side": lambda rate, aircraft: fast_side(nacelle_rate_deg_s=rate, aircraft=aircraft),
}
"""The paper's paths by name, each a function of the nacelle rate [deg/s] (12 or more for the variable-rate one) and of
the aircraft's database."""
PATH_NAMES: tuple[str, ...] = tuple(GENERATORS)


def paper_path(
    name: str, *, nacelle_rate_deg_s: float = 3.0, reconversion: bool = False, aircraft: Database | None = None
) -> ConversionPath:
    """One of the paper's paths by name.

    Args:
        name: One of :data:`PATH_NAMES`.
        nacelle_rate_deg_s: Nacelle rate [deg/s]; the variable-rate path takes its largest rate, 12 deg/s, instead.
        reconversion: Flown backwards, at 2 kn/s.

    Raises:
        InputError: There is no such path.
    """
    if name not in GENERATORS:
        raise InputError("is not a path", key="path", value=name, allowed=", ".join(PATH_NAMES))
    path = GENERATORS[name](nacelle_rate_deg_s, aircraft)
    if name != "centre_line_variable":
        path = dataclasses.replace(path, name=f"{name}_{_rate_text(nacelle_rate_deg_s)}")
    return path.reconversion(caps=RECONVERSION_CAPS) if reconversion else path


def _rate_text(rate: float) -> str:
    return f"{rate:g}deg".replace(".", "p")


def corridor_distance_kt(path: ConversionPath, *, corridor: str = "design", aircraft: Database | None = None) -> float:
    """Smallest distance of the planned path to the corridor's boundaries [kn], negative outside.

    Args:
        path: The path.
        corridor: Name of the corridor.
    """
    programme = path.programme()
    boundaries = load_boundary(corridor, aircraft)
    time = np.linspace(0.0, programme.duration, 2001)
    airspeed = np.interp(time, programme.time, programme.airspeed)
    nacelle = np.interp(time, programme.time, programme.nacelle_angle)
    high = np.where(nacelle <= boundaries.downstop_nacelle, boundaries.downstop_speed, boundaries.high.at(nacelle))
    return to_kt(float(np.minimum(airspeed - boundaries.low.at(nacelle), high - airspeed).min()))


__all__ = [
    "FAST_SIDE_CAPS",
    "GENERATORS",
    "NEAR_STALL_CAPS",
    "PATH_NAMES",
    "TABLE_1",
    "centre_line",
    "centre_line_corners",
    "centre_line_variable",
    "conversion_end_kt",
    "corridor_distance_kt",
    "fast_side",
    "near_stall",
    "paper_path",
    "table_1",
    "trim_flapping_map",
]
