"""Stability of the scheduled pilot along a path: the loop as flown, frozen at points of the programme."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.optimization.path import ConversionPath
from rtsim.units import to_deg, to_kt


@dataclass(frozen=True, slots=True)
class PathStability:
    """Growth rates of the closed loop along a path."""

    time_s: FloatArray
    """Times of the points [s], shape (points,)."""
    airspeed_kt: FloatArray
    """Airspeeds there [kn]."""
    nacelle_deg: FloatArray
    """Nacelle angles there [deg]."""
    level_growth: FloatArray
    """Largest real part of the eigenvalues in level flight there [rad/s]; negative: stable."""
    accelerated_growth: FloatArray
    """The same at the acceleration the path has there [rad/s]."""

    @property
    def worst_level(self) -> float:
        """Largest growth rate in level flight [rad/s]."""
        return float(self.level_growth.max())

    @property
    def unstable_accelerated_s(self) -> float:
        """Time the path spends where the accelerated loop, held for ever, would be unstable [s]."""
        spacing = np.gradient(self.time_s) if len(self.time_s) > 1 else np.zeros(1)
        return float(spacing[self.accelerated_growth >= 0.0].sum())


def path_stability(path: ConversionPath, *, points: int = 40, outer_loop: str = "integrators") -> PathStability:
    """Freeze the loop at points evenly spread over a path's time; most of them lie between the grid's points.

    Args:
        path: The path.
        points: How many.
        outer_loop: ``integrators`` or ``pi``.
    """
    from rtsim.analysis.frozen_loop import FrozenCommand, frozen_loop
    from rtsim.lpv.aircraft import load_aircraft
    from rtsim.lpv.tables import prepare_tables
    from rtsim.pilot.tables import load_pilot_tables

    database = load_aircraft().database
    form = "pi" if outer_loop == "pi" else "integrators"
    dt = 0.004
    tables = (prepare_tables(database, "layered"), load_pilot_tables(database, form, dt=dt))
    programme = path.programme()
    time = np.linspace(0.0, programme.duration, points)
    at = [programme.at(float(t)) for t in time]
    rates = [programme.rates_at(float(t)) for t in time]
    level = [
        frozen_loop(database, FrozenCommand(p.airspeed, p.nacelle_angle), dt=dt, tables=tables).growth() for p in at
    ]
    moving = [
        frozen_loop(database, FrozenCommand(p.airspeed, p.nacelle_angle, r.airspeed), dt=dt, tables=tables).growth()
        for p, r in zip(at, rates, strict=True)
    ]
    return PathStability(
        time_s=time,
        airspeed_kt=np.array([to_kt(p.airspeed) for p in at]),
        nacelle_deg=np.array([to_deg(p.nacelle_angle) for p in at]),
        level_growth=np.array(level),
        accelerated_growth=np.array(moving),
    )
