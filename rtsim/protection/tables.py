"""Built-in laws by name, and the tables of their kernels."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from rtsim.choices import CorridorName
from rtsim.corridor.boundaries import Corridor
from rtsim.errors import InputError
from rtsim.lpv.database import Database
from rtsim.protection.boundary import guarded_corridor, load_boundary
from rtsim.protection.law_data import LawSettings, ProtectionTables
from rtsim.protection.limits import frames_per_decision, load_limits, load_settings, load_weights
from rtsim.protection.model import reduce_model
from rtsim.protection.prediction_kernels import BoundaryTables
from rtsim.units import deg

LawName = Literal["off", "monitor", "governor", "full"]
LAW_NAMES: tuple[LawName, ...] = get_args(LawName)
"""The built-in laws; the number of a law in compiled code is its place here."""
SPACING_DEG = 0.1
"""Spacing of the sampled boundaries [deg]: the published corners are given to a tenth of a degree."""


def law_tables(
    law: str,
    database: Database,
    *,
    dt: float,
    boundary: CorridorName = "flight",
    settings: LawSettings | None = None,
) -> ProtectionTables:
    """Prepare a built-in law for the kernels.

    Args:
        law: ``off``, ``monitor``, ``governor`` or ``full``.
        boundary: The corridor it keeps to; its low side is tightened to what the plant can trim.
        settings: The law's numbers; None: the aircraft's.

    Raises:
        InputError: There is no such law or boundary, or the aircraft's profile lacks a number.
    """
    if law not in LAW_NAMES:
        raise InputError("no such built-in law", key="protection", value=law, allowed=", ".join(LAW_NAMES))
    profile = database.profile
    limits = load_limits(profile)
    corridor = load_boundary(boundary, database)
    if law in {"governor", "full"}:
        corridor = guarded_corridor(corridor, database, limits.plant_guard)
    return ProtectionTables(
        law=LAW_NAMES.index(law),
        every=frames_per_decision(profile, dt=dt),
        model=reduce_model(database, load_weights(profile)),
        corridor=sample_boundary(corridor),
        torque=limits.torque,
        sink=limits.sink,
        sideways=limits.sideways,
        settings=load_settings(profile, dt=dt) if settings is None else settings,
    )


def sample_boundary(corridor: Corridor) -> BoundaryTables:
    """Sample a corridor evenly in nacelle angle.

    Args:
        corridor: The boundaries.
    """
    angles = np.asarray(deg(SPACING_DEG) * np.arange(round(95.0 / SPACING_DEG) + 1), dtype=np.float64)
    low, high = np.asarray(corridor.low.at(angles)), np.asarray(corridor.high.at(angles))
    low.setflags(write=False)
    high.setflags(write=False)
    return BoundaryTables(
        spacing=deg(SPACING_DEG),
        low=low,
        high=high,
        downstop_nacelle=corridor.downstop_nacelle,
        downstop_speed=corridor.downstop_speed,
        turn_low=np.interp(angles, corridor.turning.nacelle, corridor.turning.low),
        turn_high=np.interp(angles, corridor.turning.nacelle, corridor.turning.high),
    )


__all__ = ["LAW_NAMES", "LawName", "law_tables", "sample_boundary"]
